//! Multiple importance sampling weights (filled in by its owner).
