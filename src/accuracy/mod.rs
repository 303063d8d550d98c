//! Metrics and estimates of accuracy (filled in by its owner).
