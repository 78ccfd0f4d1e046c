//! What a driven array of 8 × 8 pixels takes: a photon, and a look of all pixels, which look alone, with blocks or with
//! neighbours. All with a window of 3 bins. The photons are those of [`State`], another exposure for each pixel.

use dtof_core::binning::Block;
use dtof_core::fixed::types::U4F12;
use dtof_core::neighbours::NeighbourConfig;
use dtof_core::{
    Array, ArrayConfig, BlockLevel, Count, Flags, Neighbours, PixelArray, PixelConfig, PixelPlace,
    WindowRule,
};
use heapless::Vec;
use static_cell::ConstStaticCell;

use crate::counter::Counter;
use crate::report;
use crate::scene::{BINS, CYCLES, PHOTONS, State};

/// Rows and columns.
const SIDE: u32 = 8;
const PIXELS: usize = (SIDE * SIDE) as usize;
/// Blocks of 2 × 2 pixels.
const BLOCKS: u32 = 16;
/// With those of 4 × 4 and 8 × 8.
const ALL_BLOCKS: usize = 21;
/// A pixel with 8 neighbours.
const INNER: usize = 27;
/// Exposures of all pixels.
const EXPOSURES: u32 = 8;
/// Laser cycles of the blocks' first tick, a while before the look that is measured.
const PATIENCE: u16 = 20;

static PLACES: ConstStaticCell<Vec<PixelPlace<BINS>, PIXELS>> = ConstStaticCell::new(Vec::new());
static ROOM_OF_BLOCKS: ConstStaticCell<Vec<Block<BINS>, ALL_BLOCKS>> =
    ConstStaticCell::new(Vec::new());

/// How pixels decide.
#[derive(Clone, Copy)]
enum Way {
    Alone,
    OncePerBin,
    /// With blocks of so many levels, whose exposures end at the second look.
    Blocks(u8),
    Neighbours,
}

/// Blocks of one level.
const BLOCKS_OF_4: Way = Way::Blocks(1);
/// The exposure at the second look that decides.
const SECOND_LOOK: u16 = CYCLES + 4;

/// What the pixels see.
#[derive(Clone, Copy, PartialEq)]
enum Scene {
    Background,
    /// A target in each pixel.
    Target,
    /// Background, and a target that one pixel is not sure of: 9 photons more of 256, and 3 in each of its neighbours.
    Dim,
}

struct Driven<'a> {
    array: PixelArray<'a, BINS, WindowRule>,
    codes: [u16; PHOTONS as usize],
}

/// Events of pixels and of blocks.
#[derive(Clone, Copy, PartialEq)]
struct Events {
    of_pixels: u32,
    /// Those of the pixels that neighbours confirmed.
    confirmed: u32,
    of_blocks: u32,
}

/// No event.
const NONE: Events = Events {
    of_pixels: 0,
    confirmed: 0,
    of_blocks: 0,
};
/// One of each pixel.
const ALL: Events = Events {
    of_pixels: SIDE * SIDE,
    ..NONE
};

/// Measures all, if it can.
pub fn run(counter: &Counter, state: &mut State) -> bool {
    let (places, blocks) = (PLACES.take(), ROOM_OF_BLOCKS.take());
    while places.push(PixelPlace::new()).is_ok() {}
    while blocks.push(Block::default()).is_ok() {}
    let mut driven = Driven {
        array: PixelArray::new(places, blocks),
        codes: [0; PHOTONS as usize],
    };
    counter.is_right_for(&mut driven)
        && photons(counter, state, &mut driven).is_some()
        && (ROWS.iter()).all(|row| row.run(counter, state, &mut driven))
}

