//! The table of effects: one row each, in the order in which they are listed. A row is
//!
//! `bit: "name" [GATE "what runs when it is forced"] = test.stages(…);`
//!
//! `bit` is a plain bool of [`Features`], which the stages read. `test` is an `effect` with a predicate that gives the
//! reason (such rows are listed as found and simulated), or a `part` of the machinery that other bits call for (such
//! rows are not). `[GATE …]`, where there is one, makes a constant of [`Gate`], by which tests and benches run what
//! nothing calls for. `stages` are the names of what runs, and where in the loop. `without` says how the effect is
//! [left out](super::without) on demand. To add an effect, add a row and its predicate.

use glam::Vec3;
use serde::Serialize;

use self::Phase::*;
use self::Stage::{At, Instead};
use super::asked::Asked;
use super::ignored::{self, Ignored};
use super::removal::{self, Removal, materials, options, scene};
use super::{found, guide, light_paths};
use crate::plan::options::{Backfaces, Gate};
use crate::scene::{Fact, Material};

/// Effects of a scene, for people and programs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Effects {
    /// What the file and the options ask for: "smooth-normals (mesh 'ball')".
    pub found: Vec<String>,
    /// What will run.
    pub simulated: Vec<String>,
    /// What will not.
    pub ignored: Vec<Ignored>,
}

/// What a wave does, in the order of the loop. Within one of these, stages run in the order of the table.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Phase {
    Camera,
    Intersection,
    Escape,
    Emission,
    Absorption,
    Roulette,
    Normals,
    Lookups,
    NormalMaps,
    Scattering,
    LightSamples,
    ShadowRays,
    Accumulation,
}

/// What a row makes run.
#[derive(Clone, Copy)]
enum Stage {
    /// A stage of this name. Rows may share one.
    At(Phase, &'static str),
    /// The first stage, where it runs, becomes the second.
    Instead(&'static str, &'static str),
}

/// Stages that run whatever is asked for.
const ALWAYS: [Stage; 3] = [At(Camera, "raygen"), At(Intersection, "closest-hit"), At(Accumulation, "accumulate")];

/// What makes a row run.
#[derive(Clone, Copy)]
enum Test {
    /// The reason for which an effect is found.
    Effect(fn(&Asked) -> Option<String>),
    /// Whether the bits of the rows above, or the options, call for a part.
    Part(fn(&Asked, &Features) -> bool),
}

/// A row of the table.
struct Row {
    name: &'static str,
    bit: fn(&mut Features) -> &mut bool,
    runs: Runs,
}

/// When a row runs, and what.
#[derive(Clone, Copy)]
struct Runs {
    test: Test,
    /// Never, not even by force, where this is false.
    allowed: fn(&Asked) -> bool,
    stages: &'static [Stage],
    /// How it is left out on demand, if it can be.
    removal: Option<Removal>,
}

const fn effect(reason: fn(&Asked) -> Option<String>) -> Runs {
    Runs { test: Test::Effect(reason), allowed: |_| true, stages: &[], removal: None }
}

const fn part(needed: fn(&Asked, &Features) -> bool) -> Runs {
    Runs { test: Test::Part(needed), allowed: |_| true, stages: &[], removal: None }
}

impl Runs {
    const fn only_if(self, allowed: fn(&Asked) -> bool) -> Self {
        Runs { allowed, ..self }
    }

    const fn stages(self, stages: &'static [Stage]) -> Self {
        Runs { stages, ..self }
    }

