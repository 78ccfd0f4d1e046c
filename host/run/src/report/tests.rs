mod histograms;

use super::*;
use base64::Engine as _;
use dtof_core::{Array, BlockLevel, DepthEvent, EchoNumber, Flags, PixelAddress};

use super::packed::tests::Reader;
use dtof_data::events::events_csv::range_mm;
use dtof_data::events::fixtures::{event, ranges};
use dtof_data::events::sample::Sample;

/// `count` events, one a laser cycle, of four pixels in turn.
fn sample(limit: usize, count: u32) -> Sample {
    let mut sample = Sample::new(limit);
    for cycle in 0..count {
        let pixel = u16::try_from(cycle % 4).unwrap();
        let event = event(pixel, cycle.into(), 10 + pixel);
        sample.add(&event, range_mm(&event, &ranges()));
    }
    sample
}

/// The events of `sample`, on an array of four pixels.
fn cloud<'a>(sample: &'a mut Sample, cycles: u64, nouns: [&'static str; 2]) -> Cloud<'a> {
    Cloud {
        axis_names: ["zone", "capture"],
        array: Array::new(2, 2).unwrap(),
        cycles,
        laser_hz: Some(20_000),
        sample,
        is_chosen: false,
        pixels: const { &[PixelAddress::new(2), PixelAddress::new(0)] },
        nouns,
        decisions: None,
    }
}

/// A page with the events of `sample`.
fn page(mut sample: Sample, cycles: u64, sections: &[Section], figures: &[Figure]) -> String {
    let events = cloud(&mut sample, cycles, ["event", "events"]);
    html("t", "l", sections, figures, events)
}

/// The data of the script.
fn data(page: &str) -> serde_json::Value {
    let (_, data) = page.split_once("id=\"data\">").unwrap();
    let (data, _) = data.split_once("</script>").unwrap();
    serde_json::from_str(data).unwrap()
}

#[test]
fn all_texts_are_escaped() {
    let rows = [("<b>&\"'".to_owned(), "1 < 2\0".to_owned())];
    let sections = [Section {
        heading: "<h>",
        rows: &rows,
    }];
    let figures = [Figure {
        svg: "<svg/>",
        caption: "a </figure> & b",
    }];
    let mut none = Sample::new(1);
    let events = cloud(&mut none, 1, ["event", "events"]);
    let page = html("</title><script>", "<lead>", &sections, &figures, events);

    assert!(page.contains("<title>&lt;/title&gt;&lt;script&gt;</title>"));
    assert!(page.contains("<p>&lt;lead&gt;</p>"));
    assert!(page.contains(">&lt;h&gt;</h2>"));
    assert!(page.contains("<th scope=\"row\">&lt;b&gt;&amp;&quot;&#39;</th>"));
    assert!(page.contains("<td>1 &lt; 2</td>"));
    assert!(page.contains("<figcaption>a &lt;/figure&gt; &amp; b</figcaption>"));
    assert!(!page.contains("<script"), "a script without events");
}

#[test]
fn page_loads_nothing() {
    let values = [Some(1.0), None];
    let map = dtof_draw::picture::Map {
        title: "t",
        unit: "m",
        axis_names: ["column", "row"],
        missing: "event",
        columns: 2,
        rows: 1,
        values: &values,
    };
    let svg = dtof_draw::picture::heat_map(&map).unwrap();
    let figures = [Figure {
        svg: &svg,
        caption: "c",
    }; 3];
    let page = page(sample(10, 10), 10, &[], &figures);

    assert_eq!(page.matches("<svg").count(), 3);
    let reaching_out = "src=|href|@import|url(|<link|fetch|import |XMLHttp|eval|innerHTML";
    for word in reaching_out.split('|') {
        assert!(!page.contains(word), "{word}");
    }
    let addresses = page.matches("http://").count() + page.matches("https://").count();
    assert_eq!(
        addresses,
        page.matches("xmlns=\"http://www.w3.org/2000/svg\"").count()
    );
}

#[test]
fn the_colours_of_the_script_are_those_of_the_maps() {
    let colours = include_str!("shared/colours.js");
    let (_, digits) = colours.split_once("DIGITS =").unwrap();
    let (digits, _) = digits.split_once(';').unwrap();
    let digits: String = digits.chars().filter(char::is_ascii_hexdigit).collect();
    let level = |level| dtof_draw::palette::hex(dtof_draw::palette::level(level));
    let expected: String = (0..=u8::MAX).map(level).collect();
    assert_eq!(digits, expected.replace('#', ""));
}

#[test]
fn the_policy_names_the_only_script() {
    let page = page(sample(10, 10), 10, &[], &[]);
    assert_eq!(page.matches("<script").count(), 2);
    let (_, script) = page.split_once("<script type=\"module\">").unwrap();
    let (script, _) = script.split_once("</script>").unwrap();
    let hash = BASE64.encode(Sha256::digest(script));
    let policy = format!("default-src 'none'; script-src 'sha256-{hash}'; ");
    assert!(page.contains(&policy));
    assert!(!page.contains("script-src 'unsafe-inline'"));
    // No handlers in attributes: the policy would not run them.
    assert!(!page.contains(" onclick") && !page.contains(" onload"));
}

/// An event as the script reads it.
#[derive(Debug, PartialEq)]
struct Read {
    cycle: u64,
    pixel: u64,
    level: u64,
    echo: u64,
    flags: u64,
    exposure: u64,
    range: f64,
    peak: u64,
}

fn events_of(data: &serde_json::Value) -> Vec<Read> {
    let mut reader = Reader::new(data["packed"].as_str().unwrap());
    let mut cycle = 0;
    let events = (0..data["count"].as_u64().unwrap()).map(|_| {
        cycle += reader.number();
        let [pixel, kind, exposure] = [(); 3].map(|()| reader.number());
        Read {
            cycle,
            pixel,
            level: kind >> 2 & 3,
            echo: (kind & 3) + 1,
            flags: kind >> 4,
            exposure,
            range: reader.range(),
            peak: reader.number(),
        }
    });
    let events = events.collect();
    assert!(reader.is_at_end());
    events
}

#[test]
fn every_event_is_in_the_data() {
    let data = data(&page(sample(10, 10), 12, &[], &[]));
    assert_eq!((&data["columns"], &data["rows"]), (&2.into(), &2.into()));
    assert_eq!(data["cycles"], 12);
    assert_eq!(data["spikes"], serde_json::json!([2, 0]));
    let read = events_of(&data);
    assert_eq!(read.len(), 10);
    for (cycle, read) in (0u16..).zip(read) {
        let given = event(cycle % 4, cycle.into(), 10 + cycle % 4);
        let expected = Read {
            cycle: cycle.into(),
            pixel: (cycle % 4).into(),
            level: 0,
            echo: 1,
            flags: 0,
            exposure: given.exposure.into(),
            range: range_mm(&given, &ranges()),
            peak: given.peak_count.raw().into(),
        };
        assert_eq!(read, expected);
    }
}

#[test]
fn level_echo_and_flags_of_each_event_are_in_the_data() {
    let mut sample = Sample::new(100);
    let mut expected = Vec::new();
    for level in 0..4u8 {
        for echo in 1..=4u8 {
            for flags in [Flags::NONE, Flags::CLIPPED, Flags::TAIL] {
                let event = DepthEvent {
                    level: BlockLevel::new(level).unwrap(),
                    echo: EchoNumber::new(echo).unwrap(),
                    flags,
                    ..event(0, 9, 10)
                };
                sample.add(&event, -1.5);
                expected.push((level.into(), echo.into(), flags.bits().into(), -1.5));
            }
        }
    }
    let data = data(&page(sample, 10, &[], &[]));
    let found: Vec<(u64, u64, u64, f64)> = events_of(&data)
        .iter()
        .map(|read| (read.level, read.echo, read.flags, read.range))
        .collect();
    assert_eq!(found, expected);
}

#[test]
fn an_unknown_laser_rate_is_marked_as_assumed() {
    let known = page(sample(10, 10), 10, &[], &[]);
    assert_eq!(data(&known)["laserHz"], 20_000);
    assert!(known.contains("Times are those of a laser of 20 kHz."));
    let mut sample = sample(10, 10);
    let events = Cloud {
        laser_hz: None,
        ..cloud(&mut sample, 10, ["event", "events"])
    };
    let assumed = html("t", "l", &[], &[], events);
    assert_eq!(data(&assumed)["laserHz"], 10_000_000);
    assert!(assumed.contains("<strong>The laser rate is not known</strong>"));
}

#[test]
fn a_page_says_how_many_of_the_events_it_shows() {
    let whole = page(sample(10, 10), 10, &[], &[]);
    assert!(whole.contains("All 10 events are shown."));
    let sample = sample(10, 50);
    let kept = sample.events().len();
    let part = page(sample, 50, &[], &[]);
    let note = format!("<strong>1 of 8 events shown</strong>: {kept} of 50, evenly spread.");
    assert!(part.contains(&note));
    assert_eq!(data(&part)["oneOf"], 8);
}

#[test]
fn a_report_on_frames_speaks_of_readings() {
    let mut sample = sample(10, 10);
    let events = cloud(&mut sample, 10, ["reading", "readings"]);
    let page = html("t", "l", &[], &[], events);
    assert!(page.contains("All 10 readings are shown."));
    assert!(page.contains(">Readings in space and time<"));
    assert_eq!(data(&page)["events"], "readings");
    assert!(!page.contains("{{"));
}

#[test]
fn events_and_figures_stay_below_the_documented_size() {
    assert_eq!(Sample::LIMIT, 262_144);
    for figures in [0, 1_000_000, 2_000_000, 3_000_000, 4_500_000] {
        let sample = sample(Sample::LIMIT, 1 << 18);
        let svg = format!("<svg>{}</svg>", "M1 1h1v1h-1z".repeat(figures / 12));
        let figures = [Figure {
            svg: &svg,
            caption: "c",
        }];
        let page = page(sample, 1 << 20, &[], &figures);
        assert!(page.len() < MAX_PAGE, "{}", page.len());
        // Large figures leave room for some events.
        let count = data(&page)["count"].as_u64().unwrap();
        assert!(count > 2048, "{count}");
    }
    let empty = page(sample(1, 1), 1, &[], &[]).len();
    assert!(empty < MAX_OTHER / 2, "{empty}");
}

#[test]
fn without_scripting_the_maps_are_left() {
    let page = page(sample(10, 10), 10, &[], &[]);
    let (_, note) = page.split_once("id=\"unscripted\">").unwrap();
    assert!(note.starts_with("Without scripting the events cannot be turned;"));
    assert!(page.contains("<div id=\"interactive\" hidden>"));
}

#[test]
fn figures_stand_in_the_page_as_elements() {
    let svg = "<?xml version=\"1.0\"?>\n<svg width=\"1\"/>\n";
    let figures = [Figure { svg, caption: "c" }, Figure { svg, caption: "d" }];
    let page = page(sample(1, 1), 1, &[], &figures);
    assert_eq!(page.matches("<svg width=\"1\"/>").count(), 2);
    assert!(!page.contains("<?xml"));
}

#[test]
fn page_is_deterministic() {
    let rows = [("a".to_owned(), "b".to_owned())];
    let sections = [Section {
        heading: "h",
        rows: &rows,
    }; 2];
    let page = || page(sample(10, 100), 100, &sections, &[]);
    assert_eq!(page(), page());
    assert!(page().contains("id=\"section-2\""));
}
