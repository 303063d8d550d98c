//! A render that can be gone on with, or merged with others, by a program that has not begun it: its state
//! ([`Render::save`]) with what its bits depend on, what it was to come to, and what its picture says of itself.
//! Format: `film/saved.rs`, kind 3.

use std::io::{self, Read, Write};
use std::path::Path;

use super::identity::Identity;
use super::renderer::Renderer;
use super::result::{Render, State};
use super::{saved, schedule};
use crate::error::Result;
use crate::film::cryptomatte::Matte;
use crate::film::exr::{ExrOptions, ViewMatrices};
use crate::film::layer;
use crate::film::saved::{WordReader, WordWriter, damaged, restore, save};
use crate::plan::Aov;

/// Kind of a file that holds a checkpoint.
const CHECKPOINT: u64 = 3;

/// A state and what it belongs to.
#[derive(Debug)]
#[non_exhaustive]
pub struct Checkpoint {
    /// The state.
    pub render: Render,
    /// What belongs to it.
    pub about: About,
}

/// What belongs to a state.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct About {
    /// What its bits depend on.
    pub identity: Identity,
    /// What it was to come to.
    pub goal: Goal,
    /// Differences that it was gone on with in spite of, one a line; empty where there are none.
    pub accepted: String,
    /// Layers besides the beauty, in the order in which they were asked for.
    pub aovs: Vec<Aov>,
    /// Largest number of path edges.
    pub max_depth: u32,
    /// Attributes of the picture.
    attributes: [Option<String>; 4],
    /// Names of layers of ids.
    mattes: Vec<Matte>,
    view: Option<ViewMatrices>,
}

/// What a render was to come to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Goal {
    /// Samples per pixel.
    pub spp: Option<u64>,
    /// Relative RMSE.
    pub error: Option<f64>,
    /// Samples per pixel before the error may stop it.
    pub min_spp: u64,
}

impl About {
    /// What belongs to the renders of `renderer`.
    ///
    /// # Errors
    /// As [`Renderer::identity`].
    pub fn of(renderer: &Renderer) -> Result<Self> {
        let (plan, limits) = (renderer.plan(), &renderer.plan().limits);
        let exr = renderer.exr_attributes();
        Ok(About {
            identity: renderer.identity()?,
            goal: Goal { spp: schedule::samples(limits), error: limits.error, min_spp: limits.min_spp },
            accepted: String::new(),
            aovs: plan.aovs.clone(),
            max_depth: plan.max_depth,
            attributes: [exr.seed.map(|seed| seed.to_string()), exr.backend, exr.isa, exr.plan],
            mattes: exr.mattes,
            view: exr.view,
        })
    }

    /// Writes `render` with this as a [`Checkpoint`].
    ///
    /// # Errors
    /// As [`Checkpoint::save`].
    pub fn save(&self, render: &Render, path: &Path) -> Result<()> {
        save(path, CHECKPOINT, |words| {
            write_about(self, words)?;
            saved::write_render(render, words)
        })
    }

    /// [`save`](Self::save) of a running render.
    ///
    /// # Errors
    /// As [`Checkpoint::save`].
    pub fn save_state(&self, state: &State, path: &Path) -> Result<()> {
        save(path, CHECKPOINT, |words| {
            write_about(self, words)?;
            saved::write_state(state, words)
        })
    }

    /// What an EXR of `render` says: other layers and all attributes.
    pub fn exr_options(&self, render: &Render) -> ExrOptions {
        let [seed, backend, isa, plan] = self.attributes.clone();
        ExrOptions::default()
            .channels(render.film.channels(&self.aovs, self.max_depth))
            .render_seconds(render.render_time.as_secs_f64())
            .seed(seed.and_then(|seed| seed.parse::<u64>().ok()))
            .backend(backend)
            .isa(isa)
            .plan(plan)
            .mattes(self.mattes.clone())
            .view(self.view)
            .accepted(Some(self.accepted.clone()).filter(|accepted| !accepted.is_empty()))
    }
}

impl Checkpoint {
    /// `render` with what belongs to it.
    pub fn new(render: Render, about: About) -> Self {
        Checkpoint { render, about }
    }

    /// Writes it, all or nothing: an older file of this name stays until the new one is complete.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) naming `path`.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<()> {
        self.about.save(&self.render, path.as_ref())
    }

    /// Reads what [`save`](Self::save) wrote.
    ///
    /// # Errors
    /// [`Error::Io`](crate::Error::Io) naming `path`: it cannot be read, is no checkpoint, or is damaged.
    pub fn restore(path: impl AsRef<Path>) -> Result<Self> {
        restore(path.as_ref(), CHECKPOINT, |words| {
            Ok(Checkpoint { about: read_about(words)?, render: saved::read_render(words)? })
        })
    }
}

