//! `--denoise`: the filter is loaded before anything else is done, and run when the render has ended.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;

use crate::error::Result;
use crate::film::Film;
use crate::film::denoise::Denoised;
use crate::film::exr::ExrOptions;
use crate::film::look::Look;
use crate::film::oidn::Oidn;
use crate::machine;
use crate::plan::Aov;
use crate::stats::denoise::DenoiseStats;

/// What denoisers want, and the one that is called.
#[derive(Debug, Args)]
pub struct DenoiseArgs {
    /// Write base colours and normals as denoisers want them, of what is seen in perfect mirrors and through smooth
    /// glass: --aov denoise_albedo,denoise_normal
    #[arg(long, help_heading = "Output")]
    pub denoiser_layers: bool,
    /// Filter the picture by Open Image Denoise, if it is there (`pip install pyoidn`), into a layer of its own,
    /// denoised.R/G/B, and measure the error of that. The beauty stays as it is; previews show the layer. Implies
    /// --denoiser-layers
    #[arg(long, help_heading = "Output")]
    pub denoise: bool,
    /// Library of Open Image Denoise 2, or a folder that has it [default: PATHSPACE_OIDN, else where the system and
    /// Python have libraries]
    #[arg(long, value_name = "PATH", requires = "denoise", help_heading = "Output")]
    pub oidn: Option<PathBuf>,
}

impl DenoiseArgs {
    /// The layers that are implied, of those that are not named besides.
    pub fn layers(&self, named: &[Aov]) -> impl Iterator<Item = Aov> {
        let implied = [Aov::DENOISE_ALBEDO, Aov::DENOISE_NORMAL].map(|aov| (aov, named.contains(&aov)));
        let wanted = self.denoiser_layers || self.denoise;
        implied.into_iter().filter(move |(_, named)| wanted && !named).map(|(aov, _)| aov)
    }

    /// The option that makes layers, if one is given.
    pub fn given(&self) -> Option<&'static str> {
        let options = [("--denoise", self.denoise), ("--denoiser-layers", self.denoiser_layers)];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// The filter, if it is asked for, for so many threads (0: all).
    ///
    /// # Errors
    /// [`Error::Backend`](crate::Error::Backend) where it is not there.
    pub fn open(&self, threads: Option<u32>) -> Result<Option<Oidn>> {
        let threads = machine::threads(threads.unwrap_or(0) as usize);
        self.denoise.then(|| Oidn::open(self.oidn.as_deref(), threads)).transpose()
    }
}

/// A filtered picture and what is written about it.
pub struct Filtered {
    denoised: Denoised,
    /// Its record.
    pub stats: DenoiseStats,
}

impl Filtered {
    /// Filters the picture of `film`.
    ///
    /// # Errors
    /// [`Error::Backend`](crate::Error::Backend) with the filter's reason.
    pub fn of(film: &Film, filter: &Oidn) -> Result<Self> {
        let start = Instant::now();
        let denoised = film.denoise(filter)?;
        let (filter, library) = (filter.to_string(), filter.file().display().to_string());
        let stats = DenoiseStats::of(film, &denoised, (filter, library), start.elapsed().as_secs_f64());
        Ok(Filtered { denoised, stats })
    }

    /// Adds it to an EXR.
    pub fn add_to(&self, exr: &mut ExrOptions) {
        exr.channels.extend(self.denoised.channels());
        exr.denoised = Some(self.stats.attribute());
    }

    /// Previews that show it in the place of the beauty.
    pub fn shown_by(&self, look: &Look) -> Look {
        look.clone().filtered(self.denoised.rgb.clone())
    }
}
