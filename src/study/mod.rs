//! What accuracy costs in time for one scene: [`measure`] renders within a budget what [`settings`] lists and
//! fills [`findings`], [`report`] turns
//! the runs into numbers with intervals ([`runs`]), and [`table`] and [`html`] show them.

pub mod clock;
mod conclude;
pub mod findings;
pub mod html;
pub mod measure;
pub mod notes;
pub mod picture;
pub mod plot;
pub mod reference;
pub mod renderers;
pub mod report;
mod rounds;
pub mod runs;
pub mod settings;
pub mod table;
