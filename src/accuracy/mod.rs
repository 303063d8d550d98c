//! Accuracy: metrics of an image against a reference. A film's estimate of its own error is `film::estimate`.

pub mod flip;
pub mod metrics;
