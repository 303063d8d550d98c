//! Statistics of a render as JSON (filled in by its owner).
