//! Drawings as SVG text, for `bench`, `accuracy` and the scaling bench: shapes and colours ([`svg`]), and plots in a
//! frame of two axes ([`axes`]).

pub mod axes;
pub mod svg;
