//! `pathspace view`: the live page of a scene, with a camera that is moved there. A view is rendered at a quarter of
//! its size first, so that a dragged camera answers at once, then in full until it is complete or another is asked for.

use std::ops::ControlFlow;
use std::time::Duration;

use glam::DVec3;

use super::args::ViewerArgs;
use super::job::{self, Fallback};
use super::live::page::ViewChange;
use super::live::watch::Page;
use super::quick;
use super::report::{Verbosity, stderr_line};
use super::signal::Signals;
use super::waiting::Waiting;
use crate::error::Result;
use crate::plan::Aov;
use crate::render::{
    Crop, Guiding, Lens, LightPaths, Progress, Render, RenderOptions, Renderer, Snapshot, StopReason, Strategy,
};
use crate::scene::orbit::{Distance, Orbit};
use crate::scene::{Camera, Projection, Scene};

/// By how much the first look at a view is smaller on each side.
const COARSE: u32 = 4;

/// Samples of the first look: two, so that it has an error.
const COARSE_SPP: u64 = 2;

/// How often a finished view looks for signals.
const PAUSE: Duration = Duration::from_millis(100);

/// Runs the command until a signal ends it.
pub fn run(args: &ViewerArgs) -> Result<u8> {
    let verbosity = Verbosity::of(args.quiet, false);
    let signals = Signals::listen()?;
    job::check(&args.settings)?;
    // Before the scene is loaded, so that an address that is taken is known at once.
    let mut page = Page::start(&args.address, args.serve_anywhere, verbosity)?;
    let waiting = Waiting::begin(verbosity, "loading and building");
    let scene = &job::load(&args.scene, &args.settings, Fallback::Studio)?;
    let asked = quick::sized(&args.settings, job::settings(&args.settings, scene)).spp(args.spp);
    let mut renderer = Renderer::new(scene, asked.clone().guiding(unguided(asked.guiding)))?;
    let (full, techniques) = decided(asked, &renderer);
    let (coarse, window) = (coarse(&full), renderer.plan().window);
    drop(waiting);
    let studio = args.settings.environment.env.is_none() && scene.environment.is_some();
    verbosity.warnings(&scene.warnings);
    verbosity.note("Ctrl-C ends it");
    signals.defer();

    let camera = scene.cameras[renderer.plan().camera].clone();
    let home = standing(scene, &camera, full.lens);
    page.shows_views((full.width, full.height), args.spp, (studio, &techniques), home.clone());
    let mut seen = Seen { camera, view: home.clone(), home };
    let (mut good, mut fine) = (seen.clone(), false);
    loop {
        if let Err(error) = seen.aim(&mut renderer, if fine { &full } else { &coarse }, &full) {
            if good == seen {
                return Err(error);
            }
            // No camera can stand where a client wanted it: the last good view stays.
            verbosity.note(format_args!("pathspace: warning: {error}"));
            (seen, fine) = (good.clone(), false);
            continue;
        }
        good.clone_from(&seen);
        page.begin(&renderer, window, Some(seen.view.clone()));
        let render = {
            let pages = std::cell::RefCell::new(&mut page);
            let progress = |_: &Progress| {
                let page = pages.borrow();
                // Clients mean pixels of the full picture.
                if fine {
                    page.answer_replays(&renderer);
                }
                // A first look is finished, or a camera that is dragged would show nothing.
                match signals.exit_code().is_some() || (fine && page.shared().has_view()) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            renderer.render_watched(progress, |snapshot: &Snapshot| {
                let mut page = pages.borrow_mut();
                page.show(&renderer, snapshot.film, snapshot.elapsed, snapshot.spp);
                if fine {
                    page.answer(&renderer, snapshot.film);
                }
            })?
        };
        match render.stop {
            StopReason::Callback => {}
            StopReason::Fault | StopReason::Texture => tell_faults(scene, &render),
            _ if fine => page.done(&renderer, &render),
            _ => {}
        }
        let was_fine = std::mem::replace(&mut fine, true);
        loop {
            if let Some(code) = signals.exit_code() {
                return Ok(code);
            }
            if let Some(view) = page.take_view() {
                (seen.view, fine) = (view, false);
                break;
            }
            if !was_fine || render.stop == StopReason::Callback {
                break;
            }
            page.answer_replays(&renderer);
            page.answer(&renderer, &render.film);
            page.shared().wait(PAUSE);
        }
    }
}

/// A guide that nobody asked for would be learnt before the first picture.
fn unguided(guiding: Guiding) -> Guiding {
    if guiding == Guiding::Auto { Guiding::Off } else { guiding }
}

/// What was `asked` for with the techniques that `renderer` uses, so that a view that moves waits for no survey; and
/// how a render is told of them, where nobody has said which.
fn decided(asked: RenderOptions, renderer: &Renderer) -> (RenderOptions, String) {
    if (asked.light_paths, asked.guiding) != (LightPaths::Auto, Guiding::Auto) || asked.strategy != Strategy::MIS {
        return (asked, String::new());
    }
    let share = renderer.plan().light_paths;
    let (light_paths, words) = match share > 0.0 {
        true => (LightPaths::Share(share), format!(" --techniques bsdf,light,light-paths:{share}")),
        false => (LightPaths::Off, " --techniques bsdf,light".into()),
    };
    (asked.light_paths(light_paths).guiding(Guiding::Off), words)
}

/// The first look at the picture of `full`.
fn coarse(full: &RenderOptions) -> RenderOptions {
    let part = |start: u32, size: u32| (start / COARSE, (start + size).div_ceil(COARSE) - start / COARSE);
    let crop = full.crop.map(|crop| {
        let ((x, width), (y, height)) = (part(crop.x, crop.width), part(crop.y, crop.height));
        Crop { x, y, width, height }
    });
    full.clone().size(full.width.div_ceil(COARSE), full.height.div_ceil(COARSE)).crop(crop).spp(COARSE_SPP)
}

/// Says why a render ended early.
fn tell_faults(scene: &Scene, render: &Render) {
    if let Some(fault) = &render.fault {
        stderr_line(format_args!("pathspace: error: {fault}"));
    }
    if let Err(error) = scene.check_textures() {
        stderr_line(format_args!("pathspace: error: {error}"));
    }
}

/// What is looked at.
#[derive(Clone, PartialEq)]
struct Seen {
    camera: Camera,
    view: ViewChange,
    /// As the scene says.
    home: ViewChange,
}

impl Seen {
    /// Turns `renderer` to it, for a picture by `options`, of which `full` is the whole.
    fn aim(&self, renderer: &mut Renderer, options: &RenderOptions, full: &RenderOptions) -> Result<()> {
        let turned = self
            .view
            .rotation
            .filter(|_| !self.view.is_lit_as(&self.home))
            .map(|degrees| (degrees as f32).to_radians());
        let scene = renderer.scene();
        if let Some(rotation_rad) = turned.or(scene.environment.as_ref().map(|map| map.rotation_rad)) {
            renderer.turn_environment(rotation_rad);
        }
        // Names that were checked as they came.
        let layers: Vec<Aov> = self.view.layers.iter().filter_map(|name| name.parse().ok()).collect();
        renderer.retarget(&RenderOptions { lens: self.lens(options), ..options.clone() }.aovs(layers))?;
        if !self.view.stands_as(&self.home) {
            let camera = self.placed(scene, full);
            renderer.look_through(&camera)?;
        }
        Ok(())
    }

    fn lens(&self, options: &RenderOptions) -> Option<Lens> {
        let parallel = matches!(self.camera.projection, Projection::Orthographic { .. });
        match self.view.sees_as(&self.home) {
            true => options.lens,
            false if parallel || self.view.aperture == 0.0 => None,
            false => Some(Lens { radius_m: self.view.aperture as f32, focus_m: self.view.distance as f32 }),
        }
    }

    fn placed(&self, scene: &Scene, full: &RenderOptions) -> Camera {
        let mut camera = self.camera.clone();
        if let (Projection::Perspective { yfov_rad, .. }, Some(fov)) = (&mut camera.projection, self.view.fov) {
            // Degrees and back are not always the same bits.
            let asked = (fov as f32 != yfov_rad.to_degrees()).then(|| (fov as f32).to_radians());
            *yfov_rad = asked.unwrap_or(*yfov_rad);
        }
        let orbit = Orbit {
            azimuth_rad: self.view.azimuth.to_radians(),
            elevation_rad: self.view.elevation.to_radians(),
            distance: Distance::Metres(self.view.distance),
            target: Some(DVec3::from_array(self.view.target)),
        };
        orbit.camera(scene, &camera, f64::from(full.width) / f64::from(full.height))
    }
}

/// The view of a camera as it stands: about the point of its axis that is nearest to the middle of the scene.
fn standing(scene: &Scene, camera: &Camera, lens: Option<Lens>) -> ViewChange {
    let (least, most) = scene.bounds().unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
    let (middle, radius) = (0.5 * (least + most), 0.5 * (most - least).length());
    let eye = camera.position().as_dvec3();
    let back = camera.world_from_camera.matrix3.z_axis.as_dvec3();
    let distance = (middle - eye).dot(-back).max(0.05 * radius).max(1e-6);
    ViewChange {
        azimuth: back.x.atan2(back.z).to_degrees(),
        elevation: back.y.clamp(-1.0, 1.0).asin().to_degrees(),
        distance: lens.map_or(distance, |lens| f64::from(lens.focus_m).min(1e9)),
        target: (eye - back * lens.map_or(distance, |lens| f64::from(lens.focus_m).min(1e9)) + scene.origin).to_array(),
        fov: match camera.projection {
            Projection::Perspective { yfov_rad, .. } => Some(f64::from(yfov_rad.to_degrees())),
            Projection::Orthographic { .. } => None,
        },
        aperture: lens.map_or(0.0, |lens| f64::from(lens.radius_m)),
        rotation: scene.environment.as_ref().map(|environment| f64::from(environment.rotation_rad.to_degrees())),
        layers: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: written by hand.
    #[test]
    fn a_first_look_shows_the_same_window() {
        let crop = |x, y, width, height| Crop { x, y, width, height };
        let of = |window: Option<Crop>| coarse(&RenderOptions::new(101, 50).crop(window));
        let whole = of(None);
        assert_eq!((whole.width, whole.height, whole.crop), (26, 13, None));
        assert_eq!(of(Some(crop(8, 4, 40, 20))).crop, Some(crop(2, 1, 10, 5)));
        assert_eq!(of(Some(crop(99, 47, 2, 3))).crop, Some(crop(24, 11, 2, 2)));
    }
}
