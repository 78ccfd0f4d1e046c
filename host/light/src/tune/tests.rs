use dtof_core::paper::Threshold;
use dtof_core::rule::z_for_levels;
use dtof_core::{BlockLevel, Count, DepthEstimator, RangeGate, WindowRule};

use super::*;
use crate::looks::repeated_looks::single_looks;
use crate::progress::NONE;

const REQUEST: Request = Request {
    background: 0.05,
    signal: 0.5,
    sigma: 1.0,
    bins: 128,
    minimum_count: MINIMUM_COUNT,
    x: 4,
    l1: Some(40),
    l2: 1000,
    limit: FalseAlarmLimit::PerExposure(0.01),
    levels: BlockLevel::PIXEL,
    seed: 1,
};

/// False alarms over the mean length of exposures, those with an event ending at the first look.
#[test]
fn a_rate_is_that_of_the_shortest_exposures() {
    for (x, l1, l2, rate) in [(4, 40, 1000, 1e-6), (1, 1, 3, 0.2), (10, 100, 5000, 1e-3)] {
        let looks = Looks::new(x, l1, l2);
        let probability = FalseAlarmLimit::PerCycle(rate).per_exposure(looks);
        let [expiry, first] = [looks.expiry(), looks.first * looks.x].map(f64::from);
        let length = (1.0 - probability) * expiry + probability * first;
        assert!((probability / length / rate - 1.0).abs() < 1e-12);
        assert_eq!(FalseAlarmLimit::PerExposure(0.1).per_exposure(looks), 0.1);
    }
}

#[test]
fn candidates_go_from_x_to_half_of_an_exposure() {
    let of = |x, l1, l2| {
        candidates(&Request {
            x,
            l1,
            l2,
            ..REQUEST
        })
    };
    assert_eq!(of(4, None, 100), [4, 8, 12, 16, 24, 36]);
    assert_eq!(of(4, None, 97), [4, 8, 12, 16, 24, 36]);
    assert_eq!(of(4, None, 72), [4, 8, 12, 16, 24]);
    assert_eq!(of(4, None, 9), [4]);
    assert_eq!(of(4, Some(7), 100), [7]);
}

#[test]
fn a_refusal_suggests_a_fix() {
    let refused = |request: &Request| check(request).unwrap_err().to_string();
    let full = |background, x, l1| Request {
        background,
        x,
        l1,
        l2: 5000,
        ..REQUEST
    };
    let too_long = full(0.5, 4, None);
    let error = refused(&too_long);
    assert!(
        error.starts_with("a background of 0.5 photons a bin fills")
            && error.ends_with("before L2 = 5000: lower --l2 to 1720"),
        "{error}"
    );
    assert!(
        check(&Request {
            l2: 1720,
            ..too_long
        })
        .is_ok()
    );
    for (l1, way_out) in [
        (Some(1716), "lower --l2 to 1720"),
        (Some(1720), "lower --l1, --x or the background"),
    ] {
        let error = refused(&full(0.5, 4, l1));
        assert!(error.ends_with(way_out), "{error}");
    }
    let error = refused(&full(0.5, 860, None));
    assert!(
        error.ends_with("lower --l1, --x or the background"),
        "{error}"
    );

    let looks = |l2| Request {
        background: 1e-3,
        x: 1,
        l2,
        ..REQUEST
    };
    assert!(check(&looks(5001)).is_ok());
    let error = refused(&looks(5002));
    assert!(
        error.contains("5001 looks an exposure, at most 5000"),
        "{error}"
    );

    for (x, l2) in [(0, 1000), (500, 1000)] {
        let l1 = None;
        let error = refused(&Request {
            x,
            l1,
            l2,
            ..REQUEST
        });
        assert!(error.ends_with("so that there is a look"), "{error}");
    }
    for limit in [0.0, 1.0] {
        for limit in [
            FalseAlarmLimit::PerExposure(limit),
            FalseAlarmLimit::PerCycle(limit),
        ] {
            let error = refused(&Request { limit, ..REQUEST });
            assert!(error.starts_with("the limit on false alarms"), "{error}");
        }
    }
}

/// A false alarm in every exposure may be rare enough. Its probability is the bound, 1, not one from the table.
#[test]
fn a_limit_of_more_than_one_an_exposure_needs_no_threshold() {
    let request = Request {
        limit: FalseAlarmLimit::PerCycle(0.2),
        ..REQUEST
    };
    let tuned = tune(&request, &Table::load().unwrap(), NONE).unwrap();
    assert!(tuned.limit > 1.0);
    assert_eq!(tuned.alpha, U8F8::ZERO);
    assert_eq!((tuned.false_alarms, tuned.source), (1.0, Source::Bound));
}

