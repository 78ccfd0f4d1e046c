//! A compact format for small numbers.
//!
//! A number is written in digits of three bits, the lowest first, two digits in a byte. The fourth bit of a
//! digit is set if another digit follows. The count of a bin usually takes one digit.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;

/// Packed numbers.
#[derive(Clone, Debug, Default)]
pub(super) struct Packed {
    bytes: Vec<u8>,
    is_half: bool,
}

impl Packed {
    /// Adds a number.
    pub fn push(&mut self, number: impl Into<u64>) {
        let mut rest: u64 = number.into();
        loop {
            let more = rest > 7;
            self.digit((rest & 7) as u8 | u8::from(more) << 3);
            if !more {
                return;
            }
            rest >>= 3;
        }
    }

    fn digit(&mut self, digit: u8) {
        self.is_half = !self.is_half;
        match self.bytes.last_mut().filter(|_| !self.is_half) {
            Some(byte) => *byte |= digit << 4,
            None => self.bytes.push(digit),
        }
    }

    /// Adds a range in steps of 1/256 mm, zigzag coded; exact below 2⁴⁵ mm.
    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "never negative"
    )]
    pub fn push_range(&mut self, millimetres: f64) {
        let parts = (millimetres * 256.0).round() as i64;
        self.push((parts << 1 ^ parts >> 63) as u64);
    }

    /// The length of [`Self::base64`] in characters.
    pub fn len(&self) -> usize {
        self.bytes.len().div_ceil(3) * 4
    }

    pub fn base64(&self) -> String {
        BASE64.encode(&self.bytes)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads numbers as the page does.
    pub struct Reader {
        bytes: Vec<u8>,
        at: usize,
    }

    impl Reader {
        pub fn new(base64: &str) -> Self {
            let bytes = BASE64.decode(base64).unwrap();
            Self { bytes, at: 0 }
        }

        pub fn number(&mut self) -> u64 {
            let (mut number, mut place) = (0, 0);
            loop {
                let digit = self.bytes[self.at / 2] >> (4 * (self.at % 2)) & 15;
                self.at += 1;
                number |= u64::from(digit & 7) << place;
                if digit < 8 {
                    return number;
                }
                place += 3;
            }
        }

        pub fn range(&mut self) -> f64 {
            let raw = self.number();
            let parts = i64::try_from(raw >> 1).unwrap();
            (if raw & 1 == 1 { -parts - 1 } else { parts }) as f64 / 256.0
        }

        pub fn is_at_end(&self) -> bool {
            self.at.div_ceil(2) == self.bytes.len()
        }
    }

    #[test]
    fn a_small_number_takes_half_a_byte() {
        let mut packed = Packed::default();
        for number in [0u64, 7, 8, 63] {
            packed.push(number);
        }
        assert_eq!(packed.bytes, [0x70, 0x18, 0x7f]);
    }

    proptest! {
        #[test]
        fn numbers_and_ranges_come_back(
            numbers in prop::collection::vec((0..64u32, any::<u64>()), 0..40), parts in -(1i32 << 30)..1 << 30,
        ) {
            let numbers: Vec<u64> = numbers.iter().map(|(shift, number)| number >> shift).collect();
            let mut packed = Packed::default();
            let range = f64::from(parts) / 256.0;
            packed.push_range(range);
            numbers.iter().for_each(|&number| packed.push(number));
            let text = packed.base64();
            prop_assert_eq!(text.len(), packed.len());
            let mut reader = Reader::new(&text);
            prop_assert_eq!(reader.range(), range);
            for number in numbers {
                prop_assert_eq!(reader.number(), number);
            }
            prop_assert!(reader.is_at_end());
        }
    }
}
