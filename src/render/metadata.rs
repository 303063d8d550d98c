//! What an EXR of a render says besides its pixels: where the camera was, what was rendered and how.

use super::renderer::Renderer;
use super::result::Render;
use crate::film::cryptomatte::Matte;
use crate::film::exr::{ExrOptions, ViewMatrices};
use crate::film::layer::kind::Values;
use crate::film::{Film, layer};
use crate::plan::record::PlanRecord;

impl Renderer<'_> {
    /// The plan and the effective query modes, as `info --json` prints them and every EXR holds them.
    pub fn record(&self) -> PlanRecord {
        PlanRecord::of(self.plan(), self.backend_info())
    }

    /// Everything that an EXR of `render`, a render of this renderer, says: other layers and all attributes.
    ///
    /// ```
    /// # use glam::Vec3;
    /// # use pathspace::scene::builder::SceneBuilder;
    /// use pathspace::{RenderOptions, Renderer};
    /// # let folder = tempfile::tempdir().expect("a temporary folder");
    /// # let mut builder = SceneBuilder::new();
    /// # let lamp = builder.emitter(Vec3::ZERO, Vec3::ONE);
    /// # builder.quad([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(x, y)| Vec3::new(x, y, 0.0)), lamp);
    /// # builder.camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 1.0);
    /// # let scene = builder.build();
    /// let renderer = Renderer::new(&scene, RenderOptions::new(8, 8).spp(4))?;
    /// let render = renderer.render()?;
    /// # let path = folder.path().join("picture.exr");
    /// render.film.write_exr(path, &renderer.exr_options(&render))?;
    /// # Ok::<(), pathspace::Error>(())
    /// ```
    pub fn exr_options(&self, render: &Render) -> ExrOptions {
        let render_seconds = Some(render.render_time.as_secs_f64());
        ExrOptions { render_seconds, ..self.exr_of(&render.film) }
    }

    /// [`exr_options`](Self::exr_options) of a film on its way: without the time.
    pub fn exr_of(&self, film: &Film) -> ExrOptions {
        let plan = self.plan();
        ExrOptions { channels: film.channels(&plan.aovs, plan.max_depth), ..self.exr_attributes() }
    }

    /// The attributes that all its renders have.
    pub(super) fn exr_attributes(&self) -> ExrOptions {
        let (plan, camera, backend) = (self.plan(), self.camera(), self.backend_info());
        let origin = self.scene().origin;
        ExrOptions {
            view: Some(ViewMatrices {
                world_to_camera: camera.world_to_camera(origin),
                world_to_ndc: camera.world_to_ndc(origin),
            }),
            seed: Some(plan.seed),
            backend: Some(format!("{} {}", backend.kind.name(), backend.version)),
            isa: Some(backend.isa.clone()),
            plan: serde_json::to_string(&self.record()).ok(),
            mattes: self.mattes(),
            ..ExrOptions::default()
        }
    }

    /// The names of layers of ids: of everything that the scene places.
    fn mattes(&self) -> Vec<Matte> {
        let scene = self.scene();
        let of = |aov| match layer::find(aov).values {
            Values::Ids(name) => {
                let names: Vec<_> = (0..scene.instances.len()).map(|instance| name(scene, instance)).collect();
                Some(Matte::new(aov.name(), names.iter().map(AsRef::as_ref)))
            }
            _ => None,
        };
        self.plan().aovs.iter().filter_map(|&aov| of(aov)).collect()
    }
}
