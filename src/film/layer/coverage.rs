//! `coverage.Y`: share of the pixel that surfaces and media cover, mean over the pixel filter; of what is passed
//! through, the share that it takes, by the mean over channels. `A` of the beauty counts an environment that is seen as
//! well; this layer does not.

use super::kind::{Layer, Values, components};
use crate::plan::aov::{Aov, Gathers};

impl Aov {
    /// Share that surfaces cover.
    pub const COVERAGE: Aov = Aov::new("coverage", Gathers::FirstHit);
}

pub(super) static LAYER: Layer = Layer {
    aov: Aov::COVERAGE,
    about: "share of the pixel that surfaces cover",
    values: Values::Mean(3),
    channels: |_| components("coverage", &["Y"]),
};
