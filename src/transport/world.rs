//! What light transport reads: the scene with its tables, and the decisions that change its numbers. Immutable and
//! shared by all workers. Nothing here knows of cameras, films, backends or instruction sets; see [`job`](super::job).

use glam::Vec3;

use super::alpha::AlphaTable;
use super::kind::{self, Kind};
use super::light_paths::lit::LightPaths;

use super::wave::Carried;
use crate::plan::light_groups::LightGroups;
use crate::plan::options::{Roulette, Strategy};
use crate::plan::{Features, FogSphere, RenderPlan};
use crate::scene::geometry::Geometry;
use crate::scene::{Fact, Facts, Material, Scene};
use crate::shading::bsdf::albedo::SpecularAlbedo;
use crate::shading::bsdf::glass_albedo::GlassAlbedo;
use crate::shading::bsdf::model::Tables;
use crate::shading::bsdf::sheen_albedo::SheenAlbedo;
use crate::shading::guide::Guide;
use crate::shading::light::Lights;
use crate::shading::light::area::AreaLight;
use crate::shading::light::select::Selection;
use crate::shading::scattering::Coefficients;

/// What is worked out of the materials once per plan.
pub struct MaterialTables {
    /// Kernel of each material.
    kinds: Vec<Kind>,
    /// The kernel of every material that is placed, where it is one for all.
    only_kind: Option<Kind>,
    /// Alpha mode of each material.
    alpha: AlphaTable,
    /// What each material that only bounds an inside multiplies light by.
    clear: Vec<Option<Vec3>>,
    /// What the inside of each material does to light.
    coefficients: Vec<Coefficients>,
    /// The most that each material reflects.
    reflectance_bounds: Vec<Vec3>,
    /// Directional albedo of dielectric coats; empty when no material has one.
    albedo: SpecularAlbedo,
    /// Directional albedo of sheen; empty when no material has it.
    sheen: SheenAlbedo,
    /// Directional albedo of rough solids; empty where their loss stays.
    glass: GlassAlbedo,
    /// Whether the two know what facets lose, and if so, whether solids lie in others there.
    compensates: Option<bool>,
}

impl MaterialTables {
    /// Of the materials of `scene`, for renders under `plan`.
    pub fn new(scene: &Scene, plan: &RenderPlan) -> Self {
        let mut tables = MaterialTables {
            kinds: Vec::new(),
            only_kind: None,
            alpha: AlphaTable::new(scene),
            clear: scene.materials.iter().map(clear).collect(),
            coefficients: scene.materials.iter().map(Coefficients::of).collect(),
            reflectance_bounds: scene.materials.iter().map(Material::reflectance_bound).collect(),
            albedo: SpecularAlbedo::for_materials(&scene.materials, false),
            sheen: SheenAlbedo::for_materials(&scene.materials),
            glass: GlassAlbedo::default(),
            compensates: None,
        };
        tables.retarget(scene, plan);
        tables
    }

    /// The same under another plan for the same scene.
    pub fn retarget(&mut self, scene: &Scene, plan: &RenderPlan) {
        let kind = |material| match kind::kind_of(material) {
            _ if plan.features.multiscatter && Facts::of(material).loses() => Kind::Compensated,
            Kind::Lambert | Kind::Opaque if plan.features.all_general => Kind::General,
            kind => kind,
        };
        let compensates = plan.features.multiscatter.then_some(plan.features.nested);
        if let Some(nested) = compensates.filter(|_| compensates != self.compensates) {
            self.albedo = SpecularAlbedo::for_materials(&scene.materials, true);
            self.glass = GlassAlbedo::for_materials(&scene.materials, nested);
            self.compensates = compensates;
        }
        self.kinds = scene.materials.iter().map(kind).collect();
        self.only_kind = kind::only_kind(scene, &self.kinds);
    }
}

fn clear(material: &Material) -> Option<Vec3> {
    Facts::of(material).has(Fact::Clear).then(|| material.base_color.clamp(Vec3::ZERO, Vec3::ONE))
}

/// See the module.
#[derive(Clone, Copy)]
pub struct World<'a> {
    /// Materials and textures.
    pub scene: &'a Scene,
    /// Triangles.
    pub geometry: &'a Geometry,
    /// Emitters.
    pub lights: &'a Lights,
    /// What the stages have to do at all.
    pub features: &'a Features,
    /// Kernel of each material.
    pub kinds: &'a [Kind],
    /// The kernel of every material that is placed, where it is one for all.
    pub only_kind: Option<Kind>,
    /// Where surfaces let rays pass.
    pub alpha: &'a AlphaTable,
    /// What each material that only bounds an inside multiplies light by that goes straight through; `None` for others.
    pub clear: &'a [Option<Vec3>],
    /// What the inside of each material does to light; read where media scatter.
    pub coefficients: &'a [Coefficients],
    /// The most that each material reflects, see [`Facts::reflectance_bound`]; read where the depth limit ends paths.
    pub reflectance_bounds: &'a [Vec3],
    /// Which light is in which group.
    pub groups: &'a LightGroups,
    /// What is where no solid is.
    pub fog: Option<FogSphere>,
    /// What scattering models look up.
    pub tables: Tables<'a>,
    /// Light paths, where they take part.
    pub light_paths: Option<LightPaths<'a>>,
    /// Directions that are mixed with those of BSDFs, where any are.
    pub directions: Option<&'a Guide>,
    /// Whether scatterings are written down, for a guide to learn from.
    pub learns: bool,
    /// The one light of the scene with its radiance, if it is an untextured area light.
    pub only_area: Option<(&'a AreaLight, Vec3)>,
    /// What paths carry from edge to edge.
    pub carried: Carried,
    /// How light sampling and BSDF sampling are combined.
    pub strategy: Strategy,
    /// Largest number of path edges.
    pub max_depth: u32,
    /// Russian roulette.
    pub roulette: Roulette,
    /// First path vertex at which roulette may end a path.
    pub roulette_start: u32,
}

impl<'a> World<'a> {
    /// Of a scene with its tables.
    pub fn new(
        scene: &'a Scene,
        geometry: &'a Geometry,
        lights: &'a Lights,
        tables: &'a MaterialTables,
        plan: &'a RenderPlan,
        (light_paths, directions): (Option<LightPaths<'a>>, Option<&'a Guide>),
    ) -> Self {
        let features = &plan.features;
        let plain = Tables::new(&tables.albedo, features.coated);
        let plain = if features.multiscatter { plain.with_glass(&tables.glass) } else { plain };
        World {
            scene,
            geometry,
            lights,
            features,
            kinds: &tables.kinds,
            only_kind: tables.only_kind,
            alpha: &tables.alpha,
            clear: &tables.clear,
            coefficients: &tables.coefficients,
            reflectance_bounds: &tables.reflectance_bounds,
            groups: &plan.light_groups,
            fog: plan.fog,
            tables: if features.sheen { plain.with_sheen(&tables.sheen) } else { plain },
            light_paths,
            directions,
            learns: false,
            only_area: lights.only_area(),
            carried: Carried {
                normal: lights.selection() == Selection::Receiver,
                transmission: features.dielectric || features.thin || features.absorption,
            },
            strategy: plan.strategy,
            max_depth: plan.max_depth,
            roulette: plan.roulette,
            roulette_start: plan.roulette_start,
        }
    }

    /// Whether light sampling takes part.
    #[inline(always)]
    pub fn samples_lights(&self) -> bool {
        self.features.light_sampling
    }
}
