//! `pathspace render --frames`: many pictures of one scene. What does not change between frames is loaded and built
//! once: a scene without animations wholly (a turntable moves the camera alone), of another one the materials,
//! textures, environment, and the hierarchies of what stands still.
//!
//! A frame that is broken off ends the sequence; a frame that misses its target, or has samples that are not finite,
//! does not, and the exit code is that of the first such frame.

use std::cell::RefCell;
use std::f32::consts::TAU;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::{Affine3A, DVec3, Vec3};

use super::args::RenderArgs;
use super::frames;
use super::job::{self, Fallback, Outputs, STREAM};
use super::keeping;
use super::live::watch::Watchers;
use super::output::EXIT_OK;
use super::progress::{self, PartOf};
use super::render::{Frame, render_frame, warn};
use super::report::Verbosity;
use super::signal::Signals;
use super::units::ShutterAngle;
use crate::backend::Kept;
use crate::error::{Error, Result};
use crate::film::exr::text_attribute;
use crate::film::oidn::Oidn;
use crate::math::hash::mix;
use crate::render::checkpoint::Checkpoint;
use crate::render::identity::{digest_of, digest_of_files};
use crate::render::{Absent, CameraChoice, RenderOptions, Renderer};
use crate::scene::{Camera, LoadOptions, Scene, Shutter};
use crate::stats::Seconds;

/// Runs the command.
pub fn run(args: &RenderArgs) -> Result<u8> {
    let result = Sequence::new(args).and_then(|sequence| sequence.run());
    if let Err(error) = &result {
        progress::failed(args.progress, error);
    }
    result
}

/// The frames of one command.
struct Sequence<'s> {
    args: &'s RenderArgs,
    frames: Vec<u32>,
    /// With places for the number.
    outputs: Outputs,
    signals: Signals,
    verbosity: Verbosity,
    /// Who sees the frames while they are rendered.
    watchers: RefCell<Watchers>,
    /// What filters them.
    denoiser: Option<Oidn>,
}

/// How the sequence went so far.
struct Progress {
    exit: u8,
    done: usize,
    /// Those of them that were there.
    there: usize,
}

impl<'s> Sequence<'s> {
    fn new(args: &'s RenderArgs) -> Result<Self> {
        let signals = Signals::listen()?;
        job::check(&args.settings)?;
        let outputs = Outputs::check(args)?;
        let frames = args.sequence.list();
        if args.sequence.skip_existing && outputs.exr.is_none() {
            let problem = "only an .exr says of which scene and settings it is".into();
            return Err(Error::Option { option: "--skip-existing", problem });
        }
        let denoiser = args.denoise.open(args.settings.threads)?;
        warn(args, &outputs);
        let verbosity = Verbosity::of(args.quiet, args.verbose);
        let name = args.output.as_ref().unwrap_or(&args.scene).display().to_string();
        let watchers = RefCell::new(Watchers::start(&args.live, args.report.is_some(), &name, verbosity)?);
        Ok(Sequence { args, frames, outputs, signals, verbosity, watchers, denoiser })
    }

    fn run(&self) -> Result<u8> {
        let start = Instant::now();
        let path = job::scene_file(&self.args.scene)?;
        if path.as_os_str() == STREAM {
            return Err(Error::Option { option: "--frames", problem: "the scene cannot come from stdin".into() });
        }
        self.frames.iter().try_for_each(|&frame| self.load_options(frame).map(drop))?;
        // Where a camera is placed to see all does not depend on which frames are rendered, here or elsewhere.
        let mut scene = Scene::load_with(&path, &self.load_options(self.args.sequence.frame_start)?)?;
        // Decided once: lamps that move would switch it on and off.
        let environment = &self.args.settings.environment;
        let studio = job::wants_studio(&scene, environment, Fallback::of(self.args));
        self.prepare(&mut scene, studio, Absent::Refused)?;
        self.spare(&scene)?;
        self.verbosity.warnings(&scene.warnings);
        let files = self.digest(&scene)?;
        let mut progress = Progress { exit: EXIT_OK, done: 0, there: 0 };
        Outputs::sweep(&self.frames.iter().map(|&frame| self.of_frame(frame)).collect::<Vec<_>>());
        let moves = self.args.sequence.frames.is_some() && !scene.motion.animations.is_empty();
        if !moves || self.args.sequence.turntable.is_some() {
            self.still(&mut scene, files, start, &mut progress)?;
        } else {
            self.moving((&path, scene, studio), files, start, &mut progress)?;
        }
        match progress.there {
            0 => {}
            1 => self.verbosity.note("1 frame is there already"),
            n => self.verbosity.note(format_args!("{n} frames are there already")),
        }
        Ok(progress.exit)
    }