fn write_about<W: Write>(about: &About, words: &mut WordWriter<W>) -> io::Result<()> {
    let About { identity, goal, accepted, aovs, max_depth, attributes, mattes, view } = about;
    words.put(identity.values.len() as u64)?;
    for (name, value) in &identity.values {
        words.put_text(name)?;
        words.put_text(value)?;
    }
    words.put(goal.spp.unwrap_or(0))?;
    words.put(goal.error.unwrap_or(0.0).to_bits())?;
    words.put(goal.min_spp)?;
    words.put_text(accepted)?;
    words.put_text(&aovs.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(","))?;
    words.put((*max_depth).into())?;
    for attribute in attributes {
        words.put(attribute.is_some().into())?;
        words.put_text(attribute.as_deref().unwrap_or_default())?;
    }
    // Files without such layers have no word of them.
    if has_ids(aovs) {
        words.put(mattes.len() as u64)?;
        for Matte { layer, manifest } in mattes {
            words.put_text(layer)?;
            words.put_text(manifest)?;
        }
    }
    words.put(view.is_some().into())?;
    let numbers = view.iter().flat_map(|view| view.world_to_camera.into_iter().chain(view.world_to_ndc));
    numbers.into_iter().try_for_each(|number| words.put(number.to_bits().into()))
}

fn read_about<R: Read>(words: &mut WordReader<R>) -> io::Result<About> {
    let mut values = Vec::new();
    for _ in 0..words.take()? {
        values.push((words.take_text()?, words.take_text()?));
    }
    let (spp, error) = (words.take()?, f64::from_bits(words.take()?));
    let goal = Goal { spp: (spp > 0).then_some(spp), error: (error > 0.0).then_some(error), min_spp: words.take()? };
    let (accepted, names) = (words.take_text()?, words.take_text()?);
    let aovs = names.split(',').filter(|name| !name.is_empty()).map(str::parse).collect::<Result<Vec<Aov>, _>>();
    let aovs = aovs.map_err(|problem| damaged(format!("layer {problem}")))?;
    let max_depth = words.take_u32()?;
    let mut attributes = [const { None }; 4];
    for attribute in &mut attributes {
        let present = words.take()? == 1;
        *attribute = Some(words.take_text()?).filter(|_| present);
    }
    let mut mattes = Vec::new();
    if has_ids(&aovs) {
        for _ in 0..words.take()? {
            mattes.push(Matte { layer: words.take_text()?, manifest: words.take_text()? });
        }
    }
    let view = match words.take()? {
        0 => None,
        _ => Some(ViewMatrices { world_to_camera: read_matrix(words)?, world_to_ndc: read_matrix(words)? }),
    };
    Ok(About { identity: Identity { values }, goal, accepted, aovs, max_depth, attributes, mattes, view })
}

fn has_ids(aovs: &[Aov]) -> bool {
    aovs.iter().any(|&aov| layer::find(aov).is_of_ids())
}

fn read_matrix<R: Read>(words: &mut WordReader<R>) -> io::Result<[f32; 16]> {
    let mut numbers = [0.0; 16];
    for number in &mut numbers {
        *number = f32::from_bits(words.take_u32()?);
    }
    Ok(numbers)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::options::RenderOptions;
    use crate::scene::builder::SceneBuilder;
    use glam::Vec3;

    /// Oracle: what was saved.
    #[test]
    fn checkpoints_come_back_with_what_belongs_to_them() {
        let mut b = SceneBuilder::new();
        let white = b.lambert(Vec3::ONE);
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let scene = b.build();
        let options = RenderOptions::new(8, 4).spp(3).aovs([Aov::SPP, Aov::CRYPTO_OBJECT, Aov::ALBEDO]);
        let renderer = Renderer::new(&scene, options).expect("valid options");
        let mut about = About::of(&renderer).expect("no files to read");
        about.accepted = "isa: avx2 → avx512".into();
        about.goal.error = Some(0.125);
        let saved = Checkpoint::new(renderer.render().expect("renders"), about);
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("state");
        saved.save(&path).expect("a writable folder");
        let restored = Checkpoint::restore(&path).expect("just saved");
        assert_eq!(restored.about, saved.about);
        assert_eq!(restored.render.film.digest(), saved.render.film.digest());
        assert!(Render::restore(&path).is_err() && Checkpoint::restore(folder.path()).is_err());
        let (a, b) = (restored.about.exr_options(&saved.render), renderer.exr_options(&saved.render));
        assert_eq!((a.seed, &a.plan, a.view, a.channels.len()), (b.seed, &b.plan, b.view, b.channels.len()));
        assert_eq!((&a.mattes, a.mattes.len()), (&b.mattes, 1));
        assert_eq!(a.accepted, Some("isa: avx2 → avx512".into()));
    }
}
