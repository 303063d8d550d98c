//! Accuracy: metrics of an image against a reference, and what a smaller error costs. A film's estimate of its own error
//! is `film::estimate`.

pub mod clock;
pub mod flip;
pub mod html;
pub mod metrics;
pub mod notes;
pub mod plot;
pub mod predict;
pub mod reference;
pub mod report;
pub mod runs;
pub mod settings;
pub mod study;
pub mod table;
