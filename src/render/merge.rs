//! Parts of one picture, rendered apart and saved as [`Checkpoint`]s, become the picture: ranges of samples, windows of
//! pixels, or both. The result has the bits of one render, whatever the parts (`film/blocks.rs`).
//!
//! Files are read twice, one at a time, so that memory holds the picture and one part: first what they are, then what
//! they hold.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::checkpoint::{About, Checkpoint};
use super::identity::MAY_DIFFER;
use super::result::{Render, State, Totals};
use crate::error::{Error, Result};
use crate::film::Film;
use crate::film::blocks::Blocks;
use crate::film::splats::AS_PIXELS;
use crate::plan::options::Crop;
use crate::transport::counters::Counters;

/// What a merge may overlook.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct MergeOptions {
    /// Samples that are missing, of some pixels or of all.
    pub allow_gaps: bool,
    /// Names of [`MAY_DIFFER`] in which parts may differ.
    pub accept_different: Vec<String>,
}

/// A picture made of parts.
#[derive(Debug)]
#[non_exhaustive]
pub struct Merged {
    /// The picture, with the sums of all counts and times.
    pub render: Render,
    /// What belongs to it.
    pub about: About,
    /// The parts in the order of their samples.
    pub parts: Vec<Part>,
    /// What is missing, one clause each; nothing unless gaps are allowed.
    pub gaps: Vec<String>,
}

/// What a part is.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Part {
    /// Its file.
    pub path: PathBuf,
    /// Its pixels.
    pub window: Crop,
    /// Its first sample and the one behind its last.
    pub samples: (u64, u64),
    resolution: (u32, u32),
    about: About,
    empty: Film,
}

/// Joins the parts in `paths`.
///
/// # Errors
/// [`Error::Io`] for files that cannot be read or are no checkpoints; [`Error::Option`], which names the files, for
/// parts of different pictures, samples that come twice, samples that are missing, parts that were stopped before their
/// end, and parts that do not begin at a multiple of their size, rounded up to a power of two.
pub fn merge(paths: &[PathBuf], options: &MergeOptions) -> Result<Merged> {
    let mut parts = paths.iter().map(|path| look(path)).collect::<Result<Vec<Part>>>()?;
    let none = || Error::Option { option: "merge", problem: "a part at least is needed".into() };
    let first = parts.first().cloned().ok_or_else(none)?;
    let mut about = first.about.clone();
    for part in &parts[1..] {
        check_same(&first, part, options, &mut about.accepted)?;
    }
    parts.sort_by_key(|part| (part.samples.0, part.window.y, part.window.x));
    check_overlaps(&parts)?;
    let window = around(&parts);
    let gaps = gaps(&parts, window);
    if let Some(gap) = gaps.first().filter(|_| !options.allow_gaps) {
        let problem = format!("{gap}; --allow-gaps writes the picture all the same");
        return Err(Error::Option { option: "merge", problem });
    }

    let mut empty = first.empty.resized(window);
    empty.first_sample = parts[0].samples.0;
    let mut totals = Totals { film: Blocks::of(vec![empty]), splats: None, counters: Counters::default() };
    let mut render_time = Duration::ZERO;
    let (mut splats, spp) = (None, parts.iter().map(|part| part.samples.1).max().unwrap_or(0) - parts[0].samples.0);
    for part in &parts {
        let Checkpoint { render, .. } = Checkpoint::restore(&part.path)?;
        if let Some(of_part) = &render.splats {
            let whole = splats.get_or_insert_with(|| of_part.of_window(window));
            whole.merge(of_part);
        }
        render_time += render.render_time;
        totals.counters.merge(&render.counters);
        for block in render.into_totals().film.films() {
            totals.film.push_film(block);
        }
    }
    if let Some(mut splats) = splats {
        // Parts are whole.
        splats.set_samples(if gaps.is_empty() { spp } else { AS_PIXELS });
        totals.splats = Some(Arc::new(splats));
    }
    let render = State { totals, render_time, check: None }.into_render().complete();
    Ok(Merged { render, about, parts, gaps })
}

fn refuse<T>(path: &Path, problem: String) -> Result<T> {
    Err(Error::Part { path: path.into(), problem })
}

/// What the file is.
fn look(path: &Path) -> Result<Part> {
    let Checkpoint { render, about } = Checkpoint::restore(path)?;
    let (film, spp, goal) = (&render.film, render.film.spp(), about.goal);
    if spp.min < spp.max || !render.splats.as_ref().is_none_or(|splats| splats.has_just(spp.min)) {
        return refuse(path, "it was stopped within a pass of samples: resume it to its end".into());
    }
    if let (None, Some(asked)) = (goal.error, goal.spp)
        && spp.min < asked
    {
        return refuse(path, format!("it was stopped after {} of {asked} samples: resume it to its end", spp.min));
    }
    let first = film.first_sample;
    let (size, end) = (spp.min.checked_next_power_of_two(), first.checked_add(spp.min));
    let (Some(end), true) = (end, size.is_some_and(|size| first.is_multiple_of(size))) else {
        let problem = "which is no multiple of their number rounded up to a power of two: the sums would not be \
                       those of one render";
        return refuse(path, format!("it has {} samples from {first} on, {problem}", spp.min));
    };
    Ok(Part {
        path: path.into(),
        window: film.window,
        samples: (first, end),
        resolution: film.resolution,
        empty: film.resized(Crop { width: 0, height: 0, ..film.window }),
        about,
    })
}

