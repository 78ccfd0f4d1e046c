use super::scale::Scale;
use super::*;
use crate::palette;

const ONE_PIXEL: Map = Map {
    title: "Range",
    unit: "mm",
    axis_names: ["column", "row"],
    missing: "event",
    columns: 1,
    rows: 1,
    values: &[Some(1.0)],
};

fn picture(columns: usize, rows: usize, values: &[Option<f64>]) -> String {
    let map = Map {
        columns,
        rows,
        values,
        ..ONE_PIXEL
    };
    let svg = heat_map(&map).unwrap();
    assert_well_formed(&svg);
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    svg
}

/// Values without two equal neighbours.
fn busy(pixels: u32) -> Vec<Option<f64>> {
    (0..pixels)
        .map(|i| Some(f64::from(i.wrapping_mul(2_654_435_761) >> 8)))
        .collect()
}

/// Checks that tags are balanced, values quoted, and no other `<` or `&` remains.
fn assert_well_formed(svg: &str) {
    let mut open = Vec::new();
    for part in svg.trim_end().split('<').skip(1) {
        let (tag, text) = part.split_once('>').expect("a closed tag");
        assert_eq!(tag.matches('"').count() % 2, 0, "{tag}");
        let name = tag.split([' ', '/']).find(|name| !name.is_empty());
        if tag.starts_with('/') {
            assert_eq!(open.pop(), name);
        } else if !tag.ends_with('/') {
            open.extend(name);
        }
        for entity in format!("{tag}{text}").split('&').skip(1) {
            let (name, _) = entity.split_once(';').expect("an entity");
            assert!(["amp", "lt", "gt", "quot", "apos", "#39"].contains(&name));
        }
        let allowed = |c: char| c == '\n' || !c.is_control();
        assert!(part.chars().all(allowed));
        assert!(!open.is_empty() || text.is_empty(), "text after the end");
    }
    assert!(open.is_empty());
}

/// The number of pixels drawn in `color`.
fn drawn(svg: &str, color: &str) -> usize {
    let path = format!("<path fill=\"{color}\" d=\"");
    let Some((_, path)) = svg.split_once(&path) else {
        return 0;
    };
    let (path, _) = path.split_once('"').unwrap();
    path.split('h')
        .skip(1)
        .filter_map(|run| run.split_once("v1")?.0.parse::<usize>().ok())
        .sum()
}

/// The number of pixels drawn as without an event.
fn silent(svg: &str) -> usize {
    drawn(svg, &palette::hex(palette::NO_EVENT))
}

#[test]
fn texts_are_escaped() {
    let map = Map {
        title: "a <b> & \"c\" 'd' ]]>\u{1}\u{fffe}",
        unit: "<&\0>",
        ..ONE_PIXEL
    };
    let svg = heat_map(&map).unwrap();
    assert_well_formed(&svg);
    assert!(svg.contains("<title>a &lt;b&gt; &amp; &quot;c&quot; &#39;d&#39; ]]&gt;</title>"));
    assert!(svg.contains("&lt;&amp; &gt;"));
    assert!(!svg.contains("<b>"));
}

#[test]
fn no_pixel_with_an_event() {
    let svg = picture(4, 2, &[None; 8]);
    assert_eq!(silent(&svg), 8);
    assert!(svg.contains("no event in any pixel"));
    assert!(!svg.contains("colours:") && !svg.contains("mm"));
}

#[test]
fn pixels_without_a_number_are_not_coloured() {
    let nothing = [
        None,
        Some(f64::NAN),
        Some(f64::INFINITY),
        Some(-f64::INFINITY),
    ];
    assert_eq!(silent(&picture(2, 2, &nothing)), 4);

    let svg = picture(3, 1, &[Some(f64::NAN), Some(1.0), Some(2.0)]);
    assert_eq!(silent(&svg), 1);
    assert!(svg.contains("no event: 1 of 3 pixels"));
    assert!(!picture(2, 1, &[Some(1.0), Some(2.0)]).contains("no event"));
}

#[test]
fn one_pixel() {
    let svg = picture(1, 1, &[Some(1234.5)]);
    assert!(svg.contains("1234.500"));
    assert!(svg.contains("all values are equal"));
    assert!(svg.contains("d=\"M0 0h1v1h-1z\""));
}

