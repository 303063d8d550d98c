//! What the camera sees of the solution: at the point that a pixel's centre ray meets, one more scattering of every
//! term is gathered from all patches through its own row. The emission of the point itself is term 0.

use super::operator::{self, Receiver, Series};
use super::patches::Patches;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::backend::{Backend, Coherence};
use crate::camera::CameraRays;
use crate::film::layer::bounces::LENGTHS;
use crate::scene::Scene;
use crate::scene::geometry::Geometry;
use crate::shading::interaction::Interaction;

/// Radiance by number of edges (index 0 unused, [`LENGTHS`] − 1 the tail up to the depth limit), and behind them that
/// of all paths beyond the depth limit, which may lie among the lengths.
pub type Radiances = [[f64; 3]; LENGTHS + 1];

/// What the ray through a pixel's centre meets.
#[derive(Clone, Copy, Debug)]
pub struct Pixel {
    surface: Option<Seen>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    receiver: Receiver,
    albedo: [f64; 3],
    /// Radiance towards the camera by emission.
    emission: [f64; 3],
}

/// Traces the rays through the centres of all pixels, row-major from the top.
pub fn pixels(
    camera: &CameraRays,
    (width, height): (u32, u32),
    geometry: &Geometry,
    scene: &Scene,
    backend: &dyn Backend,
) -> Vec<Pixel> {
    let count = width as usize * height as usize;
    let mut rays = vec![RayHitBlock::EMPTY; count.div_ceil(LANES)];
    for i in 0..count {
        let (x, y) = (i as u32 % width, i as u32 / width);
        let (org, dir) = camera.pinhole_ray(x as f32 + 0.5, y as f32 + 0.5);
        rays[i / LANES].ray.set(i % LANES, org, dir, f32::INFINITY);
    }
    backend.closest_hit(&mut rays, count, Coherence::Coherent);
    let seen = |i: usize| {
        let block = &rays[i / LANES];
        let hit = block.hit(i % LANES)?;
        let at = Interaction::at(geometry, &hit, false);
        let front = at.n_g.dot(block.ray.dir(i % LANES)) < 0.0;
        let material = &scene.materials[at.material as usize];
        let normal = if front { at.n_g } else { -at.n_g };
        Some(Seen {
            receiver: Receiver { p: at.p.as_dvec3(), n: normal.as_dvec3().normalize(), error: at.error },
            albedo: material.base_color.to_array().map(f64::from),
            emission: if front { material.emissive.to_array().map(f64::from) } else { [0.0; 3] },
        })
    };
    (0..count).map(|i| Pixel { surface: seen(i) }).collect()
}

/// Radiance of every node that one more scattering turns into paths of 2, 3, … edges; the last but one makes the tail
/// up to the depth limit, the last one all beyond it.
pub fn sources(series: &Series, max_depth: u32) -> Vec<Vec<[f64; 3]>> {
    let nodes = series.terms[0].len();
    let nothing = || vec![[0.0; 3]; nodes];
    // Paths of e edges have e − 1 scatterings, the last of which happens at the point that is seen.
    let mut sources: Vec<Vec<[f64; 3]>> = (2..=LENGTHS).map(|_| nothing()).collect();
    for (k, term) in series.terms.iter().enumerate() {
        let edges = k + 2;
        let beyond = edges as u64 > u64::from(max_depth);
        let own = if edges < LENGTHS - 1 { Some(edges - 2) } else { (!beyond).then_some(LENGTHS - 3) };
        for slot in own.into_iter().chain(beyond.then_some(LENGTHS - 2)) {
            for (sum, radiance) in sources[slot].iter_mut().zip(term) {
                for c in 0..3 {
                    sum[c] += radiance[c];
                }
            }
        }
    }
    sources
}

/// Radiance along a pixel's ray by number of edges.
pub fn radiances(pixel: &Pixel, sources: &[Vec<[f64; 3]>], patches: &Patches, backend: &dyn Backend) -> Radiances {
    let mut radiances = [[0.0; 3]; LENGTHS + 1];
    let Some(seen) = &pixel.surface else { return radiances };
    radiances[1] = seen.emission;
    if seen.albedo == [0.0; 3] {
        return radiances;
    }
    let row = operator::row(&seen.receiver, patches, backend);
    let scattered = |source: &Vec<[f64; 3]>| {
        let gathered = operator::gather(&row, source);
        std::array::from_fn(|c| seen.albedo[c] * gathered[c])
    };
    for (edges, radiance) in radiances.iter_mut().enumerate().take(LENGTHS).skip(2) {
        *radiance = scattered(&sources[edges - 2]);
    }
    radiances[LENGTHS] = scattered(&sources[LENGTHS - 2]);
    radiances
}

/// Ratio of the two longest lengths that are distinguished, over all pixels, by channel; 0 where no light is scattered
/// on.
pub fn late_ratio(seen: &[Radiances]) -> [f64; 3] {
    std::array::from_fn(|c| {
        let sum = |edges: usize| seen.iter().map(|r| r[edges][c]).sum::<f64>();
        let (before, last) = (sum(LENGTHS - 3), sum(LENGTHS - 2));
        if before > 0.0 { last / before } else { 0.0 }
    })
}

/// Share of the energy of all pixels that lies beyond the depth limit.
pub fn share_beyond(seen: &[Radiances], max_depth: u32) -> f64 {
    let sum = |edges: usize| seen.iter().flat_map(|r| r[edges]).sum::<f64>();
    let within: f64 = (1..=(LENGTHS - 1).min(max_depth as usize)).map(sum).sum();
    let beyond = sum(LENGTHS);
    if beyond > 0.0 { beyond / (within + beyond) } else { 0.0 }
}