    /// The files that are read are none of any frame's outputs.
    fn spare(&self, scene: &Scene) -> Result<()> {
        let environment = job::environment_file(&self.args.settings.environment);
        let more = [Some(&self.args.scene), environment.as_ref(), self.args.reference.as_ref()];
        let more = more.into_iter().flatten().filter_map(|path| path.canonicalize().ok());
        let inputs: Vec<PathBuf> = scene.inputs.iter().cloned().chain(more).collect();
        self.frames.iter().try_for_each(|&frame| self.of_frame(frame).spare(&inputs))
    }

    /// A scene that is the same in all frames but for the camera: one renderer.
    fn still(&self, scene: &mut Scene, files: u64, start: Instant, progress: &mut Progress) -> Result<()> {
        let base = self.options(scene);
        let cameras = match self.args.sequence.turntable {
            Some(turns) => self.turn(scene, &base, turns)?,
            None => vec![base.camera.clone(); self.frames.len()],
        };
        let scene = &*scene;
        let mut renderer: Option<Renderer> = None;
        let mut start = start;
        for (&frame, camera) in self.frames.iter().zip(cameras) {
            let options = self.seeded(&base, frame).camera(camera);
            if self.is_over(progress) {
                break;
            }
            let outputs = self.of_frame(frame);
            let key = self.key(files, &options, frame)?;
            if self.is_there(&outputs, &key) {
                progress.there += 1;
            } else {
                let (earlier, resume) = self.earlier(frame)?;
                let options = self.settled(options, earlier.as_ref());
                let renderer = match &mut renderer {
                    Some(renderer) => {
                        renderer.retarget(&options)?;
                        renderer
                    }
                    none => none.insert(self.build(scene, &options, Kept::NOTHING)?),
                };
                self.render(renderer, (frame, &outputs, key, options), (earlier, resume), start, progress)?;
            }
            progress.done += 1;
            start = Instant::now();
        }
        Ok(())
    }

    /// A scene that is another one in each frame; `scene` is that at the start of the animations.
    fn moving(
        &self,
        (path, mut scene, studio): (&Path, Scene, bool),
        files: u64,
        start: Instant,
        progress: &mut Progress,
    ) -> Result<()> {
        let (mut start, mut kept) = (start, Kept::NOTHING);
        let mut at = self.args.sequence.frame_start;
        let placed = self.placed(&scene);
        for &frame in &self.frames {
            if self.is_over(progress) {
                break;
            }
            let outputs = self.of_frame(frame);
            let options = self.seeded(&self.options(&scene), frame);
            let key = self.key(files, &options, frame)?;
            if self.is_there(&outputs, &key) {
                progress.there += 1;
            } else {
                if at != frame {
                    let left_out = scene.left_out.clone();
                    scene = Scene::load_again(path, &self.load_options(frame)?, &scene)?;
                    self.prepare(&mut scene, studio, Absent::Passed)?;
                    // All frames say the same, whatever this one calls for.
                    scene.left_out = left_out;
                    self.keep_placed(&mut scene, placed.as_ref());
                    at = frame;
                }
                let (earlier, resume) = self.earlier(frame)?;
                let options = self.settled(options, earlier.as_ref());
                let renderer = self.build(&scene, &options, std::mem::take(&mut kept))?;
                self.render(&renderer, (frame, &outputs, key, options), (earlier, resume), start, progress)?;
                kept = renderer.keep();
            }
            progress.done += 1;
            start = Instant::now();
        }
        Ok(())
    }

    /// Lights a loaded scene, by the studio or as it is, puts its camera where the settings say, and leaves out what
    /// they say.
    fn prepare(&self, scene: &mut Scene, studio: bool, absent: Absent) -> Result<()> {
        let settings = &self.args.settings;
        job::light_as(scene, &settings.environment, studio);
        job::prepare(settings, scene, absent)
    }

