//! The picture as SVG.
//!
//! Axes, texts and the like are drawn by plotters. The pixels are not: it would
//! write one element each. They become one path for each colour instead.

use std::fmt::Write as _;

use anyhow::{Context as _, Result};
use plotters::coord::Shift;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::axis::Axis;
use super::cells::write_cells;
use super::layout::{Bar, Frame, LINE_HEIGHT, Layout};
use super::{MARK, escape};

/// Background, text, lines, pixels without a value.
const PAPER: RGBColor = RGBColor(0xff, 0xff, 0xff);
const INK: RGBColor = RGBColor(0x1f, 0x23, 0x28);
const LINE: RGBColor = RGBColor(0x8c, 0x95, 0x9f);
pub(super) const NO_EVENT: RGBColor = RGBColor(0x84, 0x89, 0x90);

/// The first three for a dark colour scheme.
const DARK: &str = "@media (prefers-color-scheme:dark){\
.heat-map>[fill=\"#FFFFFF\"]{fill:#0d1117}\
.heat-map>[fill=\"#1F2328\"]{fill:#e6edf3}\
.heat-map>[fill=\"#8C959F\"]{fill:#6e7681}}";

const FONT: &str = "system-ui, sans-serif";
const TEXT_SIZE: f64 = 16.0;
const TITLE_SIZE: f64 = 19.0;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// The document for `layout` with the pixels' `levels`.
pub(super) fn document(layout: &Layout, levels: &[Option<u8>]) -> Result<String> {
    let mut drawn = String::new();
    {
        let area = SVGBackend::with_string(&mut drawn, layout.size).into_drawing_area();
        area.fill(&PAPER)?;
        draw_texts(&area, layout)?;
        draw_frame(&area, layout.plot)?;
        draw_axes(&area, layout)?;
        if let Some(bar) = &layout.bar {
            draw_bar(&area, bar)?;
        }
        area.present()?;
    }

    let head = drawn.find('>').context("SVG without an opening tag")?;
    let tail = drawn.rfind("</svg>").context("SVG without a closing tag")?;
    let title = escape(&layout.title.join(" "));
    // Where there is too little room for the picture its text loses less.
    let narrow = layout.size.0 * 3 / 4;
    let mut document = drawn[..head].to_owned();
    write!(
        document,
        " {MARK} role=\"img\"><title>{title}</title><style>{DARK}\
         @media (max-width:{narrow}px){{.heat-map>text{{font-size:{TITLE_SIZE}px}}}}</style>"
    )?;
    document.push_str(&drawn[head + 1..tail]);
    write_cells(
        &mut document,
        levels,
        layout.columns,
        layout.plot,
        layout.cell,
    )?;
    if let Some(Bar { frame, levels, .. }) = &layout.bar {
        let height = f64::from(frame.height) / levels.len() as f64;
        write_cells(
            &mut document,
            levels,
            1,
            *frame,
            (f64::from(frame.width), height),
        )?;
    }
    document.push_str("</svg>\n");
    Ok(document)
}

/// Title and notes.
fn draw_texts(area: &Area, layout: &Layout) -> Result<()> {
    let title = style(TITLE_SIZE, FontStyle::Bold, HPos::Left, VPos::Top);
    let mut y = 14;
    for line in &layout.title {
        area.draw_text(line, &title, (layout.plot.x, y))?;
        y += LINE_HEIGHT;
    }

    let text = style(TEXT_SIZE, FontStyle::Normal, HPos::Left, VPos::Center);
    let mut y = layout.notes_y + LINE_HEIGHT / 2;
    for note in &layout.notes {
        let mut x = layout.plot.x;
        if note.no_event {
            fill(
                area,
                Frame {
                    x,
                    y: y - 7,
                    width: 14,
                    height: 14,
                },
                NO_EVENT,
            )?;
            x += 22;
        }
        area.draw_text(&note.text, &text, (x, y))?;
        y += LINE_HEIGHT;
    }
    Ok(())
}

/// Numbers and names of the axes.
fn draw_axes(area: &Area, layout: &Layout) -> Result<()> {
    let Frame {
        x,
        y,
        width,
        height,
    } = layout.plot;
    let [
        Axis {
            name: below,
            numbers: columns,
        },
        Axis {
            name: beside,
            numbers: rows,
        },
    ] = &layout.axes;

    let under = style(TEXT_SIZE, FontStyle::Normal, HPos::Center, VPos::Top);
    let bottom = y + height + 1;
    for (at, number) in columns {
        fill(
            area,
            Frame {
                x: x + at,
                y: bottom,
                width: 1,
                height: 5,
            },
            LINE,
        )?;
        area.draw_text(number, &under, (x + at, bottom + 8))?;
    }
    area.draw_text(below, &under, (x + width / 2, bottom + 31))?;

    let before = style(TEXT_SIZE, FontStyle::Normal, HPos::Right, VPos::Center);
    for (at, number) in rows {
        fill(
            area,
            Frame {
                x: x - 6,
                y: y + at,
                width: 5,
                height: 1,
            },
            LINE,
        )?;
        area.draw_text(number, &before, (x - 10, y + at))?;
    }
    let upright = style(TEXT_SIZE, FontStyle::Normal, HPos::Center, VPos::Center)
        .transform(FontTransform::Rotate270);
    area.draw_text(beside, &upright, (18, y + height / 2))?;
    Ok(())
}

/// Frame, marks and unit of the colour bar.
fn draw_bar(area: &Area, bar: &Bar) -> Result<()> {
    draw_frame(area, bar.frame)?;
    let Frame {
        x,
        y,
        width,
        height,
    } = bar.frame;
    let right = x + width + 1;
    let text = style(TEXT_SIZE, FontStyle::Normal, HPos::Left, VPos::Center);
    for mark in &bar.marks {
        let at = y + height - mark.offset(height);
        fill(
            area,
            Frame {
                x: right,
                y: at,
                width: 5,
                height: 1,
            },
            LINE,
        )?;
        area.draw_text(&mark.label, &text, (right + 9, at))?;
    }
    area.draw_text(&bar.unit, &text, (x, y - LINE_HEIGHT + 6))?;
    Ok(())
}

/// An empty frame around `inside`.
fn draw_frame(area: &Area, inside: Frame) -> Result<()> {
    let Frame {
        x,
        y,
        width,
        height,
    } = inside;
    fill(
        area,
        Frame {
            x: x - 1,
            y: y - 1,
            width: width + 2,
            height: height + 2,
        },
        LINE,
    )?;
    fill(area, inside, PAPER)
}

fn fill(area: &Area, frame: Frame, color: RGBColor) -> Result<()> {
    let Frame {
        x,
        y,
        width,
        height,
    } = frame;
    area.draw(&Rectangle::new(
        [(x, y), (x + width, y + height)],
        color.filled(),
    ))?;
    Ok(())
}

fn style(size: f64, font: FontStyle, h: HPos, v: VPos) -> TextStyle<'static> {
    // An SVG of plotters has 1.24 times smaller letters than asked for.
    let font = FontDesc::new(FontFamily::Name(FONT), size * 1.24, font);
    TextStyle::from(font).color(&INK).pos(Pos::new(h, v))
}
