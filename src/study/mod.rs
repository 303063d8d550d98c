//! What accuracy costs in time for one scene: [`measure`] renders within a budget what [`settings`] lists and
//! fills [`findings`], [`report`] turns
//! the runs into numbers with intervals ([`runs`]), and [`table`] and [`html`] show them. [`effects`] are priced on
//! request, in the place of techniques and knobs.

pub mod class;
mod class_tables;
pub mod classes;
pub mod clock;
mod conclude;
mod crops;
pub mod effects;
mod effects_page;
mod effects_plot;
mod energy;
pub mod findings;
pub mod html;
pub mod measure;
pub mod notes;
mod pairs;
pub mod picture;
pub mod plot;
pub mod reference;
pub mod renderers;
pub mod report;
mod rounds;
pub mod runs;
pub mod settings;
pub mod table;
mod tails;
mod words;
