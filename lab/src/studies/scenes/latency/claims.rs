//! The paper's claims on latency.

use super::element::{AT_ONCE, PIPELINE, READINGS};
use super::{PROTOTYPE_X, RATE_MHZ, first, next, shared_points, shortest_exposure};
use crate::sweep::Part;
use crate::sweep::mean::Measured;
use crate::sweep::results::{Claim, Verdict};
use dtof_data::options::rows::grouped;

/// The paper's latency, in microseconds.
const PRINTED_US: f64 = 2.4;
/// The latency of the fastest other system of Table I.
const OTHERS_US: f64 = 128.0;
/// Frames a second in Table I, and the latency given below them.
const FRAME_BASED: [(f64, f64); 2] = [(250.0, 4_000.0), (50.0, 20_000.0)];
/// Parts of the 128×64 imager, one of which is connected at a time (section IV-B).
const SUBGROUPS: u16 = 64;
/// Bins of a histogram, and groups that are compared side by side (section IV-B).
const TREE: (u16, u16) = (128, 8);
/// Clock cycles of the square root (section IV-B).
const ROOT_CLOCKS: u16 = 5;

pub fn claims(part: &Part) -> Vec<Claim> {
    vec![processing(part), root(), exposure(part), table(part)]
}

/// Whether the pipeline delays every first event by four laser cycles, compared with an immediate
/// decision on the same photons.
pub fn is_later_by_the_delay(part: &Part) -> bool {
    let mut points = part.at([("shared", 1.0)]);
    points.all(|point| {
        let [at_once, pipeline] = [AT_ONCE, PIPELINE].map(|element| {
            let name = first(element);
            let count = |what: &str| point.count(&format!("{name} {what}"));
            [count("values"), count("above 0")]
        });
        // The same number of them, each later by the delay.
        at_once[0] == pipeline[0]
            && pipeline[1] == at_once[1] + at_once[0] * u64::from(PIPELINE.delay)
    })
}

fn processing(part: &Part) -> Claim {
    let later = |element| {
        let at = |snr| {
            let mut points = shared_points(part).filter(|point| point.is_at([("snr", snr)]));
            points.next().map_or("none".to_owned(), |point| {
                let [with, without] =
                    [element, AT_ONCE].map(|element| Measured::mean(point, &next(element)).value);
                format!("{:.1}", with - without)
            })
        };
        [64.0, 16.0].map(at).join(" and ")
    };
    let readings = READINGS[1..]
        .iter()
        .map(|&element| format!("{} (X = {}) {}", element.name, element.x(), later(element)));
    let readings: Vec<String> = readings.collect();
    let is_later = is_later_by_the_delay(part);
    Claim::new(
        "processing",
        format!(
            "X = 4 takes a pipeline with {} histograms in it; its first event comes {} after that of a decision at \
             once, the next {} later at SNR 64 and 16",
            PIPELINE.in_flight(),
            if is_later {
                "exactly 4 laser cycles"
            } else {
                "not always 4 laser cycles"
            },
            later(PIPELINE)
        ),
        // Every interpretation delays events; with one of them no look is lost.
        Verdict::graded(PIPELINE.delay == 0, is_later && PIPELINE.x() == PROTOTYPE_X),
    )
    .with_details(format!(
        "of the same photons; mean laser cycles more from an event to the next at SNR 64 and 16: {}",
        readings.join(", ")
    ))
}

/// By arithmetic: the longer of two stages limits the rate of histograms.
fn root() -> Claim {
    let (bins, groups) = TREE;
    let first_stage = bins / groups;
    Claim::new(
        "root",
        format!(
            "the first stage compares {bins} bins in {groups} groups, at least {first_stage} clock \
             cycles; the root takes {ROOT_CLOCKS} in the second"
        ),
        Verdict::of(ROOT_CLOCKS <= first_stage),
    )
}

