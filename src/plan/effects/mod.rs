//! What a scene calls for: found from scene and options, with the first object that asks for each effect. Pure.
//!
//! [`table`] has one row an effect and derives everything from it: gates that the stages read, gates that can be
//! forced, names of stages, and what is found, simulated and ignored. `found` are its predicates, [`ignored`] is what
//! is asked for in vain, [`asked`] is what both read.

pub mod asked;
mod found;
pub mod ignored;
pub mod table;
