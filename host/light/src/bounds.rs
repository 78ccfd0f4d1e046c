//! How fast and how exact anything can be that knows the scene.

pub mod cramer_rao;
pub mod likelihood_ratio;
