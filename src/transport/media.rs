//! What paths run in: which solids are around them, what those absorb, what lies outside of a boundary, and which
//! boundaries rays pass. One stack a camera sample; renders of scenes without media have none.

use glam::Vec3;

use super::tape::LANE;
use super::vertices::Vertices;
use super::wave::PathBlock;
use super::world::World;
use crate::backend::batch::{Hit, LANES, RayHitBlock};
use crate::math::columns::{Lane, Lane3, Mask, get, set};
use crate::math::lanes::lanes_of;
use crate::plan::options::Fog;
use crate::scene::Material;
use crate::scene::geometry::NO_SOLID;
use crate::shading::bsdf::fresnel::relative_index;
use crate::shading::bsdf::model::HIDDEN;
use crate::shading::medium::{self, Boundary, Media};
use crate::shading::scattering::Coefficients;

/// Boundaries at one place: that of the surface that counts, and that of a second solid.
pub type Boundaries = [Option<Boundary>; 2];

/// Number of the solid that a hit lies on; [`NO_SOLID`] where there is none.
#[inline(always)]
pub fn solid_of(world: &World, hit: &Hit) -> u32 {
    let record = world.geometry.meshes[hit.geom as usize].first_triangle + hit.prim;
    world.geometry.solids.of(record as usize, hit.inst)
}

/// The boundary that a hit lies on, met from outside or from inside.
#[inline(always)]
pub fn boundary(world: &World, hit: &Hit, entering: bool) -> Option<Boundary> {
    let solid = solid_of(world, hit);
    (solid != NO_SOLID).then_some(Boundary { solid, entering })
}

/// Material of a medium; `None` outside of all solids.
#[inline(always)]
pub fn material_of<'a>(world: &World<'a>, solid: u32) -> Option<&'a Material> {
    let solid = world.geometry.solids.list().get(solid as usize)?;
    Some(&world.scene.materials[solid.material as usize])
}

/// Fraction of light left after a way inside a solid.
#[inline(always)]
pub fn transmittance(world: &World, solid: u32, distance_m: f32) -> Vec3 {
    material_of(world, solid).map_or(Vec3::ONE, |material| medium::transmittance(material, distance_m))
}

/// What a medium does to light; asked only where media scatter.
#[inline(always)]
pub fn coefficients(world: &World, solid: u32) -> Coefficients {
    match world.geometry.solids.list().get(solid as usize) {
        Some(solid) => world.coefficients[solid.material as usize],
        None => world.fog.map_or(Coefficients::VACUUM, |fog| of_fog(&fog.medium)),
    }
}

/// A stretch of a ray within one medium.
#[derive(Clone, Copy)]
pub struct Stretch {
    /// Origin of the ray.
    pub org: Vec3,
    /// Its unit direction.
    pub dir: Vec3,
    /// The medium.
    pub medium: u32,
    /// Where it begins and ends, metres along the ray.
    pub between: [f32; 2],
}

fn of_fog(fog: &Fog) -> Coefficients {
    Coefficients::new(Vec3::splat(fog.sigma_t), Vec3::splat(fog.albedo), fog.g)
}

/// Where a stretch runs through its medium: all of it in a solid, within the sphere in fog.
pub fn reach(world: &World, stretch: &Stretch) -> [f32; 2] {
    let [from, to] = stretch.between;
    match world.fog.filter(|_| stretch.medium == NO_SOLID) {
        None => [from, to],
        Some(fog) => {
            let [enters, leaves] = fog.met_by(stretch.org, stretch.dir);
            let from = from.max(enters);
            [from, to.min(leaves).max(from)]
        }
    }
}

/// Fraction of light left after a stretch.
#[inline(always)]
pub fn left(world: &World, stretch: &Stretch) -> Vec3 {
    if !world.features.scattering {
        return transmittance(world, stretch.medium, stretch.between[1] - stretch.between[0]);
    }
    let [from, to] = reach(world, stretch);
    coefficients(world, stretch.medium).transmittance(to - from)
}

/// Fraction of light left on the way to infinity from where a path leaves the scene; paths that scatter have travelled
/// it already.
pub fn left_to_infinity(world: &World, around: &Media) -> Vec3 {
    if world.features.scattering { Vec3::ONE } else { transmittance(world, around.top(), f32::INFINITY) }
}

/// A boundary that light goes straight through.
pub struct Straight {
    /// The medium before it.
    pub from: u32,
    /// What it multiplies light by.
    pub tint: Vec3,
}

/// How a ray in `around` passes a surface of `material` with these boundaries; `None` where it is reflected or bent,
/// at least in part.
pub fn straight(world: &World, around: &Media, boundaries: Boundaries, material: u32) -> Option<Straight> {
    boundaries[0]?;
    let [from, to] = around.across(boundaries);
    if from == to {
        return Some(Straight { from, tint: Vec3::ONE });
    }
    let tint = world.clear[material as usize]?;
    let index = |medium| material_of(world, medium).map_or(1.0, |material| relative_index(material.ior));
    (index(from) == index(to)).then_some(Straight { from, tint })
}

