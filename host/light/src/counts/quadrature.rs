//! Integrals of smooth functions.

/// Positive nodes and weights of the ten-point Gauss-Legendre rule on −1..1
/// (Abramowitz and Stegun, table 25.4).
const RULE: [(f64, f64); 5] = [
    (0.148_874_338_981_631_21, 0.295_524_224_714_752_87),
    (0.433_395_394_129_247_2, 0.269_266_719_309_996_35),
    (0.679_409_568_299_024_4, 0.219_086_362_515_982_04),
    (0.865_063_366_688_984_5, 0.149_451_349_150_580_6),
    (0.973_906_528_517_171_7, 0.066_671_344_308_688_14),
];

/// The integral of `function` from `from` to `to` by the ten-point rule on
/// each of `pieces` equal pieces. Exact for polynomials of degree 19.
pub fn integral(from: f64, to: f64, pieces: u32, function: impl Fn(f64) -> f64) -> f64 {
    let half = (to - from) / f64::from(pieces) / 2.0;
    let piece = |index: u32| {
        let middle = from + half * f64::from(2 * index + 1);
        let pair = |(node, weight): (f64, f64)| {
            weight * (function(middle - half * node) + function(middle + half * node))
        };
        RULE.into_iter().map(pair).sum::<f64>()
    };
    half * (0..pieces).map(piece).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn polynomials_of_degree_19_are_exact() {
        for degree in 0..20 {
            let exact = 2f64.powi(degree + 1) / f64::from(degree + 1);
            let found = integral(0.0, 2.0, 1, |x| x.powi(degree));
            assert!((found / exact - 1.0).abs() < 1e-13, "{degree}: {found}");
        }
        // The next even power is not exact with ten points.
        let found = integral(-1.0, 1.0, 1, |x| x.powi(20));
        assert!((found * 21.0 / 2.0 - 1.0).abs() > 1e-7);
    }

    #[test]
    fn a_normal_density_integrates_to_one() {
        let density = |x: f64| (-x * x / 2.0).exp() / (2.0 * std::f64::consts::PI).sqrt();
        assert!((integral(-9.0, 9.0, 20, density) - 1.0).abs() < 1e-14);
    }
}
