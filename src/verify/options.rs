//! Options of a check.

use std::time::Duration;

use crate::backend::BackendKind;
use crate::setters::setters;

/// Options of a check.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct VerifyOptions {
    /// Patches of the finer solution, about.
    pub patches: usize,
    /// Samples per pixel of the path tracer, over both of its runs.
    pub spp: u64,
    /// Wall time for everything: where it is over, there are fewer samples.
    pub time: Option<Duration>,
    /// Columns and rows of the picture.
    pub resolution: (u32, u32),
    /// Largest number of path edges.
    pub max_depth: u32,
    /// Seed of the path tracer.
    pub seed: u64,
    /// Worker threads; 0 means all that the process may use.
    pub threads: usize,
    /// Ray backend of both; `None` takes the fastest of this build.
    pub backend: Option<BackendKind>,
}

impl Default for VerifyOptions {
    fn default() -> Self {
        VerifyOptions {
            patches: 2000,
            spp: 256,
            time: None,
            resolution: (64, 64),
            max_depth: 64,
            seed: 0,
            threads: 0,
            backend: None,
        }
    }
}

impl VerifyOptions {
    setters! {
        patches: = usize,
        spp: = u64,
        time: into Option<Duration>,
        resolution: = (u32, u32),
        max_depth: = u32,
        seed: = u64,
        threads: = usize,
        backend: into Option<BackendKind>,
    }
}
