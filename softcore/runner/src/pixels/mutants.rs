//! Faults that the scenes have to find: each a text of the pixel processor's Verilog that is
//! there once, and what stands there instead.

use anyhow::{Result, bail};

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mutant {
    /// Without `.v`.
    pub file: &'static str,
    pub from: &'static str,
    pub to: &'static str,
}

impl Mutant {
    /// The file's text with the fault.
    pub fn apply(&self, text: &str) -> Result<String> {
        match text.matches(self.from).count() {
            1 => Ok(text.replacen(self.from, self.to, 1)),
            times => bail!("`{}` is {times} times in {}.v", self.from, self.file),
        }
    }
}

/// Faults of one file: what is there, and what instead.
pub struct Faults {
    pub file: &'static str,
    pub changes: &'static [(&'static str, &'static str)],
}

/// Each by itself.
pub fn each(of: &[Faults]) -> impl Iterator<Item = Mutant> {
    of.iter().flat_map(|&Faults { file, changes }| {
        let mutant = move |&(from, to)| Mutant { file, from, to };
        changes.iter().map(mutant)
    })
}

/// All that the scenes have to find, of files of `softcore/rtl/pixels`.
pub const MUTANTS: &[Faults] = &[
    // Counting: words on their way, valid bits, full counters.
    Faults {
        file: "bin_counter",
        changes: &[
            ("b_hit_d <= c_writes &&", "b_hit_d <= 1'b0 && c_writes &&"),
            ("b_hit_e <= d_writes &&", "b_hit_e <= 1'b0 && d_writes &&"),
            ("c_hit_d <= c_writes &&", "c_hit_d <= 1'b0 && c_writes &&"),
            ("b_hit_d ? d_word : b_hit_e", "b_hit_e ? e_word : b_hit_d"),
            ("c_fresh <= b_fresh;", "c_fresh <= 0;"),
            ("c_lane[lane] && !is_full", "c_lane[lane]"),
            ("is_full = &so_far[10:9]", "is_full = &so_far[9:0]"),
            (
                "counted[9:0] | {10{counted[10]}}",
                "counted[9:0] & ~{10{counted[9]}}",
            ),
            (
                "has_row_after & (slot ? live : ~live)",
                "has_row_after & (slot ? ~live : live)",
            ),
            ("a_look ? has_row_after &", "a_look ? has_row &"),
            ("if (reset) has_row <= 0;", "if (reset) has_row[0] <= 0;"),
            (
                "e_full0 <= histogram[0].counted[10];",
                "e_full0 <= &histogram[0].counted[9:0];",
            ),
            ("|| b_is_read && b_fresh ||", "|| b_is_read && c_fresh ||"),
            ("|| c_is_read && c_fresh;", ";"),
            ("read_hit ? e_word : copy", "read_hit ? d_word : copy"),
        ],
    },
    Faults {
        file: "word_bin",
        changes: &[("3'd5: count = word[65:55];", "3'd5: count = word[76:66];")],
    },
    // Peak and maxima.
    Faults {
        file: "peak_keeper",
        changes: &[
            ("key = {f_count, ~f_bin}", "key = {f_count, f_bin}"),
            (
                "f_counts && key > f_state[16:0]",
                "f_counts && key[16:7] > f_state[16:7]",
            ),
            ("&& f_count > highest", "&& f_count > highest + 10'd1"),
            (
                "f_quadrant <= 4'd1 << e_quadrant;",
                "f_quadrant <= 4'd1 << {e_quadrant[0], e_quadrant[1]};",
            ),
            (
                "f_valid && f_pixel == e_pixel ? f_next : states[e_pixel]",
                "states[e_pixel]",
            ),
            (
                "slot ? valid_after & live : valid_after & ~live",
                "slot ? valid & live : valid & ~live",
            ),
            (
                "slot ? seen_after & live : seen_after & ~live",
                "slot ? seen & live : seen & ~live",
            ),
            (
                "f_count = slot ? f_count1 : f_count0",
                "f_count = slot ? f_count0 : f_count1",
            ),
            ("{15'd0, !(&came)}", "{15'd0, f_counts && !(&came)}"),
            (
                "{23'd0, f_counts && f_full && !(&lost)}",
                "{23'd0, f_counts && !(&lost)}",
            ),
        ],
    },
    // States put aside.
    Faults {
        file: "peak_keeper",
        changes: &[
            (
                "if (f_valid && !is_aside[f_pixel]) aside",
                "if (f_valid) aside",
            ),
            (
                "if (f_look) is_aside <= 0;",
                "if (f_look && !f_valid) is_aside <= 0;",
            ),
            (
                "f_live = live[f_pixel] ? kept[1].f_state",
                "f_live = !live[f_pixel] ? kept[1].f_state",
            ),
            (
                "is_aside[scan_pixel] ? aside[scan_pixel]",
                "is_aside[scan_pixel] && !(&scan_pixel) ? aside[scan_pixel]",
            ),
        ],
    },
    // The rule.
    Faults {
        file: "decision",
        changes: &[
            ("{1'b0, peak_bin} >= middle", "{1'b0, peak_bin} > middle"),
            (
                "level[0] <= first < second ?",
                "level[0] <= first > second ?",
            ),
            ("first_peak >= minimum", "first_peak > minimum"),
            (
                "root[step] | (less[step][10] ? 5'd0 :",
                "root[step] | (less[step][10] || less[step] == 11'd0 ? 5'd0 :",
            ),
            (
                "{2'd0, excess} > above[STEPS + 1]",
                "{2'd0, excess} >= above[STEPS + 1]",
            ),
            (
                "(root[step][STEPS - step] ?",
                "(root[step][STEPS - step] && step != 5 ?",
            ),
        ],
    },
    // Looks, exposures, decisions put off.
    Faults {
        file: "look_scan",
        changes: &[
            ("is_next <= x <= 16'd1;", "is_next <= x <= 16'd2;"),
            (
                "is_next <= until_due == 16'd1;",
                "is_next <= until_due == 16'd2;",
            ),
            (
                "requesting_at_look <= requesting;",
                "requesting_at_look <= 0;",
            ),
            ("is_early <= exposure <= l1;", "is_early <= exposure < l1;"),
            ("is_long <= exposure >= l2;", "is_long <= exposure > l2;"),
            ("sum[15:0] | {16{sum[16]}}", "sum[15:0]"),
            (
                "&& {rest[32:17], 1'b0} > {1'b0, exposure}",
                "&& {rest[32:17], 1'b0} >= {1'b0, exposure}",
            ),
            ("if (ends) live[o_pixel]", "if (fires) live[o_pixel]"),
            ("!ends && (waits || is_deferred[o_pixel])", "!ends && waits"),
            (
                "ends || reset ? 16'd0 : o_exposure",
                "fires || reset ? 16'd0 : o_exposure",
            ),
            (
                "deferred <= acts && !is_long && waits;",
                "deferred <= acts && waits;",
            ),
            (
                "full_ended <= ends ? o_full",
                "full_ended <= fires ? o_full",
            ),
            (
                "if (is_scanned && !found && !reading) begin",
                "if (scanning && is_last) begin",
            ),
        ],
    },
    // The bins beside the peak.
    Faults {
        file: "event_reader",
        changes: &[
            ("count = t_ended - t_since", "count = t_ended"),
            (
                "ended = s_live ? read_word0",
                "ended = !s_live ? read_word0",
            ),
            ("q_neighbour >= gate_first", "q_neighbour > gate_first"),
            ("q_neighbour < gate_end", "q_neighbour <= gate_end"),
            (
                "put_clipped <= !t_inside || !left_inside;",
                "put_clipped <= !t_inside;",
            ),
            ("counted[9:0] | {10{counted[10]}}", "counted[9:0]"),
            (
                "host_word[10*lane +: 10] = counted",
                "host_word[10*lane +: 10] = ~counted",
            ),
        ],
    },
    // The queue, words, registers.
    Faults {
        file: "event_queue",
        changes: &[(
            "if (put) next <= next + 1'b1;",
            "if (put && !take) next <= next + 1'b1;",
        )],
    },
    Faults {
        file: "event_packer",
        changes: &[
            ("is_sent && sent_high == high ? EVENT", "is_sent ? EVENT"),
            (
                "remainder <= {2'd0, distance, 9'd0} + {9'd0, sum};",
                "remainder <= {2'd0, distance, 9'd0};",
            ),
        ],
    },
    Faults {
        file: "pixel_registers",
        changes: &[(
            "host_comes <= host_on_way[1];",
            "host_comes <= host_on_way[0];",
        )],
    },
    Faults {
        file: "pixel_processor",
        changes: &[
            (
                "a_quadrant <= bin < gate_middle ?",
                "a_quadrant <= bin <= gate_middle ?",
            ),
            ("bin >= gate_fourth", "bin > gate_fourth"),
            ("is_clipped, &count}", "&count, is_clipped}"),
            (
                "wire is_gated = bin >= gate_first && bin < gate_end;",
                "wire is_gated = bin > gate_first && bin < gate_end;",
            ),
            (
                "strayed <= i_valid && is_stray;",
                "strayed <= i_valid && is_stray && !is_rejected;",
            ),
            (".cycle_high(event_cycle[63:16])", ".cycle_high(48'd0)"),
        ],
    },
    Faults {
        file: "pixel_registers",
        changes: &[
            ("if (write && !run)", "if (write)"),
            (
                "8'h08: wb_dat_o <= {31'd0, event_waiting && !packs};",
                "8'h08: wb_dat_o <= 0;",
            ),
            (
                "8'h0d: wb_dat_o <= {6'd0, event_right, 6'd0, event_left};",
                "8'h0d: wb_dat_o <= {6'd0, event_left, 6'd0, event_right};",
            ),
        ],
    },
    // Start and stop: what a run leaves behind.
    Faults {
        file: "pixel_processor",
        changes: &[
            (
                "i_valid <= photon_valid && running;",
                "i_valid <= photon_valid;",
            ),
            ("i_end <= cycle_end && running;", "i_end <= cycle_end;"),
            (
                "running <= run && (running || emptied[PIXELS_LOG2]) && !reset;",
                "running <= run && !reset;",
            ),
            (
                "&& (running || emptied[PIXELS_LOG2]) && !reset;",
                "&& (running || emptied[PIXELS_LOG2]);",
            ),
            (
                "if (running || reset) emptied <= 0;",
                "if (reset) emptied <= 0;",
            ),
            (
                ".reset(stopped), .live(live),\n        .a_valid",
                ".reset(reset), .live(live),\n        .a_valid",
            ),
            (
                ".reset(stopped), .live(live),\n        .e_valid",
                ".reset(reset), .live(live),\n        .e_valid",
            ),
            (
                ".reset(stopped), .live(live), .gate_first",
                ".reset(reset), .live(live), .gate_first",
            ),
            (".reset(stopped), .emptied(", ".reset(reset), .emptied("),
            (
                ".reset(stopped),\n        .put(put),",
                ".reset(reset),\n        .put(put),",
            ),
            (
                ".reset(stopped), .enabled(packs)",
                ".reset(reset), .enabled(packs)",
            ),
            (
                ".emptied(emptied[PIXELS_LOG2-1:0])",
                ".emptied({PIXELS_LOG2{1'b0}})",
            ),
        ],
    },
    Faults {
        file: "look_scan",
        changes: &[
            ("found <= fires && !reset;", "found <= fires;"),
            ("            deferred <= 0;\n", ""),
            ("            on_way <= 0;\n", ""),
            ("            n_pixel <= 0;\n", ""),
        ],
    },
    Faults {
        file: "event_packer",
        changes: &[
            ("            is_sent <= 0;\n", ""),
            (
                "            state <= IDLE;\n            is_sent",
                "            is_sent",
            ),
        ],
    },
    Faults {
        file: "event_queue",
        changes: &[("            next <= 0;\n", "")],
    },
    Faults {
        file: "pixel_processor",
        changes: &[(".begins(begins), .x(x)", ".begins(1'b0), .x(x)")],
    },
    // How the modules are joined: ports swapped, a clock too late or early, too narrow.
    Faults {
        file: "pixel_processor",
        changes: &[
            (
                ".a_valid(a_valid), .a_counts(a_counts), .a_look(a_look)",
                ".a_valid(a_valid), .a_counts(a_counts), .a_look(look)",
            ),
            ("a_look <= look;", "a_look <= look_begins;"),
            (".cycle_end(i_end)", ".cycle_end(cycle_end && running)"),
            (".look(look), .late(late)", ".look(late), .late(look)"),
            (
                ".e_count0(e_count0), .e_count1(e_count1), .e_full0(e_full0), .e_full1(e_full1),\n        .scan",
                ".e_count0(e_count1), .e_count1(e_count0), .e_full0(e_full0), .e_full1(e_full1),\n        .scan",
            ),
            (
                ".e_full0(e_full0), .e_full1(e_full1),\n        .scan",
                ".e_full0(e_full1), .e_full1(e_full0),\n        .scan",
            ),
            (
                ".scan(scan), .scan_pixel(scan_pixel),\n        .peak_count(peak_count), .peak_bin(peak_bin), .maxima",
                ".scan(scan), .scan_pixel(found_pixel),\n        .peak_count(peak_count), .peak_bin(peak_bin), .maxima",
            ),
            (".live(live), .gate_first", ".live(~live), .gate_first"),
            (
                ".alpha(alpha), .minimum(minimum), .middle",
                ".alpha({6'd0, alpha[9:0]}), .minimum(minimum), .middle",
            ),
            (
                ".alpha(alpha), .minimum(minimum), .middle",
                ".alpha({1'b0, alpha[14:0]}), .minimum(minimum), .middle",
            ),
            (
                ".alpha(alpha), .minimum(minimum), .middle",
                ".alpha(alpha), .minimum({1'b0, minimum[8:0]}), .middle",
            ),
            (
                ".event_cycle_high(event_cycle[63:16])",
                ".event_cycle_high(48'd0)",
            ),
            (
                ".minimum(minimum), .middle(gate_middle)",
                ".minimum({7'd0, minimum[2:0]}), .middle(gate_middle)",
            ),
            (
                ".middle(gate_middle),\n        .peak_count",
                ".middle(gate_second),\n        .peak_count",
            ),
            (
                ".x(x), .l1(l1), .l2(l2), .is_one_hit",
                ".x({8'd0, x[7:0]}), .l1(l1), .l2(l2), .is_one_hit",
            ),
            (
                ".l1(l1), .l2(l2), .is_one_hit(is_one_hit),\n        .cycle_end",
                ".l1(l2), .l2(l1), .is_one_hit(is_one_hit),\n        .cycle_end",
            ),
            (
                ".is_one_hit(is_one_hit),\n        .cycle_end",
                ".is_one_hit(1'b0),\n        .cycle_end",
            ),
            (
                ".photons(photons), .full(full),\n        .background",
                ".photons({6'd0, photons[9:0]}), .full(full),\n        .background",
            ),
            (
                ".full(full),\n        .background",
                ".full({12'd0, full[11:0]}),\n        .background",
            ),
            (".reading(reading), .live", ".reading(1'b0), .live"),
            (
                "assign taken_pixel = pixel;",
                "reg [PIXELS_LOG2-1:0] left_pixel;\n    always @(posedge clk) left_pixel <= pixel;\n    assign taken_pixel = left_pixel;",
            ),
            ("assign taken = take;", "assign taken = event_leaves;"),
            (
                "assign take = register_takes || packer_takes;",
                "assign take = packer_takes;",
            ),
            (
                ".found_rest({found_piled_up, found_deferred,",
                ".found_rest({found_deferred, found_piled_up,",
            ),
            (
                "found_exposure, found_background, found_count}),",
                "{8'd0, found_exposure[7:0]}, found_background, found_count}),",
            ),
            (
                ".read_word0(read_word0), .read_word1(read_word1),\n        .put",
                ".read_word0(read_word1), .read_word1(read_word0),\n        .put",
            ),
            (
                ".put_left(put_left), .put_right(put_right)",
                ".put_left(put_right), .put_right(put_left)",
            ),
            (
                ".host_address(host_address), .host_taken(host_taken),\n        .host_word(host_word)\n    );\n\n    // The events",
                ".host_address(read_address), .host_taken(host_taken),\n        .host_word(host_word)\n    );\n\n    // The events",
            ),
            (".in({scan_cycle, put_clipped,", ".in({cycle, put_clipped,"),
            (
                ".left(left), .right(right),\n        .cycle_high",
                ".left(right), .right(left),\n        .cycle_high",
            ),
            (
                ".event_left(left), .event_right(right)",
                ".event_left(right), .event_right(left)",
            ),
            ("event_cycle[15:0], exposure,", "cycle[15:0], exposure,"),
            ("{was_late, look_begins,", "{look_begins, was_late,"),
            (
                "expired_deferred, expired, deferred, found,",
                "expired, expired_deferred, deferred, found,",
            ),
            (
                "strayed, gated_out, rejected, counted}",
                "strayed, rejected, gated_out, counted}",
            ),
        ],
    },
];
