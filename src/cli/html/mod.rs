//! Pages about pictures, for browsers: one of a render (`render --report`), and one of two pictures side by side
//! (`compare --html`). How a page is written is in `plot/html.rs`; what both show alike in `picture` and `record`.

pub mod compare;
pub mod picture;
mod record;
pub mod render;
