//! `cargo softcore formal`: what is proved of the pixel processor's Verilog, for all inputs.
//!
//! Each proof is a module `top` of `softcore/formal` around a module of the pixel processor, or
//! around one that joins others; of these the file may have stand-ins that do anything.
//! Yosys makes both one circuit of gates, for which ABC then shows that no assertion ever
//! fails. What no reset sets holds anything at first.
//!
//! Two kinds of comments in these files join what ports do not: `// probe PATH` behind a wire
//! gives it what the wire at that path has, `// drive PATH WIRE` gives that path the wire.
//! `// two clocks` has each step of the solver be any moment, in which clocks may rise or fall.

use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::Instant;

use anyhow::{Context, Result, bail, ensure};

use crate::pixels::mutants::{self, Faults, Mutant};
use crate::program;
use crate::{folder, read, root};

pub const HELP: &str = "\
cargo softcore formal

Proves properties of the pixel processor with Yosys and ABC, and that each proof fails with a
fault in the Verilog.";

/// How a property is proved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Engine {
    /// In so many clocks from any state, after which no clock matters any more.
    Clocks(u32),
    /// By induction over so many clocks, and in these from the beginning: without end.
    Induction(u32),
    /// With invariants that ABC finds (PDR): without end.
    Reachability,
}

/// A proof: the file of its `top`, the modules, faults with each of which it has to fail.
struct Proof {
    name: &'static str,
    sources: &'static [&'static str],
    claim: &'static str,
    engine: Engine,
    faults: &'static [Faults],
}

