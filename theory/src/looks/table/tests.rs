//! The table against the grid.

use super::*;

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
