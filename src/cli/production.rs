//! Arguments of renders that outlive their process, are parts of a picture or many pictures: checkpoints, ranges of
//! samples, frames.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::PossibleValuesParser;
use clap::{ArgGroup, Args};

use super::frames::{self, Frames};
use super::units::{self, ShutterAngle};
use crate::error::{Error, Result};
use crate::film::atomic::check_writable;
use crate::render::identity::MAY_DIFFER;

/// How often the state is saved where only a file is named.
const EVERY: Duration = Duration::from_secs(60);

/// Options of `render` about its state.
#[derive(Debug, Default, Args)]
pub struct ProductionArgs {
    /// Save the state of the render each DURATION [default: 60s], when a signal ends it, and at its end, to be gone on
    /// with by --resume or joined by `merge` [default FILE: the output's name with .checkpoint]
    #[arg(
        long, value_names = ["DURATION", "FILE"], num_args = 1..=2, conflicts_with = "pixel",
        help_heading = "Production"
    )]
    pub checkpoint: Vec<PathBuf>,
    /// Go on from a saved state: to the limits given here, else to those that it was to come to. Size, seed and all
    /// other settings must be the same. Unless --checkpoint names another file, the state is saved to this one
    #[arg(long, value_name = "FILE", conflicts_with_all = ["pixel", "error_log"], help_heading = "Production")]
    pub resume: Option<PathBuf>,
    /// Go on although the state is of another instruction set or build: the picture is as right, but not the same in
    /// every bit; EXR and checkpoint say so
    #[arg(
        long, value_name = "LIST", value_delimiter = ',', requires = "resume",
        value_parser = PossibleValuesParser::new(MAY_DIFFER), help_heading = "Production"
    )]
    pub accept_different: Vec<String>,
    /// Render samples A to B − 1 of each pixel alone, a part for `merge`: A is a multiple of the power of two that is
    /// not below B − A. The part is the --checkpoint, by default the output's name with .checkpoint
    #[arg(
        long, value_name = "A..B", value_parser = units::sample_range, conflicts_with_all = ["spp", "error", "pixel"],
        help_heading = "Production"
    )]
    pub sample_range: Option<(u64, u64)>,
    /// Keep what the survey of the scene says of light paths: it is read from FILE where that is there, else made and
    /// written to it. A survey of another scene, view or setting is refused
    #[arg(long, value_name = "FILE", help_heading = "Production")]
    pub survey: Option<PathBuf>,
    /// Exit with 0 instead of 3 when time or samples end the render before its error target
    #[arg(long, requires = "error", help_heading = "Production")]
    pub best_effort: bool,
}

/// Options of `render` about sequences of frames.
#[derive(Debug, Args)]
#[command(group(ArgGroup::new("sequence").args(["frames", "turntable"]).multiple(true)))]
pub struct SequenceArgs {
    /// Render these frames: 1-100, 1-100x2 (every second), 1-100:2 (the same), 1,5,9-12. Names of outputs have a place
    /// for the number, f.####.exr or f.%04d.exr; without one .0001 goes before the extension
    #[arg(
        long, value_name = "LIST", value_parser = frames::list, help_heading = "Frames",
        conflicts_with_all = ["pixel", "at", "shutter", "error_log", "sample_range", "survey"]
    )]
    pub frames: Option<Frames>,
    /// Frames a second of the animations' time
    #[arg(
        long, value_name = "N", default_value = "24", value_parser = units::rate, requires = "frames",
        conflicts_with = "turntable", help_heading = "Frames"
    )]
    pub fps: f64,
    /// Frame at which the animations' time is 0
    #[arg(
        long,
        value_name = "FRAME",
        default_value_t = 0,
        requires = "frames",
        conflicts_with = "turntable",
        help_heading = "Frames"
    )]
    pub frame_start: u32,
    /// Open the shutter for so much of a frame, 360 is all of it: from the frame's time on, or with `,centred` as long
    /// before as behind it (not before time 0) [default: no length, the scene stands still]
    #[arg(
        long, value_name = "DEG[,centred]", value_parser = units::shutter_angle, requires = "frames",
        conflicts_with = "turntable", help_heading = "Frames"
    )]
    pub shutter_angle: Option<ShutterAngle>,
    /// The same random numbers in every frame, so that noise stands still [default: a seed for each frame, made of
    /// --seed and its number]
    #[arg(long, requires = "sequence", help_heading = "Frames")]
    pub fixed_seed: bool,
    /// Skip frames whose outputs are there and whose EXR is of the same scene and settings
    #[arg(long, requires = "sequence", help_heading = "Frames")]
    pub skip_existing: bool,
    /// Turn the camera once around the vertical axis through the scene's middle, in N frames from 1 on
    #[arg(
        long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000),
        conflicts_with_all = ["pixel", "error_log", "sample_range", "survey"], help_heading = "Frames"
    )]
    pub turntable: Option<u32>,
}

