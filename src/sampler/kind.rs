//! The samplers by name: spelling on the command line and in reports.

use std::fmt;
use std::str::FromStr;

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
            .ok_or_else(|| format!("'{s}' is not one of sobol, independent"))
    }
}
