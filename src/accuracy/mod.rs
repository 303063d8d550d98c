//! Accuracy: metrics of an image against a reference, and what a smaller error costs. A film's estimate of its own error
//! is `film::estimate`.

pub mod flip;
pub mod metrics;
pub mod predict;
