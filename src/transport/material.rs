//! A material's textures where a ray meets it: the only page of the transport that reads them.
//!
//! One rule for all readers. A value is factor × texel × vertex colour. A triangle without the channel of texture
//! coordinates that a slot names is read by its first channel; a triangle without any has no texture. Base colour,
//! metallic and roughness are clamped to [0, 1] after that: no surface reflects more than it gets.
//!
//! Under trilinear filtering, what a hit shows (base colour, metallic, roughness, normal map) is averaged over the
//! width of the path there. Emission and alpha are read at points: light sampling and shadow rays read them too, have
//! no width, and must find the same values.

use glam::{Vec2, Vec3, Vec4};

use super::vertices::Vertices;
use super::world::World;
use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
use crate::math::columns::{Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use crate::scene::{AlphaMode, Material, TextureSlot};
use crate::shading::bsdf::model::{Extended, Textured};
use crate::shading::dispersion;
use crate::shading::interaction::{self, Interaction};
use crate::shading::light::TexturePoint;
use crate::texture::{self, ColorSpace};

/// A point of a triangle: where its corner attributes are found, and the weights of its second and third corner.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    attributes: u32,
    weights: [f32; 2],
}

impl Place {
    /// Of the hit of lane `i`.
    #[inline(always)]
    pub fn of_lane(world: &World, rays: &RayHitBlock, i: usize) -> Self {
        let attributes = world.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]).attributes;
        Place { attributes, weights: [rays.hit.u[i], rays.hit.v[i]] }
    }

    /// Of a surface point.
    #[inline(always)]
    pub fn of(at: &Interaction) -> Self {
        let (attributes, weights) = at.corner();
        Place { attributes, weights }
    }

    /// Channel and coordinates that a slot is read by.
    #[inline(always)]
    fn uv(self, world: &World, slot: TextureSlot) -> Option<(u32, Vec2)> {
        let at = |channel| Some((channel, world.geometry.uv(self.attributes, channel, self.weights)?));
        at(slot.uv_set).or_else(|| at(0))
    }

    /// Vertex colour.
    #[inline(always)]
    fn color(self, world: &World) -> Vec4 {
        world.geometry.color(self.attributes, self.weights)
    }

    /// Value of a texture at the point itself; white where there is none.
    #[inline(always)]
    fn texel(self, world: &World, slot: Option<TextureSlot>) -> Vec4 {
        match slot.and_then(|slot| Some((slot, self.uv(world, slot)?))) {
            Some((slot, (_, uv))) => texture::lookup(&world.scene.textures[slot.texture.index()], uv),
            None => Vec4::ONE,
        }
    }
}

/// Probability that a ray meets the surface of `material` at a point.
#[inline]
pub fn coverage(world: &World, material: u32, place: Place) -> f32 {
    let mode = world.alpha.mode(material);
    if mode == AlphaMode::Opaque {
        return 1.0;
    }
    let material = &world.scene.materials[material as usize];
    let mut alpha = material.base_alpha * place.texel(world, material.base_color_texture).w;
    if material.vertex_colors {
        alpha *= place.color(world).w;
    }
    mode.coverage(alpha)
}

/// Radiance of the front side of `material` at a hit.
#[inline(always)]
pub fn emission(world: &World, material: &Material, place: Place) -> Vec3 {
    material.emissive * place.texel(world, material.emissive_texture).truncate()
}

/// Texel of the emission at a sampled light point, times the probability that the emitter is there: what its constant
/// radiance is multiplied by.
#[inline(always)]
pub fn emission_texel(world: &World, point: &TexturePoint) -> Vec3 {
    let triangle = &world.geometry.triangles[point.triangle as usize];
    let place = Place { attributes: triangle.attributes, weights: point.barycentric };
    let there = if world.features.alpha { coverage(world, triangle.material, place) } else { 1.0 };
    place.texel(world, world.scene.materials[triangle.material as usize].emissive_texture).truncate() * there
}

/// Base colour at a point: read without a width.
#[inline(always)]
pub fn base_color(world: &World, material: &Material, place: Place) -> Vec3 {
    tinted(world, material, place, place.texel(world, material.base_color_texture))
}