/// Refuses parts of different pictures; what is accepted is written down.
fn check_same(first: &Part, part: &Part, options: &MergeOptions, accepted: &mut String) -> Result<()> {
    let other = first.path.display();
    if first.resolution != part.resolution {
        return refuse(&part.path, format!("it belongs to a picture of another size than {other}"));
    }
    for (name, here, there) in first.about.identity.differences(&part.about.identity) {
        let may_differ = MAY_DIFFER.contains(&name.as_str());
        if may_differ && options.accept_different.contains(&name) {
            accepted.push_str(&format!("{name}: {here}, {there}\n"));
            continue;
        }
        let hint = match may_differ {
            true => format!("; --accept-different {name} joins them all the same"),
            false => String::new(),
        };
        return refuse(&part.path, format!("its {name} is {there}, that of {other} is {here}{hint}"));
    }
    if !first.empty.is_like_in_layers(&part.empty) {
        return refuse(&part.path, format!("its layers are other than those of {other}"));
    }
    Ok(())
}

fn check_overlaps(parts: &[Part]) -> Result<()> {
    for (i, a) in parts.iter().enumerate() {
        for b in &parts[i + 1..] {
            // Sorted by the first sample.
            if b.samples.0 >= a.samples.1 {
                break;
            }
            let meet = |a: (u32, u32), b: (u32, u32)| a.0 < b.0 + b.1 && b.0 < a.0 + a.1;
            let (u, v) = (a.window, b.window);
            if meet((u.x, u.width), (v.x, v.width)) && meet((u.y, u.height), (v.y, v.height)) {
                let ((from, to), (start, end), other) = (b.samples, a.samples, a.path.display());
                return refuse(&b.path, format!("its samples {from}..{to} overlap {start}..{end} of {other}"));
            }
        }
    }
    Ok(())
}

/// The smallest window that holds all parts.
fn around(parts: &[Part]) -> Crop {
    let least = |of: fn(&Crop) -> u32| parts.iter().map(|part| of(&part.window)).min().unwrap_or(0);
    let most = |of: fn(&Crop) -> u32| parts.iter().map(|part| of(&part.window)).max().unwrap_or(0);
    let (x, y) = (least(|w| w.x), least(|w| w.y));
    Crop { x, y, width: most(|w| w.x + w.width) - x, height: most(|w| w.y + w.height) - y }
}

/// What is missing between samples 0 and the last one that any pixel has; at most a clause for each rectangle that the
/// borders of the parts cut out of `window`.
fn gaps(parts: &[Part], window: Crop) -> Vec<String> {
    let end = parts.iter().map(|part| part.samples.1).max().unwrap_or(0);
    let cuts = |of: fn(&Crop) -> (u32, u32), all: (u32, u32)| {
        let ends = |(start, size): (u32, u32)| [start, start + size];
        let mut cuts: Vec<u32> = parts.iter().flat_map(|part| ends(of(&part.window))).chain(ends(all)).collect();
        cuts.sort_unstable();
        cuts.dedup();
        cuts
    };
    let columns = cuts(|w| (w.x, w.width), (window.x, window.width));
    let rows = cuts(|w| (w.y, w.height), (window.y, window.height));
    let mut gaps = Vec::new();
    for row in rows.windows(2) {
        for column in columns.windows(2) {
            let covers =
                |w: &Crop| w.x <= column[0] && column[1] <= w.x + w.width && w.y <= row[0] && row[1] <= w.y + w.height;
            let mut done = 0;
            let mut before: Option<&Part> = None;
            let mut missing = |from: u64, to: u64, before: Option<&Part>| {
                let place = format!("{}x{}+{}+{}", column[1] - column[0], row[1] - row[0], column[0], row[0]);
                let behind = before.map_or(String::new(), |part| format!(" behind {}", part.path.display()));
                gaps.push(format!("samples {from}..{to} of the pixels {place} are missing{behind}"));
            };
            for part in parts.iter().filter(|part| covers(&part.window)) {
                if part.samples.0 > done {
                    missing(done, part.samples.0, before);
                }
                (done, before) = (part.samples.1, Some(part));
            }
            if done < end {
                missing(done, end, before);
            }
        }
    }
    gaps
}
