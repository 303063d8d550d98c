//! A scene made ready to be rendered: plan, acceleration structure, light tables, threads. What passes and replays read
//! of it is a [`Job`].
//!
//! Everything is built once, in [`Renderer::new`]; other options of the same backend are taken by
//! [`Renderer::retarget`]. `mod.rs` describes how a render runs.

use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::memory::{self, Need};
use crate::backend::{self, Backend, BackendInfo, Kept};
use crate::camera::CameraRays;
use crate::error::{Error, Result};
use crate::film::filter::FilterTable;
use crate::film::shares::Shares;
use crate::film::splats::Splats;
use crate::machine;
use crate::plan::options::RenderOptions;
use crate::plan::{FogSphere, RenderPlan};
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Scene};
use crate::shading::guide::Guide;
use crate::shading::light::Lights;
use crate::shading::medium::Media;
use crate::texture::stored::Tiles;
use crate::transport::job::Job;
use crate::transport::light_paths::lit;
use crate::transport::names::Names;
use crate::transport::replay::{self, Replay};
use crate::transport::world::{MaterialTables, World};

/// A scene made ready: plan, acceleration structure, light tables.
///
/// ```
/// use std::ops::ControlFlow;
/// use std::time::Duration;
///
/// use pathspace::render::StopReason;
/// use pathspace::{RenderOptions, Renderer, Scene};
///
/// let scene = Scene::load("scenes/cornell-box/scene.gltf")?;
/// let mut renderer = Renderer::new(&scene, RenderOptions::new(16, 16).error(0.2).time(Duration::from_secs(20)))?;
/// // The callback runs on this thread between passes; breaking off is a result, not an error.
/// let render = renderer.render_with(|progress| {
///     if progress.spp >= 4096 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
/// })?;
/// assert!(render.stop != StopReason::Error || render.film.error_estimate().is_some());
///
/// // Nothing is built again for another camera, size or number of samples.
/// renderer.retarget(&RenderOptions::new(8, 8).spp(4))?;
/// assert_eq!(renderer.render()?.film.spp().max, 4);
/// # Ok::<(), pathspace::Error>(())
/// ```
pub struct Renderer<'a> {
    scene: &'a Scene,
    pub(super) plan: RenderPlan,
    geometry: Geometry,
    lights: Lights,
    backend: Box<dyn Backend>,
    camera: CameraRays,
    /// The camera at equal intervals of the shutter; empty where it is at rest.
    camera_steps: Vec<CameraRays>,
    /// The solids around the camera as the shutter opens.
    media: Media,
    filter: FilterTable,
    tables: MaterialTables,
    pub(super) light_paths: Option<lit::Tables>,
    pub(super) guide: Option<Guide>,
    names: Names,
    pub(super) pool: rayon::ThreadPool,
    /// Textures that are read while it renders.
    pub(super) tiles: Option<Arc<Tiles>>,
    pub(super) need: Need,
    build_time: Duration,
}

impl<'a> Renderer<'a> {
    /// Resolves the options against the scene and builds the backend.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, [`Error::Backend`] when the backend cannot be built,
    /// [`Error::InvalidScene`] for lights that are not finite.
    pub fn new(scene: &'a Scene, options: RenderOptions) -> Result<Self> {
        Renderer::new_after(scene, options, Kept::NOTHING)
    }

