//! The link between device and host. Its format is `docs/link-format.md`.
pub mod endpoint;
pub mod frame;
pub mod message;
