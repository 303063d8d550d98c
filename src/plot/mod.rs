//! What is drawn for people: shapes and colours as SVG text ([`svg`]), plots in a frame of two axes ([`axes`]), maps of
//! values in colours ([`heat`]), and the pages that hold them ([`html`]); numbers with three digits ([`number`]).

pub mod axes;
pub mod heat;
pub mod html;
pub mod number;
pub mod svg;
