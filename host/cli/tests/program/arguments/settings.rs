//! The settings file, end to end.

use std::fmt::Write;
use std::path::PathBuf;

use crate::common::{Scratch, assert_contains};

/// Four pixels of two rows with a pulse at bin 60 and background.
fn photons(scratch: &Scratch) -> PathBuf {
    let mut text = "pixel,cycle,bin\n".to_owned();
    for cycle in 0..3000 {
        for pixel in 0..4 {
            writeln!(text, "{pixel},{cycle},{}", 60 + (cycle + pixel) % 2).unwrap();
            writeln!(text, "{pixel},{cycle},{}", (cycle * 7 + pixel) % 128).unwrap();
        }
    }
    scratch.file("photons.csv", text)
}

const ALL: &str = "--columns 2 --bin-width-ps 92.1 --offset-mm -3.3 --gate 10..120 --mask 3 \
    --rule window --sigma-bins 0.8 --false-alarm 0.02 --l1 8 --l2 1500 --x 2 --min-count 6 \
    --binning 1 --patience 32 --tracking --echoes 2 --echo-wait 5 --cycles 2500 --seed 9 \
    --laser-hz 20000";

const RESULTS: [&str; 3] = ["events.csv", "events.aer", "dtof.toml"];

#[test]
fn a_run_is_repeated_from_its_folder() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.printed(&format!("replay --input photons.csv --out first {ALL}"));
    let again = "replay --input photons.csv --out again --settings first/dtof.toml";
    scratch.printed(again);
    for name in RESULTS {
        let read = |folder| std::fs::read(scratch.path(folder).join(name)).unwrap();
        assert!(read("first") == read("again"), "{name}");
    }
    assert!(scratch.read("first/events.csv").lines().count() > 100);
    // An option overrides the file, and removes the keys that it replaces.
    scratch.printed(&format!("{again} --rule paper --alpha 6 --tracking=false"));
    let toml = scratch.read("again/dtof.toml");
    assert_contains(&toml, "rule = \"paper\"");
    assert_contains(&toml, "alpha = 6.0");
    assert_contains(&toml, "binning = 1");
    assert!(
        !toml.contains("tracking") && !toml.contains("\nz ="),
        "{toml}"
    );
}

#[test]
fn a_simulation_and_its_export_are_repeated_too() {
    let scratch = Scratch::new();
    let scene = "columns = 4\nrows = 2\nbackground = 0.05\nlaser_rate_mhz = 1\n\
                 field_of_view_degrees = [20, 10]\n[[surface]]\nrange_mm = 1000\nsignal = 0.5\n";
    scratch.file("scene.toml", scene);
    let simulate = "simulate --scene scene.toml --out";
    scratch.printed(&format!(
        "{simulate} first --rule window --window 3 --cycles 5000 --seed 4 --mask 2"
    ));
    scratch.printed(&format!("{simulate} again --settings first/dtof.toml"));
    for name in RESULTS {
        assert_eq!(
            std::fs::read(scratch.path("first").join(name)).unwrap(),
            std::fs::read(scratch.path("again").join(name)).unwrap(),
            "{name}"
        );
    }
    // Pixel 2 is left out, and its photons are counted.
    assert!(
        scratch
            .read("first/events.csv")
            .lines()
            .all(|row| row.split(',').nth(1) != Some("2"))
    );
    let summary: serde_json::Value =
        serde_json::from_str(&scratch.read("first/summary.json")).unwrap();
    let masked = summary["masked"].as_u64().unwrap();
    // 5,000 laser cycles of 128 bins with 0.05 photons, and 0.5 of signal.
    assert!((34_500 - 1000..34_500 + 1000).contains(&masked), "{masked}");

    let export = "export first/events.aer --format csv --out";
    scratch.printed(&format!("{export} a.csv --settings first/dtof.toml"));
    scratch.printed(&format!("{export} b.csv --fov 20x10 --laser-hz 1000000"));
    assert_eq!(scratch.read("a.csv"), scratch.read("b.csv"));
    scratch.printed(&format!(
        "{export} c.csv --settings first/dtof.toml --fov 60x30"
    ));
    assert_ne!(scratch.read("a.csv"), scratch.read("c.csv"));
}

