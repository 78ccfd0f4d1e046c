//! A capture log has zones and captures, where other arrays have columns and rows.

use crate::common::{Scratch, assert_contains};

#[test]
fn the_report_of_a_capture_log_calls_them_so() {
    let scratch = Scratch::new();
    let mut counts = vec!["1"; 128];
    counts[40] = "500";
    let zone = format!("[{}]", counts.join(","));
    let capture = format!("{{\"hists\": [{}]}}", [zone.as_str(); 9].join(","));
    let log = scratch.file("log.json", format!("[{capture},{capture}]"));
    let photons = scratch.file("photons.csv", "pixel,cycle,bin\n0,0,0\n");
    for (input, [across, down], has_events) in [
        (log, ["zone", "capture"], true),
        (photons, ["column", "row"], false),
    ] {
        let summary = scratch.replayed(&input, "");
        assert_eq!(summary["events"].as_u64() > Some(0), has_events);
        let map = scratch.read("out/event-counts.svg");
        let report = scratch.read("out/report.html");
        for side in [across, down] {
            assert_contains(&map, &format!(">{side}<"));
        }
        let sides = format!("\"sides\":[\"{across}\",\"{down}\"]");
        assert_eq!(report.contains(&sides), has_events);
    }
}