    /// [`new`](Self::new) for another frame of an animation: what is the same as in the one that `kept` is of, as far
    /// as the backend can tell, is not built again. Its renders have the bits of those of a renderer made alone.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn new_after(scene: &'a Scene, options: RenderOptions, mut kept: Kept) -> Result<Self> {
        let start = Instant::now();
        memory::check_geometry(scene)?;
        let mut geometry = Geometry::build(scene);
        let mut plan = RenderPlan::new(scene, &geometry, &options)?;
        if plan.features.footprints {
            scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        let lights = Lights::build(scene, &geometry)?;
        lights.assign(&mut geometry);
        let pool = machine::pool(plan.threads, "render")
            .map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;
        let need = Need::of(scene, &geometry, &plan);
        if need.check_building().is_err() {
            // There may be room without it.
            drop(std::mem::take(&mut kept));
            need.check_building()?;
        }
        let backend = backend::select::build_after(plan.backend, &geometry, &plan.backend_options(), kept)?;
        let camera = CameraRays::new(&scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        let camera_steps = camera_steps(scene, &plan)?;
        let media = media_of(&geometry, &camera, &plan);
        let light_paths = light_paths(scene, &geometry, &lights, &mut plan);
        let mut renderer = Renderer {
            scene,
            lights,
            backend,
            camera,
            camera_steps,
            media,
            filter: FilterTable::new(plan.filter),
            tables: MaterialTables::new(scene, &plan),
            light_paths,
            guide: None,
            names: Names::new(scene, &plan.aovs),
            pool,
            tiles: scene.texture_tiles().cloned(),
            geometry,
            plan,
            need,
            build_time: start.elapsed(),
        };
        renderer.survey_techniques(&options)?;
        renderer.need = renderer.need.surveyed(renderer.light_paths.is_some());
        renderer.build_time = start.elapsed();
        Ok(renderer)
    }

    /// What the renderer of another frame may take over ([`new_after`](Self::new_after)).
    pub fn keep(self) -> Kept {
        self.backend.keep()
    }

    /// Takes other options for the renders to come. Nothing is built again, so backend, traversal and ray modes must
    /// stay what they are.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Option`] for options that need another backend.
    pub fn retarget(&mut self, options: &RenderOptions) -> Result<()> {
        let mut plan = self.plan.again(self.scene, &self.geometry, options)?;
        if plan.backend != self.plan.backend || plan.backend_options() != self.plan.backend_options() {
            let problem = "another backend, ray mode or number of threads needs a renderer of its own".into();
            return Err(Error::Option { option: "--backend", problem });
        }
        if plan.features.footprints {
            self.scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        let camera = CameraRays::new(&self.scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        self.media = media_of(&self.geometry, &camera, &plan);
        (self.camera, self.camera_steps) = (camera, camera_steps(self.scene, &plan)?);
        self.filter = FilterTable::new(plan.filter);
        self.tables.retarget(self.scene, &plan);
        self.light_paths = light_paths(self.scene, &self.geometry, &self.lights, &mut plan);
        self.names = Names::new(self.scene, &plan.aovs);
        self.plan = plan;
        self.guide = None;
        self.survey_techniques(options)
    }

    /// Renders through another camera from here on, at rest, until options are taken anew.
    ///
    /// # Errors
    /// Those of [`CameraRays::new`].
    pub fn look_through(&mut self, camera: &Camera) -> Result<()> {
        let camera = CameraRays::new(camera, self.plan.resolution, self.plan.lens)?;
        self.media = media_of(&self.geometry, &camera, &self.plan);
        self.plan.fog = self.plan.fog.map(|fog| FogSphere::new(fog.medium, &self.geometry, &[camera.position()]));
        (self.camera, self.camera_steps) = (camera, Vec::new());
        Ok(())
    }

    /// Renders in an environment that is turned so about +Y ([`Environment::rotation_rad`]) instead of as the scene
    /// says;
    /// [`retarget`](Self::retarget) is to follow. Nothing changes without an environment.
    ///
    /// [`Environment::rotation_rad`]: crate::scene::Environment::rotation_rad
    pub fn turn_environment(&mut self, rotation_rad: f32) {
        self.lights.turn_environment(rotation_rad);
    }

    /// Renders with other random numbers from here on. Nothing that was built depends on the seed.
    pub fn set_seed(&mut self, seed: u64) {
        self.plan.seed = seed;
    }

    /// The scene.
    pub fn scene(&self) -> &'a Scene {
        self.scene
    }

    /// The resolved decisions.
    pub fn plan(&self) -> &RenderPlan {
        &self.plan
    }

    /// The backend that traces.
    pub fn backend_info(&self) -> &BackendInfo {
        self.backend.info()
    }

    /// The same, to be asked.
    pub fn backend(&self) -> &dyn Backend {
        self.backend.as_ref()
    }

    /// The flattened geometry that the backend was built over.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The camera that looks, with its matrices.
    pub fn camera(&self) -> &CameraRays {
        &self.camera
    }

    /// Wall time of flattening the scene and building the acceleration structure and the light tables.
    pub fn build_time(&self) -> Duration {
        self.build_time
    }

    /// What it takes in memory, by part, as it was known before the hierarchy was built, and what surveys have left.
    pub fn need(&self) -> &Need {
        &self.need
    }

    /// What the workers read.
    pub(super) fn job(&self) -> Job<'_> {
        let light_paths = self.light_paths.as_ref().map(|tables| tables.view(&self.plan));
        let (scene, techniques) = (self.scene, (light_paths, self.guide.as_ref()));
        Job {
            world: World::new(scene, &self.geometry, &self.lights, &self.tables, &self.plan, techniques),
            backend: self.backend.as_ref(),
            camera: &self.camera,
            camera_steps: &self.camera_steps,
            media: self.media,
            filter: &self.filter,
            sampler: self.plan.sampler,
            seed: self.plan.seed,
            columns: self.plan.resolution.0,
            rows: self.plan.resolution.1,
            names: &self.names,
            layers: &self.plan.aovs,
            avx512: self.plan.avx512,
        }
    }

    /// Where light paths are added up; `None` without.
    pub(super) fn splats(&self) -> Option<Splats> {
        let tables = self.light_paths.as_ref()?;
        let exponent = tables.exponent(&self.plan, &self.camera, &self.geometry);
        let shares = Shares::of(&self.plan.aovs, self.plan.light_groups.names.len());
        Some(Splats::with_shares(self.plan.resolution, self.plan.window, exponent, shares))
    }

    /// Renders one sample of a pixel of the full image again, with everything that was decided on its path written
    /// down. Kernels, backend, query modes and random numbers are those of a render, and so are the bits.
    ///
    /// # Errors
    /// [`Error::Option`] for a pixel outside the full image.
    pub fn replay(&self, pixel: (u32, u32), sample: u64) -> Result<Replay> {
        let (width, height) = self.plan.resolution;
        if pixel.0 >= width || pixel.1 >= height {
            let problem = format!("{},{} lies outside the picture of {width}x{height} pixels", pixel.0, pixel.1);
            return Err(Error::Option { option: "--pixel", problem });
        }
        Ok(replay::run(&self.job(), pixel, sample))
    }
}

/// The solids around the camera, where paths keep those.
fn media_of(geometry: &Geometry, camera: &CameraRays, plan: &RenderPlan) -> Media {
    if plan.features.media { Media::of(&geometry.solids_around(camera.position()).0) } else { Media::NONE }
}

/// What light paths need, where they take part; else the plan has none.
fn light_paths(scene: &Scene, geometry: &Geometry, lights: &Lights, plan: &mut RenderPlan) -> Option<lit::Tables> {
    let tables = lit::Tables::new(scene, geometry, lights, plan);
    if tables.is_none() {
        let called = plan.features.light_paths;
        let reason = if called { "no light reaches what bundles it".into() } else { plan.light_paths_reason.clone() };
        plan.set_light_paths(0.0, reason);
    }
    tables
}

/// The camera of the plan along its way while the shutter is open; nothing where it is at rest.
pub(super) fn camera_steps(scene: &Scene, plan: &RenderPlan) -> Result<Vec<CameraRays>> {
    let steps = scene.motion.of_camera(plan.camera).map_or(&[][..], |track| &track.steps);
    let camera = &scene.cameras[plan.camera];
    let posed = |&world_from_camera: &_| {
        CameraRays::new(&Camera { world_from_camera, ..camera.clone() }, plan.resolution, plan.lens)
    };
    steps.iter().map(posed).collect()
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::plan::Gate;
    use crate::scene::builder::SceneBuilder;
    use crate::transport::kind::Kind;

    /// A retargeted renderer has the kernels of a fresh one. Oracle: the fresh one. Deterministic. (Rays that pass
    /// surfaces need another backend: that gate stays closed.)
    #[test]
    fn retarget_takes_the_kernels_that_gates_ask_for() {
        let mut b = SceneBuilder::new();
        let white = b.lambert(Vec3::ONE);
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let scene = b.build();
        let options = |forced: &[Gate]| RenderOptions { forced: forced.to_vec(), ..RenderOptions::new(4, 4) };
        let kinds = |renderer: &Renderer| (renderer.job().world.kinds.to_vec(), renderer.job().world.only_kind);
        let fresh = |forced| kinds(&Renderer::new(&scene, options(forced)).expect("valid options"));
        let mut renderer = Renderer::new(&scene, options(&[])).expect("valid options");
        let rest: Vec<Gate> = Gate::ALL.into_iter().filter(|gate| *gate != Gate::ALPHA).collect();
        for forced in [&[Gate::GENERAL][..], &[], &rest] {
            renderer.retarget(&options(forced)).expect("the backend stays");
            assert_eq!(kinds(&renderer), fresh(forced), "{forced:?}");
            assert_eq!(kinds(&renderer).1 == Some(Kind::General), !forced.is_empty(), "{forced:?}");
        }
    }

    /// And the tables: rough metal that gets back what it loses, asked for later. Oracle: the fresh one.
    #[test]
    fn retarget_makes_the_tables_that_options_ask_for() {
        let mut b = SceneBuilder::new();
        let metal = b.metal(Vec3::splat(0.9), 0.5);
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, metal);
        b.point_light(Vec3::new(0.3, 0.4, 0.1), Vec3::ONE);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let scene = b.build();
        let hash = |renderer: &Renderer| renderer.render().expect("it renders").film.hash();
        let options = RenderOptions::new(8, 8).spp(4);
        let mut renderer = Renderer::new(&scene, options.clone()).expect("valid options");
        let without = hash(&renderer);
        let with = RenderOptions { multiscatter: true, ..options.clone() };
        renderer.retarget(&with).expect("the backend stays");
        assert_eq!(hash(&renderer), hash(&Renderer::new(&scene, with).expect("valid options")));
        renderer.retarget(&options).expect("the backend stays");
        assert_eq!(hash(&renderer), without);
    }
}
