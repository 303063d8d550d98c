//! A scene made ready to be rendered: plan, acceleration structure, light tables, threads. What passes and replays read
//! of it is the stages' [`Context`].
//!
//! Everything is built once, in [`Renderer::new`]; other options of the same backend are taken by [`Renderer::retarget`].
//! How a render runs is told in `mod.rs`.

use std::time::{Duration, Instant};

use rayon::prelude::*;

use crate::backend::{self, Backend, BackendInfo};
use crate::camera::CameraRays;
use crate::error::{Error, Result};
use crate::film::filter::FilterTable;
use crate::plan::RenderPlan;
use crate::plan::options::RenderOptions;
use crate::scene::geometry::Geometry;
use crate::scene::{Camera, Scene};
use crate::shading::bsdf::albedo::SpecularAlbedo;
use crate::shading::light::Lights;
use crate::shading::light::select::Selection;
use crate::wavefront::alpha::AlphaTable;
use crate::wavefront::queue::{self, Kind};
use crate::wavefront::replay::Replay;
use crate::wavefront::state::Carried;
use crate::wavefront::{self, Context};

/// A scene made ready: plan, acceleration structure, light tables.
pub struct Renderer<'a> {
    scene: &'a Scene,
    pub(super) plan: RenderPlan,
    geometry: Geometry,
    lights: Lights,
    backend: Box<dyn Backend>,
    camera: CameraRays,
    /// The camera at equal intervals of the shutter; empty where it is at rest.
    camera_steps: Vec<CameraRays>,
    filter: FilterTable,
    kinds: Vec<Kind>,
    only_kind: Option<Kind>,
    alpha: AlphaTable,
    albedo: SpecularAlbedo,
    pub(super) pool: rayon::ThreadPool,
    build_time: Duration,
}

impl<'a> Renderer<'a> {
    /// Resolves the options against the scene and builds the backend.
    ///
    /// # Errors
    /// [`Error::Option`] for options out of range, [`Error::Backend`] when the backend cannot be built,
    /// [`Error::InvalidScene`] for lights that are not finite.
    pub fn new(scene: &'a Scene, options: RenderOptions) -> Result<Self> {
        let start = Instant::now();
        let mut geometry = Geometry::build(scene);
        let plan = RenderPlan::new(scene, &geometry, &options)?;
        if plan.features.footprints {
            scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        let lights = Lights::build(scene, &geometry)?;
        lights.assign(&mut geometry);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(plan.threads)
            .thread_name(|i| format!("pathspace-{i}"))
            .build()
            .map_err(|e| Error::Option { option: "--threads", problem: e.to_string() })?;
        let backend = backend::build(plan.backend, &geometry, &plan.backend_options())?;
        let camera = CameraRays::new(&scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        let camera_steps = camera_steps(scene, &plan)?;
        let kind = |m| if plan.features.all_general { Kind::General } else { queue::kind_of(m) };
        let kinds: Vec<Kind> = scene.materials.iter().map(kind).collect();
        Ok(Renderer {
            scene,
            lights,
            backend,
            camera,
            camera_steps,
            filter: FilterTable::new(plan.filter),
            only_kind: queue::only_kind(scene, &kinds),
            kinds,
            alpha: AlphaTable::new(scene),
            albedo: SpecularAlbedo::for_materials(&scene.materials),
            pool,
            geometry,
            plan,
            build_time: start.elapsed(),
        })
    }

    /// Takes other options for the renders to come. Nothing is built again, so backend, traversal and ray modes must stay
    /// what they are.
    ///
    /// # Errors
    /// As [`new`](Self::new), and [`Error::Option`] for options that need another backend.
    pub fn retarget(&mut self, options: &RenderOptions) -> Result<()> {
        let plan = RenderPlan::new(self.scene, &self.geometry, options)?;
        if plan.backend != self.plan.backend || plan.backend_options() != self.plan.backend_options() {
            let problem = "another backend, ray mode or number of threads needs a renderer of its own".into();
            return Err(Error::Option { option: "--backend", problem });
        }
        if plan.features.footprints {
            self.scene.textures.par_iter().for_each(|texture| texture.make_levels());
        }
        let camera = CameraRays::new(&self.scene.cameras[plan.camera], plan.resolution, plan.lens)?;
        (self.camera, self.camera_steps) = (camera, camera_steps(self.scene, &plan)?);
        self.filter = FilterTable::new(plan.filter);
        self.plan = plan;
        Ok(())
    }

    /// Renders with other random numbers from here on. Nothing that was built depends on the seed.
    pub fn set_seed(&mut self, seed: u64) {
        self.plan.seed = seed;
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

    /// What the stages read.
    pub(super) fn context(&self) -> Context<'_> {
        Context {
            plan: &self.plan,
            scene: self.scene,
            geometry: &self.geometry,
            lights: &self.lights,
            backend: self.backend.as_ref(),
            camera: &self.camera,
            camera_steps: &self.camera_steps,
            filter: &self.filter,
            kinds: &self.kinds,
            only_kind: self.only_kind,
            carried: Carried {
                normal: self.lights.selection() == Selection::Receiver,
                medium: self.plan.features.dielectric || self.plan.features.thin || self.plan.features.absorption,
            },
            only_area: self.lights.only_area(),
            alpha: &self.alpha,
            albedo: &self.albedo,
            observer: None,
        }
    }

    /// Renders one sample of a pixel of the full image again, with everything that was decided on its path written down.
    /// Kernels, backend, query modes and random numbers are those of a render, and so are the bits.
    ///
    /// # Errors
    /// [`Error::Option`] for a pixel outside the full image.
    pub fn replay(&self, pixel: (u32, u32), sample: u64) -> Result<Replay> {
        let (width, height) = self.plan.resolution;
        if pixel.0 >= width || pixel.1 >= height {
            let problem = format!("{},{} lies outside the picture of {width}x{height} pixels", pixel.0, pixel.1);
            return Err(Error::Option { option: "--pixel", problem });
        }
        Ok(wavefront::replay::run(&self.context(), pixel, sample))
    }
}

/// The camera of the plan along its way while the shutter is open; nothing where it is at rest.
fn camera_steps(scene: &Scene, plan: &RenderPlan) -> Result<Vec<CameraRays>> {
    let steps = scene.motion.of_camera(plan.camera).map_or(&[][..], |track| &track.steps);
    let camera = &scene.cameras[plan.camera];
    let posed = |&world_from_camera: &_| {
        CameraRays::new(&Camera { world_from_camera, ..camera.clone() }, plan.resolution, plan.lens)
    };
    steps.iter().map(posed).collect()
}
