//! Spearman's rank correlation.

/// Twice the ranks of `values`, so that the mean ranks of ties are integers.
fn doubled_ranks(values: &[f64]) -> Vec<i64> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut ranks = vec![0; values.len()];
    let mut before = 0;
    for equals in order.chunk_by(|&a, &b| values[a].total_cmp(&values[b]).is_eq()) {
        let count = i64::try_from(equals.len()).unwrap_or(i64::MAX);
        for &index in equals {
            ranks[index] = 2 * before + count + 1;
        }
        before += count;
    }
    ranks
}

/// Spearman's rank correlation of pairs, with mean ranks for ties. `None` if one side is constant.
pub fn rank_correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = i64::try_from(a.len()).ok()? + 1; // of doubled ranks
    let centred = |values| -> Vec<i64> {
        let ranks = doubled_ranks(values).into_iter();
        ranks.map(|rank| rank - mean).collect()
    };
    let (a, b) = (centred(a), centred(b));
    let product = |a: &[i64], b: &[i64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<i64>() as f64;
    let spread = (product(&a, &a) * product(&b, &b)).sqrt();
    (spread > 0.0).then(|| product(&a, &b) / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_share_their_mean_rank() {
        assert_eq!(doubled_ranks(&[3.0, 1.0, 3.0, 2.0]), [7, 2, 7, 4]);
    }

    #[test]
    fn order_alone_counts() {
        let a = [1.0, 2.0, 3.0, 4.0];
        assert_eq!(rank_correlation(&a, &[1.0, 10.0, 100.0, 1e9]), Some(1.0));
        assert_eq!(rank_correlation(&a, &[0.0, -1.0, -2.0, -3.0]), Some(-1.0));
        assert_eq!(rank_correlation(&a, &[5.0; 4]), None);
        // By hand: 1 − 6 Σd² / (n (n² − 1)) with d = 0, 1, 1, 0.
        let swapped = rank_correlation(&a, &[1.0, 3.0, 2.0, 4.0]).unwrap();
        assert!((swapped - 0.8).abs() < 1e-15);
    }
}