impl SequenceArgs {
    /// Whether there is a sequence.
    pub fn is_on(&self) -> bool {
        self.frames.is_some() || self.turntable.is_some()
    }

    /// The frames, in order.
    pub fn list(&self) -> Vec<u32> {
        match (&self.frames, self.turntable) {
            (Some(frames), _) => frames.0.clone(),
            (None, Some(turns)) => (1..=turns).collect(),
            (None, None) => Vec::new(),
        }
    }
}

impl ProductionArgs {
    /// How often the state is saved, and where.
    ///
    /// # Errors
    /// [`Error::Option`] where it cannot be told.
    pub fn checkpoint(&self, output: Option<&Path>) -> Result<Option<(Duration, PathBuf)>> {
        let refuse = |problem: &str| Err(Error::Option { option: "--checkpoint", problem: problem.into() });
        let duration = |path: &Path| path.to_str().and_then(|text| units::duration(text).ok());
        match &self.checkpoint[..] {
            [] if self.resume.is_some() => Ok(self.resume.clone().filter(|file| may_replace(file)).map(|f| (EVERY, f))),
            // A part without its state is no part.
            [] => match (self.sample_range, output) {
                (None, _) => Ok(None),
                (Some(_), Some(output)) => Ok(Some((EVERY, output.with_extension("checkpoint")))),
                (Some(_), None) => refuse("a part needs a file: --checkpoint FILE, or -o FILE.exr for one beside it"),
            },
            [only] => match (duration(only), output) {
                (None, _) => Ok(Some((EVERY, only.clone()))),
                (Some(every), Some(output)) => Ok(Some((every, output.with_extension("checkpoint")))),
                (Some(_), None) => refuse("without an output the file must be named: --checkpoint 60s FILE"),
            },
            [every, file, ..] => match duration(every) {
                Some(every) => Ok(Some((every, file.clone()))),
                None => refuse("write --checkpoint DURATION FILE, as in --checkpoint 60s part.checkpoint"),
            },
        }
    }
}

/// Whether a file may be written over: it and its folder are not read-only.
fn may_replace(file: &Path) -> bool {
    !std::fs::metadata(file).is_ok_and(|data| data.permissions().readonly()) && check_writable(file).is_ok()
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// Oracle: written by hand.
    #[test]
    fn checkpoints_have_a_time_and_a_file() {
        let read = |words: &[&str], output: Option<&str>| {
            let args = ProductionArgs { checkpoint: words.iter().map(PathBuf::from).collect(), ..Default::default() };
            args.checkpoint(output.map(Path::new)).map_err(|error| error.to_string())
        };
        let expected = |seconds, file: &str| Ok(Some((Duration::from_secs(seconds), PathBuf::from(file))));
        assert_eq!(read(&[], Some("a.exr")), Ok(None));
        assert_eq!(read(&["10s"], Some("out/a.exr")), expected(10, "out/a.checkpoint"));
        assert_eq!(read(&["part.7"], None), expected(60, "part.7"));
        assert_eq!(read(&["2m", "part"], Some("a.exr")), expected(120, "part"));
        assert!(read(&["2m"], None).is_err() && read(&["part", "2m"], None).is_err());
        // A part has its state beside it.
        let part = ProductionArgs { sample_range: Some((0, 4)), ..Default::default() };
        let beside = part.checkpoint(Some(Path::new("p.exr"))).map_err(|error| error.to_string());
        assert_eq!(beside, expected(60, "p.checkpoint"));
        assert!(part.checkpoint(None).is_err());
        // A state is kept where it was, if it can be.
        let folder = tempfile::tempdir().expect("a temporary folder");
        let resumed = |name: &str| {
            let resume = Some(folder.path().join(name));
            ProductionArgs { resume, ..Default::default() }.checkpoint(Some(Path::new("a.exr"))).expect("settled")
        };
        assert_eq!(resumed("p.checkpoint"), Some((EVERY, folder.path().join("p.checkpoint"))));
        assert_eq!(resumed("gone/p.checkpoint"), None);
        let read_only = folder.path().join("r");
        std::fs::write(&read_only, "").expect("a writable folder");
        let permissions = std::fs::metadata(&read_only).expect("a file").permissions();
        std::fs::set_permissions(&read_only, PermissionsExt::from_mode(permissions.mode() & 0o444))
            .expect("an own file");
        assert_eq!(resumed("r"), None);
    }
}
