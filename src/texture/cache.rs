//! Tiles in memory, up to a limit: what look-ups read of images that are not held. Any number of threads look into it.
//!
//! A thread keeps the tiles that it saw last, so that most look-ups need no lock; all together they keep an eighth of
//! the limit. Behind that, tiles lie in sixteen parts with a lock each, and leave in the order of a clock: one that was
//! asked for since the hand passed stays another round. The memory of a tile that leaves serves the next one: it was
//! taken by another thread, whose heap would keep it.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet, VecDeque};
use std::mem;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use super::plane::Rows;

/// Tiles that a thread keeps.
const KEPT: usize = 64;

/// Parts of the cache.
const SHARDS: usize = 16;

/// Buffers that wait for the next tile, of each kind, and the texels of the largest.
const SPARE: usize = 16;
const SPARE_TEXELS: usize = 1 << 12;

/// A tile of a level of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    pub(super) image: u32,
    pub(super) level: u32,
    /// Row-major from the top.
    pub(super) tile: u32,
}

impl Key {
    /// A number below 2⁶ that neighbours do not share.
    fn slot(self) -> usize {
        let mixed = (u64::from(self.image) << 40) ^ (u64::from(self.level) << 34) ^ u64::from(self.tile);
        (mixed.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 58) as usize
    }
}

/// Texels that count towards the limit while anybody has them.
#[derive(Debug)]
struct Tile {
    texels: Rows,
    pool: Arc<Pool>,
}

impl Drop for Tile {
    fn drop(&mut self) {
        self.pool.bytes.fetch_sub(self.texels.bytes(), Ordering::Relaxed);
        self.pool.give(mem::replace(&mut self.texels, Rows::Eight(Vec::new())));
    }
}

/// Memory of tiles.
#[derive(Debug, Default)]
struct Pool {
    /// Of all tiles that anybody has.
    bytes: AtomicU64,
    peak_bytes: AtomicU64,
    /// Of these, kept by threads.
    kept_bytes: AtomicU64,
    spare: Mutex<[Vec<Rows>; 2]>,
}

impl Pool {
    fn spare(&self) -> MutexGuard<'_, [Vec<Rows>; 2]> {
        self.spare.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An empty buffer of a kind.
    fn take(&self, eight_bits: bool) -> Rows {
        let spare = self.spare()[usize::from(eight_bits)].pop();
        spare.unwrap_or_else(|| if eight_bits { Rows::Eight(Vec::new()) } else { Rows::Float(Vec::new()) })
    }

    fn give(&self, mut texels: Rows) {
        if (1..=SPARE_TEXELS).contains(&texels.capacity()) {
            texels.clear();
            let spare = &mut self.spare()[usize::from(matches!(texels, Rows::Eight(_)))];
            if spare.len() < SPARE {
                spare.push(texels);
            }
        }
    }
}

/// A tile that a thread keeps.
struct Kept {
    key: Key,
    tile: Arc<Tile>,
}

impl Kept {
    fn new(key: Key, tile: Arc<Tile>) -> Self {
        tile.pool.kept_bytes.fetch_add(tile.texels.bytes(), Ordering::Relaxed);
        Kept { key, tile }
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        self.tile.pool.kept_bytes.fetch_sub(self.tile.texels.bytes(), Ordering::Relaxed);
    }
}

/// What a thread keeps, of one cache at a time.
struct Front {
    of: u64,
    slots: [Option<Kept>; KEPT],
}

thread_local! {
    static FRONT: RefCell<Front> = const { RefCell::new(Front { of: 0, slots: [const { None }; KEPT] }) };
}

#[derive(Debug)]
struct Entry {
    tile: Arc<Tile>,
    /// Asked for since the clock's hand passed.
    used: bool,
}

#[derive(Debug, Default)]
struct Shard {
    tiles: HashMap<Key, Entry>,
    /// As the hand of the clock meets them.
    clock: VecDeque<Key>,
}

impl Shard {
    /// Lets one tile go; none is left if there was none.
    fn evict(&mut self) -> Option<Arc<Tile>> {
        while let Some(key) = self.clock.pop_front() {
            let Some(entry) = self.tiles.get_mut(&key) else { continue };
            if !mem::take(&mut entry.used) {
                return self.tiles.remove(&key).map(|entry| entry.tile);
            }
            self.clock.push_back(key);
        }
        None
    }
}

/// The cache.
#[derive(Debug)]
pub(super) struct Cache {
    /// No other cache of this process has it.
    serial: u64,
    most_bytes: u64,
    shards: [Mutex<Shard>; SHARDS],
    pool: Arc<Pool>,
    /// Tiles that could not be read once.
    broken: Mutex<HashSet<Key>>,
    any_broken: AtomicBool,
    misses: AtomicU64,
    read_nanoseconds: AtomicU64,
}

/// What a cache did so far.
pub(super) struct Counts {
    pub(super) misses: u64,
    pub(super) peak_bytes: u64,
    pub(super) read_seconds: f64,
}

impl Cache {
    /// An empty one that holds at most so many bytes, and the tiles at hand.
    pub(super) fn new(most_bytes: u64) -> Self {
        static SERIAL: AtomicU64 = AtomicU64::new(1);
        Cache {
            serial: SERIAL.fetch_add(1, Ordering::Relaxed),
            most_bytes,
            shards: Default::default(),
            pool: Arc::default(),
            broken: Mutex::default(),
            any_broken: AtomicBool::new(false),
            misses: AtomicU64::new(0),
            read_nanoseconds: AtomicU64::new(0),
        }
    }