/// What an unlit surface shows at the hit of lane `i`: its base colour.
pub fn unlit(world: &World, rays: &RayHitBlock, vertices: &Vertices, i: usize) -> Vec3 {
    let material = &world.scene.materials[vertices.material[i] as usize];
    let place = Place::of_lane(world, rays, i);
    match material.base_color_texture.filter(|_| world.features.footprints) {
        Some(slot) => tinted(world, material, place, filtered(world, rays, vertices, i, slot).unwrap_or(Vec4::ONE)),
        None => base_color(world, material, place),
    }
}

/// Base colour of a material whose texture has the value `texel` there.
#[inline(always)]
fn tinted(world: &World, material: &Material, place: Place, texel: Vec4) -> Vec3 {
    let mut color = material.base_color * texel.truncate();
    if material.vertex_colors {
        color *= place.color(world).truncate();
    }
    color.clamp(Vec3::ZERO, Vec3::ONE)
}

/// Value of a texture at the hit of lane `i`, averaged over the path's width there; `None` where there are no
/// coordinates. The exact ratio of the triangle's areas in texture coordinates and in the world carries the width over.
#[inline(never)]
fn filtered(world: &World, rays: &RayHitBlock, vertices: &Vertices, i: usize, slot: TextureSlot) -> Option<Vec4> {
    let texture = &world.scene.textures[slot.texture.index()];
    let triangle = world.geometry.triangle(rays.hit.geom[i], rays.hit.prim[i]);
    let (channel, uv) = Place::of_lane(world, rays, i).uv(world, slot)?;
    let (mut e1, mut e2) = (Vec3::from(triangle.e1), Vec3::from(triangle.e2));
    if rays.hit.inst[i] != INVALID_ID {
        let world_from_object = world.geometry.world_from_object(rays.hit.inst[i], rays.ray.time[i]);
        (e1, e2) = (world_from_object.transform_vector3(e1), world_from_object.transform_vector3(e2));
    }
    let cos = get(&vertices.n_g, i).dot(get(&vertices.wo, i)).abs();
    let per_metre = (uv_area(world, triangle.attributes, channel) / e1.cross(e2).length()).sqrt();
    Some(texture::lookup_filtered(texture, uv, per_metre * vertices.width[i] / cos))
}

/// Twice the area of a triangle in texture coordinates.
fn uv_area(world: &World, attributes: u32, channel: u32) -> f32 {
    let at = |u, v| world.geometry.uv(attributes, channel, [u, v]).unwrap_or_default();
    let corner = at(0.0, 0.0);
    (at(1.0, 0.0) - corner).perp_dot(at(0.0, 1.0) - corner).abs()
}

/// Material factors of sixteen lanes after their textures. Each slot is looked up for all lanes together, so that the
/// waits for memory of sixteen look-ups overlap.
#[repr(C, align(64))]
pub struct Factors {
    /// Linear base colour.
    pub base_color: Lane3,
    /// 0 dielectric … 1 metal.
    pub metallic: Lane,
    /// glTF roughness.
    pub roughness: Lane,
    /// Index of refraction outside of solids.
    pub exterior: Lane,
}

impl Factors {
    /// The base colours of the materials of all lanes, for models that read no textures and no other factors.
    #[inline(always)]
    pub fn base_color(world: &World, vertices: &Vertices) -> Self {
        let mut factors = Factors { base_color: ZERO3, metallic: ZERO, roughness: ZERO, exterior: vertices.exterior };
        for i in 0..LANES {
            set(&mut factors.base_color, i, world.scene.materials[vertices.material[i] as usize].base_color);
        }
        factors.clamp_color();
        factors
    }

