//! How an effect is taken out of what is rendered: by a change of the scene, of each of its materials, or of the
//! options. A row of the table of effects names its own; where there is none, the effect cannot be left out.
//!
//! What remains is what the file would say without the effect: a texture leaves its factor, a lobe the surface below
//! it, a medium the clear inside. Random numbers are addressed, so nothing else of the picture changes. Limit: a
//! removal takes along what cannot be without it (a clearcoat its textures, absorption what scatters in the same
//! solid).

use crate::plan::options::{RenderOptions, TextureFilter};
use crate::scene::{AlphaMode, Fact, Facts, Material, Scene};

/// What takes an effect away.
#[derive(Clone, Copy)]
pub struct Removal {
    material: fn(&mut Material),
    scene: fn(&mut Scene),
    options: fn(&mut RenderOptions),
}

const NOTHING: Removal = Removal { material: |_| {}, scene: |_| {}, options: |_| {} };

/// Changes every material.
pub const fn materials(change: fn(&mut Material)) -> Removal {
    Removal { material: change, ..NOTHING }
}

/// Changes the rest of the scene.
pub const fn scene(change: fn(&mut Scene)) -> Removal {
    Removal { scene: change, ..NOTHING }
}

/// Changes the options.
pub const fn options(change: fn(&mut RenderOptions)) -> Removal {
    Removal { options: change, ..NOTHING }
}

impl Removal {
    /// Changes the options as well.
    pub const fn and_options(self, change: fn(&mut RenderOptions)) -> Removal {
        Removal { options: change, ..self }
    }

    /// Takes the effect out of a scene.
    pub fn change_scene(&self, scene: &mut Scene) {
        scene.materials.iter_mut().for_each(self.material);
        (self.scene)(scene);
    }

    /// Takes the effect out of options.
    pub fn change_options(&self, options: &mut RenderOptions) {
        (self.options)(options);
    }
}

pub fn smooth_normals(scene: &mut Scene) {
    for mesh in &mut scene.meshes {
        mesh.normals = None;
        mesh.later.iter_mut().for_each(|shape| shape.normals = None);
    }
}

/// Everything stands as it does when the shutter opens.
pub fn shutter(scene: &mut Scene) {
    let motion = &mut scene.motion;
    (motion.shutter, motion.off) = (None, None);
    scene.meshes.iter_mut().for_each(|mesh| mesh.later.clear());
    motion.instances.clear();
    motion.cameras.clear();
}

pub fn lens(options: &mut RenderOptions) {
    options.lens = None;
}

pub fn fog(options: &mut RenderOptions) {
    options.fog = None;
}

pub fn texture_filter(options: &mut RenderOptions) {
    options.texture_filter = TextureFilter::Exact;
}

pub fn alpha_masks(material: &mut Material) {
    if matches!(material.alpha_mode, AlphaMode::Mask { .. }) {
        material.alpha_mode = AlphaMode::Opaque;
    }
}

pub fn alpha_blending(material: &mut Material) {
    if material.alpha_mode == AlphaMode::Blend {
        material.alpha_mode = AlphaMode::Opaque;
    }
}

pub fn specular_textures(material: &mut Material) {
    (material.specular_texture, material.specular_color_texture) = (None, None);
}

/// An opaque dielectric is its diffuse base alone.
pub fn coat(material: &mut Material) {
    if Facts::of(material).has(Fact::Coat) {
        material.specular = 0.0;
        specular_textures(material);
    }
}

/// What has an inside becomes opaque.
pub fn dielectric(material: &mut Material) {
    if Facts::of(material).has(Fact::Solid) {
        opaque(material);
    }
}

/// What is a thin wall becomes opaque.
pub fn thin(material: &mut Material) {
    if Facts::of(material).has(Fact::Thin) {
        opaque(material);
    }
}

fn opaque(material: &mut Material) {
    (material.transmission, material.transmission_texture) = (0.0, None);
}

pub fn clearcoat_textures(material: &mut Material) {
    (material.clearcoat_texture, material.clearcoat_roughness_texture) = (None, None);
}

pub fn clearcoat(material: &mut Material) {
    material.clearcoat = 0.0;
    material.clearcoat_normal_texture = None;
    clearcoat_textures(material);
}

pub fn sheen_textures(material: &mut Material) {
    (material.sheen_color_texture, material.sheen_roughness_texture) = (None, None);
}

pub fn sheen(material: &mut Material) {
    material.sheen_color = glam::Vec3::ZERO;
    sheen_textures(material);
}

pub fn anisotropy(material: &mut Material) {
    (material.anisotropy, material.anisotropy_texture) = (0.0, None);
}

pub fn iridescence_textures(material: &mut Material) {
    (material.iridescence_texture, material.iridescence_thickness_texture) = (None, None);
}

pub fn iridescence(material: &mut Material) {
    material.iridescence = 0.0;
    iridescence_textures(material);
}

pub fn diffuse_transmission_textures(material: &mut Material) {
    (material.diffuse_transmission_texture, material.diffuse_transmission_color_texture) = (None, None);
}

pub fn diffuse_transmission(material: &mut Material) {
    material.diffuse_transmission = 0.0;
    diffuse_transmission_textures(material);
}

pub fn area_lights(material: &mut Material) {
    (material.emissive, material.emissive_texture) = (glam::Vec3::ZERO, None);
}
