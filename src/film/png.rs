//! PNG preview (filled in by its owner).