/// Photons of one pixel.
fn photons(counter: &Counter, state: &mut State, driven: &mut Driven<'_>) -> Option<()> {
    for (variant, way, cycles) in [
        ("array", Way::Alone, 0),
        ("array; once per bin", Way::OncePerBin, 0),
        ("array with blocks; feeds none", BLOCKS_OF_4, 0),
        ("array with blocks; 1 level", BLOCKS_OF_4, PATIENCE),
        ("array with blocks; 2 levels", Way::Blocks(2), PATIENCE),
        ("array with blocks; 3 levels", Way::Blocks(3), PATIENCE),
    ] {
        let mut total = 0;
        for number in 0..EXPOSURES {
            driven.configure(way)?;
            driven.pass(cycles);
            state.empty(number, true);
            driven.codes = state.codes;
            for index in 0..PHOTONS {
                total += counter.measure(photon, driven, index);
                if index % 16 == 15 {
                    // Without a look that decides.
                    driven.array.end_laser_cycle();
                }
            }
        }
        report::line("photon", variant, total, EXPOSURES * PHOTONS);
    }
    let mut total = 0;
    for number in 0..EXPOSURES {
        driven.configure(Way::Alone)?;
        state.empty(number, true);
        driven.codes = state.codes;
        total += counter.measure(batch, driven, 0);
    }
    report::line("photon", "array; batch", total, EXPOSURES * PHOTONS);
    Some(())
}

/// A look of the whole array, and what is in it.
#[derive(Clone, Copy)]
struct Looked {
    way: Way,
    scene: Scene,
    /// Laser cycles at its end.
    cycles: u16,
    events: Events,
}

/// A figure: that of a look, less that of another one, divided by so many.
struct Row {
    operation: &'static str,
    variant: &'static str,
    look: Looked,
    less: Option<Looked>,
    among: u32,
}

const BACKGROUND: Looked = Looked {
    way: Way::Alone,
    scene: Scene::Background,
    cycles: CYCLES,
    events: NONE,
};
const TARGET: Looked = Looked {
    scene: Scene::Target,
    events: ALL,
    ..BACKGROUND
};
const WITH_BLOCKS: Looked = Looked {
    way: BLOCKS_OF_4,
    ..BACKGROUND
};
const WITH_NEIGHBOURS: Looked = Looked {
    way: Way::Neighbours,
    ..BACKGROUND
};

const ROWS: [Row; 7] = [
    Row {
        operation: "decision",
        variant: "look; array; no event",
        look: BACKGROUND,
        less: None,
        among: SIDE * SIDE,
    },
    Row {
        operation: "decision",
        variant: "look; array; event",
        look: TARGET,
        less: None,
        among: SIDE * SIDE,
    },
    Row {
        operation: "decision",
        variant: "look; block; no event",
        look: WITH_BLOCKS,
        less: Some(BACKGROUND),
        among: BLOCKS,
    },
    Row {
        operation: "decision",
        variant: "look; block; event",
        look: Looked {
            scene: Scene::Target,
            events: Events {
                of_blocks: BLOCKS,
                ..ALL
            },
            ..WITH_BLOCKS
        },
        less: Some(TARGET),
        among: BLOCKS,
    },
    Row {
        operation: "clear",
        variant: "look at L2; block",
        look: Looked {
            cycles: SECOND_LOOK,
            ..WITH_BLOCKS
        },
        less: Some(BACKGROUND),
        among: BLOCKS,
    },
    Row {
        operation: "decision",
        variant: "look; array, 8 neighbours; no event",
        look: WITH_NEIGHBOURS,
        less: None,
        among: SIDE * SIDE,
    },
    Row {
        operation: "decision",
        variant: "look; array, 8 neighbours; more for each confirmed",
        look: Looked {
            scene: Scene::Dim,
            events: Events {
                of_pixels: 1,
                confirmed: 1,
                ..NONE
            },
            ..WITH_NEIGHBOURS
        },
        less: Some(WITH_NEIGHBOURS),
        among: 1,
    },
];

