//! What tests need of the tools, too.

pub mod stack_bound;
