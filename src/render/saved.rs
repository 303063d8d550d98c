//! A stopped render as a file, to be gone on with by [`Renderer::resume`](super::Renderer::resume): the film with all
//! layers in blocks of samples, the counts, and the time that it took. Format: `film/saved.rs`, kind 2; the body is the
//! number of blocks, the film of each, what light paths added, then the counts, the time, and where an error target is
//! checked next.
//!
//! Limit: scene and options are not in it; that they are the same is up to the caller, or to a
//! [`Checkpoint`](super::checkpoint::Checkpoint). A forecast is not kept.

use std::io::{self, Read, Write};
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::result::{Render, State, StopReason};
use crate::error::Result;
use crate::film::saved::{self, WordReader, WordWriter, damaged};
use crate::film::splats::Splats;
use crate::film::{Film, blocks};
use crate::transport::counters::{Counters, NONFINITE_LISTED, NonFinite};
use crate::transport::truncation::Truncated;

/// Kind of a file that holds a render.
const RENDER: u64 = 2;

/// Blocks of a pixel with as many samples as there are numbers for them.
const MOST_BLOCKS: u64 = 64;

/// Stands for a bounce that is not known.
const UNKNOWN: u64 = u64::MAX;

/// Reasons by their number in a file.
const REASONS: [StopReason; 6] = [
    StopReason::Spp,
    StopReason::Time,
    StopReason::Error,
    StopReason::Callback,
    StopReason::Fault,
    StopReason::Texture,
];

impl Render {
    /// Writes the render, all or nothing. [`restore`](Self::restore) and [`Renderer::resume`](super::Renderer::resume)
    /// then come to the bits of a render without the stop.
    ///
    /// ```
    /// # use glam::Vec3;
    /// # use pathspace::scene::builder::SceneBuilder;
    /// use pathspace::render::Render;
    /// use pathspace::{RenderOptions, Renderer};
    /// # let folder = tempfile::tempdir().expect("a temporary folder");
    /// # let path = folder.path().join("half-way");
    /// # let mut builder = SceneBuilder::new();
    /// # let lamp = builder.emitter(Vec3::ZERO, Vec3::ONE);
    /// # builder.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), lamp);
    /// # builder.camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 1.0);
    /// # let scene = builder.build();
    /// let options = RenderOptions::new(8, 8);
    /// Renderer::new(&scene, options.clone().spp(4))?.render()?.save(&path)?;
    ///
    /// let renderer = Renderer::new(&scene, options.spp(8))?;
    /// let resumed = renderer.resume(Render::restore(&path)?)?;
    /// assert_eq!(resumed.film.hash(), renderer.render()?.film.hash());
    /// # Ok::<(), pathspace::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) naming `path`.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        saved::save(path.as_ref(), RENDER, |words| write_render(self, words))
    }

    /// Reads what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// As [`Film::restore`].
    pub fn restore(path: impl AsRef<Path>) -> Result<Self> {
        saved::restore(path.as_ref(), RENDER, read_render)
    }
}

/// The body of a saved render.
pub(super) fn write_render<W: Write>(render: &Render, words: &mut WordWriter<W>) -> io::Result<()> {
    let films = if render.blocks.is_empty() { std::slice::from_ref(&render.film) } else { &render.blocks };
    write_parts(
        (films, render.splats.as_deref(), &render.counters),
        render.render_time,
        render.stop,
        render.check,
        words,
    )
}

/// The body of a running render that is saved.
pub(super) fn write_state<W: Write>(state: &State, words: &mut WordWriter<W>) -> io::Result<()> {
    let films = state.totals.film.films();
    let used = films.iter().take_while(|film| film.spp().max > 0).count().max(1);
    let parts = (&films[..used], state.totals.splats.as_deref(), &state.totals.counters);
    write_parts(parts, state.render_time, StopReason::Callback, state.check, words)
}

fn write_parts<W: Write>(
    (films, splats, counters): (&[Film], Option<&Splats>, &Counters),
    render_time: Duration,
    stop: StopReason,
    check: Option<(f64, u64)>,
    words: &mut WordWriter<W>,
) -> io::Result<()> {
    words.put(films.len() as u64)?;
    films.iter().try_for_each(|film| film.write_words(words))?;
    words.put(splats.is_some().into())?;
    splats.map_or(Ok(()), |splats| splats.write_words(words))?;
    write_counters(counters, words)?;
    words.put(render_time.as_secs())?;
    words.put(render_time.subsec_nanos().into())?;
    let reason = REASONS.iter().position(|reason| *reason == stop).expect("all reasons are listed");
    words.put(reason as u64)?;
    let (target, next) = check.unwrap_or_default();
    words.put(target.to_bits())?;
    words.put(next)
}

