use super::*;

#[test]
fn equal_values_have_the_middle_colour_and_one_mark() {
    for value in [0.0, 3.0, -5e300, 5e-324] {
        let values = [Some(value); 12];
        let scale = Scale::new(&values).unwrap();
        assert_eq!(scale.level(value), 127);
        assert_eq!(scale.marks(256.0).len(), 1);
    }
}

#[test]
fn marks_are_round_and_apart() {
    let values = [Some(1293.7), Some(3702.2)];
    let labels = |length| {
        let marks = Scale::new(&values).unwrap().marks(length);
        marks.into_iter().map(|mark| mark.label).collect::<Vec<_>>()
    };
    assert_eq!(labels(256.0), ["1294", "3702", "2000", "2500", "3000"]);
    assert_eq!(labels(160.0), ["1294", "3702", "2000", "3000"]);

    // Counts have no fractions, and zero no sign.
    let values = [Some(-1.0), Some(0.0), Some(1.0)];
    let marks = Scale::new(&values).unwrap().marks(384.0);
    let labels: Vec<_> = marks.iter().map(|mark| mark.label.as_str()).collect();
    assert_eq!(labels, ["-1", "1", "0"]);
}

#[test]
fn extreme_values() {
    for values in [
        [f64::MIN, f64::MAX],
        [0.0, 5e-324],
        [1e16, 1e16 + 2.0],
        [1.0, 1.0 + f64::EPSILON],
        [-0.0, 0.0],
    ] {
        let values = values.map(Some);
        let scale = Scale::new(&values).unwrap();
        let marks = scale.marks(384.0);
        assert!(marks.len() < 13, "{marks:?}");
        for value in values {
            scale.level(value.unwrap());
        }
    }
}