    pub(super) fn counts(&self) -> Counts {
        Counts {
            misses: self.misses.load(Ordering::Relaxed),
            peak_bytes: self.pool.peak_bytes.load(Ordering::Relaxed),
            read_seconds: 1e-9 * self.read_nanoseconds.load(Ordering::Relaxed) as f64,
        }
    }

    /// Shows `look` the texels of a tile, which `read` puts into an empty buffer if they are not here.
    ///
    /// # Errors
    /// Those of `read`; an empty text for a tile that failed before.
    pub(super) fn with<V>(
        &self,
        key: Key,
        eight_bits: bool,
        read: impl FnOnce(&mut Rows) -> Result<(), String>,
        look: impl FnOnce(&Rows) -> V,
    ) -> Result<V, String> {
        FRONT.with_borrow_mut(|front| {
            if front.of != self.serial {
                front.slots.fill_with(|| None);
                front.of = self.serial;
            }
            let slot = key.slot();
            if let Some(kept) = &front.slots[slot]
                && kept.key == key
            {
                return Ok(look(&kept.tile.texels));
            }
            let tile = self.tile(key, eight_bits, read)?;
            let value = look(&tile.texels);
            front.slots[slot] = None;
            let most = self.most_bytes / 8;
            let fits = || self.pool.kept_bytes.load(Ordering::Relaxed) + tile.texels.bytes() <= most;
            if !fits() {
                front.slots.fill_with(|| None);
            }
            if fits() {
                front.slots[slot] = Some(Kept::new(key, tile));
            }
            Ok(value)
        })
    }

    fn shard(&self, number: usize) -> MutexGuard<'_, Shard> {
        self.shards[number].lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn broken(&self) -> MutexGuard<'_, HashSet<Key>> {
        self.broken.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn tile(
        &self,
        key: Key,
        eight_bits: bool,
        read: impl FnOnce(&mut Rows) -> Result<(), String>,
    ) -> Result<Arc<Tile>, String> {
        let number = key.slot() % SHARDS;
        if let Some(entry) = self.shard(number).tiles.get_mut(&key) {
            entry.used = true;
            return Ok(entry.tile.clone());
        }
        if self.any_broken.load(Ordering::Relaxed) && self.broken().contains(&key) {
            return Err(String::new());
        }
        self.misses.fetch_add(1, Ordering::Relaxed);
        let start = Instant::now();
        let mut texels = self.pool.take(eight_bits);
        if let Err(problem) = read(&mut texels) {
            self.broken().insert(key);
            self.any_broken.store(true, Ordering::Relaxed);
            return Err(problem);
        }
        self.read_nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
        self.make_room(number, texels.bytes());
        let bytes = self.pool.bytes.fetch_add(texels.bytes(), Ordering::Relaxed) + texels.bytes();
        self.pool.peak_bytes.fetch_max(bytes, Ordering::Relaxed);
        let tile = Arc::new(Tile { texels, pool: self.pool.clone() });
        let mut shard = self.shard(number);
        // Another thread may have read it meanwhile: then there are two for a moment.
        if shard.tiles.insert(key, Entry { tile: tile.clone(), used: false }).is_none() {
            shard.clock.push_back(key);
        }
        Ok(tile)
    }

    /// Lets tiles go until so many bytes fit, from this shard on.
    fn make_room(&self, first: usize, bytes: u64) {
        let (mut number, mut empty) = (first, 0);
        while self.pool.bytes.load(Ordering::Relaxed) + bytes > self.most_bytes && empty < SHARDS {
            let evicted = self.shard(number).evict();
            empty = if evicted.is_none() { empty + 1 } else { 0 };
            number = (number + 1) % SHARDS;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texels that tell their tile.
    fn texels_of(key: Key) -> Vec<[u8; 4]> {
        vec![[key.image as u8, key.level as u8, key.tile as u8, 7]; 64]
    }

    /// Threads that ask in their own orders get the texels of the tile that they ask for, within the limit and the few
    /// tiles at hand. Oracle: the key, written into the texels. Deterministic but for the threads' interleaving.
    #[test]
    fn tiles_are_those_asked_for_within_the_limit() {
        let cache = Cache::new(40 * 256);
        std::thread::scope(|scope| {
            for thread in 0..4u64 {
                let cache = &cache;
                scope.spawn(move || {
                    let mut state = thread;
                    for _ in 0..20_000 {
                        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                        let [image, level, tile, ..] = (state >> 40).to_le_bytes();
                        let key = Key { image: image.into(), level: (level % 4).into(), tile: (tile % 8).into() };
                        let key = Key { image: key.image % 3, ..key };
                        let fill = |texels: &mut Rows| {
                            let Rows::Eight(texels) = texels else { return Err("of another kind".into()) };
                            assert!(texels.is_empty());
                            texels.extend(texels_of(key));
                            Ok(())
                        };
                        let found = cache.with(key, true, fill, |texels| *texels == Rows::Eight(texels_of(key)));
                        assert_eq!(found, Ok(true));
                    }
                });
            }
        });
        let counts = cache.counts();
        assert!(counts.peak_bytes <= 48 * 256, "{} bytes", counts.peak_bytes);
        assert!(counts.misses > 96, "{}", counts.misses);
    }

    /// A tile that cannot be read is not read again, and is an error each time. Deterministic.
    #[test]
    fn a_tile_that_fails_stays_failed() {
        let cache = Cache::new(1 << 20);
        let key = Key { image: 0, level: 0, tile: 0 };
        assert_eq!(cache.with(key, true, |_| Err("gone".into()), |_| ()), Err("gone".into()));
        assert_eq!(cache.with(key, true, |_| unreachable!("known"), |_| ()), Err(String::new()));
    }
}
