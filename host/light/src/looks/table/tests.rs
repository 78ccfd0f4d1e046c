//! The table against the grid.

use super::*;
use crate::looks::single_look::SingleLook;

#[test]
fn the_table_has_this_grid() {
    let table = Table::load().unwrap();
    // Every point has rows.
    for point in points() {
        let of_point = |row: &&Row| (row.first_mean, row.first) == (point.first_mean, point.first);
        assert!(table.rows.iter().any(|row| of_point(&row)), "{point:?}");
    }
    // In the order of the grid, without duplicates.
    let place = |row: &Row| (row.first_mean, row.first, row.last, row.alpha);
    assert!(
        table
            .rows
            .windows(2)
            .all(|pair| place(&pair[0]) < place(&pair[1]))
    );
}

#[test]
fn another_grid_is_refused() {
    let another = CSV.replace("[2, 5, 11,", "[2, 6, 11,");
    let error = Table::read(&another).unwrap_err().to_string();
    assert!(
        error.contains("another grid") && !error.contains('\n'),
        "{error}"
    );
    let row = CSV.lines().last().unwrap();
    let with = |row: &str| format!("{CSV}{row}\n");
    let fields: Vec<&str> = row.split(',').collect();
    for (field, value) in [(0, "7"), (1, "3"), (2, "100"), (3, "300")] {
        let mut bad = fields.clone();
        bad[field] = value;
        let error = Table::read(&with(&bad.join(","))).unwrap_err();
        assert!(
            format!("{error:#}").contains("not a point of the grid"),
            "{error:#}"
        );
    }
}

#[test]
fn upper_limits_are_not_below_the_probability() {
    let table = Table::load().unwrap();
    for row in &table.rows {
        let found = table.look_up(row.first_mean, row.first, row.last, row.intensity);
        let found = found.unwrap();
        assert!(found.upper_limit >= found.probability, "{row:?}");
    }
}

/// A thousand exposures with another seed, at four points.
#[test]
fn the_table_equals_a_new_simulation() {
    let table = Table::load().unwrap();
    let all = points();
    let of_grid = FIRST_MEANS.len() * FIRSTS.len();
    assert_eq!(all.len(), of_grid);
    let mut compared = 0;
    for at in [7, 22, 41, 63] {
        let point = &all[at];
        let last = point.lasts.last().copied().unwrap();
        assert!(last <= LAST && point.lasts[0] == point.first, "{point:?}");
        let tally = simulate(99, 5000, point, 2).unwrap();
        assert_eq!(tally.exposures, 2 * u64::from(TRIAL));
        let rows = rows(point, &tally);
        for row in &rows {
            assert!((MIN_EVENTS..=950).contains(&row.events));
            let found = table.look_up(row.first_mean, row.first, row.last, row.intensity);
            let expected = found.unwrap().probability * tally.exposures as f64;
            let error = (row.events as f64 - expected).abs();
            assert!(
                error < 5.0 * expected.sqrt() + 0.05 * expected,
                "{row:?} {expected}"
            );
        }
        compared += rows.len();
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn points_reach_the_highest_look_and_mean() {
    let all = points();
    for (first_mean, first, lasts) in [
        (0.1, 2, &[2, 4, 8, 16, 32, 64, 128, 256, 512, 1024][..]),
        (0.1, 101, &[101, 202, 404, 808, 1616]),
        (25.0, 5, &[5, 10, 20, 40, 80, 160, 320]),
        (300.0, 2, &[2, 4, 8]),
    ] {
        let is_here = |point: &&Point| (point.first_mean, point.first) == (first_mean, first);
        assert_eq!(all.iter().find(is_here).unwrap().lasts, lasts);
    }
}

/// Two last looks with so many events of 1000 exposures; a probability near 0 or 1 is left out.
#[test]
fn rows_are_tallies_and_the_intensity_of_their_looks() {
    let point = Point {
        first_mean: 1.1,
        first: 2,
        lasts: vec![2, 8],
    };
    let mut tally = FalseAlarms::new(2);
    tally.exposures = 1000;
    tally.events[0][..5].copy_from_slice(&[951, 950, 20, 19, 0]);
    tally.events[1][..3].copy_from_slice(&[1000, 949, 500]);
    let rows = rows(&point, &tally);
    let found = rows.iter().map(|row| (row.last, row.alpha, row.events));
    let found: Vec<_> = found.collect();
    assert_eq!(
        found,
        [(2, 384, 950), (2, 512, 20), (8, 384, 949), (8, 512, 500)]
    );
    for row in &rows {
        let minimum = Count::saturating(MINIMUM_COUNT.into());
        let threshold = Threshold::new(U8F8::from_bits(row.alpha), minimum);
        let none = (2..=row.last).map(|step| {
            let look = SingleLook::new(128, 0.55 * f64::from(step));
            1.0 - look.false_alarm_probability(&threshold)
        });
        let expected = -none.product::<f64>().ln();
        assert!((row.intensity / expected - 1.0).abs() < 1e-9, "{row:?}");
        assert_eq!((row.first_mean, row.first), (1.1, 2));
    }
    // The file has five digits.
    let read = Table::read(&csv(&[(point, tally)]).unwrap()).unwrap();
    assert_eq!((read.exposures, read.rows.len()), (1000, 4));
    for (read, row) in read.rows.iter().zip(&rows) {
        assert!((read.intensity / row.intensity - 1.0).abs() < 1e-4);
        let intensity = row.intensity;
        assert_eq!(Row { intensity, ..*read }, *row);
    }
}

/// Events that were simulated, and so few that there were none.
#[test]
fn an_estimate_says_whether_there_were_such_events() {
    let table = Table::load().unwrap();
    let at = |independent| table.look_up(1.3, 3, 40, independent).unwrap();
    assert!(at(0.1).is_observed && !at(1e-12).is_observed);
    // At most the smallest in the table.
    assert_eq!(at(1e-12).probability, at(1e-20).probability);
    assert!(at(0.01).probability < at(0.1).probability);
}
