//! From a number of bins to a type with so many.

use std::error::Error;
use std::fmt::{self, Display, Formatter};

/// A number of bins that histograms cannot have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UnsupportedBins(pub usize);

impl Display for UnsupportedBins {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let Self(bins) = self;
        write!(f, "{bins} bins: must be a power of two from 8 to 1024")
    }
}

impl Error for UnsupportedBins {}

/// Evaluates an expression for a number of bins that is known only at run time. Returns
/// [`UnsupportedBins`] unless it is a power of two from 8 to 1024.
///
/// ```
/// use dtof_core::Histogram;
/// use dtof_engine::with_bins;
///
/// let bytes = with_bins!(128, BINS => size_of::<Histogram<BINS>>());
/// assert!(bytes.is_ok());
/// assert!(with_bins!(100, BINS => BINS).is_err());
/// // Of some numbers only.
/// assert!(with_bins!(128, of 8 16, BINS => BINS).is_err());
/// ```
#[macro_export]
macro_rules! with_bins {
    ($bins:expr, $name:ident => $value:expr) => {
        $crate::with_bins!($bins, of 8 16 32 64 128 256 512 1024, $name => $value)
    };
    ($bins:expr, of $($number:literal)*, $name:ident => $value:expr) => {
        match $bins {
            $($number => {
                const $name: usize = $number;
                Ok($value)
            })*
            bins => Err($crate::bins::UnsupportedBins(bins)),
        }
    };
}

/// The same with the widest counters of histograms with so many bins, as a count and its bin fit into 32 bits
/// together: of 24 bits up to 256 bins, of 20 from there on.
#[macro_export]
macro_rules! with_widest {
    ($bins:expr, $name:ident, $width:ident => $value:expr) => {
        match $bins {
            bins @ (512 | 1024) => $crate::with_bins!(bins, of 512 1024, $name => {
                type $width = dtof_core::Count20;
                $value
            }),
            bins => $crate::with_bins!(bins, of 8 16 32 64 128 256, $name => {
                type $width = dtof_core::Count24;
                $value
            }),
        }
    };
}

#[cfg(test)]
mod tests {
    use super::UnsupportedBins;

    #[test]
    fn the_numbers_are_those_of_the_core() {
        for bins in 0..=2048_usize {
            let is_supported = (8..=1024).contains(&bins) && bins.is_power_of_two();
            let expected = is_supported.then_some(bins).ok_or(UnsupportedBins(bins));
            assert_eq!(with_bins!(bins, BINS => BINS), expected);
        }
    }
}