    /// The factors of the active lanes with all that is multiplied into them. Normal maps tilt the shading normals of
    /// `vertices`.
    #[inline(always)]
    pub fn look_up(world: &World, rays: &RayHitBlock, vertices: &mut Vertices) -> Self {
        let mut factors = Factors { base_color: ZERO3, metallic: ZERO, roughness: ZERO, exterior: vertices.exterior };
        for i in 0..LANES {
            let material = &world.scene.materials[vertices.material[i] as usize];
            set(&mut factors.base_color, i, material.base_color);
            factors.metallic[i] = material.metallic;
            factors.roughness[i] = material.roughness;
        }
        if world.features.textures {
            factors.apply_textures(world, rays, vertices);
        }
        if world.features.vertex_colors {
            for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
                if world.scene.materials[vertices.material[i] as usize].vertex_colors {
                    let vertex = Place::of_lane(world, rays, i).color(world).truncate();
                    let color = get(&factors.base_color, i) * vertex;
                    set(&mut factors.base_color, i, color);
                }
            }
        }
        factors.clamp_color();
        for i in 0..LANES {
            factors.metallic[i] = factors.metallic[i].clamp(0.0, 1.0);
            factors.roughness[i] = factors.roughness[i].clamp(0.0, 1.0);
        }
        factors
    }

    /// The factors of one lane.
    #[inline(always)]
    pub fn textured(&self, i: usize) -> Textured {
        Textured {
            base_color: get(&self.base_color, i),
            metallic: self.metallic[i],
            roughness: self.roughness[i],
            exterior: self.exterior[i],
        }
    }

    #[inline(always)]
    fn clamp_color(&mut self) {
        for i in 0..LANES {
            let color = get(&self.base_color, i).clamp(Vec3::ZERO, Vec3::ONE);
            set(&mut self.base_color, i, color);
        }
    }

    #[inline(always)]
    fn apply_textures(&mut self, world: &World, rays: &RayHitBlock, vertices: &mut Vertices) {
        let features = world.features;
        let coordinates = Coordinates::at(world, rays, vertices);
        if features.base_color_textures {
            let texels = coordinates.fetch(world, rays, vertices, ColorSpace::Srgb, |m| m.base_color_texture);
            for c in 0..3 {
                for i in 0..LANES {
                    let product = self.base_color[c][i] * texels.rgb[c][i];
                    self.base_color[c][i] = if texels.found[i] != 0 { product } else { self.base_color[c][i] };
                }
            }
        }
        if features.metallic_roughness_textures {
            let texels = coordinates.fetch(world, rays, vertices, ColorSpace::Linear, |m| m.metallic_roughness_texture);
            for i in 0..LANES {
                let (roughness, metallic) = (self.roughness[i] * texels.rgb[1][i], self.metallic[i] * texels.rgb[2][i]);
                self.roughness[i] = if texels.found[i] != 0 { roughness } else { self.roughness[i] };
                self.metallic[i] = if texels.found[i] != 0 { metallic } else { self.metallic[i] };
            }
        }
        if features.normal_maps {
            let texels = coordinates.fetch(world, rays, vertices, ColorSpace::Linear, |m| m.normal_texture);
            for i in (0..LANES).filter(|&i| texels.found[i] != 0) {
                tilt(world, rays, vertices, i, get(&texels.rgb, i));
            }
        }
    }
}

/// Least cosine between the viewer and a normal that was turned back to him.
const LEAST_FACING: f32 = 1e-4;

/// Tilts the shading normal of lane `i` by a texel of its normal map. One that then faces away from the viewer belongs
/// to a facet that he cannot see; he sees one that is tilted as far towards him instead, its mirror image. Unless
/// normals are folded, it stays as it is and scatters nothing.
#[inline(always)]
fn tilt(world: &World, rays: &RayHitBlock, vertices: &mut Vertices, i: usize, texel: Vec3) {
    let scale = world.scene.materials[vertices.material[i] as usize].normal_scale;
    if let Some(n_s) = tilted(world, rays, (get(&vertices.n_s, i), vertices.side[i]), i, (texel, scale)) {
        let wo = get(&vertices.wo, i);
        let facing = n_s.dot(wo);
        let turned = n_s + wo * ((-facing).max(LEAST_FACING) - facing);
        let stays = facing > 0.0 || !world.features.folded_normals;
        set(&mut vertices.n_s, i, if stays { n_s } else { interaction::unit_or(turned, n_s) });
    }
}

