//! The same mistake as a flag, as a key of a settings file and as a keyword of Python is one error value.
//! The tests of the Python package have its lines, those of C the mistakes that a device can be sent.

use anyhow::{Result, anyhow};
use dtof_core::{Array, Count10};
use dtof_data::options::Refused;
use dtof_engine::settings::SettingsFile;
use dtof_run::replay::Options;

use crate::common::Scratch;

const PHOTONS: &str = "pixel,cycle,bin\n0,0,0\n";

struct Mistake {
    /// Section and lines of a file.
    file: [&'static str; 2],
    flags: &'static str,
    keywords: &'static [(&'static str, &'static str)],
    /// The lines of the program, for flags and for the file.
    lines: [&'static str; 2],
}

const MISTAKES: [Mistake; 9] = [
    // Out of range.
    Mistake {
        file: ["detection", "rule = 'window'\nwindow = 9"],
        flags: "--rule window --window 9",
        keywords: &[("rule", "window"), ("window", "9")],
        lines: [
            "--window 9: must be a whole number from 1 to 7",
            "my.toml: window 9: must be a whole number from 1 to 7",
        ],
    },
    // Two that exclude each other.
    Mistake {
        file: ["detection", "rule = 'window'\nz = 4.0\nfalse_alarm = 0.01"],
        flags: "--rule window --z 4 --false-alarm 0.01",
        keywords: &[("rule", "window"), ("z", "4"), ("false_alarm", "0.01")],
        lines: [
            "--z cannot be used with --false-alarm",
            "my.toml: z cannot be used with false_alarm",
        ],
    },
    // Two that do not fit.
    Mistake {
        file: ["detection", "x = 50\nl1 = 40"],
        flags: "--x 50 --l1 40",
        keywords: &[("x", "50"), ("l1", "40")],
        lines: [
            "--x 50: must not be greater than --l1 40",
            "my.toml: x 50: must not be greater than l1 40",
        ],
    },
    Mistake {
        file: [
            "detection",
            "rule = 'window'\nwindow = 3\nneighbours = 8\nbinning = 1",
        ],
        flags: "--rule window --window 3 --neighbours 8 --binning 1",
        keywords: &[
            ("rule", "window"),
            ("window", "3"),
            ("neighbours", "8"),
            ("binning", "1"),
        ],
        lines: [
            "--neighbours cannot be used with --binning",
            "my.toml: neighbours cannot be used with binning",
        ],
    },
    // For another rule.
    Mistake {
        file: ["detection", "tracking = true"],
        flags: "--tracking",
        keywords: &[("tracking", "true")],
        lines: [
            "--tracking is for --rule window",
            "my.toml: tracking is for --rule window",
        ],
    },
    // Too few bins.
    Mistake {
        file: ["sensor", "gate = [4, 9]"],
        flags: "--gate 4..9",
        keywords: &[("gate", "4,9")],
        lines: [
            "--gate 4..9: with 128 bins: the range gate leaves fewer than 8 bins",
            "my.toml: gate 4..9: with 128 bins: the range gate leaves fewer than 8 bins",
        ],
    },
    // Unknown.
    Mistake {
        file: ["detection", "alfa = 4"],
        flags: "--alfa 4",
        keywords: &[("alfa", "4")],
        lines: [
            "--alfa is unknown; is it --alpha?",
            "my.toml: alfa is unknown in [detection]; is it alpha?",
        ],
    },
    // Missing.
    Mistake {
        file: ["detection", "rule = 'window'"],
        flags: "--rule window",
        keywords: &[("rule", "window")],
        lines: [
            "--rule window needs --window or --sigma-bins",
            "my.toml: rule window needs --window or --sigma-bins",
        ],
    },
    // A number with a unit.
    Mistake {
        file: ["sensor", "bin_width_ps = '0.25ns'"],
        flags: "--bin-width-ps=0.25ns",
        keywords: &[("bin_width_ps", "0.25ns")],
        lines: [
            "--bin-width-ps 0.25ns: must be a number from 0 to 65535.99998; write it without a unit",
            "my.toml: bin_width_ps 0.25ns: must be a number from 0 to 65535.99998; write it without a unit",
        ],
    },
];

/// As before a replay: the settings, and an array of them.
fn checked(file: &SettingsFile) -> Result<()> {
    let settings = file.settings(128)?;
    let array = Array::new(4, 4).ok_or_else(|| anyhow!("no array"))?;
    let config = settings.array_config::<128, Count10, ()>(array);
    config.map(drop)
}

#[test]
fn a_mistake_is_one_error_however_it_is_made() {
    let scratch = Scratch::new();
    scratch.file("photons.csv", PHOTONS);
    scratch.file("defaults.toml", "");
    let replay = "replay --input photons.csv --out out";
    let refused = |line: &str| {
        let output = scratch.run(line);
        assert!(!output.status.success(), "{line}");
        String::from_utf8(output.stderr).unwrap()
    };
    for mistake in MISTAKES {
        let [section, keys] = mistake.file;
        let text = format!("[{section}]\n{keys}\n");
        scratch.file("my.toml", &text);
        let [by_flag, by_file] = mistake.lines;
        let line = refused(&format!(
            "{replay} --settings defaults.toml {}",
            mistake.flags
        ));
        assert_eq!(line, format!("error: {by_flag}\n"));
        let line = refused(&format!("{replay} --settings my.toml"));
        assert_eq!(line, format!("error: {by_file}\n"));
        // Flag and file give the same value.
        let of_file = SettingsFile::parse(&text).and_then(|file| checked(&file));
        let mut of_file = of_file.unwrap_err().downcast::<Refused>().unwrap();
        // A key is unknown in its section.
        of_file.reason = of_file.reason.replace(&format!(" in [{section}]"), "");
        let of_keywords = dtof_data::options::read::<Options>(mistake.keywords.iter().copied());
        let of_keywords = of_keywords
            .map_err(anyhow::Error::from)
            .and_then(|options| checked(&options.requested()?));
        let of_keywords = of_keywords.unwrap_err().downcast::<Refused>().unwrap();
        assert_eq!(of_file, of_keywords);
    }
}