const PROOFS: [Proof; 10] = [
    Proof {
        name: "bin_counter",
        sources: &[
            "rtl/pixels/bin_counter.v",
            "rtl/pixels/word_bin.v",
            "formal/histogram_ram.sv",
        ],
        claim: "every photon counts in its bin of both histograms, a look empties the spare one, readers see that",
        engine: Engine::Induction(5),
        faults: &[Faults {
            file: "bin_counter",
            changes: &[("|| c_is_read && c_fresh;", ";")],
        }],
    },
    Proof {
        name: "decision",
        sources: &["rtl/pixels/decision.v"],
        claim: "background, root and comparison are the paper's formula",
        engine: Engine::Clocks(11),
        faults: &[Faults {
            file: "decision",
            changes: &[(
                "{2'd0, excess} > above[STEPS + 1]",
                "{2'd0, excess} >= above[STEPS + 1]",
            )],
        }],
    },
    Proof {
        name: "event_packer",
        sources: &["rtl/pixels/event_packer.v"],
        claim: "the offset is the centroid, rounded; words stay until taken; time words come when due",
        engine: Engine::Induction(3),
        faults: &[Faults {
            file: "event_packer",
            changes: &[(
                "remainder <= {2'd0, distance, 9'd0} + {9'd0, sum};",
                "remainder <= {2'd0, distance, 9'd0};",
            )],
        }],
    },
    Proof {
        name: "event_queue",
        sources: &["rtl/pixels/event_queue.v"],
        claim: "what is put in leaves once, in order",
        engine: Engine::Reachability,
        faults: &[Faults {
            file: "event_queue",
            changes: &[(
                "if (put) next <= next + 1'b1;",
                "if (put && !take) next <= next + 1'b1;",
            )],
        }],
    },
    Proof {
        name: "event_reader",
        sources: &[
            "rtl/pixels/event_reader.v",
            "rtl/pixels/event_queue.v",
            "rtl/pixels/word_bin.v",
        ],
        claim: "the neighbours are the counts at the look, though photons came since",
        engine: Engine::Clocks(7),
        faults: &[Faults {
            file: "event_reader",
            changes: &[("t_ended - t_since", "t_ended")],
        }],
    },
    Proof {
        name: "look_scan",
        sources: &["rtl/pixels/look_scan.v"],
        claim: "no macropixel has a second event before its first was taken",
        engine: Engine::Reachability,
        faults: &[Faults {
            file: "look_scan",
            changes: &[(
                "requesting_at_look <= requesting;",
                "requesting_at_look <= 0;",
            )],
        }],
    },
    Proof {
        name: "peak_keeper",
        sources: &["rtl/pixels/peak_keeper.v"],
        claim: "a look shows the peak, the maxima and the numbers of photons as they were when it passed",
        engine: Engine::Induction(3),
        faults: &[Faults {
            file: "peak_keeper",
            changes: &[(
                "f_valid && f_pixel == e_pixel ? f_next : states[e_pixel]",
                "states[e_pixel]",
            )],
        }],
    },
    Proof {
        name: "photon_crossing",
        sources: &[
            "rtl/photon_crossing.v",
            "rtl/crossing_counter.v",
            "formal/synchronizer.sv",
        ],
        claim: "of photons in another clock each comes out once, in order and in its laser cycle, or is counted as lost; a reset ends",
        engine: Engine::Induction(3),
        faults: &[
            Faults {
                file: "crossing_counter",
                changes: &[
                    // Not Gray code: several bits change at a time.
                    ("gray <= then_ ^ then_ >> 1;", "gray <= then_;"),
                ],
            },
            Faults {
                file: "photon_crossing",
                changes: &[
                    ("wire has_room = !fill[DEPTH_LOG2];", "wire has_room = 1;"),
                    // An entry stays free; nothing comes out.
                    (
                        "wire has_room = !fill[DEPTH_LOG2];",
                        "wire has_room = !fill[DEPTH_LOG2] && !(&fill[1:0]);",
                    ),
                    (
                        "assign waiting = next_seen != first;",
                        "assign waiting = 0;",
                    ),
                    (
                        "photon_valid && has_room && !has_pending;",
                        "photon_valid && has_room;",
                    ),
                    (
                        "photon_cycle_end && (!has_room || has_pending);",
                        "photon_cycle_end && !has_room;",
                    ),
                    (
                        "if (&pending) end_is_lost <= 1;",
                        "if (&pending) end_is_lost <= 0;",
                    ),
                    (
                        ".counts(photon_valid && !puts_photon)",
                        ".counts(photon_valid && !has_room)",
                    ),
                    (
                        "if (!waiting || reset) {cycle_end, valid} <= 0;",
                        "if (reset) {cycle_end, valid} <= 0;",
                    ),
                    (
                        ".clk(photon_clk), .reset(photon_reset), .counts(put)",
                        ".clk(photon_clk), .reset(1'b0), .counts(put)",
                    ),
                    // A reset never ends.
                    (
                        ".in(reset), .out(photon_reset)",
                        ".in(reset || photon_reset), .out(photon_reset)",
                    ),
                ],
            },
        ],
    },
    Proof {
        name: "pixel_processor",
        sources: &[
            "rtl/pixels/pixel_processor.v",
            "rtl/pixels/look_scan.v",
            "rtl/pixels/pixel_registers.v",
        ],
        claim: "each photon counts once, in its laser cycle, and none while it stands still; a run leaves nothing; modules are joined bit for bit",
        engine: Engine::Induction(5),
        faults: &[
            Faults {
                file: "pixel_processor",
                changes: &[
                    (
                        "is_stray = |(i_pixel >> PIXELS_LOG2);",
                        "is_stray = i_pixel[PIXELS_LOG2];",
                    ),
                    ("is_rejected = |i_code[15:7];", "is_rejected = i_code[7];"),
                    (
                        "if (running || reset) emptied <= 0;",
                        "if (running) emptied <= 0;",
                    ),
                    ("a_look <= look;", "a_look <= look_begins;"),
                    (
                        "look_begins, expired_deferred, expired, deferred, found,",
                        "look_begins, expired, expired_deferred, deferred, found,",
                    ),
                    (
                        ".alpha(alpha), .minimum(minimum), .middle",
                        ".alpha({1'b0, alpha[14:0]}), .minimum(minimum), .middle",
                    ),
                    (
                        ".reset(stopped), .live(live), .gate_first",
                        ".reset(reset), .live(live), .gate_first",
                    ),
                    (
                        ".event_cycle_high(event_cycle[63:16])",
                        ".event_cycle_high({1'b0, event_cycle[62:16]})",
                    ),
                    (
                        ".full(full),\n        .background",
                        ".full({1'b0, full[22:0]}),\n        .background",
                    ),
                    (
                        ".in({scan_cycle, put_clipped,",
                        ".in({1'b0, scan_cycle[62:0], put_clipped,",
                    ),
                ],
            },
            Faults {
                file: "pixel_registers",
                changes: &[(
                    "{minimum, alpha} <= wb_dat_i[25:0];",
                    "{minimum, alpha} <= {1'b0, wb_dat_i[24:0]};",
                )],
            },
        ],
    },
    Proof {
        name: "system",
        sources: &["rtl/system.v", "rtl/aer_port.v"],
        claim: "each half word leaves once, in order, whatever ACK does; photons and bus reach the pixel processor",
        engine: Engine::Induction(4),
        faults: &[
            Faults {
                file: "aer_port",
                changes: &[
                    ("left != 0 && !aer_req && !ack", "left != 0 && !aer_req"),
                    ("aer_req && ack)", "aer_req)"),
                    (
                        "assign word_taken = word_valid && left == 0 && !ack;",
                        "assign word_taken = word_valid && left <= 1 && !ack;",
                    ),
                    (
                        "            aer_req <= 0;\n            left <= 0;",
                        "            left <= 0;",
                    ),
                ],
            },
            Faults {
                file: "system",
                changes: &[
                    (
                        ".word_taken(port_taken && !event_valid)",
                        ".word_taken(port_taken)",
                    ),
                    (".cycle_end(cycle_end)", ".cycle_end(photon_cycle_end)"),
                    (
                        ".photon_code({9'd0, code})",
                        ".photon_code({10'd0, code[5:0]})",
                    ),
                    (
                        ".reset(in_reset),\n        .word_valid",
                        ".reset(1'b0),\n        .word_valid",
                    ),
                    (
                        ".wb_adr(wb_adr),\n        .wb_dat_i",
                        ".wb_adr({2'd0, wb_adr[5:0]}),\n        .wb_dat_i",
                    ),
                ],
            },
        ],
    },
];