/// The upper limit of false alarms is within the limit at α, and not one step below.
#[test]
fn alpha_is_the_smallest_that_keeps_false_alarms_down() {
    let table = Table::load().unwrap();
    let mut sources = Vec::new();
    for (bins, background, limit) in [
        (64, 0.05, 0.01),
        (128, 0.05, 0.01),
        (128, 0.1, 0.03),
        (128, 0.3, 0.003),
        (128, 0.1, 1e-4),
        (128, 0.05, 1e-9),
    ] {
        let request = Request {
            bins,
            background,
            ..REQUEST
        };
        let looks = Looks::new(4, 40, 1000);
        let steps = single_looks(bins.into(), background * 4.0, looks.last);
        let request = Request {
            limit: FalseAlarmLimit::PerExposure(limit),
            ..request
        };
        let found = tune(&request, &table, NONE).unwrap();
        assert_eq!((found.l1, found.looks, found.limit), (40, looks, limit));

        let repeated = RepeatedLooks::new(&steps, looks.first, looks.last);
        // The upper limit by the table or by the sum over looks.
        let most = |alpha: u16| {
            let minimum = Count::saturating(MINIMUM_COUNT.into());
            let bounds = repeated.bounds(&Threshold::new(U8F8::from_bits(alpha), minimum));
            let first_mean = background * 44.0;
            let found = table.look_up(first_mean, 11, 249, bounds.independent);
            match found.filter(|found| bins == 128 && found.probability < bounds.sum) {
                Some(found) => (found.upper_limit.max(bounds.worst_look) * MARGIN).min(bounds.sum),
                None => bounds.sum,
            }
        };
        let alpha = found.alpha.to_bits();
        assert!(most(alpha) <= limit && most(alpha - 1) > limit, "{found:?}");
        assert!(found.false_alarms <= limit);
        assert!(found.detections.detected() > 0.99);
        sources.push(found.source);
    }
    assert_eq!(sources[0], Source::Bound);
    assert!(sources.contains(&Source::Table), "{sources:?}");
}

/// In exposures that did not determine α, too.
#[test]
fn alpha_of_the_average_keeps_false_alarms_down() {
    let limit = 0.02;
    let found = average::tune(
        &Request {
            background: 0.2,
            bins: 8,
            l2: 200,
            signal: 2.0,
            limit: FalseAlarmLimit::PerExposure(limit),
            ..REQUEST
        },
        NONE,
    )
    .unwrap();
    assert_eq!((found.l1, found.exposures), (40, 64 * 2000));
    let (exposures, events) = found.false_alarms;
    assert_eq!(exposures, 8 * 500);
    let share = events as f64 / exposures as f64 / limit;
    // Steps of α are coarse; 80 events are expected.
    assert!((0.5..1.3).contains(&share), "{share}");
    assert!(found.detections.detected() > 0.9);
}

/// Within a tenth: fewer exposures choose L1.
#[test]
fn no_other_l1_is_much_faster() {
    let time = |l1| {
        let request = Request {
            signal: 0.3,
            l1,
            ..REQUEST
        };
        let found = window::tune(&request, NONE).unwrap();
        (found.l1, found.detections.cycles_to_event())
    };
    let (chosen, best) = time(None);
    let others = [12, 48, 108, 364].map(|l1| (l1, time(Some(l1)).1));
    assert!(
        others.iter().all(|&(_, other)| best < 1.1 * other),
        "{chosen} {best} {others:?}"
    );
    assert!(
        others.iter().any(|&(_, other)| best < 0.8 * other),
        "{chosen} {best} {others:?}"
    );
}

/// Of a bright target: a pixel that looks sooner reports it sooner.
#[test]
fn the_first_of_the_shortest_is_chosen() {
    use std::sync::atomic::{AtomicU64, Ordering};

    let request = Request {
        bins: 8,
        signal: 4.0,
        l2: 200,
        ..REQUEST
    };
    let settings = |l1, minimum| DetectionSettings {
        looks: Looks::new(4, l1, 200),
        rule: WindowRule::new(3, "4".parse().unwrap(), Count::saturating(minimum))
            .unwrap()
            .into(),
        estimator: DepthEstimator::for_pulse("1".parse().unwrap()),
    };
    let [slow, fast, never] = [(40, 5), (4, 5), (4, 1023)].map(|(l1, of)| settings(l1, of));
    let total = AtomicU64::new(0);
    let progress = |_, all| {
        total.store(all, Ordering::Relaxed);
        Ok(())
    };
    for (all, chosen) in [
        ([slow, fast], 1),
        ([fast, slow], 0),
        ([fast, fast], 0),
        ([never, fast], 1),
    ] {
        let all = [(all[0], 0), (all[1], 1)];
        let (found, detections) = shortest::shortest(&request, &all, &progress).unwrap();
        assert_eq!(found, chosen);
        assert!(detections.detected() > 0.9);
        // Exposures at each of eight positions: 50 of each settings, 500 of the chosen.
        assert_eq!(total.load(Ordering::Relaxed), 8 * (2 * 50 + 500));
    }
    let refused = shortest::shortest(&request, &[(never, 0)], NONE);
    let line =
        "the signal is too weak: fewer than 1 % of exposures report the target before L2 = 200";
    assert_eq!(refused.unwrap_err().to_string(), line);

    let (exposures, _) = shortest::false_alarms(&request, &fast, &progress).unwrap();
    assert_eq!([exposures, total.into_inner()], [8 * 500; 2]);
}