/// Reads a body.
pub(super) fn read_render<R: Read>(words: &mut WordReader<R>) -> io::Result<Render> {
    let (mut film, mut blocks) = read_films(words)?;
    let splats = match words.take()? {
        0 => None,
        _ => Some(Splats::read_words(words, &film)?),
    };
    if let Some(splats) = &splats {
        if blocks.is_empty() {
            blocks.push(film.clone());
        }
        splats.add_to(&mut film);
    }
    let splats = splats.map(Arc::new);
    let counters = read_counters(words)?;
    let (seconds, nanos) = (words.take()?, words.take_u32()?);
    if nanos >= 1_000_000_000 {
        return Err(damaged("a time is out of range"));
    }
    let reason = REASONS.get(words.take()? as usize).ok_or_else(|| damaged("an unknown reason to stop"))?;
    let render_time = Duration::new(seconds, nanos);
    let check = (f64::from_bits(words.take()?), words.take()?);
    let check = Some(check).filter(|(target, _)| *target > 0.0);
    Ok(Render { film, blocks, splats, counters, render_time, stop: *reason, check, forecast: None, fault: None })
}

/// The films of a render's blocks: their sum, and they themselves where there is more than one.
fn read_films<R: Read>(words: &mut WordReader<R>) -> io::Result<(Film, Vec<Film>)> {
    let count = words.take()?;
    if !(1..=MOST_BLOCKS).contains(&count) {
        return Err(damaged("a number of blocks that no render has"));
    }
    let mut films = Vec::new();
    for _ in 0..count {
        let film = Film::read_words(words)?;
        if films.first().is_some_and(|first| !film.is_like(first)) {
            return Err(damaged("its blocks are of different pictures"));
        }
        films.push(film);
    }
    match films.len() {
        1 => Ok((films.remove(0), Vec::new())),
        _ => Ok((blocks::total(&films), films)),
    }
}

fn write_counters<W: Write>(counters: &Counters, words: &mut WordWriter<W>) -> io::Result<()> {
    // By name, so that a new count is not forgotten.
    let Counters {
        paths,
        rays_camera,
        rays_bounce,
        rays_shadow,
        invalid_rays,
        nonfinite,
        nonfinite_first,
        capped_paths,
        truncated,
        texture_lookups,
    } = counters;
    for count in [paths, rays_camera, rays_bounce, rays_shadow, invalid_rays, nonfinite, capped_paths, texture_lookups]
    {
        words.put(*count)?;
    }
    words.put(truncated.paths)?;
    for sum in truncated.sums() {
        words.put(sum as u64)?;
        words.put((sum >> 64) as u64)?;
    }
    words.put(nonfinite_first.len() as u64)?;
    for met in nonfinite_first {
        words.put(met.pixel.0.into())?;
        words.put(met.pixel.1.into())?;
        words.put(met.sample)?;
        words.put(met.bounce.map_or(UNKNOWN, u64::from))?;
    }
    Ok(())
}

fn read_counters<R: Read>(words: &mut WordReader<R>) -> io::Result<Counters> {
    let mut counters = Counters {
        paths: words.take()?,
        rays_camera: words.take()?,
        rays_bounce: words.take()?,
        rays_shadow: words.take()?,
        invalid_rays: words.take()?,
        nonfinite: words.take()?,
        capped_paths: words.take()?,
        texture_lookups: words.take()?,
        ..Counters::default()
    };
    let paths = words.take()?;
    let mut sums = [0; 3];
    for sum in &mut sums {
        *sum = u128::from(words.take()?) | u128::from(words.take()?) << 64;
    }
    counters.truncated = Truncated::of_sums(paths, sums);
    let listed = words.take()?;
    if listed > NONFINITE_LISTED as u64 {
        return Err(damaged("a list is longer than it can be"));
    }
    for _ in 0..listed {
        let (pixel, sample, bounce) = ((words.take_u32()?, words.take_u32()?), words.take()?, words.take()?);
        let bounce = if bounce == UNKNOWN { None } else { u32::try_from(bounce).ok() };
        counters.nonfinite_first.push(NonFinite { pixel, sample, bounce });
    }
    Ok(counters)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::Aov;
    use crate::plan::options::Crop;

    /// Oracle: what was saved. Deterministic.
    #[test]
    fn counts_and_times_come_back() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("render");
        let film = Film::with_layers((2, 2), Crop { x: 0, y: 0, width: 2, height: 1 }, &[Aov::DEPTH]);
        let met = |sample, bounce| NonFinite { pixel: (1, 0), sample, bounce };
        let counters = Counters {
            paths: 1,
            rays_camera: 2,
            rays_bounce: 3,
            rays_shadow: 4,
            invalid_rays: 5,
            nonfinite: 6,
            nonfinite_first: vec![met(7, None), met(1 << 40, Some(3))],
            capped_paths: 8,
            truncated: Truncated::of_sums(9, [1, 1 << 100, u128::MAX]),
            texture_lookups: 10,
        };
        let render_time = Duration::new(5, 999_999_999);
        let (stop, blocks) = (StopReason::Callback, vec![film.clone(), film.clone()]);
        let film = blocks::total(&blocks);
        let check = Some((0.01, 48));
        let saved =
            Render { film, blocks, splats: None, counters, render_time, stop, check, forecast: None, fault: None };
        saved.save(&path).expect("a writable folder");
        let restored = Render::restore(&path).expect("just saved");
        assert_eq!((&restored.film, &restored.blocks), (&saved.film, &saved.blocks));
        assert_eq!(restored.counters, saved.counters);
        assert_eq!((restored.render_time, restored.stop, restored.check), (saved.render_time, saved.stop, check));
        assert!(Film::restore(&path).is_err(), "it holds more than a film");
    }
}
