//! One predicate an effect: the reason for which it is found, naming the first object that asks for it, or `None`.

use super::asked::{Asked, Placed};
use crate::plain::one_line;
use crate::plan::aov::Gathers;
use crate::plan::options::{Backfaces, Roulette, TextureFilter};
use crate::scene::{AlphaMode, Fact, Facts, Material, Projection, PunctualKind, TextureSlot};

/// The first placed mesh for which `asks` is true.
fn first<'a>(asked: &Asked<'a>, asks: impl Fn(&Placed<'a>) -> bool) -> Option<Placed<'a>> {
    asked.placed.iter().copied().find(asks)
}

fn first_mesh<'a>(asked: &Asked<'a>, asks: impl Fn(&Placed<'a>) -> bool) -> Option<String> {
    first(asked, asks).map(|placed| format!("mesh '{}'", one_line(&placed.mesh.name)))
}

fn first_material<'a>(asked: &Asked<'a>, asks: impl Fn(&Placed<'a>) -> bool) -> Option<String> {
    first(asked, asks).map(|placed| format!("material '{}'", one_line(&placed.material.name)))
}

/// The first material of which a fact is true.
pub fn first_with(asked: &Asked, fact: Fact) -> Option<String> {
    first_material(asked, |placed| placed.facts.has(fact))
}

/// As [`first_material`], by a slot of meshes with texture coordinates.
pub fn first_textured(asked: &Asked, slot: fn(&Material) -> Option<TextureSlot>) -> Option<String> {
    first_material(asked, |placed| placed.mesh.uvs.is_some() && slot(placed.material).is_some())
}

pub fn lens(asked: &Asked) -> Option<String> {
    let lens = asked.options.lens.filter(|_| !is_parallel(asked))?;
    Some(format!("aperture radius {} m", lens.radius_m))
}

/// Whether the camera's rays are parallel: such a camera has no aperture.
pub fn is_parallel(asked: &Asked) -> bool {
    let camera = asked.scene.cameras.get(asked.camera);
    camera.is_some_and(|camera| matches!(camera.projection, Projection::Orthographic { .. }))
}

pub fn smooth_normals(asked: &Asked) -> Option<String> {
    first_mesh(asked, |placed| placed.mesh.normals.is_some())
}

pub fn base_color_textures(asked: &Asked) -> Option<String> {
    first_textured(asked, |material| material.base_color_texture)
}

pub fn metallic_roughness_textures(asked: &Asked) -> Option<String> {
    first_textured(asked, |material| material.metallic_roughness_texture)
}

pub fn normal_maps(asked: &Asked) -> Option<String> {
    first_textured(asked, |material| material.normal_texture)
}

pub fn emissive_textures(asked: &Asked) -> Option<String> {
    first_textured(asked, |material| material.emissive_texture)
}

pub fn texture_filter(asked: &Asked) -> Option<String> {
    let filter = asked.options.texture_filter;
    let reads = |placed: &Placed| placed.mesh.uvs.is_some() && placed.facts.has(Fact::Textures);
    (filter == TextureFilter::Trilinear && first(asked, reads).is_some()).then(|| filter.name().into())
}

pub fn alpha_masks(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| matches!(placed.facts.alpha, AlphaMode::Mask { .. }))
}

pub fn alpha_blending(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| placed.facts.alpha == AlphaMode::Blend)
}

pub fn vertex_colors(asked: &Asked) -> Option<String> {
    first_mesh(asked, |placed| placed.facts.has(Fact::VertexColors) && placed.mesh.colors.is_some())
}

pub fn more_uvs(asked: &Asked) -> Option<String> {
    first_mesh(asked, |Placed { mesh, material, .. }| {
        mesh.uvs.is_some() && !mesh.more_uvs.is_empty() && material.uv_channels() > 1
    })
}

pub fn unlit(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Unlit)
}

pub fn area_lights(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Emits)
}

pub fn double_sided_lamps(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| placed.facts.has(Fact::Emits) && placed.material.double_sided)
}

pub fn metal(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Metal)
}

pub fn coat(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Coat)
}

/// An opaque dielectric without a coat, whether or not it is mixed with a metal.
pub fn lambert(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| placed.facts.has(Fact::Base) && !placed.facts.has(Fact::Coat))
}

pub fn dielectric(asked: &Asked) -> Option<String> {
    let solid = first(asked, |placed| placed.facts.has(Fact::Solid))?.material;
    let rough = if solid.roughness > 0.0 { "rough" } else { "smooth" };
    Some(format!("{rough}, material '{}'", one_line(&solid.name)))
}

pub fn absorption(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Absorbs)
}

/// Fog, or a solid that scatters.
pub fn scattering(asked: &Asked) -> Option<String> {
    let fog = asked.options.fog.map(|fog| format!("fog of {} per metre", fog.sigma_t));
    fog.or_else(|| first_with(asked, Fact::Scatters))
}

/// Two solids that may share a place.
pub fn nested(asked: &Asked) -> Option<String> {
    let solids = &asked.geometry.solids;
    let name = |number: u32| {
        let solid = solids.list()[number as usize];
        one_line(&asked.scene.materials[solid.material as usize].name)
    };
    let [a, b] = solids.overlapping()?;
    Some(format!("solids '{}' and '{}'", name(a), name(b)))
}

/// A solid that only bounds its inside and has the index of air.
pub fn matched(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| placed.facts.has(Fact::Clear) && placed.material.ior == 1.0)
}