#[test]
fn z_is_that_of_all_bins() {
    let request = Request {
        bins: 8,
        signal: 2.0,
        l2: 200,
        ..REQUEST
    };
    let gate = RangeGate::<1024>::new(0, 7).unwrap();
    let z = z_for_levels(100, &gate, 4, 40, 200, BlockLevel::PIXEL);
    assert_eq!(window::tune(&request, NONE).unwrap().z, z);
}

/// z holds from 0.4 background photons a bin at the first look on: 40 laser cycles here.
#[test]
fn a_bright_target_waits_until_z_holds() {
    let found = window::tune(
        &Request {
            background: 0.01,
            signal: 3.0,
            l1: None,
            ..REQUEST
        },
        NONE,
    );
    assert_eq!(found.unwrap().l1, 36);
}

/// 64 trials of so many exposures that they have 5e8 photons, but of 2000 at most.
#[test]
fn the_exposures_of_the_average_follow_from_their_photons() {
    for (background, exposures) in [(0.4, 152), (0.05, 1220), (0.001, 2000)] {
        let request = Request {
            background,
            ..REQUEST
        };
        let asked = std::sync::Mutex::new(0);
        let refused = average::tune(&request, &|_, total| {
            *asked.lock().unwrap() = total;
            anyhow::bail!("enough")
        });
        assert!(refused.is_err());
        assert_eq!(asked.into_inner().unwrap(), 64 * exposures, "{background}");
    }
}

/// The number of exposures follows from the photons simulated in a second.
#[test]
fn much_background_has_fewer_exposures_without_a_target() {
    let found = window::tune(
        &Request {
            background: 0.4,
            signal: 3.0,
            ..REQUEST
        },
        NONE,
    );
    // An exposure of 996 laser cycles has 50,995 of the 1e8 photons.
    assert_eq!(found.unwrap().false_alarms.0, 8 * 245);
}

/// Each rule reports parts that begin with 0 and end with their totals, and stops where it is told to.
#[test]
fn progress_is_reported_and_ends_the_work() {
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    let request = Request {
        background: 0.2,
        bins: 8,
        l2: 200,
        signal: 2.0,
        ..REQUEST
    };
    let table = Table::load().unwrap();
    let run = |rule: usize, progress: Progress| match rule {
        0 => tune(&request, &table, progress).map(drop),
        1 => average::tune(&request, progress).map(drop),
        _ => window::tune(&request, progress).map(drop),
    };
    for (rule, parts) in [3, 3, 2].into_iter().enumerate() {
        let calls = Mutex::new(Vec::new());
        run(rule, &|done, total| {
            calls.lock().unwrap().push((done, total));
            Ok(())
        })
        .unwrap();
        let calls = calls.into_inner().unwrap();
        let begun: Vec<u64> = calls
            .iter()
            .filter(|call| call.0 == 0)
            .map(|call| call.1)
            .collect();
        assert_eq!(begun.len(), parts, "{rule}");
        let ended: Vec<u64> = calls
            .iter()
            .filter(|call| call.0 == call.1)
            .map(|call| call.1)
            .collect();
        assert_eq!(ended, begun, "{rule}");
        assert!(calls.iter().all(|&(done, total)| done <= total), "{rule}");
        // Calls after an error are those of items that were under way.
        for last in [0, calls.len() / 2, calls.len() - 2] {
            let count = AtomicUsize::new(0);
            let error = run(rule, &|_, _| {
                anyhow::ensure!(count.fetch_add(1, Ordering::Relaxed) < last, "stopped");
                Ok(())
            });
            assert_eq!(error.unwrap_err().to_string(), "stopped");
            let extra = count.into_inner() - last;
            assert!(extra <= 128, "{rule} {last}: {extra}");
        }
    }
}
