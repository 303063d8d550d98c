//! Materials: their numbers as the file states them (`parameters`), how alpha is read (`alpha`), which textures there
//! can be (`slot`), and what a material can do (`facts`). Code that distinguishes materials asks the facts.

pub mod alpha;
pub mod facts;
pub mod parameters;
pub mod slot;
