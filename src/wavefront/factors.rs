//! Material factors of sixteen lanes after their textures, and normal maps. Each texture slot is looked up for all lanes
//! together, so that the waits for memory of sixteen look-ups overlap.

use glam::Vec3;

use super::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use super::vertices::Vertices;
use super::{Context, footprint};
use crate::backend::batch::{LANES, RayHitBlock};
use crate::scene::{Material, TextureSlot};
use crate::shading::interaction;
use crate::shading::surface::Textured;
use crate::texture::{self, ColorSpace};

/// See the module.
#[repr(C, align(64))]
pub struct Factors {
    /// Linear base colour.
    pub base_color: Lane3,
    /// 0 dielectric … 1 metal.
    pub metallic: Lane,
    /// glTF roughness.
    pub roughness: Lane,
    /// Lanes whose shading normal a map has tilted.
    pub mapped: Mask,
}

impl Factors {
    /// Looks the materials of the active lanes up. Tilts the shading normals of `vertices`; one may then face away from the viewer.
    #[inline(always)]
    pub fn look_up(context: &Context, rays: &RayHitBlock, vertices: &mut Vertices) -> Self {
        let mut factors = Factors { base_color: ZERO3, metallic: ZERO, roughness: ZERO, mapped: [0; LANES] };
        for i in 0..LANES {
            let material = &context.scene.materials[vertices.material[i] as usize];
            set(&mut factors.base_color, i, material.base_color);
            factors.metallic[i] = material.metallic;
            factors.roughness[i] = material.roughness;
        }
        if context.plan.features.textures {
            factors.apply_textures(context, rays, vertices);
        }
        if context.plan.features.vertex_colors {
            for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
                if context.scene.materials[vertices.material[i] as usize].vertex_colors {
                    let attributes = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
                    let vertex = context.geometry.color(attributes, [rays.hit.u[i], rays.hit.v[i]]).truncate();
                    let color = get(&factors.base_color, i) * vertex;
                    set(&mut factors.base_color, i, color);
                }
            }
        }
        factors
    }

    /// The factors of one lane.
    #[inline(always)]
    pub fn textured(&self, i: usize) -> Textured {
        Textured { base_color: get(&self.base_color, i), metallic: self.metallic[i], roughness: self.roughness[i] }
    }

    #[inline(always)]
    fn apply_textures(&mut self, context: &Context, rays: &RayHitBlock, vertices: &mut Vertices) {
        let features = &context.plan.features;
        let coordinates = Coordinates::at(context, rays, vertices);
        if features.base_color_textures {
            let texels = coordinates.fetch(context, rays, vertices, ColorSpace::Srgb, |m| m.base_color_texture);
            for c in 0..3 {
                for i in 0..LANES {
                    let product = self.base_color[c][i] * texels.rgb[c][i];
                    self.base_color[c][i] = if texels.found[i] != 0 { product } else { self.base_color[c][i] };
                }
            }
        }
        if features.metallic_roughness_textures {
            let texels =
                coordinates.fetch(context, rays, vertices, ColorSpace::Linear, |m| m.metallic_roughness_texture);
            for i in 0..LANES {
                let (roughness, metallic) = (self.roughness[i] * texels.rgb[1][i], self.metallic[i] * texels.rgb[2][i]);
                self.roughness[i] = if texels.found[i] != 0 { roughness } else { self.roughness[i] };
                self.metallic[i] = if texels.found[i] != 0 { metallic } else { self.metallic[i] };
            }
        }
        if features.normal_maps {
            let texels = coordinates.fetch(context, rays, vertices, ColorSpace::Linear, |m| m.normal_texture);
            for i in (0..LANES).filter(|&i| texels.found[i] != 0) {
                let scale = context.scene.materials[vertices.material[i] as usize].normal_scale;
                let texel = get(&texels.rgb, i);
                // Maps are authored for normals of the front side.
                let (n_s, side) = (get(&vertices.n_s, i) * vertices.side[i], vertices.side[i]);
                let hit = rays.hit_unchecked(i);
                if let Some(tangent) = interaction::tangent(context.geometry, &hit, n_s) {
                    let map =
                        Vec3::new((texel.x * 2.0 - 1.0) * scale, (texel.y * 2.0 - 1.0) * scale, texel.z * 2.0 - 1.0);
                    set(&mut vertices.n_s, i, interaction::tilt(n_s, tangent, map) * side);
                    self.mapped[i] = 1;
                }
            }
        }
    }
}

/// Where sixteen lanes read their textures.
struct Coordinates {
    /// 1 where the material reads some texture and the triangle has coordinates.
    reads: Mask,
    /// Channel 0 of the texture coordinates; slots with another look it up themselves.
    uv: [Lane; 2],
    /// Attributes of the triangle that was hit.
    attributes: [u32; LANES],
}

/// What sixteen lanes found in one of their textures.
struct Found {
    /// Linear; any value where nothing was found.
    rgb: Lane3,
    /// 1 where the material has such a texture.
    found: Mask,
}

impl Coordinates {
    #[inline(always)]
    fn at(context: &Context, rays: &RayHitBlock, vertices: &Vertices) -> Self {
        let mut at = Coordinates { reads: [0; LANES], uv: [ZERO; 2], attributes: [0; LANES] };
        for i in 0..LANES {
            if vertices.active[i] != 0 && context.scene.materials[vertices.material[i] as usize].reads_textures() {
                at.attributes[i] = context.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
                if let Some(uv) = context.geometry.uv(at.attributes[i], 0, [rays.hit.u[i], rays.hit.v[i]]) {
                    (at.uv[0][i], at.uv[1][i], at.reads[i]) = (uv.x, uv.y, 1);
                }
            }
        }
        at
    }

    /// Looks one slot of the materials up.
    #[inline(always)]
    fn fetch(
        &self,
        context: &Context,
        rays: &RayHitBlock,
        vertices: &Vertices,
        color_space: ColorSpace,
        slot: impl Fn(&Material) -> Option<TextureSlot>,
    ) -> Found {
        let (mut found, mut textures, mut uv) = ([0; LANES], [None; LANES], self.uv);
        let mut rgb = ZERO3;
        for i in (0..LANES).filter(|&i| self.reads[i] != 0) {
            let Some(slot) = slot(&context.scene.materials[vertices.material[i] as usize]) else { continue };
            found[i] = 1;
            if context.plan.features.footprints {
                set(&mut rgb, i, footprint::lookup(context, rays, vertices, i, slot).truncate());
                continue;
            }
            textures[i] = Some(&context.scene.textures[slot.texture.index()]);
            if slot.uv_set != 0 {
                let corners = [rays.hit.u[i], rays.hit.v[i]];
                if let Some(other) = context.geometry.uv(self.attributes[i], slot.uv_set, corners) {
                    (uv[0][i], uv[1][i]) = (other.x, other.y);
                }
            }
        }
        if !context.plan.features.footprints {
            rgb = texture::lookup_lanes(&textures, color_space, &uv[0], &uv[1]);
        }
        Found { rgb, found }
    }
}