    const fn without(self, removal: Removal) -> Self {
        Runs { removal: Some(removal), ..self }
    }
}

macro_rules! table {
    ($($(#[doc = $doc:literal])+ $bit:ident: $name:literal $([$gate:ident $opened:literal])? = $runs:expr;)+) => {
        /// The gates that the stages read. Each is true only if something in the scene or the options calls for it.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Features {
            $($(#[doc = $doc])+ pub $bit: bool,)+
        }

        /// All rows.
        const TABLE: &[Row] = &[
            $(Row {
                name: $name,
                bit: |features| &mut features.$bit,
                runs: $runs,
            },)+
        ];

        impl Gate {
            $($(#[doc = $opened] pub const $gate: Gate = Gate($name);)?)+

            /// Every gate: what `--no-plan` opens.
            pub const ALL: [Gate; GATES.len()] = [$($(Gate::$gate,)?)+];
        }

        const GATES: &[&str] = &[$($({ let _ = $opened; $name },)?)+];
    };
}

table! {
    /// A finite aperture.
    lens: "lens" [LENS "Camera rays from a lens, here of radius 0. (Cameras with parallel rays have none.)"]
        = effect(found::lens).stages(&[Instead("raygen", "raygen-lens")])
        .without(options(removal::lens));
    /// Vertex normals on some placed mesh.
    smooth_normals: "smooth-normals" [SMOOTH_NORMALS "Interpolated normals, here of flat triangles."]
        = effect(found::smooth_normals).stages(&[At(Normals, "smooth-normals")])
        .without(scene(removal::smooth_normals));
    /// Base-colour textures.
    base_color_textures: "base-colour-textures"
        = effect(found::base_color_textures)
        .without(materials(|material| material.base_color_texture = None));
    /// Metallic-roughness textures.
    metallic_roughness_textures: "metallic-roughness-textures"
        = effect(found::metallic_roughness_textures)
        .without(materials(|material| material.metallic_roughness_texture = None));
    /// Normal maps.
    normal_maps: "normal-maps"
        = effect(found::normal_maps).stages(&[At(NormalMaps, "normal-maps")])
        .without(materials(|material| material.normal_texture = None));
    /// Light that normal maps send below the surface comes back.
    folded_normals: "folded-normals"
        = part(|asked, f| f.normal_maps && asked.options.fold_normals);
    /// Emissive textures.
    emissive_textures: "emissive-textures"
        = effect(found::emissive_textures)
        .without(materials(|material| material.emissive_texture = None));
    /// Textures of transmission.
    transmission_textures: "transmission-textures"
        = effect(|asked| found::first_textured(asked, |material| material.transmission_texture))
        .without(materials(|material| material.transmission_texture = None));
    /// Textures of the strength or the colour of dielectric reflection.
    specular_textures: "specular-textures"
        = effect(|asked| {
            found::first_textured(asked, |material| material.specular_texture.or(material.specular_color_texture))
        })
        .without(materials(removal::specular_textures));
    /// Textures of clearcoats.
    clearcoat_textures: "clearcoat-textures"
        = effect(|asked| {
            found::first_textured(asked, |material| material.clearcoat_texture.or(material.clearcoat_roughness_texture))
        })
        .without(materials(removal::clearcoat_textures));
    /// Normal maps of clearcoats.
    clearcoat_normal_maps: "clearcoat-normal-maps"
        = effect(|asked| found::first_textured(asked, |material| material.clearcoat_normal_texture))
        .stages(&[At(NormalMaps, "normal-maps")])
        .without(materials(|material| material.clearcoat_normal_texture = None));
    /// Textures of sheen.
    sheen_textures: "sheen-textures"
        = effect(|asked| {
            found::first_textured(asked, |material| material.sheen_color_texture.or(material.sheen_roughness_texture))
        })
        .without(materials(removal::sheen_textures));
    /// Textures of glossiness.
    glossiness_textures: "glossiness-textures"
        = effect(|asked| found::first_textured(asked, |material| material.glossiness_texture))
        .without(materials(|material| material.glossiness_texture = None));
    /// Textures of anisotropy.
    anisotropy_textures: "anisotropy-textures"
        = effect(|asked| found::first_textured(asked, |material| material.anisotropy_texture))
        .without(materials(|material| material.anisotropy_texture = None));
    /// Textures of iridescence.
    iridescence_textures: "iridescence-textures"
        = effect(|asked| {
            let of = |material: &Material| material.iridescence_texture.or(material.iridescence_thickness_texture);
            found::first_textured(asked, of)
        })
        .without(materials(removal::iridescence_textures));
    /// Textures of diffuse transmission.
    diffuse_transmission_textures: "diffuse-transmission-textures"
        = effect(|asked| {
            found::first_textured(asked, |material| {
                material.diffuse_transmission_texture.or(material.diffuse_transmission_color_texture)
            })
        })
        .without(materials(removal::diffuse_transmission_textures));
    /// Any texture at all; those above say which.
    textures: "textures" [TEXTURES "Look-ups, here of materials that read no texture."]
        = part(|_, f| f.base_color_textures | f.metallic_roughness_textures | f.normal_maps | f.emissive_textures
            | f.transmission_textures | f.specular_textures | f.clearcoat_textures | f.clearcoat_normal_maps
            | f.sheen_textures | f.glossiness_textures
            | f.anisotropy_textures | f.iridescence_textures | f.diffuse_transmission_textures)
        .stages(&[At(Lookups, "textures")]);
    /// Textures are averaged over the width of paths, which have to be kept.
    footprints: "texture-filter"
        = effect(found::texture_filter).stages(&[At(Lookups, "texture-filter")])
        .without(options(removal::texture_filter));
    /// Alpha masks.
    alpha_masks: "alpha-masks"
        = effect(found::alpha_masks)
        .without(materials(removal::alpha_masks));
    /// Alpha blending.
    alpha_blending: "alpha-blending"
        = effect(found::alpha_blending)
        .without(materials(removal::alpha_blending));
    /// Surfaces that are not there everywhere: alpha masks and blending.
    alpha: "alpha" [ALPHA "Passing rays, here through nothing; shadow rays look for their closest hit."]
        = part(|_, f| f.alpha_masks | f.alpha_blending)
        .stages(&[At(Intersection, "alpha"), Instead("any-hit", "transmittance")]);
    /// Colours at vertices.
    vertex_colors: "vertex-colours" [VERTEX_COLORS "Colours at vertices, here of materials that read none."]
        = effect(found::vertex_colors).stages(&[At(Lookups, "vertex-colours")])
        .without(materials(|material| material.vertex_colors = false));
    /// More than one channel of texture coordinates on some mesh.
    more_uvs: "more-texture-coordinates"
        = effect(found::more_uvs);
    /// Unlit materials.
    unlit: "unlit"
        = effect(found::unlit).stages(&[At(Emission, "emission")]);
    /// Emissive triangles.
    area_lights: "area-lights"
        = effect(found::area_lights).stages(&[At(Emission, "emission")])
        .without(materials(removal::area_lights));
    /// Emissive triangles that emit from both sides.
    double_sided_lamps: "double-sided-lamps"
        = effect(found::double_sided_lamps);
    /// Metals, in part or all over.
    metal: "metal"
        = effect(found::metal)
        .without(materials(|material| material.metallic = 0.0));
    /// Dielectric coats over a diffuse base: needs the albedo tables.
    coated: "dielectric-coat"
        = effect(found::coat)
        .without(materials(removal::coat));
    /// Exactly diffuse bases.
    lambert: "lambert"
        = effect(found::lambert);
    /// Specular reflection on an opaque surface (metal, or a dielectric coat).
    glossy: "glossy"
        = part(|_, f| f.metal | f.coated).stages(&[At(Scattering, "glossy")]);
    /// Solid dielectrics.
    dielectric: "solid-dielectric"
        = effect(found::dielectric).stages(&[At(Scattering, "dielectric")])
        .without(materials(removal::dielectric));
    /// Absorption inside solid dielectrics.
    absorption: "absorption"
        = effect(found::absorption).stages(&[At(Absorption, "absorption")])
        .without(materials(|material| material.attenuation_distance_m = f32::INFINITY));
    /// Solids that may lie in each other, so that boundaries depend on what is around them.
    nested: "nested-solids"
        = effect(found::nested);
    /// Solids whose index is that of what is around them: light goes straight through their boundaries.
    matched: "index-matched-solids"
        = effect(found::matched);
    /// Rays pass boundaries that change nothing but the medium.
    boundaries: "boundaries"
        = part(|_, f| f.nested | f.matched)
        .stages(&[At(Intersection, "boundaries"), Instead("any-hit", "transmittance")]);
    /// Of boundaries nearer than rounding to where rays start, the media around decide which they meet.
    exact_starts: "exact-starts"
        = part(|_, f| f.nested).stages(&[At(Intersection, "exact-starts")]);
    /// Light is scattered on its way, in solids or in fog.
    scattering: "scattering-media"
        = effect(found::scattering).stages(&[At(Absorption, "scattering-media")])
        .without(materials(|material| material.multiscatter_color = Vec3::ZERO).and_options(removal::fog));
    /// Paths keep the solids that are around them.
    media: "media" [MEDIA "Stacks of media, here of nothing in nothing."]
        = part(|_, f| f.absorption | f.boundaries | f.scattering).stages(&[At(Absorption, "media")]);
    /// Triangles that lie on one another: which of them a ray meets is decided by rule.
    coincident: "coincident-faces" [COINCIDENT "The rule for coincident faces, here of none."]
        = effect(found::coincident).stages(&[At(Intersection, "coincident-faces")]);
    /// Rays from the camera pass the backs of one-sided surfaces.
    hidden_backs: "hidden-backs"
        = effect(found::hidden_backs).stages(&[At(Intersection, "hidden-backs")])
        .without(options(|options| options.backfaces = Backfaces::Show));
    /// So does every other ray.
    hidden_to_all: "backs-hidden-to-all"
        = part(|asked, f| f.hidden_backs && asked.options.backfaces == Backfaces::HideAll)
        .stages(&[Instead("any-hit", "transmittance")]);
    /// Thin-walled transmission.
    thin: "thin-transmission"
        = effect(found::thin).stages(&[At(Scattering, "thin")])
        .without(materials(removal::thin));
    /// Clearcoats over other surfaces.
    clearcoat: "clearcoat"
        = effect(|asked| found::first_with(asked, Fact::Clearcoat)).stages(&[At(Scattering, "clearcoat")])
        .without(materials(removal::clearcoat));
    /// Sheen over other surfaces: needs its table.
    sheen: "sheen"
        = effect(|asked| found::first_with(asked, Fact::Sheen)).stages(&[At(Scattering, "sheen")])
        .without(materials(removal::sheen));
    /// Specular lobes with a grain.
    anisotropy: "anisotropy"
        = effect(|asked| found::first_with(asked, Fact::Grain)).stages(&[At(Normals, "tangents")])
        .without(materials(removal::anisotropy));
    /// Thin films on specular lobes.
    iridescence: "iridescence"
        = effect(|asked| found::first_with(asked, Fact::Film)).stages(&[At(Scattering, "iridescence")])
        .without(materials(removal::iridescence));
    /// Diffuse bases that let light pass.
    diffuse_transmission: "diffuse-transmission"
        = effect(|asked| found::first_with(asked, Fact::Translucent)).stages(&[At(Scattering, "diffuse-transmission")])
        .without(materials(removal::diffuse_transmission));
    /// Light that rough metals and glass scatter between facets.
    multiscatter: "multiple-scattering"
        = effect(found::multiscatter).stages(&[At(Scattering, "multiple-scattering")])
        .without(options(|options| options.multiscatter = false));
    /// Solids whose index depends on the wavelength: paths have one.
    dispersion: "dispersion"
        = effect(|asked| found::first_with(asked, Fact::Disperses)).stages(&[At(Scattering, "dispersion")])
        .without(materials(|material| material.dispersion = 0.0));
    /// Light from infinity all around.
    environment: "environment" [ENVIRONMENT "Escaped rays, here into blackness."]
        = effect(found::environment).stages(&[At(Escape, "environment")])
        .without(scene(|scene| scene.environment = None));
    /// Point, spot and directional lights.
    punctual: "punctual-lights"
        = effect(found::punctual)
        .without(scene(|scene| scene.punctual.clear()));
    /// Light samples at surfaces: there is a light, and the strategy wants them.
    light_sampling: "light-sampling" [LIGHT_SAMPLING "Light samples, here of no light."]
        = part(|asked, f| f.environment | f.punctual || found::has_lamp_at_rest(asked))
        .only_if(|asked| asked.samples_lights())
        .stages(&[At(LightSamples, "light-sampling"), At(ShadowRays, "any-hit")]);
    /// Light samples where only delta lobes scatter; only by force.
    lights_at_deltas: "lights-at-deltas"
        [LIGHTS_AT_DELTAS "Light samples where only delta lobes scatter, which reflect nothing of them."]
        = part(|_, _| false);
    /// Every material is shaded by the general kernel; only by force.
    all_general: "general-kernel" [GENERAL "The general kernel, here for materials that a lean one serves."]
        = part(|_, _| false);
    /// Paths are ended at random.
    roulette: "roulette"
        = part(|asked, _| found::roulette(asked)).stages(&[At(Roulette, "roulette")]);
    /// Placements that stay instanced.
    instancing: "instancing"
        = effect(found::instancing);
    /// One accumulator per path length.
    per_length: "per-length-images" [PER_LENGTH "One accumulator per path length, here for nobody."]
        = effect(found::per_length).stages(&[At(Accumulation, "per-length")]);
    /// One accumulator per group of lights.
    light_groups: "light-groups" [LIGHT_GROUPS "One accumulator per group of lights, here for nobody."]
        = effect(found::light_groups).stages(&[At(Accumulation, "light-groups")]);
    /// One accumulator per kind of lobe at the first vertex.
    lobes: "lobe-layers" [LOBES "One accumulator per kind of lobe, here for nobody."]
        = effect(found::lobes).stages(&[At(Accumulation, "lobe-layers")]);
    /// Layers of what camera rays meet first.
    first_hit: "first-hit"
        = effect(found::first_hit).stages(&[At(Accumulation, "first-hit")]);
    /// Layers of what paths come to through mirrors and smooth glass.
    followed: "denoiser-layers"
        = effect(found::followed).stages(&[At(Accumulation, "denoiser-layers")]);
    /// Something moves while the shutter is open: paths have times.
    shutter: "shutter" [SHUTTER "Times of paths, here of scenes at rest."]
        = effect(found::shutter).stages(&[At(Camera, "shutter")])
        .without(scene(removal::shutter));
    /// Light paths to the camera.
    light_paths: "light-paths"
        = part(|asked, _| light_paths::wanted(asked) && light_paths::refusal(asked).is_none())
        .stages(&[At(Accumulation, "light-paths")]);
    /// Directions of a guide, mixed with those of BSDFs.
    guide: "guide"
        = part(|asked, _| guide::wanted(asked)).stages(&[At(Scattering, "guide")]);
}

impl Features {
    /// Whether rays of this edge pass the backs of one-sided surfaces; 1 is the camera's.
    #[inline(always)]
    pub fn hides_backs(&self, edge: u32) -> bool {
        self.hidden_to_all | (self.hidden_backs & (edge == 1))
    }

    /// Whether rays of this edge may go straight through what they hit.
    #[inline(always)]
    pub fn passes(&self, edge: u32) -> bool {
        self.alpha | self.boundaries | self.hides_backs(edge)
    }

    /// Whether shadow rays may.
    #[inline(always)]
    pub fn shadows_pass(&self) -> bool {
        self.alpha | self.boundaries | self.hidden_to_all
    }
}

/// What `asked` calls for.
pub fn find(asked: &Asked) -> (Features, Effects) {
    let (mut features, mut effects) = (Features::default(), Effects::default());
    for Row { name, bit, runs } in TABLE {
        let wanted = match runs.test {
            Test::Effect(reason) => {
                let reason = reason(asked);
                if let Some(reason) = &reason {
                    effects.found.push(format!("{name} ({reason})"));
                    effects.simulated.push(name.to_string());
                }
                reason.is_some()
            }
            Test::Part(needed) => needed(asked, &features),
        };
        *bit(&mut features) = wanted && (runs.allowed)(asked);
    }
    effects.ignored = ignored::list(asked);
    effects.found.extend(effects.ignored.iter().map(|ignored| ignored.what.clone()));
    (features, effects)
}

/// The rows that can be left out, in order: name and predicate.
pub fn removable() -> impl Iterator<Item = (&'static str, fn(&Asked) -> Option<String>)> {
    TABLE.iter().filter(|row| row.runs.removal.is_some()).filter_map(|row| match row.runs.test {
        Test::Effect(reason) => Some((row.name, reason)),
        Test::Part(_) => None,
    })
}

/// How the effect of this name is left out; `None` where there is none that can be.
pub fn removal(name: &str) -> Option<Removal> {
    TABLE.iter().find(|row| row.name == name)?.runs.removal
}

/// Opens gates that nothing calls for. The picture stays the same, bit for bit: a strategy that must not sample lights
/// does not.
pub fn force(features: &mut Features, gates: &[Gate], asked: &Asked) {
    for row in TABLE.iter().filter(|row| gates.iter().any(|gate| gate.name() == row.name)) {
        *(row.bit)(features) = (row.runs.allowed)(asked);
    }
}

/// Names of the stages in the order in which a wave runs them; a stage that nothing calls for is absent.
pub fn stages(features: &Features) -> Vec<&'static str> {
    let mut features = *features;
    let running: Vec<_> =
        TABLE.iter().filter(|row| *(row.bit)(&mut features)).flat_map(|row| row.runs.stages).collect();
    let mut stages: Vec<(Phase, &str)> = Vec::new();
    for stage in ALWAYS.iter().chain(running.iter().copied()) {
        if let At(phase, name) = *stage
            && !stages.contains(&(phase, name))
        {
            stages.push((phase, name));
        }
    }
    // Stable: within a phase in the order of the table.
    stages.sort_by_key(|(phase, _)| *phase);
    let name = |plain| {
        let other = running.iter().find_map(|stage| match **stage {
            Instead(of, name) if of == plain => Some(name),
            _ => None,
        });
        other.unwrap_or(plain)
    };
    stages.into_iter().map(|(_, plain)| name(plain)).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use glam::{Affine3A, Vec2};

    use super::*;
    use crate::plan::options::RenderOptions;
    use crate::scene::builder::SceneBuilder;
    use crate::scene::geometry::Geometry;
    use crate::scene::material::parameters::TextureSlot;
    use crate::scene::material::slot::Slot;
    use crate::scene::{Mesh, TextureId};

    /// No row hides another: names and bits are unique, and a gate is a row.
    #[test]
    fn rows_are_distinct() {
        let names: BTreeSet<_> = TABLE.iter().map(|row| row.name).collect();
        assert_eq!(names.len(), TABLE.len());
        let mut features = Features::default();
        for row in TABLE {
            assert!(!std::mem::replace((row.bit)(&mut features), true), "{}: its bit is another row's", row.name);
        }
        let gates: BTreeSet<_> = Gate::ALL.iter().map(|gate| gate.name()).collect();
        assert!(gates.len() == Gate::ALL.len() && gates.is_subset(&names), "{gates:?}");
    }

    /// A texture in any slot of a material calls for look-ups. Oracle: the slots. Deterministic.
    #[test]
    fn every_slot_calls_for_look_ups() {
        for slot in Slot::ALL {
            let mut b = SceneBuilder::new();
            let mut material = Material { emissive: Vec3::ONE, ..Material::all_parts() };
            let texture = TextureSlot { texture: TextureId(0), uv_set: 0 };
            *slot.of_mut(&mut material).expect("every part is there") = Some(texture);
            let id = b.material(material);
            let uvs = Some(vec![Vec2::ZERO; 3]);
            let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
            let mesh = Mesh { positions, triangles: vec![[0, 1, 2]], uvs, material: id, ..Mesh::default() };
            let mesh = b.full_mesh(mesh);
            b.place(mesh, Affine3A::IDENTITY).camera(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0);
            let (scene, options) = (b.build(), RenderOptions::new(8, 8));
            let geometry = Geometry::build(&scene);
            let (features, _) = find(&Asked::new(&scene, &options, 0, &geometry));
            assert!(features.textures, "a texture in {} is not looked up", slot.name());
        }
    }

    /// What takes the place of a stage takes that of one that there is, and every stage is in one phase.
    #[test]
    fn stages_are_distinct() {
        let all = || ALWAYS.iter().chain(TABLE.iter().flat_map(|row| row.runs.stages));
        let mut phases: Vec<(&str, Phase)> = Vec::new();
        for (name, phase) in
            all().filter_map(|stage| if let At(phase, name) = *stage { Some((name, phase)) } else { None })
        {
            assert!(phases.iter().all(|(other, at)| *other != name || *at == phase), "{name} is in two phases");
            phases.push((name, phase));
        }
        for stage in all() {
            if let Instead(of, name) = *stage {
                let is_stage = |wanted: &str| phases.iter().any(|(name, _)| *name == wanted);
                assert!(is_stage(of) && !is_stage(name), "{name} instead of {of}");
            }
        }
    }
}
