//! What a scene calls for: found from scene and options, with the first object that asks for each effect. Pure.
//!
//! [`table`] has one row an effect and derives everything from it: gates that the stages read, gates that can be
//! forced, names of stages, and what is found, simulated and ignored. `found` are its predicates, [`ignored`] is what
//! is asked for in vain, [`asked`] is what both read. [`without`] leaves effects out on demand, each by its `removal`,
//! and what is `named` besides them.

pub mod asked;
mod found;
pub mod guide;
pub mod ignored;
pub mod light_paths;
mod named;
mod removal;
pub mod table;
pub mod without;
