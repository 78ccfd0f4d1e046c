use std::cell::{Cell, RefCell};
use std::rc::Rc;

use dtof_core::{BlockLevel, DepthEvent};
use dtof_draw::palette;
use proptest::prelude::*;

use super::*;
use dtof_events::fixtures::{self, event, ranges};

fn array(columns: u32, rows: u32) -> Array {
    Array::new(columns, rows).unwrap()
}

/// `text` without colours.
fn characters(text: &str) -> String {
    let mut parts = text.split('\x1b');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        let end = part.find(|c: char| c.is_ascii_alphabetic()).unwrap();
        all + &part[end + 1..]
    })
}

#[test]
fn two_rows_share_a_line_and_no_range_is_empty() {
    let (near, far) = (Some(1000.0), Some(2000.0));
    let lines = picture(&[near, None, far, far, None, None], 2, 2, 2);
    assert_eq!(lines.len(), 2);
    assert_eq!(characters(&lines[0]), "▀▄");
    assert_eq!(characters(&lines[1]), "  ");
    // The upper pixel is the ink, the lower one the background.
    let ([r, g, b], [red, green, blue]) = (palette::level(0), palette::level(255));
    let expected = format!("\x1b[38;2;{r};{g};{b}m\x1b[48;2;{red};{green};{blue}m▀");
    assert!(lines[0].starts_with(&expected), "{:?}", lines[0]);
    assert!(r < red && g < green, "purple to yellow");
    assert!(lines.iter().all(|line| line.ends_with(PLAIN)));
}

#[test]
fn too_little_room_leaves_pixels_out() {
    let ranges: Vec<Option<f64>> = (0..64 * 32).map(|pixel| Some(f64::from(pixel))).collect();
    for (most_lines, most_columns, lines, columns) in [
        (100, 100, 16, 64),
        (16, 64, 16, 64),
        (15, 64, 8, 32),
        (16, 63, 8, 32),
        (1, 1, 1, 1),
        (0, 0, 1, 1),
    ] {
        let picture = picture(&ranges, 64, most_lines, most_columns);
        assert_eq!(picture.len(), lines);
        for line in picture {
            assert_eq!(characters(&line).chars().count(), columns);
        }
    }
}

proptest! {
    /// The picture is as large as the room allows. Each number appears once if it fits.
    #[test]
    fn a_picture_fills_its_room(
        rows in 1..20usize,
        columns in 1..20usize,
        missing in 0..20usize,
        most_lines in 1..60usize,
        most_columns in 1..250usize,
        first in 100..99_000u32,
    ) {
        let pixels = (rows * columns).saturating_sub(missing.min(columns - 1));
        let ranges: Vec<_> = (first..).take(pixels).map(|range| Some(f64::from(range))).collect();
        let lines = picture(&ranges, columns, most_lines, most_columns);
        let lines: Vec<_> = lines.iter().map(|line| characters(line)).collect();
        let width = lines[0].chars().count();
        prop_assert!(lines.iter().all(|line| line.chars().count() == width));
        prop_assert!(width <= most_columns && lines.len() <= most_lines);

        let side = (most_columns / columns).min(2 * most_lines / rows);
        if side == 0 {
            return Ok(());
        }
        prop_assert_eq!((width, lines.len()), (side * columns, (side * rows).div_ceil(2)));
        let fits = (first as usize + pixels - 1).to_string().len() < side;
        let text = lines.join("\n");
        for number in (first..).take(pixels) {
            prop_assert_eq!(text.matches(&number.to_string()).count(), usize::from(fits));
        }
    }
}

#[test]
fn a_small_array_has_its_ranges_in_it() {
    let ranges = [Some(812.4), None, Some(1204.0), Some(-31.0)];
    let lines = picture(&ranges, 2, 5, 99);
    let text: Vec<_> = lines.iter().map(|line| characters(line)).collect();
    // Five squares a pixel, three characters' height and then two.
    let expected = [
        "▀▀▀▀▀     ",
        " 812      ",
        "▀▀▀▀▀▄▄▄▄▄",
        "1204  -31 ",
        "▀▀▀▀▀▀▀▀▀▀",
    ];
    assert_eq!(text, expected);
    // Black on yellow, white on purple.
    let (bright, dark) = ("\x1b[38;2;0;0;0m", "\x1b[38;2;255;255;255m");
    assert_eq!(lines[3].matches(bright).count(), 1);
    assert_eq!(lines[3].matches(dark).count(), 1);
}

/// A terminal whose text the test can read.
#[derive(Clone, Default)]
struct Screen(Rc<RefCell<Vec<u8>>>);

