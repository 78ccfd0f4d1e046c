//! Laws of counts, and the numbers they need.

pub mod binomial;
pub mod normal;
pub mod poisson;
pub mod quadrature;