/// Triangles that lie on one another and look different.
pub fn coincident(asked: &Asked) -> Option<String> {
    let geometry = asked.geometry;
    let &record = geometry.coincident.records().first()?;
    let partner = *geometry.coincident.of(record).all.first()?;
    let [a, b] = [record, partner].map(|record| {
        let material = geometry.triangles[record as usize].material;
        one_line(&asked.scene.materials[material as usize].name)
    });
    Some(format!("of materials '{a}' and '{b}'"))
}

/// A material that loses light between facets, where that is given back.
pub fn multiscatter(asked: &Asked) -> Option<String> {
    first_material(asked, |placed| placed.facts.loses()).filter(|_| asked.options.multiscatter)
}

/// Materials whose backs rays pass.
pub fn hidden_backs(asked: &Asked) -> Option<String> {
    let backfaces = asked.options.backfaces;
    let material = first_material(asked, |placed| placed.material.is_one_sided())?;
    (backfaces != Backfaces::Show).then(|| format!("{}, {material}", backfaces.name()))
}

pub fn thin(asked: &Asked) -> Option<String> {
    first_with(asked, Fact::Thin)
}

pub fn environment(asked: &Asked) -> Option<String> {
    let environment = asked.scene.environment.as_ref()?;
    let shines = environment.intensity > 0.0 && environment.texels.iter().any(|t| t.max_element() > 0.0);
    shines.then(|| format!("{}×{} texels", environment.width, environment.height))
}

pub fn punctual(asked: &Asked) -> Option<String> {
    let lights = if asked.samples_lights() { &asked.scene.punctual[..] } else { &[] };
    let light = lights.iter().find(|light| light.intensity.max_element() > 0.0)?;
    let kind = match light.kind {
        PunctualKind::Point if light.profile.is_some() => "photometric",
        PunctualKind::Point => "point",
        PunctualKind::Spot { .. } => "spot",
        PunctualKind::Directional => "directional",
    };
    Some(format!("{kind} light '{}'", one_line(&light.name)))
}

/// Whether an emissive mesh stands still: moving ones are not sampled.
pub fn has_lamp_at_rest(asked: &Asked) -> bool {
    let scene = asked.scene;
    scene.instances.iter().enumerate().any(|(index, instance)| {
        scene.materials[scene.material_of(instance).index()].is_emissive() && scene.motion.of_instance(index).is_none()
    })
}

pub fn instancing(asked: &Asked) -> Option<String> {
    (!asked.geometry.instances.is_empty()).then(|| format!("{} placements", asked.scene.instances.len()))
}

pub fn per_length(asked: &Asked) -> Option<String> {
    let wanted = asked.options.per_length || asked.options.aovs.iter().any(|aov| aov.is_of_lengths());
    wanted.then(|| "asked for".into())
}

pub fn light_groups(asked: &Asked) -> Option<String> {
    asked.options.aovs.iter().any(|aov| aov.gathers() == Gathers::LightGroups).then(|| "asked for".into())
}

pub fn lobes(asked: &Asked) -> Option<String> {
    let aov = asked.options.aovs.iter().find(|aov| matches!(aov.gathers(), Gathers::Scattered(_)))?;
    Some(format!("channels '{}'", aov.name()))
}

pub fn first_hit(asked: &Asked) -> Option<String> {
    let aov = asked.options.aovs.iter().find(|aov| aov.is_of_first_hit())?;
    Some(format!("channels '{}'", aov.name()))
}

pub fn followed(asked: &Asked) -> Option<String> {
    let aov = asked.options.aovs.iter().find(|aov| matches!(aov.gathers(), Gathers::Followed(_)))?;
    Some(format!("channels '{}'", aov.name()))
}

/// Something that is seen moves while the shutter is open.
pub fn shutter(asked: &Asked) -> Option<String> {
    let motion = &asked.scene.motion;
    let shutter = motion.shutter?;
    let camera = if motion.of_camera(asked.camera).is_some() { ", the camera" } else { "" };
    if camera.is_empty() && motion.instances.is_empty() {
        return None;
    }
    let mesh = motion.instances.first().map_or(String::new(), |track| {
        let mesh = &asked.scene.meshes[asked.scene.instances[track.index].mesh.index()];
        format!(", mesh '{}'", one_line(&mesh.name))
    });
    let (open_s, close_s, moving) = (shutter.open_s(), shutter.close_s(), motion.instances.len());
    let changing = asked.scene.meshes.iter().filter(|mesh| !mesh.later.is_empty()).count();
    let shapes = if changing > 0 { format!(", {changing} meshes change their shape") } else { String::new() };
    Some(format!("{open_s} s to {close_s} s; {moving} placements move{mesh}{shapes}{camera}"))
}

/// Whether a solid moves while the shutter is open, so that what is in it may change.
pub fn moving_solid(asked: &Asked) -> bool {
    let (scene, motion) = (asked.scene, &asked.scene.motion);
    let solid = |index: usize| {
        let material = &scene.materials[scene.material_of(&scene.instances[index]).index()];
        Facts::with_textures(material, &scene.textures).has(Fact::Solid)
    };
    motion.shutter.is_some() && motion.instances.iter().any(|track| solid(track.index))
}

pub fn roulette(asked: &Asked) -> bool {
    asked.options.roulette != Roulette::Off
}
