//! OpenEXR output (filled in by its owner).