/// The normal `n` of the viewer's side, tilted by a texel of a normal map; `None` where there are no tangents.
#[inline(always)]
fn tilted(
    world: &World,
    rays: &RayHitBlock,
    (n, side): (Vec3, f32),
    i: usize,
    (texel, scale): (Vec3, f32),
) -> Option<Vec3> {
    // Maps are authored for normals of the front side.
    let n_s = n * side;
    let tangent = interaction::tangent(world.geometry, &rays.hit_unchecked(i), n_s)?;
    let map = Vec3::new((texel.x * 2.0 - 1.0) * scale, (texel.y * 2.0 - 1.0) * scale, texel.z * 2.0 - 1.0);
    Some(interaction::tilt(n_s, tangent, map) * side)
}

/// What the extensions of the material at the hit of lane `i` say there, with their textures. `n` is the mesh's shading
/// normal, on the viewer's side.
#[inline(never)]
pub fn extended(world: &World, rays: &RayHitBlock, vertices: &Vertices, i: usize, n: Vec3) -> Extended {
    let material = &world.scene.materials[vertices.material[i] as usize];
    let mut extended = Extended::constant(material, n);
    if vertices.wavelength_nm[i] > 0.0 {
        let boundary = &mut extended.boundary;
        boundary.ior = dispersion::index(boundary.ior, material.dispersion, vertices.wavelength_nm[i]);
    }
    let mut turn = material.anisotropy_rotation_rad;
    if world.features.textures {
        turn += look_up_extended(world, rays, vertices, (i, n), &mut extended);
    }
    if extended.anisotropy > 0.0 {
        let front = get(&vertices.n_s, i) * vertices.side[i];
        match interaction::tangent(world.geometry, &rays.hit_unchecked(i), front) {
            Some(tangent) => {
                let (sin, cos) = turn.sin_cos();
                let (t, b) = (tangent.truncate(), front.cross(tangent.truncate()) * tangent.w);
                extended.tangent = t * cos + b * sin;
            }
            None => extended.anisotropy = 0.0,
        }
    }
    extended
}

/// Multiplies textures into what the extensions say at the hit of lane `i`. Returns by what angle the grain is turned.
fn look_up_extended(
    world: &World,
    rays: &RayHitBlock,
    vertices: &Vertices,
    (i, n): (usize, Vec3),
    extended: &mut Extended,
) -> f32 {
    let material = &world.scene.materials[vertices.material[i] as usize];
    let place = Place::of_lane(world, rays, i);
    let texel = |slot: Option<TextureSlot>| match slot.filter(|_| world.features.footprints) {
        Some(slot) => filtered(world, rays, vertices, i, slot).unwrap_or(Vec4::ONE),
        None => place.texel(world, slot),
    };
    let unit = |factor: f32| factor.clamp(0.0, 1.0);
    let color = |factor: Vec3| factor.clamp(Vec3::ZERO, Vec3::ONE);
    let boundary = &mut extended.boundary;
    boundary.transmission = unit(boundary.transmission * texel(material.transmission_texture).x);
    boundary.specular = unit(boundary.specular * texel(material.specular_texture).w);
    boundary.specular_color *= texel(material.specular_color_texture).truncate();
    extended.glossiness = texel(material.glossiness_texture).w;
    extended.clearcoat = unit(extended.clearcoat * texel(material.clearcoat_texture).x);
    extended.clearcoat_roughness = unit(extended.clearcoat_roughness * texel(material.clearcoat_roughness_texture).y);
    extended.sheen_color = color(extended.sheen_color * texel(material.sheen_color_texture).truncate());
    extended.sheen_roughness = unit(extended.sheen_roughness * texel(material.sheen_roughness_texture).w);
    extended.film.weight = unit(extended.film.weight * texel(material.iridescence_texture).x);
    if material.iridescence_thickness_texture.is_some() {
        let [least, most] = material.iridescence_thickness_nm;
        extended.film.thickness_nm = least + (most - least) * texel(material.iridescence_thickness_texture).y;
    }
    let fraction = extended.diffuse_transmission * texel(material.diffuse_transmission_texture).w;
    extended.diffuse_transmission = unit(fraction);
    let through = texel(material.diffuse_transmission_color_texture).truncate();
    extended.diffuse_transmission_color = color(extended.diffuse_transmission_color * through);
    if material.clearcoat_normal_texture.is_some() {
        let map = texel(material.clearcoat_normal_texture).truncate();
        let tilted = tilted(world, rays, (n, vertices.side[i]), i, (map, material.clearcoat_normal_scale));
        // A layer that the viewer would see from below has no meaning: it keeps the mesh's normal there.
        extended.clearcoat_n = tilted.filter(|tilted| tilted.dot(get(&vertices.wo, i)) > 0.0).unwrap_or(n);
    }
    if material.anisotropy_texture.is_none() {
        return 0.0;
    }
    let grain = texel(material.anisotropy_texture);
    extended.anisotropy = unit(extended.anisotropy * grain.z);
    (grain.y * 2.0 - 1.0).atan2(grain.x * 2.0 - 1.0)
}

