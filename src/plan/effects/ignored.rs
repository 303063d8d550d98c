//! What scene and options ask for in vain, and why.

use serde::Serialize;

use super::asked::{Asked, Placed};
use super::found;
use crate::plain::one_line;
use crate::plan::light_groups;
use crate::plan::options::Backfaces;

/// An effect that is not simulated, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Ignored {
    /// Name of the effect, with the object that asks for it.
    pub what: String,
    /// Why it is not simulated.
    pub why: String,
}

/// Everything that is ignored, each thing once.
pub fn list(asked: &Asked) -> Vec<Ignored> {
    let mut ignored = List(Vec::new());
    shutter(asked, &mut ignored);
    placements(asked, &mut ignored);
    if let Some(placed) = asked.placed.iter().find(|placed| placed.material.occlusion_texture) {
        let what = format!("occlusion-textures (material '{}')", placed.material.name);
        ignored.add(what, "light transport computes occlusion itself");
    }
    if let Some(placed) = asked.placed.iter().find(|placed| placed.material.thickness_texture) {
        let what = format!("thickness-textures (material '{}')", placed.material.name);
        ignored.add(what, "light goes as far through solids as the geometry says");
    }
    if asked.scene.environment.is_some() && found::environment(asked).is_none() {
        ignored.add("environment".into(), "its radiance is 0 everywhere");
    }
    punctual(asked, &mut ignored);
    if asked.options.lens.is_some() && found::is_parallel(asked) {
        ignored.add("lens".into(), "an orthographic camera has no aperture");
    }
    for left_out in &asked.scene.left_out {
        ignored.add(left_out.found.clone(), "left out (--without)");
    }
    for group in light_groups::unmatched(asked.scene, &asked.options.light_groups) {
        ignored.add(format!("light group '{}={}'", group.name, group.pattern), "no lamp has such a name");
    }
    if asked.options.backfaces == Backfaces::Show {
        let one_sided = |placed: &&Placed| placed.material.is_one_sided() && placed.mesh.is_open();
        if let Some(placed) = asked.placed.iter().find(one_sided) {
            let what = format!("one-sided-faces (material '{}')", one_line(&placed.material.name));
            ignored.add(what, "both sides are seen; --backfaces hide lets camera rays pass backs");
        }
    }
    ignored.0
}

struct List(Vec<Ignored>);

impl List {
    fn add(&mut self, what: String, why: &str) {
        if !self.0.iter().any(|ignored| ignored.what == what) {
            self.0.push(Ignored { what, why: why.into() });
        }
    }
}

/// A shutter that sees nothing move, and animations that do not move.
fn shutter(asked: &Asked, ignored: &mut List) {
    let motion = &asked.scene.motion;
    let Some(shutter) = motion.shutter else { return };
    if found::shutter(asked).is_none() {
        let why = match (motion.animations.is_empty(), shutter.is_instant()) {
            (true, _) => "the scene has no animations",
            (false, true) => "of zero length: the scene is posed at that time and stands still",
            (false, false) => "nothing that is seen moves meanwhile",
        };
        ignored.add(format!("shutter ({} s to {} s)", shutter.open_s(), shutter.close_s()), why);
    }
    for unmoved in &motion.unmoved {
        ignored.add(unmoved.what.clone(), &unmoved.why);
    }
}

/// Light sampling of moving lamps, and textures on meshes without coordinates.
fn placements(asked: &Asked, ignored: &mut List) {
    let scene = asked.scene;
    for (index, instance) in scene.instances.iter().enumerate() {
        let mesh = &scene.meshes[instance.mesh.index()];
        let material = &scene.materials[scene.material_of(instance).index()];
        if material.is_emissive() && scene.motion.of_instance(index).is_some() {
            let what = format!("light sampling of mesh '{}'", mesh.name);
            ignored.add(what, "it moves; BSDF sampling alone finds it");
        }
        if mesh.uvs.is_none() && material.reads_textures() {
            let what = format!("textures of material '{}' on mesh '{}'", material.name, mesh.name);
            ignored.add(what, "the mesh has no texture coordinates");
        }
    }
}

fn punctual(asked: &Asked, ignored: &mut List) {
    for light in &asked.scene.punctual {
        let why = match (light.intensity.max_element() > 0.0, asked.samples_lights()) {
            (false, _) => "its intensity is 0",
            (true, false) => "strategy bsdf: BSDF sampling cannot find a punctual light",
            (true, true) => continue,
        };
        ignored.add(format!("light '{}'", light.name), why);
    }
}
