//! The integration suite: one module per theme.

mod conformance;