/// Proves everything.
pub fn run(mut parser: lexopt::Parser) -> Result<()> {
    if let Some(argument) = parser.next()? {
        return Err(argument.unexpected().into());
    }
    let all = Instant::now();
    // The longest of them last as long as all others.
    thread::scope(|scope| {
        let running: Vec<_> = PROOFS
            .iter()
            .map(|proof| scope.spawn(move || prove(proof).with_context(|| proof.name)))
            .collect();
        running
            .into_iter()
            .try_for_each(|proof| match proof.join() {
                Ok(line) => {
                    println!("{}", line?);
                    Ok(())
                }
                Err(_) => bail!("a proof panics"),
            })
    })?;
    println!("{} proofs in {} s", PROOFS.len(), all.elapsed().as_secs());
    Ok(())
}

/// Proves one, and that it fails with each of its faults.
fn prove(proof: &Proof) -> Result<String> {
    let began = Instant::now();
    let shows = |commands: &str, expected: &str| -> Result<()> {
        let output = solve(proof, None, commands)?;
        ensure!(output.contains(expected), "not shown: {output}");
        Ok(())
    };
    let depth = |frames: u32| {
        let expected = format!("No output asserted in {frames} frames");
        shows(&format!("bmc3 -F {frames}"), &expected)
    };
    let how = match proof.engine {
        Engine::Clocks(clocks) => {
            depth(clocks)?;
            format!("in {clocks} clocks from any state")
        }
        Engine::Induction(clocks) => {
            depth(clocks + 1)?;
            let commands = format!("orpos; ind -F {clocks}");
            shows(&commands, "Networks are equivalent")?;
            format!("by induction over {clocks} clocks")
        }
        Engine::Reachability => {
            shows("scorr; orpos; pdr", "Property proved")?;
            "for every state that can be".to_owned()
        }
    };
    let seconds = began.elapsed().as_secs_f32();
    let faults: Vec<Mutant> = mutants::each(proof.faults).collect();
    for fault in &faults {
        let output = solve(proof, Some(fault), "orpos; bmc3 -F 60")?;
        ensure!(
            output.contains("was asserted in frame"),
            "`{}` as `{}` is not found: {output}",
            fault.from,
            fault.to
        );
    }
    let Proof { name, claim, .. } = proof;
    let number = faults.len();
    let faults = if number == 1 { "fault" } else { "faults" };
    Ok(format!(
        "{name}: {claim}: proved {how}, {seconds:.1} s; fails with {number} {faults}, each by itself"
    ))
}

