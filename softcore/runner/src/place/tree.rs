//! The comparator tree in simulation, against its model in `dtof-core`.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};
use dtof_core::fixed::types::U8F8;
use dtof_core::paper::{ComparatorTree, Threshold, isqrt, quadrant_background};
use dtof_core::{Count, Count10, RangeGate};
use rand_pcg::Pcg64;
use rand_pcg::rand_core::{Rng, SeedableRng};

use crate::folder;
use crate::program;
use crate::rtl;

const BINS: usize = 128;
/// The largest count of 10 bits.
const MOST: u32 = 1023;
const RANDOM: usize = 20_000;

/// A histogram and the rule about it.
struct Question {
    counts: [u16; BINS],
    /// In 1/256.
    alpha: u16,
    least: u16,
}

/// Whether the tree with so many lanes decides as the model; the clocks it takes.
pub fn check(lanes: u32) -> Result<u64> {
    let name = format!("comparator_tree-{lanes}");
    let parameter = format!("-GLANES={lanes}");
    let defined = format!("-DLANES={lanes}");
    let options = [&*parameter, "-CFLAGS", &defined];
    let simulation = rtl::verilate("comparator_tree", &name, Path::new(""), &options)?;
    let questions = questions();
    let file = folder(&name)?.join("histograms");
    let lines: String = questions.iter().map(line).collect();
    fs::write(&file, lines).with_context(|| file.display().to_string())?;
    let ran = program::succeed(Command::new(simulation).arg(&file))?;
    let (clocks, events) = compare(&questions, &ran.output)?;
    println!(
        "{name}: {} decisions as the model, {events} events, {clocks} clocks each",
        questions.len()
    );
    Ok(clocks)
}

/// Whether the answers are those of the model; the clocks of each and the events of all.
fn compare(questions: &[Question], answers: &str) -> Result<(u64, usize)> {
    let mut lines = answers.lines();
    let (mut clocks, mut events) = (None, 0);
    for (number, question) in questions.iter().enumerate() {
        let line = lines.next().context("answers are missing")?;
        let (answer, took) = line.rsplit_once(' ').context("an answer without clocks")?;
        let expected = expected(question);
        ensure!(
            answer == expected,
            "histogram {number}: {answer}, not {expected}: {:?}",
            question.counts
        );
        let took: u64 = took.parse().context("clocks")?;
        ensure!(
            *clocks.get_or_insert(took) == took,
            "histogram {number}: {took} clocks"
        );
        events += usize::from(answer.ends_with(" 1"));
    }
    ensure!(lines.next().is_none(), "more answers than histograms");
    Ok((clocks.context("no histograms")?, events))
}

/// Histograms with ties everywhere, empty, full, of one photon, and random ones.
fn questions() -> Vec<Question> {
    let mut random = Pcg64::seed_from_u64(1);
    let mut below = |end: u32| u16::try_from(random.next_u32() % end).unwrap_or(u16::MAX);
    let mut all = Vec::new();
    let mut ask = |counts, alpha, least| {
        all.push(Question {
            counts,
            alpha,
            least,
        });
    };
    for level in [0, 1, 512, 1023] {
        ask([level; BINS], 0, 0);
        for bin in 0..BINS {
            let mut counts = [level; BINS];
            counts[bin] = level ^ 1;
            ask(counts, 1 << 8, 1);
            // And the same count in another bin, half of them in another group.
            counts[(bin * 37 + 5) % BINS] = level ^ 1;
            ask(counts, 8 << 8, 1);
        }
    }
    for round in 0..RANDOM {
        let most = [1, 2, 7, 40, MOST][round % 5];
        let mut counts = [0; BINS];
        counts.fill_with(|| below(most + 1));
        // A peak about as high as the threshold, so that both answers are frequent.
        let alpha = [0, 1 << 8, 4 << 8, below(1 << 12), u16::MAX][round % 7 % 5];
        let bin = usize::from(below(128));
        counts[bin] = (counts[bin] + below(most + 1)).min(1023);
        let least = [0, 5, below(MOST + 1)][round % 3];
        ask(counts, alpha, least);
    }
    all
}

/// A line of the file that the simulation reads.
fn line(question: &Question) -> String {
    let mut line = format!("{} {}", question.alpha, question.least);
    for count in question.counts {
        let _ = write!(line, " {count}");
    }
    line + "\n"
}

/// The model's answer but for the clocks.
fn expected(question: &Question) -> String {
    let tree = ComparatorTree::of(&question.counts);
    let (peak, quadrants) = (tree.peak(), tree.quadrant_maxima());
    let background = quadrant_background(&question.counts, &RangeGate::full(), peak.bin);
    let threshold = Threshold::new(
        U8F8::from_bits(question.alpha),
        Count::saturating(question.least.into()),
    );
    let event = threshold.is_exceeded::<Count10>(peak.count, background);
    let [a, b, c, d] = quadrants.map(Count::raw);
    format!(
        "{} {} {a} {b} {c} {d} {} {} {}",
        peak.bin.raw(),
        peak.count.raw(),
        background.raw(),
        isqrt::<5>(background.raw()),
        u8::from(event)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_answer_is_found() {
        let mut counts = [3; BINS];
        counts[70] = 20;
        counts[1] = 17;
        // Background 3 or 17: the smaller. Threshold 3 + 1 * 1.
        let question = Question {
            counts,
            alpha: 256,
            least: 20,
        };
        let right = "70 20 17 3 20 3 3 1 1";
        assert_eq!(expected(&question), right);
        let questions = [question];
        assert_eq!(
            compare(&questions, &format!("{right} 28\n")).unwrap(),
            (28, 1)
        );
        for wrong in ["", "70 20 17 3 20 3 3 1 0 28\n", "70 20 17 3 20 3 3 1 1\n"] {
            assert!(compare(&questions, wrong).is_err(), "{wrong}");
        }
        assert!(compare(&questions, &format!("{right} 28\n{right} 28\n")).is_err());
    }

    #[test]
    fn histograms_have_what_is_hard() {
        let questions = questions();
        let events = questions
            .iter()
            .filter(|of| expected(of).ends_with('1'))
            .count();
        assert!((questions.len() / 10..questions.len() * 9 / 10).contains(&events));
        assert!(questions.iter().any(|of| of.counts == [0; BINS]));
        assert!(questions.iter().any(|of| of.counts == [1023; BINS]));
        assert!(
            questions
                .iter()
                .flat_map(|of| of.counts)
                .all(|count| u32::from(count) <= MOST)
        );
    }
}
