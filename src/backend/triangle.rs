//! Watertight ray–triangle test (filled in by its owner).
