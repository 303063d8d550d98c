//! A backend that remembers: it asks another backend once for each batch of rays and answers the same batch from memory
//! afterwards. A render through it costs what a render costs without tracing (and what copying the hits costs), which
//! is what benches of shading and counts of instructions want.
//!
//! Batches are known by their length and the bits of their first and last ray. The memory grows with every new batch:
//! for small frames, rendered again with the same options.

use std::collections::HashMap;
use std::sync::RwLock;

use crate::backend::batch::{LANES, RayBlock, RayHitBlock};
use crate::backend::past::Past;
use crate::backend::{Backend, BackendInfo, Coherence};

/// A batch's length and two of its rays.
type Key = [u32; 13];

/// Answers of one backend, by batch.
pub struct Playback<'b> {
    inner: &'b dyn Backend,
    closest: RwLock<HashMap<Key, Vec<RayHitBlock>>>,
    any: RwLock<HashMap<Key, Vec<RayBlock>>>,
}

impl<'b> Playback<'b> {
    /// Remembers nothing yet.
    pub fn new(inner: &'b dyn Backend) -> Self {
        Playback { inner, closest: RwLock::default(), any: RwLock::default() }
    }
}

/// `block` gives the rays of a block.
fn key<'r>(len: usize, block: impl Fn(usize) -> &'r RayBlock) -> Key {
    let mut key = [0; 13];
    key[0] = len as u32;
    if len > 0 {
        for (part, ray) in key[1..].chunks_mut(6).zip([0, len - 1]) {
            let rays = block(ray / LANES);
            let (org, dir) = (rays.org(ray % LANES), rays.dir(ray % LANES));
            for c in 0..3 {
                part[c] = org[c].to_bits();
                part[3 + c] = dir[c].to_bits();
            }
        }
    }
    key
}

impl Backend for Playback<'_> {
    fn info(&self) -> &BackendInfo {
        self.inner.info()
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64 {
        let key = key(len, |block| &blocks[block].ray);
        if let Some(answer) = self.closest.read().expect("no thread panicked").get(&key) {
            blocks.copy_from_slice(answer);
            return 0;
        }
        let invalid = self.inner.closest_hit(blocks, len, hint);
        self.closest.write().expect("no thread panicked").insert(key, blocks.to_vec());
        invalid
    }

    /// Rays that go on are not remembered: what they have passed is not in their rays.
    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        self.inner.closest_hit_past(blocks, len, past)
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, hint: Coherence) -> u64 {
        let key = key(len, |block| &blocks[block]);
        if let Some(answer) = self.any.read().expect("no thread panicked").get(&key) {
            blocks.copy_from_slice(answer);
            return 0;
        }
        let invalid = self.inner.any_hit(blocks, len, hint);
        self.any.write().expect("no thread panicked").insert(key, blocks.to_vec());
        invalid
    }
}
