//! Where the fields of a word lie in its four parts of 32 bits, the least significant first:
//! `docs/aer-format.md`.

/// A bit field of one of the four parts of a word.
#[derive(Clone, Copy)]
pub struct Field {
    /// The place of its lowest bit.
    pub shift: u32,
    /// How many bits it has.
    pub bits: u32,
}

const fn field(shift: u32, bits: u32) -> Field {
    Field { shift, bits }
}

impl Field {
    const fn mask(self) -> u32 {
        u32::MAX >> (u32::BITS - self.bits)
    }

    /// The field's bits of a value that fits.
    pub const fn put(self, value: u32) -> u32 {
        debug_assert!(value <= self.mask());
        value << self.shift
    }

    /// The field's bits of the lowest bits of a value that may not fit.
    pub const fn put_low(self, value: u32) -> u32 {
        (value & self.mask()) << self.shift
    }

    /// The value of the field in a part.
    pub const fn get(self, part: u32) -> u32 {
        (part >> self.shift) & self.mask()
    }
}

// The second part of every word.
pub const KIND: Field = field(30, 2);
// The first part of an event.
pub const PIXEL: Field = field(0, 16);
pub const EXPOSURE: Field = field(16, 16);
// The second.
pub const CYCLE_LOW: Field = field(0, 16);
pub const LEVEL: Field = field(16, 2);
/// The number of the echo, minus 1.
pub const ECHO: Field = field(18, 2);
pub const PEAK_BIN: Field = field(20, 10);
// The third, and the fourth.
pub const PEAK_COUNT: Field = field(0, 24);
/// The low bits of the background; the others are in the fourth part.
pub const BACKGROUND_LOW: Field = field(24, 8);
pub const BACKGROUND_HIGH: Field = field(0, 16);
pub const OFFSET: Field = field(16, 10);
pub const FLAGS: Field = field(26, 6);
// The second part of a dynamic depth event; its pixel, cycle and level are where those of a
// depth event are. The third is the position, the fourth the change.
pub const CHANGE_FLAGS: Field = field(20, 6);
// The second part of a control word. The first of the last word is the checksum.
pub const CONTROL: Field = field(20, 10);

pub const KIND_CONTROL: u32 = 0;
pub const KIND_DEPTH_EVENT: u32 = 1;
pub const KIND_DYNAMIC_DEPTH: u32 = 2;
pub const CONTROL_TIME: u32 = 1;
pub const CONTROL_END: u32 = 2;
