//! What the statistics and the EXR say of a filtered picture.

use serde::Serialize;

use crate::film::Film;
use crate::film::denoise::Denoised;
use crate::film::estimate::FilteredError;

/// Two-sided 95 % point of the normal distribution.
const NORMAL_95: f64 = 1.959964;

/// A filtered picture, and the error of that as one half of the samples measured it of the other.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct DenoiseStats {
    /// The filter and its version.
    pub filter: String,
    /// The file that it was loaded from.
    pub library: String,
    /// Wall time of filtering, three times where the error was measured.
    pub seconds: f64,
    /// 1 − the sum of the filtered picture over that of the picture; `null` where that is black.
    pub energy_removed: Option<f64>,
    /// The measured error; `null` until every pixel has samples in both halves of the film.
    pub measured: Option<FilteredError>,
}

impl DenoiseStats {
    /// Of `film` and what the filter (its name, its file) made of it in so many seconds.
    pub fn of(film: &Film, denoised: &Denoised, (filter, library): (String, String), seconds: f64) -> Self {
        let before: f64 = film.pixels.iter().flat_map(|pixel| pixel.mean().into_iter().take(3)).sum();
        let after: f64 = denoised.rgb.iter().flatten().map(|&value| f64::from(value)).sum();
        let energy_removed = Some(1.0 - after / before).filter(|share| share.is_finite());
        DenoiseStats { filter, library, seconds, energy_removed, measured: denoised.error }
    }

    /// What an EXR says of it, as JSON: all but where the filter was and how long it took.
    pub fn attribute(&self) -> String {
        let DenoiseStats { filter, energy_removed, measured, .. } = self;
        serde_json::json!({"filter": filter, "energy_removed": energy_removed, "measured": measured}).to_string()
    }

    /// The measured error for people: "4.1 % (95 %: 3.9 to 4.4 %) of half the samples, measured; 21.3 % without".
    pub fn told(&self) -> Option<String> {
        let error = self.measured?;
        let percent = |relmse: f64| 100.0 * relmse.max(0.0).sqrt();
        let reach = NORMAL_95 * error.relmse_stderr;
        let [low, high] = [error.relmse - reach, error.relmse + reach].map(percent);
        let (filtered, before) = (percent(error.relmse), percent(error.unfiltered_relmse));
        let interval = format!("{filtered:.1} % (95 %: {low:.1} to {high:.1} %)");
        Some(format!("{interval} of half the samples, measured; {before:.1} % without"))
    }
}