#[test]
fn what_contradicts_the_file_is_refused() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.file("scene.toml", "[[surface]]\nrange_mm = 1000\nsignal = 1\n");
    scratch.file("wide.toml", "[sensor]\nbins = 64\n");
    scratch.file("key.toml", "[detection]\nl_1 = 4\n");
    scratch.file("section.toml", "[detecton]\nl1 = 4\n");
    scratch.file("z.toml", "[detection]\nrule = 'window'\n");
    scratch.all_refused(
        "replay --input photons.csv --out out",
        "--settings missing.toml | missing.toml: No such file
        --settings section.toml | error: section.toml: detecton is unknown; is it detection?
        --settings key.toml | error: key.toml: l_1 is unknown in [
        --settings z.toml | error: z.toml: rule window needs --window or --sigma-bins
        --mask 4 | --mask 4: there are 4 pixels
        --mask x | must be a whole number from 0 to 65535
        --patience 8 | --patience is for --binning
        --half-widths 2 | --half-widths 2: must be BEFORE,AFTER, each 1 to 4 bins
        --tracking --rule paper | --tracking is for --rule window",
    );
    scratch.all_refused(
        "simulate --scene scene.toml --out out",
        "--settings wide.toml | wide.toml: 64 bins of 250 ps, but the scene has 128 of 250 ps",
    );

    // An error about a file names file and key, an error about an option its flag.
    scratch.file("gate.toml", "[sensor]\ngate = [100, 200]\n");
    scratch.file("mask.toml", "[sensor]\nmasked = [4]\n");
    scratch.file("l2.toml", "[detection]\nl2 = 20\nfalse_alarm = 1e-5\n");
    scratch.file("list.toml", "[run]\naxes = 'rows,bins'\n");
    scratch.file(
        "z4.toml",
        "[detection]\nrule = 'window'\nwindow = 3\nz = 4.0\n",
    );
    scratch.file("width.toml", "[sensor]\nbin_width_ps = 100.0\n");
    let window = "--settings l2.toml --l2 2000 --rule window --window 3";
    scratch.all_refused(
        "replay --input photons.csv --out out",
        &format!(
            "--settings gate.toml | error: gate.toml: gate 100..200: with 128 bins
            --settings gate.toml --gate 9..200 | error: --gate 9..200: with 128 bins
            --settings mask.toml | error: mask.toml: masked 4: there are 4 pixels
            --settings l2.toml --alpha 3 | error: l2.toml: false_alarm is for --rule window
            {window} --false-alarm 1e-9 | error: --false-alarm 0.000000001: there is no z
            --settings l2.toml --rule window --window 3 | error: l2.toml: l2 20: must be greater than --l1 40
            {window} --l1 3000 | error: --l2 2000: must be greater than --l1 3000
            --settings width.toml --bin-width-ps 0 | error: --bin-width-ps 0: too narrow:
            --l1 4 --l1 5 | error: --l1 is given twice
            --masked 3 | error: --masked is unknown; is it --mask?
            --in photons.csv | error: --in is unknown; is it --input?
            --bin 8 | error: --bin is unknown; is it --bins?
            --verbose | error: --verbose is unknown\n
            --mask 1,2,x,4 | error: --mask 1,2,x,4: x must be a whole number from 0 to 65535
            --rule= | error: --rule needs a value
            --false-alarm --seed 5 | error: --false-alarm needs a value
            --alpha -x | error: --alpha -x: must be a number from 0 to 255.996
            --settings z4.toml --false-alarm 1e-30 | error: --false-alarm 0.000000000000000000000000000001: there is no z
            --settings list.toml | error: list.toml: axes is for arrays of histograms"
        ),
    );
    scratch.all_refused(
        "compare --scene scene.toml --out out --cycles 100",
        "--settings gate.toml | error: scene.toml: gate.toml: gate 100..200: with 128 bins",
    );
}

/// A bin width from an option is that of the recording's bins, one from a file that of rebinned bins.
#[test]
fn a_width_and_rebin_are_those_of_one_place_for_every_command() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.file("width.toml", "[sensor]\nbin_width_ps = 100.0\n");
    scratch.file("rebin.toml", "[run]\nrebin = 2\n");
    let replay = "replay --input photons.csv --columns 2 --cycles 100 --out out";
    let calibrate = "calibrate --input photons.csv --columns 2 --out found.toml";
    for command in [replay, calibrate] {
        let refused = "error: --rebin changes the bins that the settings file is for";
        scratch.all_refused(
            command,
            &format!("--settings width.toml --rebin 2 | {refused}"),
        );
        // As the file has it.
        scratch.printed(&format!("{command} --settings width.toml --rebin 1"));
        std::fs::remove_dir_all(scratch.path("out")).ok();
    }
    for command in [replay, calibrate] {
        scratch.printed(&format!(
            "{command} --settings rebin.toml --bin-width-ps 100 --offset-mm -.5"
        ));
    }
    for file in ["out/dtof.toml", "found.toml"] {
        let settings = dtof_engine::settings::SettingsFile::read(&scratch.path(file)).unwrap();
        assert_eq!(
            settings.sensor.bin_width_ps.map(f64::from),
            Some(200.0),
            "{file}"
        );
        assert_eq!(
            settings.sensor.offset_mm.map(f64::from),
            Some(-0.5),
            "{file}"
        );
    }
}
