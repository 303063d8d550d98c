//! The test suite: one module per theme.

mod cli;
mod film;
