//! Textures (filled in by its owner).
