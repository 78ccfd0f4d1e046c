//! Distributions of counts, and their numerics.

pub mod binomial;
pub mod dead_time;
pub mod normal;
pub mod poisson;
pub mod quadrature;

/// The edge between `inside` and `outside` at which `is_inside` ends, by 60 bisections.
pub(crate) fn bisect(mut inside: f64, mut outside: f64, is_inside: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..60 {
        let middle = f64::midpoint(inside, outside);
        if is_inside(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    outside
}
