//! No command replaces a file that it reads, nor one in its folder that it did not write.

use std::fs;
use std::path::PathBuf;
use std::process::Stdio;

use crate::common::aer::{HEADER, events, file};
use crate::common::{Scratch, assert_contains, names, npy};
use dtof_data::photons::open::{ReadOptions, open};
use dtof_engine::settings::Settings;
use dtof_run::output::Output;
use dtof_run::summary::Summary;

const PHOTONS: &str = "pixel,cycle,bin\n0,0,0\n";
const SCENE: &str = "cycles = 100\n[[surface]]\nrange_mm = 1000\nsignal = 1\n";
const RESULTS: [&str; 18] = [
    "age.npy",
    "confidence.npy",
    "depth-best.npy",
    "depth-events.npy",
    "depth-last.svg",
    "depth-mean.svg",
    "depth.csv",
    "depth.npy",
    "depth.svg",
    "dtof.toml",
    "event-counts.svg",
    "events.aer",
    "events.csv",
    "photon-counts.svg",
    "reflectivity-events.svg",
    "reflectivity-signal.svg",
    "report.html",
    "summary.json",
];

/// `dtof LINE` must end with one line that says `reason`, and leave `name` as it is.
#[track_caller]
fn kept(scratch: &Scratch, line: &str, name: &str, reason: &str) {
    let before = scratch.read(name);
    let output = scratch.run(line);
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1), "{line}");
    assert!(message.contains(&format!("{name}: {reason}")), "{message}");
    assert_eq!(message.lines().count(), 1, "{message}");
    assert_eq!(scratch.read(name), before);
}

/// Settings that leave all to the defaults: nothing is searched.
const REPLAY: &str = "replay --input photons.csv --out out --settings defaults.toml";
const READ: &str = "is an input file";

/// What [`REPLAY`] reads.
fn photons(scratch: &Scratch) -> PathBuf {
    scratch.file("defaults.toml", "");
    scratch.file("photons.csv", PHOTONS)
}

#[test]
fn a_recording_in_the_output_folder_is_kept() {
    for name in RESULTS {
        let scratch = Scratch::new();
        // Photon lists end in .csv; other names are reached through a link.
        let result = format!("out/{name}");
        let photons = scratch.file("out/photons.csv", PHOTONS);
        fs::hard_link(photons, scratch.path(&result)).unwrap();
        kept(
            &scratch,
            "replay --input out/photons.csv --out out --rule paper",
            &result,
            READ,
        );
        assert_eq!(names(&scratch.path("out")).len(), 2);
    }
    let scratch = Scratch::new();
    scratch.file("out/events.csv", PHOTONS);
    let output = scratch.run("replay --input out/events.csv --out out/../out");
    assert_contains(&String::from_utf8(output.stderr).unwrap(), READ);
    assert_eq!(scratch.read("out/events.csv"), PHOTONS);
}

#[cfg(unix)]
#[test]
fn links_hide_no_input() {
    let scratch = Scratch::new();
    fs::create_dir(scratch.path("out")).unwrap();
    photons(&scratch);
    scratch.file("scene.toml", SCENE);
    std::os::unix::fs::symlink("../photons.csv", scratch.path("out/summary.json")).unwrap();
    kept(&scratch, REPLAY, "out/summary.json", READ);
    fs::remove_file(scratch.path("out/summary.json")).unwrap();
    std::os::unix::fs::symlink("../scene.toml", scratch.path("out/report.html")).unwrap();
    let line = "simulate --scene scene.toml --out out";
    kept(&scratch, line, "out/report.html", READ);
    assert_eq!(
        scratch.read("photons.csv") + &scratch.read("scene.toml"),
        PHOTONS.to_owned() + SCENE
    );
}

#[test]
fn a_scene_in_the_output_folder_is_kept() {
    let scratch = Scratch::new();
    scratch.file("out/summary.json", SCENE);
    let line = "simulate --scene out/summary.json --out out";
    kept(&scratch, line, "out/summary.json", READ);
}

