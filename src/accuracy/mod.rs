//! Accuracy: metrics of an image against a reference, and what a smaller error costs. A film's estimate of its own
//! error is `film::estimate`; what accuracy costs in time is measured by `study`.

pub mod flip;
pub mod metrics;
pub mod predict;
pub mod verdict;
