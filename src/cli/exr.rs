//! How EXR files are written: what their channels are called and which primaries their colours have. Neither changes
//! what is rendered, nor previews.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use crate::film::exr::ExrOptions;
use crate::film::pass_names::PassNames;
use crate::film::primaries::Primaries;

/// What an EXR is like.
#[derive(Clone, Copy, Debug, Args)]
pub struct ExrArgs {
    /// Call the channels of the EXR as Blender or Nuke do: ViewLayer.Combined.R, or albedo.red
    #[arg(long, value_name = "NAMES", value_parser = names_parser(), ignore_case = true, help_heading = "Output")]
    pub pass_names: Option<PassNames>,
    /// Primaries of the colours in the EXR, as its chromaticities say; variance and stderr stay in rec709 [default:
    /// rec709]
    #[arg(long, value_name = "SPACE", value_parser = space_parser(), ignore_case = true, help_heading = "Output")]
    pub colorspace: Option<Primaries>,
}

impl ExrArgs {
    /// Name of an option that was given.
    pub fn given(&self) -> Option<&'static str> {
        let names = self.pass_names.map(|_| "--pass-names");
        names.or(self.colorspace.map(|_| "--colorspace"))
    }

    /// `exr` as it was asked for.
    pub fn apply(&self, exr: ExrOptions) -> ExrOptions {
        exr.pass_names(self.pass_names.unwrap_or_default()).primaries(self.colorspace.unwrap_or_default())
    }
}

fn names_parser() -> impl TypedValueParser<Value = PassNames> {
    PossibleValuesParser::new(PassNames::ALL.map(PassNames::name)).try_map(|s| s.to_lowercase().parse())
}

fn space_parser() -> impl TypedValueParser<Value = Primaries> {
    PossibleValuesParser::new(Primaries::ALL.map(Primaries::name)).try_map(|s| s.to_lowercase().parse())
}