    /// The camera that `--camera-orbit` has put somewhere in `scene`, and the origin that it is relative to.
    fn placed(&self, scene: &Scene) -> Option<(Camera, DVec3)> {
        self.args.settings.view.camera_orbit?;
        Some((self.options(scene).camera.of(scene)?.clone(), scene.origin))
    }

    /// Puts the camera where it was `placed` at the start: the orbit is not fitted anew to what has moved.
    fn keep_placed(&self, scene: &mut Scene, placed: Option<&(Camera, DVec3)>) {
        let chosen = self.options(scene).camera;
        let place = |chosen: &Camera| scene.cameras.iter().position(|camera| std::ptr::eq(camera, chosen));
        let chosen = chosen.of(scene).and_then(place);
        if let (Some((camera, origin)), Some(index)) = (placed, chosen) {
            let moved = camera.moved((*origin - scene.origin).as_vec3());
            scene.cameras[index].world_from_camera = moved.world_from_camera;
        }
    }

    /// Makes a renderer, if it fits into memory.
    fn build<'a>(&self, scene: &'a Scene, options: &RenderOptions, kept: Kept) -> Result<Renderer<'a>> {
        options.check_memory_for(scene)?;
        let renderer = Renderer::new_after(scene, options.clone(), kept)?;
        self.verbosity.detail(renderer.record());
        self.verbosity.detail(renderer.need());
        Ok(renderer)
    }

    /// Whether a signal has come.
    fn is_over(&self, progress: &mut Progress) -> bool {
        if let Some(code) = self.signals.exit_code() {
            progress.exit = code;
        }
        progress.exit >= 128
    }

    fn render(
        &self,
        renderer: &Renderer,
        (frame, outputs, key, options): (u32, &Outputs, String, RenderOptions),
        (earlier, resume): (Option<Checkpoint>, Option<PathBuf>),
        start: Instant,
        progress: &mut Progress,
    ) -> Result<()> {
        self.verbosity.note(format_args!("frame {frame} ({} of {})", progress.done + 1, self.frames.len()));
        outputs.forget();
        let part = PartOf { frame, done: progress.done, frames: self.frames.len() };
        let build = renderer.build_time().as_secs_f64();
        let load = (start.elapsed().as_secs_f64() - build).max(0.0);
        let frame = Frame {
            args: self.args,
            outputs,
            signals: &self.signals,
            options,
            resume: resume.as_deref(),
            key: Some(key),
            part: Some(part),
            watchers: &self.watchers,
            denoiser: self.denoiser.as_ref(),
            seconds: Seconds { load, build, ..Seconds::default() },
            start,
        };
        let exit = render_frame(renderer, frame, earlier)?;
        if progress.exit == EXIT_OK || exit >= 128 {
            progress.exit = exit;
        }
        Ok(())
    }

    fn of_frame(&self, frame: u32) -> Outputs {
        self.outputs.of_frame(frame, self.frames.len() > 1)
    }

    /// The state that a frame goes on from, if there is one.
    fn earlier(&self, frame: u32) -> Result<(Option<Checkpoint>, Option<PathBuf>)> {
        let path = self.args.production.resume.as_ref();
        let path = path.map(|path| frames::file(path, frame, self.frames.len() > 1)).filter(|path| path.exists());
        Ok((keeping::earlier(path.as_deref())?, path))
    }

    fn settled(&self, mut options: RenderOptions, earlier: Option<&Checkpoint>) -> RenderOptions {
        keeping::settle(&mut options, &self.args.production, earlier);
        options
    }

    /// Whether a frame is there already, of the same scene and settings.
    fn is_there(&self, outputs: &Outputs, key: &str) -> bool {
        let exr = outputs.exr.as_deref().filter(|_| self.args.sequence.skip_existing && outputs.exist());
        exr.is_some_and(|path| text_attribute(path, "pathspace/key").as_deref() == Some(key))
    }

    fn options(&self, scene: &Scene) -> RenderOptions {
        job::options(self.args, scene)
    }

    /// With the seed of a frame.
    fn seeded(&self, options: &RenderOptions, frame: u32) -> RenderOptions {
        let seed = if self.args.sequence.fixed_seed { options.seed } else { mix(options.seed, frame.into()) };
        options.clone().seed(seed)
    }

    fn load_options(&self, frame: u32) -> Result<LoadOptions> {
        let settings = &self.args.settings;
        let shutter = match self.args.sequence.turntable {
            Some(_) => settings.content.at.or(settings.content.shutter),
            None => Some(self.shutter(frame)?),
        };
        let (content, environment, fallback) = (&settings.content, &settings.environment, Fallback::of(self.args));
        let options = job::load_options(content, environment, settings.files, settings.textures, fallback)?;
        Ok(options.shutter(shutter))
    }

    /// When the shutter of a frame is open.
    fn shutter(&self, frame: u32) -> Result<Shutter> {
        let sequence = &self.args.sequence;
        let Some(number) = frame.checked_sub(sequence.frame_start) else {
            let problem = format!("frame {frame} lies before {}, the start of the animations", sequence.frame_start);
            return Err(Error::Option { option: "--frame-start", problem });
        };
        let time = f64::from(number);
        let (before, behind) = match sequence.shutter_angle {
            None => (0.0, 0.0),
            Some(ShutterAngle { share, centred: true }) => (share / 2.0, share / 2.0),
            Some(ShutterAngle { share, centred: false }) => (0.0, share),
        };
        let (open, close) = ((time - before).max(0.0), time + behind);
        Shutter::new(open / sequence.fps, close / sequence.fps)
    }

    /// Digest of the scene's files and the environment's.
    fn digest(&self, scene: &Scene) -> Result<u64> {
        let environment = job::environment_file(&self.args.settings.environment);
        let environment = environment.as_deref().map(digest_of).transpose()?;
        Ok(mix(digest_of_files(scene)?, environment.unwrap_or(0)))
    }

    /// Fingerprint of everything that a frame's picture is made of, but for threads and build.
    fn key(&self, files: u64, options: &RenderOptions, frame: u32) -> Result<String> {
        let load = self.load_options(frame)?;
        let settings = &self.args.settings;
        let environment = &settings.environment;
        let environment = (
            environment.env.is_some().then(|| job::environment_file(environment).is_some()),
            (environment.env_rotation, environment.env_intensity),
        );
        let (view, look) = (&settings.view, &self.args.look);
        let previews = (look.exposure, look.tone_map, look.transparent, look.background, self.args.quick);
        let settings = format!(
            "{:?} {:?} {:?} {environment:?} {view:?} {:?} {:?} {:?} {:?}",
            options.clone().threads(0),
            load.shutter,
            (&load.scene, &load.variant, &load.animation, &settings.without),
            (load.missing_texture, load.texture_budget.decoder, Fallback::of(self.args)),
            (self.args.half, self.args.exr),
            self.args.sequence.turntable.map(|turns| (turns, frame)),
            (!self.outputs.previews.is_empty() || self.outputs.report.is_some()).then_some(previews),
        );
        let key = settings.bytes().fold(files, |key, byte| mix(key, byte.into()));
        let key = if self.args.denoise.denoise { mix(key, 1) } else { key };
        Ok(format!("{key:016x}"))
    }

    /// Adds a camera for each frame of a turntable of so many frames.
    fn turn(&self, scene: &mut Scene, options: &RenderOptions, turns: u32) -> Result<Vec<CameraChoice>> {
        let Some(camera) = options.camera.of(scene).cloned() else {
            // The plan says what is wrong with it.
            return Ok(vec![options.camera.clone(); self.frames.len()]);
        };
        let (mut least, mut most) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for instance in &scene.instances {
            let positions = &scene.meshes[instance.mesh.index()].positions;
            let low = positions.iter().copied().fold(Vec3::INFINITY, Vec3::min);
            let high = positions.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
            for corner in 0..8 {
                let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let corner = instance.world_from_object.transform_point3(Vec3::new(pick(0), pick(1), pick(2)));
                (least, most) = (least.min(corner), most.max(corner));
            }
        }
        let middle = (least + most) / 2.0;
        let mut choices = Vec::new();
        for &frame in &self.frames {
            let step = frame.wrapping_sub(1) % turns;
            if step == 0 {
                choices.push(options.camera.clone());
                continue;
            }
            let turn = Affine3A::from_rotation_y(TAU * step as f32 / turns as f32);
            let around = Affine3A::from_translation(middle) * turn * Affine3A::from_translation(-middle);
            let name = format!("{}, turned {step} of {turns}", camera.name);
            choices.push(CameraChoice::Index(scene.cameras.len()));
            scene.cameras.push(Camera { name, world_from_camera: around * camera.world_from_camera, ..camera });
        }
        Ok(choices)
    }
}
