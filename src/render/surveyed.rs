//! Surveys as a file: made once, used by all renders of the same view, those of a farm's tasks among them.
//!
//! Format: `film/saved.rs`, kind 4; the body is what surveys depend on, as named values, then the parts, each behind a
//! word that says whether it is there: the light paths for each pixel and sample, and why so many; of the guide what
//! else it depends on, why it is there or not, and its numbers in pairs. A part that a render needs and the file has
//! not is made and added. Another scene, view or setting is refused by the name of what differs; seed, samples, layers,
//! machine and build may be others, as any survey leaves pictures unbiased.

use std::io::{self, Read, Write};
use std::path::Path;

use super::guiding;
use super::identity::Identity;
use super::renderer::Renderer;
use super::survey;
use crate::error::{Error, Result};
use crate::film::saved::{WordReader, WordWriter, damaged, restore, save};
use crate::plan::options::{Guiding, LightPaths, RenderOptions};
use crate::shading::guide::Guide;

/// Kind of a file that holds a survey.
const SURVEY: u64 = 4;

/// What it depends on of what the bits of pictures depend on, besides its size.
const OF_PICTURES: [&str; 17] = [
    "without",
    "scene",
    "content",
    "environment",
    "shutter",
    "camera",
    "lens",
    "fog",
    "filter",
    "max-depth",
    "roulette",
    "strategy",
    "sampler",
    "texture-filter",
    "fold-normals",
    "multiscatter",
    "backfaces",
];

/// What surveys of a view have found, in a file where one is given.
pub(super) struct Surveys<'p> {
    path: Option<&'p Path>,
    identity: Identity,
    light_paths: Option<survey::Found>,
    guide: Option<(Identity, guiding::Found)>,
    /// Whether there is something that the file has not.
    grown: bool,
    /// Whether the render goes by any of it.
    used: bool,
}

impl<'p> Surveys<'p> {
    /// Those of what `renderer` sees, from the file at `path` where it is there.
    ///
    /// # Errors
    /// [`Error::Option`] for surveys of something else, which it names; [`Error::Io`] naming a file.
    pub fn open(renderer: &Renderer, path: Option<&'p Path>) -> Result<Self> {
        let identity = if path.is_some() { renderer.identity_of_survey()? } else { Identity::default() };
        let mut surveys = Surveys { path, identity, light_paths: None, guide: None, grown: false, used: false };
        if let Some(path) = path.filter(|path| path.exists()) {
            let (there, light_paths, guide) = restore(path, SURVEY, read)?;
            same(path, &there, &surveys.identity)?;
            (surveys.light_paths, surveys.guide) = (light_paths, guide);
        }
        Ok(surveys)
    }

    /// What is known of light paths, else what `survey` finds.
    ///
    /// # Errors
    /// Those of `survey`.
    pub fn light_paths(&mut self, survey: impl FnOnce() -> Result<survey::Found>) -> Result<survey::Found> {
        self.used = true;
        if let Some(found) = &self.light_paths {
            return Ok(found.clone());
        }
        self.grown = true;
        Ok(self.light_paths.insert(survey()?).clone())
    }

    /// What is known of a guide that depends on `settings` besides, else what `survey` finds.
    ///
    /// # Errors
    /// [`Error::Option`] for a guide of other settings, and those of `survey`.
    pub fn guide(
        &mut self,
        settings: Identity,
        survey: impl FnOnce() -> Result<guiding::Found>,
    ) -> Result<guiding::Found> {
        self.used = true;
        if let Some((there, found)) = &self.guide {
            same(self.path.unwrap_or(Path::new("")), there, &settings)?;
            return Ok(found.clone());
        }
        self.grown = true;
        Ok(self.guide.insert((settings, survey()?)).1.clone())
    }

    /// Writes what is new; name of the file, if the render goes by it.
    ///
    /// # Errors
    /// [`Error::Io`] naming the file.
    pub fn close(self) -> Result<Option<String>> {
        let Some(path) = self.path.filter(|_| self.used) else { return Ok(None) };
        if self.grown {
            save(path, SURVEY, |words| self.write(words))?;
        }
        Ok(path.file_name().map(|name| name.to_string_lossy().into_owned()))
    }

    fn write(&self, words: &mut WordWriter<&mut dyn Write>) -> io::Result<()> {
        write_identity(&self.identity, words)?;
        words.put(self.light_paths.is_some().into())?;
        if let Some(found) = &self.light_paths {
            words.put(found.share.to_bits().into())?;
            words.put_text(&found.reason)?;
        }
        words.put(self.guide.is_some().into())?;
        if let Some((settings, found)) = &self.guide {
            write_identity(settings, words)?;
            words.put_text(&found.reason)?;
            words.put(found.guide.is_some().into())?;
            found.guide.as_ref().map_or(Ok(()), |guide| write_guide(guide, words))?;
        }
        Ok(())
    }
}