impl Row {
    /// Whether there was an exposure to measure: one with these events.
    fn run(&self, counter: &Counter, state: &mut State, driven: &mut Driven<'_>) -> bool {
        let (mut total, mut runs) = (0, 0);
        for exposure in 0..EXPOSURES {
            let mut look = |look| driven.look(counter, state, exposure, look);
            if let Some(instructions) = look(&self.look)
                && let Some(less) = self.less.as_ref().map_or(Some(0), look)
            {
                total += instructions.saturating_sub(less);
                runs += 1;
            }
        }
        report::line(self.operation, self.variant, total, runs * self.among);
        runs > 0
    }
}

impl Driven<'_> {
    /// All pixels begin.
    fn configure(&mut self, way: Way) -> Option<()> {
        let layout = Array::new(SIDE, SIDE)?;
        let rule = WindowRule::new(3, const { U4F12::lit("4.4") }, Count::saturating(5)).ok()?;
        let config = |rule: WindowRule, l2| {
            let config = PixelConfig::with_rule(rule).x(4).l1(40).l2(l2);
            config.build().ok()
        };
        let alone = ArrayConfig::new(layout, config(rule, 2000)?);
        let config = match way {
            Way::Alone => alone,
            Way::OncePerBin => alone.once_per_bin(),
            Way::Blocks(levels) => {
                let levels = BlockLevel::new(levels)?;
                let of_blocks = config(rule.of_blocks(levels), SECOND_LOOK)?;
                alone.blocks(levels, of_blocks, PATIENCE).ok()?
            }
            Way::Neighbours => {
                let neighbours = NeighbourConfig::new(layout, Neighbours::Eight, &rule);
                let own = config(*neighbours.rule().own(), 2000)?;
                ArrayConfig::new(layout, own).neighbours(neighbours).ok()?
            }
        };
        self.array.configure(&config).ok()
    }

    fn pass(&mut self, cycles: u16) {
        (0..cycles).for_each(|_| self.array.end_laser_cycle());
    }

    /// What a look takes. `None` if there are other events.
    fn look(
        &mut self,
        counter: &Counter,
        state: &mut State,
        exposure: u32,
        looked: &Looked,
    ) -> Option<u32> {
        self.configure(looked.way)?;
        self.pass(PATIENCE);
        for (number, pixel) in (exposure * SIDE * SIDE..).zip(0..PIXELS) {
            state.empty(number, looked.scene == Scene::Target);
            for code in state.codes {
                self.array.photon(pixel, code);
            }
        }
        if looked.scene == Scene::Dim {
            self.dim_target();
        }
        self.pass(looked.cycles - PATIENCE - 1);
        let instructions = counter.measure(look, self, 0);
        (self.events() == looked.events).then_some(instructions)
    }

    fn dim_target(&mut self) {
        let side = SIDE as usize;
        for row in [INNER - side, INNER, INNER + side] {
            for pixel in row - 1..=row + 1 {
                let photons = if pixel == INNER { 9 } else { 3 };
                for photon in 0..photons {
                    self.array.photon(pixel, 60 + photon % 2);
                }
            }
        }
    }

    /// The events that wait.
    fn events(&mut self) -> Events {
        let mut events = NONE;
        while let Some(event) = self.array.next_event() {
            if event.level == BlockLevel::PIXEL {
                events.of_pixels += 1;
                events.confirmed += u32::from(event.flags.contains(Flags::CONFIRMED));
            } else {
                events.of_blocks += 1;
            }
        }
        events
    }
}

extern "C" fn photon(driven: &mut Driven<'_>, index: u32) -> u32 {
    if let Some(&code) = driven.codes.get(index as usize) {
        driven.array.photon(INNER, code);
    }
    0
}

extern "C" fn batch(driven: &mut Driven<'_>, _: u32) -> u32 {
    driven.array.photons(INNER, &driven.codes);
    0
}

extern "C" fn look(driven: &mut Driven<'_>, _: u32) -> u32 {
    driven.array.end_laser_cycle();
    0
}
