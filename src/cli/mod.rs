//! Command line (filled in by its owner).
