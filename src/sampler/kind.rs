//! The samplers: names, help, and the type of each, which loops are compiled for.

use std::fmt;
use std::str::FromStr;

use super::independent::IndependentScheme;
use super::scheme::Scheme;
use super::sobol::SobolScheme;
use crate::plan::options::SamplerKind;

impl SamplerKind {
    /// Every sampler, in the order of the help text.
    pub const ALL: [SamplerKind; 2] = [SamplerKind::Sobol, SamplerKind::Independent];

    /// Name on the command line and in reports.
    pub fn name(self) -> &'static str {
        match self {
            SamplerKind::Sobol => "sobol",
            SamplerKind::Independent => "independent",
        }
    }

    /// What `--help` says of it.
    pub fn about(self) -> &'static str {
        match self {
            SamplerKind::Sobol => "Owen-scrambled Sobol points",
            SamplerKind::Independent => "Independent uniform numbers",
        }
    }

    /// Runs `task` with the type of this sampler.
    #[inline(always)]
    pub fn with<T: WithScheme>(self, task: T) -> T::Output {
        match self {
            SamplerKind::Sobol => task.run::<SobolScheme>(),
            SamplerKind::Independent => task.run::<IndependentScheme>(),
        }
    }
}

/// What [`SamplerKind::with`] runs.
pub trait WithScheme {
    /// What it returns.
    type Output;

    /// Runs with the sampler `S`.
    fn run<S: Scheme>(self) -> Self::Output;
}

impl fmt::Display for SamplerKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SamplerKind {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        SamplerKind::ALL
            .into_iter()
            .find(|kind| kind.name() == s)
            .ok_or_else(|| format!("'{s}' is not one of {}", SamplerKind::ALL.map(SamplerKind::name).join(", ")))
    }
}