/// What ABC says of the circuit, with or without a fault.
fn solve(proof: &Proof, fault: Option<&Mutant>, commands: &str) -> Result<String> {
    let kind = if fault.is_some() { "fault" } else { "right" };
    let folder = folder(&format!("formal/{}/{kind}", proof.name))?;
    let top = format!("formal/{}.sv", proof.name);
    let (mut files, mut joins, mut has_two_clocks) = (Vec::new(), String::new(), false);
    for source in proof.sources.iter().copied().chain([&*top]) {
        let mut text = read(&root().join("softcore").join(source))?;
        if let Some(fault) = fault
            && Path::new(source).file_stem() == Some(fault.file.as_ref())
            && source != top
        {
            text = fault.apply(&text)?;
        }
        joins += &connections(&text);
        has_two_clocks |= text.contains("\n// two clocks\n");
        // Yosys is told names without folders, which may have any letters.
        let name = source.replace('/', "-");
        fs::write(folder.join(&name), text)?;
        files.push(name);
    }
    let to_one_clock = if has_two_clocks {
        "clk2fflogic"
    } else {
        "async2sync"
    };
    let script = format!(
        "read_verilog -formal -sv {}\nhierarchy -top top\nproc\nflatten\nmemory_map\n{joins}\
         opt -full\n{to_one_clock}\nopt -full\ntechmap\nopt -fast\ndffunmap\nabc -g AND -fast\n\
         opt_clean\nwrite_aiger -zinit circuit.aig\n",
        files.join(" ")
    );
    fs::write(folder.join("script.ys"), script)?;
    let mut yosys = Command::new("yosys");
    let ran = program::succeed(yosys.current_dir(&folder).args(["-q", "-s", "script.ys"]))?;
    // Without it, the wrapper and the module would stand apart.
    ensure!(
        !ran.errors.contains("is used but has no driver"),
        ran.output()
    );
    let mut abc = Command::new("yosys-abc");
    let commands = format!("read_aiger circuit.aig; fold; strash; {commands}");
    Ok(program::succeed(abc.current_dir(&folder).args(["-q", &commands]))?.output)
}

/// The comments that join, as Yosys has it.
fn connections(text: &str) -> String {
    let mut all = String::new();
    for line in text.lines() {
        if let Some((wire, path)) = line.split_once("// probe ")
            && let Some((declared, _)) = wire.split_once(';')
        {
            let name = declared.split_whitespace().last().unwrap_or_default();
            all += &format!("connect -nounset -set {name} \\{path}\n");
        }
        if let Some((_, rest)) = line.split_once("// drive ")
            && let Some((path, wire)) = rest.split_once(' ')
        {
            all += &format!("connect -nounset -set \\{path} {wire}\n");
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_has_its_place() {
        for proof in PROOFS {
            assert!(!proof.faults.is_empty(), "{}", proof.name);
            for fault in mutants::each(proof.faults) {
                let is_of =
                    |source: &&&str| Path::new(source).file_stem() == Some(fault.file.as_ref());
                let source = proof.sources.iter().find(is_of).unwrap();
                let text = fs::read_to_string(root().join("softcore").join(source)).unwrap();
                assert_ne!(fault.apply(&text).unwrap(), text);
            }
        }
    }

    #[test]
    fn comments_join() {
        let text = "wire [1:0] a;  // probe dut.b[0].c\n// drive dut.d e\nwire f; // other\n";
        let joined = "connect -nounset -set a \\dut.b[0].c\nconnect -nounset -set \\dut.d e\n";
        assert_eq!(connections(text), joined);
    }
}