fn exposure(part: &Part) -> Claim {
    // Both sides of the first look with N > L1.
    let shortest = |l1: f64, before: u64, at: u64| {
        let points = part.at([("shared", 0.0), ("l1", l1)]);
        let count = |by: u64| {
            let counts = points
                .clone()
                .map(|point| point.count(&format!("waited by {by}")));
            counts.sum::<u64>()
        };
        count(before) == 0 && count(at) > 0
    };
    let then = |is_so| if is_so { "just then" } else { "not then" };
    let [at_40, at_20] = [(40.0, 40, 44), (20.0, 20, 24)];
    let [at_40, at_20] = [at_40, at_20].map(|(l1, before, at)| then(shortest(l1, before, at)));
    let of_snr = |snr| {
        part.one([
            ("shared", 0.0),
            ("l1", 40.0),
            ("background", 0.02),
            ("snr", snr),
        ])
    };
    let (best, usual) = (of_snr(64.0), of_snr(16.0));
    let microseconds = |point| {
        Measured::mean(point, "latency")
            .times(1.0 / RATE_MHZ)
            .text(2)
    };
    let us = |cycles: u16| f64::from(cycles) / RATE_MHZ;
    let [looks_40, looks_20] = [40, 20].map(shortest_exposure);
    let answered = looks_40 + PIPELINE.delay;
    Claim::new(
        "exposure",
        format!(
            "first look {:.1} µs after a reset (L1 = 20: {:.1} µs), its answer after {:.1} µs; events within 2.4 µs \
             of the first photon: {} of {}",
            us(looks_40),
            us(looks_20),
            us(answered),
            best.count("latency by 24"),
            grouped(best.count("latency values")),
        ),
        Verdict::of(us(looks_40) <= PRINTED_US),
    )
    .with_details(format!(
            "by arithmetic the first look is {:.1} µs after a reset (L1 = 20: {:.1} µs), in simulation the earliest \
             {at_40}, and at L1 = 20 {at_20}; with four laser cycles of processing its answer comes after {:.1} \
             µs; from the first photon to the look {} µs at SNR 64, {} µs at SNR 16; events within 2.4 µs of it: \
             {} of {}",
            us(looks_40),
            us(looks_20),
            us(answered),
            microseconds(best),
            microseconds(usual),
            best.count("latency by 24"),
            grouped(best.count("latency values")),
        ))
}

/// The other systems, with the period of a frame as latency, and this one with the pipeline.
fn table(part: &Part) -> Claim {
    let is_period = |(rate, latency): (f64, f64)| (1e6 / rate - latency).abs() < 1e-6;
    let periods = FRAME_BASED.into_iter().all(is_period);
    let means = shared_points(part).map(|point| {
        let mean = Measured::mean(point, &next(PIPELINE));
        (point.parameter("snr"), mean.times(1.0 / RATE_MHZ))
    });
    let all_below = means.clone().all(|(_, mean)| mean.interval.1 < OTHERS_US);
    let weakest = means.min_by(|a, b| a.0.total_cmp(&b.0));
    let best = f64::from(shortest_exposure(40) + PIPELINE.delay) / RATE_MHZ;
    Claim::new(
        "table",
        format!(
            "events of one pixel: {best:.1} µs at best, on average {}",
            weakest.map_or("nothing".to_owned(), |(snr, mean)| {
                format!("{} µs at the weakest signal, SNR {snr}", mean.text(1))
            }),
        ),
        Verdict::graded(periods && all_below && weakest.is_some(), best < OTHERS_US),
    )
    .with_details("a period of 250 frames a second is 4,000 µs, of 50 it is 20,000 µs")
}

/// The consequences if a pixel has only one of [`SUBGROUPS`] laser cycles.
pub fn subgroups() -> String {
    let cycles = u32::from(shortest_exposure(40)) * u32::from(SUBGROUPS);
    format!(
        "{:.0} kHz a subgroup, and its first look after {} laser cycles, {:.0} µs",
        RATE_MHZ * 1000.0 / f64::from(SUBGROUPS),
        grouped(cycles.into()),
        f64::from(cycles) / RATE_MHZ
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_arithmetic() {
        assert_eq!(
            subgroups(),
            "156 kHz a subgroup, and its first look after 2,816 laser cycles, 282 µs"
        );
        assert_eq!(root().verdict, Verdict::Agrees);
        // Interpretations of 2.4 µs: the look at L1 = 20, or L1 = 20 (half of 40) plus four laser
        // cycles.
        let four = PIPELINE.delay;
        let readings = [shortest_exposure(20), 20 + four, 40 / 2 + four];
        assert!(
            readings
                .iter()
                .all(|&cycles| f64::from(cycles) / RATE_MHZ == PRINTED_US)
        );
        assert_eq!([40, 20].map(shortest_exposure), [44, 24]);
    }
}