/// Where sixteen lanes read their textures.
struct Coordinates {
    /// 1 where the material reads some texture.
    reads: Mask,
    /// Where on the triangle that was hit.
    places: [Place; LANES],
    /// Coordinates of channel 0, which nearly all slots are read by; `found` says where the triangle has them.
    uv: [Lane; 2],
    found: Mask,
}

/// What sixteen lanes found in one of their textures.
struct Texels {
    /// Linear; any value where nothing was found.
    rgb: Lane3,
    /// 1 where the material has such a texture and the triangle coordinates.
    found: Mask,
}

impl Coordinates {
    #[inline(always)]
    fn at(world: &World, rays: &RayHitBlock, vertices: &Vertices) -> Self {
        let nowhere = Place { attributes: 0, weights: [0.0; 2] };
        let mut at = Coordinates { reads: [0; LANES], places: [nowhere; LANES], uv: [ZERO; 2], found: [0; LANES] };
        for i in 0..LANES {
            let material = &world.scene.materials[vertices.material[i] as usize];
            let slots = [material.base_color_texture, material.metallic_roughness_texture, material.normal_texture];
            if vertices.active[i] != 0 && slots.iter().any(Option::is_some) {
                at.reads[i] = 1;
                at.places[i] = Place::of_lane(world, rays, i);
                if let Some(uv) = world.geometry.uv(at.places[i].attributes, 0, at.places[i].weights) {
                    (at.uv[0][i], at.uv[1][i], at.found[i]) = (uv.x, uv.y, 1);
                }
            }
        }
        at
    }

    /// Looks one slot of the materials up.
    #[inline(always)]
    fn fetch(
        &self,
        world: &World,
        rays: &RayHitBlock,
        vertices: &Vertices,
        color_space: ColorSpace,
        slot: impl Fn(&Material) -> Option<TextureSlot>,
    ) -> Texels {
        let (mut found, mut textures, mut uv) = ([0; LANES], [None; LANES], self.uv);
        let mut rgb = ZERO3;
        for i in (0..LANES).filter(|&i| self.reads[i] != 0) {
            let Some(slot) = slot(&world.scene.materials[vertices.material[i] as usize]) else { continue };
            if world.features.footprints {
                if let Some(texel) = filtered(world, rays, vertices, i, slot) {
                    found[i] = 1;
                    set(&mut rgb, i, texel.truncate());
                }
                continue;
            }
            found[i] = self.found[i];
            if slot.uv_set != 0
                && let Some((_, other)) = self.places[i].uv(world, slot)
            {
                (uv[0][i], uv[1][i], found[i]) = (other.x, other.y, 1);
            }
            if found[i] != 0 {
                textures[i] = Some(&world.scene.textures[slot.texture.index()]);
            }
        }
        if !world.features.footprints {
            rgb = texture::lookup_lanes(&textures, color_space, &uv[0], &uv[1]);
        }
        Texels { rgb, found }
    }
}