#[test]
fn outliers_do_not_flatten_the_colours() {
    let mut values: Vec<_> = (0..1000).map(|i| Some(f64::from(i) / 1000.0)).collect();
    values[500] = Some(1e6);
    values[501] = Some(-1e6);
    let scale = Scale::new(&values).unwrap();
    assert_eq!((scale.level(1e6), scale.level(-1e6)), (255, 0));
    assert!((118..138).contains(&scale.level(0.5)));

    let marks = scale.marks(256.0);
    let ends = [&marks[0], &marks[1]].map(|mark| (mark.position, mark.label.as_str()));
    assert_eq!(ends, [(0.0, "≤ 0.02"), (1.0, "≥ 0.98")]);
    let mut others = marks[2..].iter();
    assert!(others.all(|mark| !mark.label.contains(['≤', '≥'])));
    assert!(picture(40, 25, &values).contains("colours: 2nd to 98th percentile"));
}

#[test]
fn few_values_are_all_spanned() {
    let svg = picture(3, 1, &[Some(1.0), Some(2.0), Some(9.0)]);
    assert!(!svg.contains(['≤', '≥']));
    assert!(svg.contains("colours: lowest to highest value"));
}

#[test]
fn a_single_other_value_is_seen() {
    let mut values = vec![Some(0.0); 1000];
    values[7] = Some(5.0);
    let scale = Scale::new(&values).unwrap();
    assert_eq!((scale.level(0.0), scale.level(5.0)), (0, 255));
    assert!(!picture(100, 10, &values).contains('≥'));
}

#[test]
fn same_map_same_bytes() {
    let values = busy(2048);
    assert_eq!(picture(64, 32, &values), picture(64, 32, &values));
}

#[test]
fn documents_are_small() {
    assert!(picture(64, 32, &busy(2048)).len() < 80_000);
    assert!(picture(256, 128, &busy(32_768)).len() < 700_000);
    assert!(picture(64, 32, &[Some(1.0); 2048]).len() < 10_000);
}

#[test]
fn shapes() {
    let size = |columns: usize, rows: usize| {
        let svg = picture(columns, rows, &busy(u32::try_from(columns * rows).unwrap()));
        let number = |name: &str| {
            let (_, rest) = svg.split_once(name).unwrap();
            rest.split('"').next().unwrap().parse::<u32>().unwrap()
        };
        (number("<svg width=\""), number(" height=\""))
    };
    for (columns, rows) in [
        (1, 1),
        (64, 32),
        (9, 159),
        (4096, 1),
        (1, 4096),
        (257, 1),
        (2, 3000),
        (3000, 2),
        (256, 128),
    ] {
        let (width, height) = size(columns, rows);
        assert!((400..600).contains(&width), "{columns} × {rows}: {width}");
        assert!((200..850).contains(&height), "{columns} × {rows}: {height}");
    }
}

#[test]
fn a_long_line_is_wrapped() {
    let svg = picture(4096, 1, &busy(4096));
    assert!(svg.contains("line start") && svg.contains("column − line start"));
    assert!(picture(1, 4096, &busy(4096)).contains("row − line start"));
    assert!(!picture(256, 1, &busy(256)).contains("line start"));

    // The rest of the last line stays empty.
    let svg = picture(257, 1, &[None; 257]);
    assert_eq!(silent(&svg), 257);
}

#[test]
fn impossible_maps_are_refused() {
    let refused = |columns, rows, values: &[Option<f64>]| {
        let map = Map {
            columns,
            rows,
            values,
            ..ONE_PIXEL
        };
        heat_map(&map).is_err()
    };
    assert!(refused(2, 2, &[None; 3]));
    assert!(refused(0, 5, &[]));
    assert!(refused(usize::MAX, 2, &[]));
    assert!(!refused(1, 1, &[None]));
}

#[test]
fn extreme_values_are_drawn() {
    for values in [
        [f64::MIN, f64::MAX],
        [0.0, 5e-324],
        [-0.0, 0.0],
        [1e16, 1e16],
    ] {
        picture(2, 1, &values.map(Some));
    }
}