#[test]
fn settings_in_the_output_folder_are_kept() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.file("out/dtof.toml", "# dtof settings\n");
    let line = "replay --input photons.csv --out out --settings out/dtof.toml";
    kept(&scratch, line, "out/dtof.toml", READ);
}

#[test]
fn a_file_of_somebody_else_is_kept() {
    // Settings are kept beside those of the run.
    for name in RESULTS.into_iter().filter(|name| *name != "dtof.toml") {
        // Of the same kind, and empty.
        for text in ["{}\n", "<svg></svg>\n", "<!DOCTYPE html>\n", PHOTONS, ""] {
            let scratch = Scratch::new();
            let result = format!("out/{name}");
            scratch.file(&result, text);
            photons(&scratch);
            kept(&scratch, REPLAY, &result, "was not written by this program");
            assert_eq!(names(&scratch.path("out")), [name]);
        }
    }
    let scratch = Scratch::new();
    let name = "out/demo/report.html";
    scratch.file(name, "mine\n");
    scratch.file("own.toml", "mine\n");
    kept(&scratch, "demo --cycles 200", name, "was not written");
    // This is found before anything is read: there is no such recording.
    let line = "replay missing.npy --out out/demo";
    kept(&scratch, line, name, "was not written");
    let line = "simulate --scene missing.toml --out out/demo";
    kept(&scratch, line, name, "was not written");
    let line = "calibrate missing.npy --out own.toml";
    kept(&scratch, line, "own.toml", "was not written");
}

#[test]
fn settings_that_a_run_would_replace_are_kept_under_another_name() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.printed(REPLAY);
    let first = scratch.read("out/dtof.toml");
    // Nothing is kept of what is the same.
    scratch.printed(REPLAY);
    assert!(!scratch.path("out/dtof.toml~1").exists());
    for (number, text) in [(1, format!("{first}# mine\n")), (2, "mine\n".to_owned())] {
        scratch.file("out/dtof.toml", &text);
        let kept = format!("out/dtof.toml~{number}");
        let printed = scratch.printed(REPLAY);
        assert_contains(
            &printed,
            &format!("{kept} has the settings that were here\n"),
        );
        assert_eq!(scratch.read(&kept), text);
        assert_eq!(scratch.read("out/dtof.toml"), first);
    }
    // The same text is not kept twice.
    scratch.file("out/dtof.toml", "mine\n");
    scratch.printed(&format!("{REPLAY} --quiet"));
    assert!(!scratch.path("out/dtof.toml~3").exists());
    assert_eq!(scratch.read("out/dtof.toml"), first);
}

#[test]
fn settings_that_a_calibration_would_replace_are_kept_under_another_name() {
    let scratch = Scratch::new();
    scratch.file("even.npy", npy("|u1", "(8, 8, 32)", &[4; 2048]));
    let calibrate = "calibrate even.npy --out own.toml";
    scratch.printed(calibrate);
    let first = scratch.read("own.toml");
    scratch.printed(calibrate);
    assert!(!scratch.path("own.toml~1").exists());
    let edited = format!("{first}# mine\n");
    scratch.file("own.toml", &edited);
    let line = "own.toml~1 has the settings that were here\n";
    assert_contains(&scratch.printed(calibrate), line);
    assert_eq!(scratch.read("own.toml~1"), edited);
    assert_eq!(scratch.read("own.toml"), first);
    // Nothing is kept where nothing is replaced.
    scratch.file("own.toml", "mine\n");
    kept(
        &scratch,
        &format!("{calibrate} --quiet"),
        "own.toml",
        "was not written by this program",
    );
    assert!(!scratch.path("own.toml~2").exists());
}

