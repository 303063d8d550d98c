//! Accuracy: metrics of an image against a reference. The film's estimate of its own error is in `film`.

pub mod flip;
pub mod metrics;
