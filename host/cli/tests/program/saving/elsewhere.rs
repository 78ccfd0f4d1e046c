//! Names that come from outside never lead outside: only what `--out` names is written.

use std::io::Write;

use super::{Files, files};
use crate::common::{Scratch, npy};

/// Hostile names that point outside of the folder, as written in TOML.
const NAMES: [&str; 7] = [
    "../evil",
    "../../evil.csv",
    "ROOT/evil",
    "..\\\\..\\\\evil",
    "C:\\\\evil",
    "summary.json\\u0000",
    "\\u001b]0;evil\\u0007<script>",
];

/// Runs `line` in a nested folder, and returns the new files outside of `out`. A simulation without
/// hostile settings must succeed.
#[track_caller]
fn elsewhere(scratch: &Scratch, line: &str) -> Files {
    let before = files(&scratch.path(""));
    let mut command = scratch.command(line);
    let output = command.current_dir(scratch.path("a/b")).output().unwrap();
    let may_fail = !line.starts_with("simulate") || line.contains("settings");
    let is_right = matches!(output.status.code(), Some(code) if code == 0 || may_fail && code == 1);
    assert!(is_right, "{line}: {output:?}");
    for said in [&output.stdout, &output.stderr] {
        assert!(!said.contains(&0x1b), "{line}: {output:?}");
    }
    let mut after = files(&scratch.path(""));
    after.retain(|name, bytes| !name.starts_with("a/b/out") && before.get(name) != Some(bytes));
    let all = files(&scratch.path(""));
    let gone: Vec<_> = before
        .keys()
        .filter(|name| !all.contains_key(*name))
        .collect();
    let of_out = gone.iter().filter(|name| name.starts_with("a/b/out"));
    assert_eq!(gone.len(), of_out.count(), "{gone:?}");
    after
}

/// A scene whose surface has this name.
fn scene(name: &str) -> String {
    format!(
        "{}[[surface]]\nname = \"{name}\"\nrange_mm = 900\nreflectivity = 0.5\n",
        super::SCENE
    )
}

/// An archive with one array, stored under this name.
fn npz(name: &str) -> Vec<u8> {
    let counts: Vec<u8> = (0..4 * 32u8)
        .flat_map(|at| [u8::from(at % 32 == 9) * 90 + 1, 0])
        .collect();
    let mut zip = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    zip.start_file(name, zip::write::SimpleFileOptions::default())
        .unwrap();
    zip.write_all(&npy("<u2", "(2, 2, 32)", &counts)).unwrap();
    zip.finish().unwrap().into_inner()
}

#[test]
fn names_in_scenes_settings_and_archives_lead_nowhere() {
    let scratch = Scratch::new();
    scratch.file("a/b/kept.txt", "kept");
    scratch.file("evil.csv", "cycle,pixel,exposure");
    let (mut runs, mut replayed) = (0, 0);
    for name in NAMES {
        let name = &name.replace("ROOT", scratch.path("").to_str().unwrap());
        scratch.file("a/b/scene.toml", scene(name));
        let plain = name.replace("\\\\", "\\").replace("\\u001b", "\u{1b}");
        let plain = plain.replace("\\u0007", "\u{7}").replace("\\u0000", "\0");
        scratch.file("a/b/in.npz", npz(&format!("{plain}.npy")));
        let settings = format!("[rays]\ncalibration = \"{name}\"\n");
        scratch.file("a/b/settings.toml", settings);
        for line in [
            "simulate --scene scene.toml --cycles 200 --out out",
            "replay --input in.npz --out out",
            "replay --input in.npz --settings settings.toml --out out",
            "simulate --scene scene.toml --cycles 200 --settings settings.toml --out out",
            "export out/events.aer --settings settings.toml --format csv --out out/points.csv",
            "calibrate --input in.npz --recorded-cycles 100 --out out/found.toml",
        ] {
            let found = elsewhere(&scratch, line);
            assert_eq!(found, Files::new(), "{name}: {line}");
            runs += 1;
            // Some names are not valid names of arrays.
            let summary = scratch.path("a/b/out/summary.json");
            if line == "replay --input in.npz --out out" {
                let summary = std::fs::read_to_string(&summary).unwrap_or_default();
                replayed += u32::from(summary.contains("in.npz"));
            }
        }
    }
    assert!(replayed >= 5, "{replayed} replayed");
    println!("doors: {runs} runs with names that lead elsewhere: 0 files outside the folder named");
}

#[cfg(unix)]
#[test]
fn links_in_the_folder_named_are_replaced_and_not_followed() {
    use std::os::unix::fs::symlink;

    let scratch = Scratch::new();
    scratch.file("a/b/scene.toml", scene("wall two"));
    let simulate = "simulate --scene scene.toml --cycles 200 --out";
    assert_eq!(
        elsewhere(&scratch, &format!("{simulate} out")),
        Files::new()
    );
    // Links to results of another run count as files of this folder.
    std::fs::rename(scratch.path("a/b/out"), scratch.path("other")).unwrap();
    std::fs::create_dir(scratch.path("a/b/out")).unwrap();
    let link = |name: &str, to: &str| {
        symlink(
            scratch.path("other").join(to),
            scratch.path("a/b/out").join(name),
        )
        .unwrap();
    };
    let names = files(&scratch.path("other"));
    for name in names.keys() {
        link(name, name);
    }
    link(".dtof-run-x.partial", "summary.json");
    let found = elsewhere(&scratch, &format!("{simulate} out --seed 5"));
    assert_eq!(found, Files::new());
    for name in names.keys() {
        assert!(!scratch.path("a/b/out").join(name).is_symlink(), "{name}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_to_a_report_stays_and_what_it_leads_to_is_replaced() {
    let work = super::Work::new();
    work.earlier("calibrated");
    let [report, link] = ["report.html", "calibrated/found.html"];
    let [place, linked] = [report, link].map(|name| work.scratch.path(name));
    std::fs::rename(&linked, &place).unwrap();
    std::os::unix::fs::symlink(&place, &linked).unwrap();
    let older = work.scratch.read(report);
    work.scratch.printed(&work.line("calibrated", true));
    assert!(linked.is_symlink());
    assert_ne!(work.scratch.read(report), older);
}