/// If one of two runs that begin together succeeds, the folder is complete and of one run.
#[test]
fn runs_that_begin_together_leave_no_mixture() {
    let scratch = Scratch::new();
    photons(&scratch);
    for round in 0..8 {
        let runs = ["8", "16"].map(|l1| {
            let line = format!(
                "replay photons.csv --quiet --out {round} --settings defaults.toml --l1 {l1}"
            );
            let run = scratch.command(&line).stderr(Stdio::null()).spawn();
            (l1, run.unwrap())
        });
        let runs = runs.map(|(l1, mut run)| (l1, run.wait().unwrap().success()));
        let succeeded: Vec<_> = runs.iter().filter(|run| run.1).map(|run| run.0).collect();
        if succeeded.is_empty() {
            continue;
        }
        let summary = scratch.read(&format!("{round}/summary.json"));
        let summary: serde_json::Value = serde_json::from_str(&summary).unwrap();
        let l1 = summary["settings"]["l1"].to_string();
        assert!(succeeded.contains(&&*l1), "{l1}, {succeeded:?}");
        assert_contains(
            &scratch.read(&format!("{round}/dtof.toml")),
            &format!("l1 = {l1} "),
        );
        let mut names = names(&scratch.path(&round.to_string()));
        // If one began after the other.
        names.retain(|name| name != "dtof.toml~1");
        assert_eq!(names, RESULTS);
    }
}

/// This also holds after a run that was ended between any two of its files.
#[test]
fn results_of_an_earlier_run_are_replaced() {
    let scratch = Scratch::new();
    photons(&scratch);
    scratch.printed(REPLAY);
    assert_eq!(names(&scratch.path("out")), RESULTS);
    scratch.file("out/notes.txt", "mine\n");
    scratch.printed(&format!("{REPLAY} --l1 8"));
    for name in "summary.json report.html events.aer depth-last.svg".split(' ') {
        fs::remove_file(scratch.path("out").join(name)).unwrap();
        scratch.printed(REPLAY);
    }
    assert_eq!(scratch.read("out/notes.txt"), "mine\n");
    // This holds for files of another command of this program, too.
    let scene = scratch.file("scene.toml", SCENE);
    assert!(scratch.simulate(&scene, "--quiet").status.success());
}

/// Files that appear during a run stay, and so do all files of the earlier run.
#[test]
fn a_folder_that_cannot_be_completed_is_left_as_it_was() {
    let scratch = Scratch::new();
    let photons = photons(&scratch);
    scratch.printed(REPLAY);
    let options = ReadOptions {
        cycles: Some(1),
        ..ReadOptions::default()
    };
    let source = open(&photons, &options).unwrap().photons;
    let settings = Settings::static_scene(1);
    let out = scratch.path("out");
    let summary = Summary::new(Default::default(), source.as_ref(), 0, &settings);
    let before = scratch.read("out/summary.json");
    let finish = |come: &dyn Fn()| {
        let output = Output::create(&out, &settings, source.as_ref(), Vec::new()).unwrap();
        fs::remove_file(out.join("report.html")).unwrap();
        come();
        let error = output.finish(&summary, "", "", &[]).unwrap_err();
        assert!(format!("{error:#}").contains("report.html: "), "{error:#}");
        assert_eq!(scratch.read("out/summary.json"), before);
        assert!(names(&out).iter().all(|name| !name.starts_with('.')));
    };
    finish(&|| fs::write(out.join("report.html"), "mine\n").unwrap());
    assert_eq!(scratch.read("out/report.html"), "mine\n");
    let ours = "<meta name=\"generator\" content=\"dtof\">";
    fs::write(out.join("report.html"), ours).unwrap();
    finish(&|| fs::create_dir(out.join("report.html")).unwrap());
}

#[test]
fn what_an_export_reads_is_kept() {
    let scratch = Scratch::new();
    scratch.file("events.aer", file(&HEADER, &events()));
    scratch.file("calibration.toml", "columns = 64\n");
    fs::hard_link(scratch.path("events.aer"), scratch.path("same.aer")).unwrap();
    let export = |out| {
        let options = "--format ply --calibration calibration.toml";
        let output = scratch.run(&format!("export events.aer {options} --out {out}"));
        String::from_utf8(output.stderr).unwrap()
    };
    for out in ["events.aer", "./events.aer", "same.aer", "calibration.toml"] {
        assert_eq!(export(out), format!("error: {out}: {READ}\n"));
    }
    assert_eq!(scratch.read("calibration.toml"), "columns = 64\n");
    assert!(fs::read(scratch.path("same.aer")).unwrap() == file(&HEADER, &events()));
}
