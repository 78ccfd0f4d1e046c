//! The integer square root of the background (sec. IV-B, Alg. 1).

/// The largest integer whose square is at most `x`.
///
/// The paper says of Alg. 1 that it "maintained an error below one for all
/// inputs" (sec. IV-B, figure "Error of the square-root computation
/// algorithm"): its result is the square root rounded down.
#[must_use]
#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the square root of a u32 lies between 0 and 65536"
)]
pub fn floor_square_root(x: u32) -> u32 {
    let mut root = f64::from(x).sqrt().floor() as u32;
    // Corrects the rounding of the floating-point root.
    while square(root) > u64::from(x) {
        root -= 1;
    }
    while square(root + 1) <= u64::from(x) {
        root += 1;
    }
    root
}

/// The square of `x`, without overflow.
fn square(x: u32) -> u64 {
    u64::from(x) * u64::from(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Alg. 1 line by line, with `n << 1 + b` read as `(n << 1) + b`.
    fn algorithm_1(background: u32) -> u32 {
        let mut shift = 5;
        let mut root = 0;
        let mut bit = 32;
        let mut remainder = background;
        while bit > 0 {
            let trial = ((root << 1) + bit) << shift;
            shift -= 1;
            if remainder >= trial {
                root += bit;
                remainder -= trial;
            }
            bit >>= 1;
        }
        root
    }

    #[test]
    fn roots_by_hand() {
        // 31^2 = 961 and 32^2 = 1024 enclose the 10-bit counts' last root.
        let roots = [
            (0, 0),
            (1, 1),
            (2, 1),
            (3, 1),
            (4, 2),
            (8, 2),
            (9, 3),
            (960, 30),
            (961, 31),
            (1023, 31),
            (1024, 32),
        ];
        for (x, root) in roots {
            assert_eq!(floor_square_root(x), root, "of {x}");
        }
    }

    #[test]
    fn exact_at_the_upper_end() {
        // 65535^2 = 4294836225; 65536^2 = 2^32 is beyond u32.
        assert_eq!(floor_square_root(4_294_836_224), 65_534);
        assert_eq!(floor_square_root(4_294_836_225), 65_535);
        assert_eq!(floor_square_root(u32::MAX), 65_535);
    }

    #[test]
    fn error_below_one_for_all_counts() {
        // 12 bits is what the six result bits of Alg. 1 can hold: 63^2 = 3969.
        for x in 0..4096 {
            let error = f64::from(x).sqrt() - f64::from(floor_square_root(x));
            assert!((0.0..1.0).contains(&error), "{error} for {x}");
        }
    }

    #[test]
    fn algorithm_1_rounds_down() {
        for x in 0..4096 {
            assert_eq!(algorithm_1(x), floor_square_root(x), "of {x}");
        }
    }
}