/// Takes a path, or a shadow ray, through boundaries `distance_m` from where it starts.
pub fn cross(around: &mut Media, boundaries: Boundaries, distance_m: f32) {
    boundaries.into_iter().flatten().for_each(|boundary| around.cross(boundary));
    around.since_m = distance_m;
}

/// Takes off what the media on the last edge absorbed, and finds out what is outside of the boundaries that it met.
/// Returns what was left in the first lane, for reports.
#[inline(never)]
pub fn arrive(
    world: &World,
    vertices: &mut Vertices,
    (rays, paths): (&RayHitBlock, &PathBlock),
    media: &[Media],
    touching: &[Option<Boundary>],
) -> Vec3 {
    let mut first = Vec3::ONE;
    for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
        let around = &media[paths.slot[i] as usize];
        let entering = vertices.side[i] > 0.0;
        let boundaries = boundaries(world, vertices, (rays, paths), touching, i);
        let [from, to] = around.across(boundaries);
        if boundaries[0].is_some() {
            let outside = if entering { from } else { to };
            let index = material_of(world, outside).map_or(1.0, |material| material.ior);
            vertices.exterior[i] = if from == to { HIDDEN } else { index };
        }
        if world.features.absorption && !world.features.scattering {
            let left = transmittance(world, from, rays.ray.tfar[i] - around.since_m);
            let beta = get(&vertices.beta, i) * left;
            set(&mut vertices.beta, i, beta);
            if i == LANE {
                first = left;
            }
        }
    }
    first
}

/// The boundaries that the path in lane `i` has met.
#[inline(always)]
fn boundaries(
    world: &World,
    vertices: &Vertices,
    (rays, paths): (&RayHitBlock, &PathBlock),
    touching: &[Option<Boundary>],
    i: usize,
) -> Boundaries {
    let own = boundary(world, &rays.hit_unchecked(i), vertices.side[i] > 0.0);
    [own, touching.get(paths.slot[i] as usize).copied().flatten()]
}

/// Paths that go on in direction `dir`: those that crossed a boundary are in another medium.
#[inline(never)]
pub fn depart(
    world: &World,
    vertices: &Vertices,
    from: (&RayHitBlock, &PathBlock),
    (dir, keep): (&Lane3, &Mask),
    media: &mut [Media],
    touching: &[Option<Boundary>],
) {
    for i in (0..LANES).filter(|&i| keep[i] != 0) {
        let around = &mut media[from.1.slot[i] as usize];
        *around = beyond(world, vertices, from, (i, get(dir, i)), around, touching);
    }
}

/// What shadow rays lose on their way: `dir` and `end_m` are theirs, `radiance` is what they carry.
#[inline(never)]
pub fn attenuate(
    world: &World,
    vertices: &Vertices,
    from: (&RayHitBlock, &PathBlock),
    (dir, end_m): (&Lane3, &Lane),
    (media, touching): (&[Media], &[Option<Boundary>]),
    radiance: &mut Lane3,
) {
    for i in 0..LANES {
        if !(get(radiance, i).max_element() > 0.0) {
            continue;
        }
        let around = beyond(world, vertices, from, (i, get(dir, i)), &media[from.1.slot[i] as usize], touching);
        let org = get(&vertices.p, i);
        let stretch = Stretch { org, dir: get(dir, i), medium: around.top(), between: [0.0, end_m[i]] };
        let left = get(radiance, i) * left(world, &stretch);
        set(radiance, i, left);
    }
}

/// What is around the shadow rays of the lanes `keep` where they start, appended to `starts`.
#[inline(never)]
pub fn start_shadows(
    world: &World,
    vertices: &Vertices,
    from: (&RayHitBlock, &PathBlock),
    (dir, keep): (&Lane3, u16),
    (media, touching): (&[Media], &[Option<Boundary>]),
    starts: &mut Vec<Media>,
) {
    let start = |i| beyond(world, vertices, from, (i, get(dir, i)), &media[from.1.slot[i] as usize], touching);
    starts.extend(lanes_of(keep).map(start));
}

/// What is around a ray that leaves the vertex of lane `i` in direction `dir`.
#[inline(always)]
fn beyond(
    world: &World,
    vertices: &Vertices,
    from: (&RayHitBlock, &PathBlock),
    (i, dir): (usize, Vec3),
    around: &Media,
    touching: &[Option<Boundary>],
) -> Media {
    let mut beyond = *around;
    beyond.since_m = 0.0;
    if !(get(&vertices.n_g, i).dot(dir) > 0.0) {
        let boundaries = boundaries(world, vertices, from, touching, i);
        boundaries.into_iter().flatten().for_each(|boundary| beyond.cross(boundary));
    }
    beyond
}
