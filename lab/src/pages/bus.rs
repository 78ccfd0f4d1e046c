//! The load of the link, and the waits on a bus that all pixels share (REQ and ACK of section
//! IV-A).
//!
//! A bus transfers one event per slot. Events of random pixels arrive as a Poisson process, `load`
//! per slot on average. At the end of a slot, one of the pending events is transferred.

use dtof_core::AerWord;
use dtof_data::options::rows::grouped;

/// Macropixels of the paper's array.
const PIXELS: u16 = 64 * 32;
/// Section of the paper, laser cycles between two events of a pixel, and laser cycles a second.
const RATES: [(&str, u16, f64); 3] = [
    ("III-B, no pixel more often", 110, 1.2e6),
    ("IV, no pixel more often", 44, 10e6),
    ("III-B, once in L2", 2000, 1.2e6),
];
/// Offered events per slot.
const LOADS: [f64; 6] = [0.1, 0.2, 0.5, 0.8, 0.9, 0.99];

/// The share of events that are not transferred in the slot of their arrival, for a load below 1.
///
/// A slot is idle with probability 1 - load: the queue is empty and no event arrives. So the queue
/// is empty with probability (1 - load)·exp(load), and then the first event to arrive does not
/// wait.
fn waiting_share(load: f64) -> f64 {
    1.0 - (1.0 - load) * load.exp_m1() / load
}

/// The mean wait of all events, in slots.
fn mean_wait(load: f64) -> f64 {
    load / (2.0 * (1.0 - load))
}

/// A row for each of [`RATES`]: events and bytes a second, events a laser cycle, and the bus time
/// of an event.
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "thousands"
)]
pub fn rates() -> String {
    let mut rows = String::new();
    for (name, cycles, hz) in RATES {
        let a_cycle = f64::from(PIXELS) / f64::from(cycles);
        let a_second = a_cycle * hz;
        let megabytes = a_second * AerWord::BYTES as f64 / 1e6;
        rows += &format!(
            "| {name} | {} | {:.1} MHz | {:.2} million | {} MB | {a_cycle:.2} | {:.1} ns |\n",
            grouped(cycles.into()),
            hz / 1e6,
            a_second / 1e6,
            grouped(megabytes.round() as u64),
            1e9 / a_second
        );
    }
    rows
}

/// A row for each of [`LOADS`].
pub fn waits() -> String {
    let rows = LOADS.map(|load| {
        format!(
            "| {:.0} % | {:.1} % | {:.2} |\n",
            load * 100.0,
            waiting_share(load) * 100.0,
            mean_wait(load)
        )
    });
    rows.concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::studies::scenes::one_pixel::{BINS, prototype};
    use dtof_core::{AsyncPixel, LaserCycle, PixelAddress, Statistics};
    use rand_core::SeedableRng;
    use rand_distr::{Binomial, Distribution};
    use rand_pcg::Pcg64;
    use std::collections::VecDeque;

    /// 2,048 pixels that fire at random, each with a small probability, and a bus that transfers
    /// the oldest event.
    #[test]
    fn random_pixels_wait_as_worked_out() {
        let mut rng = Pcg64::seed_from_u64(1);
        for load in [0.1, 0.5, 0.8, 0.9] {
            let firing = Binomial::new(PIXELS.into(), load / f64::from(PIXELS)).unwrap();
            let mut queue = VecDeque::new();
            let (mut taken, mut waited, mut sum) = (0u32, 0u32, 0u64);
            for slot in 0..400_000u64 {
                queue.extend((0..firing.sample(&mut rng)).map(|_| slot));
                if let Some(arrived) = queue.pop_front() {
                    let wait = slot - arrived;
                    taken += 1;
                    waited += u32::from(wait > 0);
                    sum += wait;
                }
            }
            let share = f64::from(waited) / f64::from(taken);
            let mean = sum as f64 / f64::from(taken);
            assert!(
                (share - waiting_share(load)).abs() < 0.006,
                "{load}: {share}"
            );
            assert!(
                (mean / mean_wait(load) - 1.0).abs() < 0.06,
                "{load}: {mean}"
            );
        }
    }

    /// At the highest rate of section IV: a photon a laser cycle in every pixel.
    #[test]
    fn a_full_bus_sets_the_rate_and_no_event_is_lost() {
        let config = prototype(40).unwrap();
        let mut pixels: Vec<_> = (0..PIXELS)
            .map(|address| AsyncPixel::<BINS>::new(PixelAddress::new(address)))
            .collect();
        let mut statistics = Statistics::new();
        let mut waiting = VecDeque::new();
        let mut taken = vec![0u32; PIXELS.into()];
        let cycles = 3 * u64::from(PIXELS) + 43;
        for cycle in 0..cycles {
            for (address, pixel) in (0..PIXELS).zip(&mut pixels) {
                let was_waiting = pixel.has_event();
                pixel.count(&config, 60);
                pixel.end_laser_cycle(&config, &mut statistics, LaserCycle::new(cycle));
                if pixel.has_event() && !was_waiting {
                    waiting.push_back(address);
                }
            }
            if let Some(address) = waiting.pop_front() {
                let address = usize::from(address);
                taken[address] += u32::from(pixels[address].take_event().is_some());
            }
        }
        // One event per laser cycle from the first look on, from each pixel in turn.
        assert!(
            taken.iter().all(|&events| events == 3),
            "{:?}",
            taken.iter().max()
        );
        let left = waiting.len() as u64;
        assert_eq!(
            statistics.events,
            u64::from(taken.iter().sum::<u32>()) + left
        );
        assert!(statistics.deferred > 0 && statistics.expired > 0);
    }

    #[test]
    fn the_paper_s_rates() {
        let (rates, waits) = (rates(), waits());
        assert!(
            rates.contains("| 110 | 1.2 MHz | 22.34 million | 357 MB | 18.62 | 44.8 ns |"),
            "{rates}"
        );
        assert!(
            rates.contains("| 44 | 10.0 MHz | 465.45 million | 7,447 MB | 46.55 | 2.1 ns |"),
            "{rates}"
        );
        assert!(waits.starts_with("| 10 % | 5.3 % | 0.06 |"), "{waits}");
    }
}
