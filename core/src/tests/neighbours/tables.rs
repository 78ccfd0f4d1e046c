//! The thresholds of confirmed windows are those of the two correlated normal distributions.

use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::NeighbourRule;
use dtof_core::{Count, WindowRule};

/// The share of a normal distribution above `z`.
fn upper_tail(z: f64) -> f64 {
    libm::erfc(z / std::f64::consts::SQRT_2) / 2.0
}

/// The probability that the own excess is above 2.5 and that of all above `z`, by Simpson's rule.
fn both(z: f64, share: f64) -> f64 {
    let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
    let given = |x: f64| upper_tail((z - share.sqrt() * x) / (1.0 - share).sqrt());
    let (from, steps) = (2.5, 4000);
    let step = 10.0 / f64::from(steps);
    let value = |number: i32| {
        let x = from + step * f64::from(number);
        let weight = match number {
            0 => 1.0,
            number if number == steps => 1.0,
            number if number % 2 == 1 => 4.0,
            _ => 2.0,
        };
        weight * density(x) * given(x)
    };
    (0..=steps).map(value).sum::<f64>() * step / 3.0
}

/// The z that one in `2^power` trials exceeds, at least 2, in 1/4096.
fn expected(power: f64, share: f64) -> f64 {
    let (mut low, mut high) = (2.0, 16.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if both(middle, share) * power.exp2() > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    (low * 4096.0).round()
}

fn rule(z: f64) -> NeighbourRule {
    NeighbourRule::new(&WindowRule::new(3, U4F12::from_num(z), Count::saturating(5)).unwrap())
}

/// The z of a normal distribution that one in `2^power` trials exceeds.
fn normal(power: f64) -> f64 {
    let (mut low, mut high) = (0.0, 40.0);
    for _ in 0..60 {
        let middle = f64::midpoint(low, high);
        if upper_tail(middle) * power.exp2() > 1.0 {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

#[test]
fn the_thresholds_are_those_of_two_normal_distributions() {
    // Of twice as many trials for half of the false alarms.
    for power in (7..=33).step_by(2).map(f64::from) {
        // The z of a rule is a straight line between even powers.
        let rule = rule(f64::midpoint(normal(power - 1.0), normal(power + 1.0)));
        let own = rule.own().z().to_num::<f64>();
        assert!((own - normal(power + 1.0)).abs() < 0.002, "{own}");
        for sixteenths in 1..=8u32 {
            let share = f64::from(sixteenths) / 16.0;
            let z = f64::from(rule.z(sixteenths, 16).to_bits());
            let expected = expected(power + 1.0, share);
            assert!(
                (z - expected).abs() <= 12.0,
                "2^{power}, {share}: {z} for {expected}"
            );
        }
    }
}

/// A share rounds up to a sixteenth, and with more than half the threshold is that of the pixel alone.
#[test]
fn a_larger_share_never_has_a_lower_threshold() {
    for z in [0.5, 2.2, 4.47, 6.4, 15.9] {
        let rule = rule(z);
        let mut before = U4F12::ZERO;
        for own in 1..=160 {
            let z = rule.z(own, 160);
            assert!(z >= before && z <= rule.own().z().max(U4F12::lit("2")));
            assert_eq!(z, rule.z(own.div_ceil(10) * 10, 160));
            before = z;
        }
        assert_eq!(before, rule.own().z());
        assert_eq!(rule.z(81, 160), rule.own().z());
    }
    // Beyond the end of the table.
    let beyond = rule(15.9);
    assert_eq!(beyond.z(1, 160), beyond.own().z());
    // No photons, and more than 2³².
    assert!(rule(4.47).z(0, 0) > U4F12::lit("2"));
    assert_eq!(rule(4.47).z(u32::MAX, u32::MAX), rule(4.47).own().z());
    assert_eq!(rule(4.47).z(1, u32::MAX), rule(4.47).z(1, 16));
}