impl Renderer<'_> {
    /// Leaves techniques to surveys, where the options do.
    ///
    /// # Errors
    /// [`Error::Option`] for a file of something else, [`Error::Io`] naming a file, and those of the surveys.
    pub(super) fn survey_techniques(&mut self, options: &RenderOptions) -> Result<()> {
        let mut surveys = Surveys::open(self, options.survey.as_deref())?;
        if self.light_paths.is_some() && options.light_paths == LightPaths::Auto {
            let found = surveys.light_paths(|| self.survey())?;
            self.plan.set_light_paths(found.share, found.reason);
            self.light_paths = self.light_paths.take().filter(|_| found.share > 0.0);
        }
        if self.plan.features.guide {
            let asked = options.guiding == Guiding::On;
            let found = surveys.guide(self.settings_of_guide(asked), || self.learn(asked))?;
            self.plan.set_guide(found.record(), found.reason);
            self.guide = found.guide;
        }
        self.plan.survey = surveys.close()?;
        Ok(())
    }

    fn identity_of_survey(&self) -> Result<Identity> {
        let mut identity = self.identity()?;
        identity.values.retain(|(name, _)| OF_PICTURES.contains(&name.as_str()));
        let (width, height) = self.survey_size();
        identity.values.push(("size".into(), format!("{width}x{height} for the survey")));
        Ok(identity)
    }
}

fn same(path: &Path, there: &Identity, here: &Identity) -> Result<()> {
    let Some((name, there, here)) = there.differences(here).into_iter().next() else { return Ok(()) };
    let problem = format!("{}: its {name} is {there}, here it is {here}", path.display());
    Err(Error::Option { option: "--survey", problem })
}

fn write_identity(identity: &Identity, words: &mut WordWriter<&mut dyn Write>) -> io::Result<()> {
    words.put(identity.values.len() as u64)?;
    identity.values.iter().try_for_each(|(name, value)| {
        words.put_text(name)?;
        words.put_text(value)
    })
}

fn write_guide(guide: &Guide, words: &mut WordWriter<&mut dyn Write>) -> io::Result<()> {
    let bits: Vec<u32> = guide.bits().collect();
    words.put(guide.nodes() as u64)?;
    words.put(guide.cells().0 as u64)?;
    bits.chunks(2).try_for_each(|pair| words.put(pair.iter().rev().fold(0, |word, &bits| word << 32 | u64::from(bits))))
}

type Found = (Identity, Option<survey::Found>, Option<(Identity, guiding::Found)>);

fn read<R: Read>(words: &mut WordReader<R>) -> io::Result<Found> {
    let identity = read_identity(words)?;
    let light_paths = match is_there(words)? {
        false => None,
        true => {
            let (share, reason) = (f32::from_bits(words.take_u32()?), words.take_text()?);
            if !(0.0..=1.0).contains(&share) {
                return Err(damaged("a share of light paths that no survey has"));
            }
            Some(survey::Found { share, reason })
        }
    };
    let guide = match is_there(words)? {
        false => None,
        true => {
            let (settings, reason) = (read_identity(words)?, words.take_text()?);
            let guide = if is_there(words)? { Some(read_guide(words)?) } else { None };
            Some((settings, guiding::Found { guide, reason }))
        }
    };
    Ok((identity, light_paths, guide))
}

fn is_there<R: Read>(words: &mut WordReader<R>) -> io::Result<bool> {
    match words.take()? {
        0 => Ok(false),
        1 => Ok(true),
        _ => Err(damaged("a survey of another version of this program")),
    }
}

fn read_identity<R: Read>(words: &mut WordReader<R>) -> io::Result<Identity> {
    let mut identity = Identity::default();
    for _ in 0..words.take()? {
        identity.values.push((words.take_text()?, words.take_text()?));
    }
    Ok(identity)
}

fn read_guide<R: Read>(words: &mut WordReader<R>) -> io::Result<Guide> {
    let wrong = || damaged("a guide that no survey has");
    let counts = [words.take_u32()?, words.take_u32()?].map(|count| count as usize);
    let [nodes, cells] = counts;
    let bits = Guide::bits_of(nodes, cells).ok_or_else(wrong)?;
    words.expect(bits.div_ceil(2) as u64)?;
    let mut all = Vec::with_capacity(bits + 1);
    for _ in 0..bits.div_ceil(2) {
        let word = words.take()?;
        all.extend([word as u32, (word >> 32) as u32]);
    }
    all.truncate(bits);
    Guide::of_bits(nodes, &all).ok_or_else(wrong)
}