impl Write for Screen {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Screen {
    fn taken(&self) -> String {
        String::from_utf8(self.0.take()).unwrap()
    }
}

#[test]
fn it_is_drawn_in_place_and_gives_the_cursor_back() {
    let screen = Screen::default();
    let mut map = LiveMap::new(
        Box::new(screen.clone()),
        Box::new(|| (24, 40)),
        4,
        array(2, 2),
    );
    map.draw_when_due().unwrap();
    let first = screen.taken();
    assert!(first.starts_with(HIDE_CURSOR));
    assert!(characters(&first).contains("no event yet of 4 pixels"));
    assert_eq!(first.matches('\n').count(), 21);

    let [known, foreign] = [3, 4].map(|pixel| Event::Depth(event(pixel, 9, 40)));
    map.add(&[known, foreign], &ranges());
    map.set_line("events/s 12, and so much more than fits here".to_owned());
    map.draw_when_due().unwrap();
    assert_eq!(screen.taken(), "", "not so soon");
    map.draw().unwrap();
    let second = screen.taken();
    // The cursor moves up over these lines, and they are drawn again.
    assert!(second.starts_with("\r\x1b[21A"));
    assert_eq!(second.matches('\n').count(), 21);
    let second = characters(&second);
    assert!(second.contains(&"▀".repeat(19)) && second.contains("1 of 4 pixels"));
    assert!(second.contains("events/s 12, and so much more than fits") && !second.contains("here"));

    drop(map);
    assert_eq!(screen.taken(), format!("{PLAIN}{SHOW_CURSOR}"));
}

/// An array of 5x3 without its last two pixels.
#[test]
fn a_block_fills_its_pixels_that_have_not_reported_since() {
    let mut map = LiveMap::new(Box::new(io::sink()), Box::new(|| (24, 40)), 13, array(5, 3));
    let block_event = |pixel, level, cycle, bin| {
        let level = BlockLevel::new(level).unwrap();
        let event = event(pixel, cycle, bin); // over 40 laser cycles
        Event::Depth(DepthEvent { level, ..event })
    };
    let shown = |map: &LiveMap| -> Vec<u16> {
        let bins = map.ranges.iter().map(|range| {
            range.map_or(0, |range| {
                (1..128)
                    .find(|bin| (f64::from(*bin) + 0.5) * 37.474 > range - 1.0)
                    .unwrap()
            })
        });
        bins.collect()
    };
    map.add(
        &[block_event(6, 0, 100, 10), block_event(0, 1, 139, 20)],
        &ranges(),
    );
    // The pixel's event lies in the block's exposure, laser cycles 100 to 139.
    assert_eq!(shown(&map), [20, 20, 0, 0, 0, 20, 10, 0, 0, 0, 0, 0, 0]);
    map.add(&[block_event(0, 1, 141, 21)], &ranges());
    assert_eq!(shown(&map), [21, 21, 0, 0, 0, 21, 21, 0, 0, 0, 0, 0, 0]);
    // At the edges, blocks fill only existing pixels.
    map.add(
        &[
            block_event(0, 2, 180, 30),
            block_event(4, 3, 200, 40),
            block_event(14, 1, 200, 50),
        ],
        &ranges(),
    );
    let second = Event::Depth(DepthEvent {
        echo: EchoNumber::new(2).unwrap(),
        ..fixtures::event(12, 300, 60)
    });
    map.add(
        &[
            second,
            block_event(10, 1, 300, 70),
            block_event(3, 0, 300, 9),
        ],
        &ranges(),
    );
    assert_eq!(
        shown(&map),
        [21, 21, 30, 9, 0, 21, 21, 30, 30, 0, 70, 70, 30]
    );
}

#[test]
fn no_line_is_wider_than_the_terminal_whose_size_may_change() {
    let screen = Screen::default();
    let room = Rc::new(Cell::new((24, 100)));
    let size = Rc::clone(&room);
    let mut map = LiveMap::new(
        Box::new(screen.clone()),
        Box::new(move || size.get()),
        64,
        array(8, 8),
    );
    map.ranges.fill(Some(123_456.0));
    map.ranges[0] = Some(1.0);
    map.set_line("events/s 12".repeat(50));
    for (lines, columns) in [
        (24, 100),
        (24, 101),
        (24, 45),
        (24, 9),
        (7, 9),
        (24, 2),
        (9, 60),
    ] {
        room.set((lines, columns));
        map.draw().unwrap();
        let drawn = screen.taken();
        assert!(drawn.starts_with(HIDE_CURSOR) || drawn.starts_with(CLEAR_ALL));
        let text: Vec<String> = drawn.lines().map(characters).collect();
        assert!(text.len() < lines, "{lines} lines");
        for line in text {
            let most = columns - 1;
            assert!(line.chars().count() <= most, "{columns} columns: {line:?}");
        }
        assert!(drawn.lines().all(|line| {
            line.rfind(PLAIN) >= line.rfind("\x1b[38") && line.ends_with(CLEAR_REST)
        }));
        // The next drawing is in place while the size stays.
        map.draw().unwrap();
        assert!(screen.taken().starts_with("\r\x1b["));
    }
}

#[test]
fn cutting_counts_what_is_seen_and_keeps_colours() {
    let line = "\x1b[38;2;1;2;3m▀\x1b[0m near\x1b[0m";
    assert_eq!(cut(line, 3), "\x1b[38;2;1;2;3m▀\x1b[0m n\x1b[0m");
    assert_eq!(cut(line, 99), line);
    assert_eq!(cut(line, 0), "\x1b[38;2;1;2;3m\x1b[0m\x1b[0m");
}
