//! Russian roulette (filled in by its owner).
