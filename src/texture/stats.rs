//! Counts of look-ups: one addition each, in the thread's own number, which workers hand over after each wave.

use std::cell::Cell;

use serde::Serialize;

thread_local! {
    static LOOKUPS: Cell<u64> = const { Cell::new(0) };
}

#[inline(always)]
pub(super) fn count_lookup() {
    count_lookups(1);
}

#[inline(always)]
pub(super) fn count_lookups(number: u64) {
    LOOKUPS.with(|count| count.set(count.get() + number));
}

/// Look-ups of this thread since it was last asked.
#[inline]
pub fn take_lookups() -> u64 {
    LOOKUPS.replace(0)
}

/// What the tile cache did, over a scene's textures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct TextureStats {
    /// Texels served without reading a file.
    pub cache_hits: u64,
    /// Tiles read from files.
    pub cache_misses: u64,
    /// Most bytes that the cache held.
    pub cache_peak_bytes: u64,
    /// Seconds of look-ups through the cache, over all threads, from one in 64 of them; those in memory are not timed.
    pub cache_seconds: f64,
    /// Seconds of these that went into reading files.
    pub read_seconds: f64,
    /// Look-ups that failed because a file changed, vanished or could not be read; their values are magenta.
    pub failed: u64,
}

/// An image of which look-ups failed.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct TextureFault {
    /// Its file and the material that asks for it.
    pub image: String,
    /// Look-ups that failed.
    pub lookups: u64,
    /// Why the first did.
    pub problem: String,
}

impl std::fmt::Display for TextureFault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}: {} look-ups failed: {}", self.image, self.lookups, self.problem)
    }
}
