//! Materials: their numbers as the file states them (`parameters`), how alpha is read (`alpha`), which textures there
//! can be (`slot`), and what a material can do (`facts`). Code that distinguishes materials asks the facts.

pub mod alpha;
#[doc(hidden)]
pub mod facts;
pub mod parameters;
#[doc(hidden)]
pub mod slot;
