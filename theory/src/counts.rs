//! Laws of counts, and the numbers they need.

pub mod binomial;
pub mod normal;
pub mod poisson;
pub mod quadrature;

/// Where `is_inside` ends between `inside` and `outside`, halved 60 times: every halving is a
/// bit.
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
