//! `dtof tune` as a user runs it. What it finds is tested in `dtof-run`.

use crate::common::Scratch;

#[test]
fn it_prints_lines_for_people_or_json() {
    let tune = "tune --background 0.05 --signal 0.4 --sigma-bins 0.8 --rule window --l1 40";
    let scratch = Scratch::new();
    let text = scratch.printed(tune);
    let json = scratch.printed(&format!("{tune} --json"));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(text.lines().last(), json["options"].as_str());
    let z = json["z"]["value"].as_f64().unwrap();
    assert!(
        text.lines()
            .any(|line| line.starts_with("z ") && line.contains(&format!("{z:.3}"))),
        "{text}"
    );
    scratch.all_refused(
        tune,
        "
        --l2 8 | --l2 8: L2 must be greater than L1
        --snr 5 | --snr cannot be used with --signal
        ",
    );
}
