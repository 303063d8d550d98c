//! Ray queries behind one trait. A backend sees geometry and rays; it never sees materials, lights or the plan.
//!
//! Five stand behind it: [`brute`] (every ray against every triangle, the oracle), [`obvhs`] (pure Rust), [`flat`]
//! (scenes of few faces, without a hierarchy), [`joint`] (a few large faces by `flat`, the rest by `obvhs`) and
//! `embree` (Debian's library, feature `embree`). [`select`] chooses among them, by the work that [`count`] counts and
//! the [`weights`] of its units, and builds them.

pub mod batch;
mod bounds;
pub mod brute;
pub mod count;
#[cfg(feature = "embree")]
#[allow(unsafe_code)] // Fence 1 of 5: the Embree API.
pub mod embree;
pub mod flat;
pub mod joint;
pub mod obvhs;
pub mod past;
pub mod select;
pub mod size;
pub mod triangle;
pub mod weights;

use std::any::Any;
use std::fmt;
use std::str::FromStr;

use batch::{RayBlock, RayHitBlock};
use past::Past;

/// Whether neighbouring rays of a batch run alike. A hint: the hits do not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Coherence {
    /// Camera rays of one tile and their shadow rays.
    Coherent,
    /// Everything after the first scattering.
    Incoherent,
}

/// How rays are handed to the traversal. Names are the command line's (`--rays`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum QueryMode {
    /// One ray a call.
    Single,
    /// Packets of 4.
    Packet4,
    /// Packets of 8.
    Packet8,
    /// Packets of 16.
    Packet16,
    /// A batch a call: native streams on Embree 3, a loop over packets on Embree 4.
    Stream,
}

impl QueryMode {
    /// Every mode, in the order of the help text.
    pub const ALL: [QueryMode; 5] =
        [QueryMode::Single, QueryMode::Packet4, QueryMode::Packet8, QueryMode::Packet16, QueryMode::Stream];

    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            QueryMode::Single => "single",
            QueryMode::Packet4 => "packet4",
            QueryMode::Packet8 => "packet8",
            QueryMode::Packet16 => "packet16",
            QueryMode::Stream => "stream",
        }
    }
}

impl fmt::Display for QueryMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The backends by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum BackendKind {
    /// Debian's Embree, 3.13 or 4.x.
    Embree,
    /// Pure Rust: a BVH by the `obvhs` crate and our own watertight triangle test.
    Obvhs,
    /// Sixteen rays at a time against every face, without a hierarchy: small scenes only.
    Flat,
    /// Large faces as [`Flat`](BackendKind::Flat), the rest by [`Obvhs`](BackendKind::Obvhs).
    FlatObvhs,
    /// Every ray against every triangle.
    Brute,
}

impl BackendKind {
    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            BackendKind::Embree => "embree",
            BackendKind::Obvhs => "obvhs",
            BackendKind::Flat => "flat",
            BackendKind::FlatObvhs => "flat+obvhs",
            BackendKind::Brute => "brute",
        }
    }

    /// Every backend, in the order of the help text.
    pub const ALL: [BackendKind; 5] =
        [BackendKind::Embree, BackendKind::Obvhs, BackendKind::Flat, BackendKind::FlatObvhs, BackendKind::Brute];

    /// The backends of this build that trace any scene; the first is taken where the scene does not say otherwise.
    pub fn available() -> &'static [BackendKind] {
        if cfg!(feature = "embree") {
            &[BackendKind::Embree, BackendKind::Obvhs, BackendKind::FlatObvhs, BackendKind::Brute]
        } else {
            &[BackendKind::Obvhs, BackendKind::FlatObvhs, BackendKind::Brute]
        }
    }
}

impl FromStr for BackendKind {
    type Err = String;
    fn from_str(s: &str) -> std::result::Result<Self, String> {
        BackendKind::ALL
            .into_iter()
            .find(|kind| kind.name() == s)
            .ok_or_else(|| format!("'{s}' is not one of {}", BackendKind::ALL.map(BackendKind::name).join(", ")))
    }
}

impl FromStr for QueryMode {
    type Err = String;
    fn from_str(s: &str) -> std::result::Result<Self, String> {
        QueryMode::ALL
            .into_iter()
            .find(|mode| mode.name() == s)
            .ok_or_else(|| format!("'{s}' is not one of single, packet4, packet8, packet16, stream"))
    }
}

