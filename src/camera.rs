//! Camera rays (filled in by its owner).
