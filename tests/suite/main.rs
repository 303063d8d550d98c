//! The suite: one module per theme.

mod bsdf;