/// Options of building a backend.
#[derive(Clone, Debug, PartialEq)]
pub struct BackendOptions {
    /// How closest-hit rays with the incoherent hint are traced.
    pub incoherent: QueryMode,
    /// How closest-hit rays with the coherent hint are traced.
    pub coherent: QueryMode,
    /// How any-hit rays are traced.
    pub shadow: QueryMode,
    /// Robust traversal (no ray may slip between triangles). Off only as a measured choice.
    pub robust: bool,
    /// Whether rays go on past what they hit ([`Backend::closest_hit_past`]): of exact copies of a triangle all are
    /// then kept.
    pub passes: bool,
    /// Instruction set to pin, in the backend's own spelling ("avx2"); `None` lets it choose.
    pub isa: Option<String>,
    /// Threads that build the hierarchy; 0 means all.
    pub build_threads: usize,
}

impl Default for BackendOptions {
    fn default() -> Self {
        BackendOptions {
            incoherent: QueryMode::Packet16,
            coherent: QueryMode::Packet16,
            shadow: QueryMode::Packet16,
            robust: true,
            passes: false,
            isa: None,
            build_threads: 0,
        }
    }
}

impl BackendOptions {
    /// Default options with one query mode for every ray class.
    pub fn with_mode(mode: QueryMode) -> Self {
        BackendOptions { incoherent: mode, coherent: mode, shadow: mode, ..Default::default() }
    }
}

/// What a backend says of itself.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct BackendInfo {
    /// Which one.
    pub kind: BackendKind,
    /// Version of the library behind it: "3.13.5", "0.4.0".
    pub version: String,
    /// Instruction set that runs: "avx512", "avx2", …
    pub isa: String,
    /// Effective mode of incoherent closest-hit rays: a [`QueryMode`] name, or "packet-loop" where a stream was asked
    /// for and the library has none.
    pub rays_incoherent: &'static str,
    /// Effective mode of coherent closest-hit rays.
    pub rays_coherent: &'static str,
    /// Effective mode of any-hit rays.
    pub rays_shadow: &'static str,
    /// Bytes of the acceleration structure, as far as the backend knows.
    pub bvh_bytes: u64,
    /// Triangles it holds (instanced ones once).
    pub triangles: u64,
}

/// What is left of the backend of one frame of an animation for that of the next ([`select::build_after`]).
/// The backend itself, whose type its own kind knows.
#[derive(Default)]
pub struct Kept(Option<Box<dyn Any + Send + Sync>>);

impl Kept {
    /// Everything is built anew.
    pub const NOTHING: Kept = Kept(None);

    /// Of a backend.
    pub fn of<T: Any + Send + Sync>(backend: Box<T>) -> Self {
        Kept(Some(backend))
    }

    /// The backend, if it is of this kind.
    pub fn take<T: Any>(self) -> Option<Box<T>> {
        self.0?.downcast().ok()
    }
}

/// Closest-hit and any-hit queries over batches of 16-lane blocks.
///
/// Calls are thread-safe and deterministic: a lane's result depends on its ray alone, not on its neighbours, on the
/// hint or on the thread (Embree: for one ISA and one query mode).
pub trait Backend: Send + Sync {
    /// Name, version, instruction set, effective query modes.
    fn info(&self) -> &BackendInfo;

    /// What the backend of another frame may take over.
    fn keep(self: Box<Self>) -> Kept {
        Kept::NOTHING
    }

    /// Finds the closest hit of the first `len` rays of `blocks` (lane-major, `len ≤ 16·blocks.len()`): writes the
    /// hit columns and `tfar`; lanes without a hit get `geom = INVALID_ID`. Returns the number of invalid rays, which
    /// count as misses.
    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, hint: Coherence) -> u64;

    /// [`closest_hit`](Backend::closest_hit) for rays that go on: the triangles that `past` lists for a lane do not
    /// count for its ray. `tnear` lies before the last of them by more than the rounding of its distance. Exact copies
    /// of a triangle all count only where [`BackendOptions::passes`] said so.
    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64;

    /// Sets `tfar` to [`batch::BLOCKED`] on each of the first `len` rays that hits anything in `[tnear, tfar]`.
    /// Returns the number of invalid rays; they count as unblocked and keep their `tfar`.
    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, hint: Coherence) -> u64;
}
