//! Light that surfaces emit, with its MIS weight, and the colours of unlit surfaces.

use glam::Vec3;

use super::estimator;
use super::light_paths::ratio;
use super::material::{self, Place};
use super::origin;
use super::tape::{Event, LANE, Tape};
use super::vertex::{self, End, Number, triple};
use super::vertices::Vertices;
use super::wave::{Path, PathBlock, Sums};
use super::world::World;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::columns::{Column, get};
use crate::shading::light::EmitterHit;

/// Adds the emission of surfaces: on their front side, and behind where the material is double-sided.
#[inline(always)]
pub fn emit<T: Tape>(
    world: &World,
    vertices: &Vertices,
    (rays, paths): (&RayHitBlock, &PathBlock),
    (sums, ratios, edge): (&mut Sums, &[f32], u32),
    tape: &mut T,
) {
    for i in 0..LANES {
        let front = vertices.cos_g[i] > 0.0;
        if vertices.active[i] == 0 || !(front | world.features.double_sided_lamps) {
            continue;
        }
        let material = &world.scene.materials[vertices.material[i] as usize];
        let shows = front || material.double_sided && vertices.cos_g[i] < 0.0;
        if !(material.is_emissive() && shows) {
            continue;
        }
        let path = Path::get(paths, i);
        let light_pdf_sa = if path.last_pdf_sa == f32::INFINITY && !T::ON {
            0.0
        } else {
            light_pdf_sa(world, vertices, rays, &path, i)
        };
        let mut weight = estimator::emission_weight(world.strategy, path.last_pdf_sa, light_pdf_sa);
        if world.features.light_paths && vertices.light[i] != u32::MAX {
            let ratio = ratios[path.slot as usize];
            let shared = ratio::weight_of_area(world, vertices, i, (ratio, [path.last_pdf_sa, light_pdf_sa]));
            weight = shared.unwrap_or(weight);
        }
        let radiance = || material::emission(world, material, Place::of_lane(world, rays, i));
        if weight > 0.0 {
            let origin = || origin::of_surface(world, rays, i, vertices.light[i]);
            sums.add(path.slot, edge, origin, get(&vertices.beta, i) * radiance() * weight);
        }
        if T::ON && i == LANE {
            tape.note(|| told(get(&vertices.beta, i), radiance(), &path, [light_pdf_sa, weight]));
        }
    }
}

/// Density with which light sampling at the path's last vertex would have found the emissive triangle in lane `i`,
/// sr⁻¹; 0 where it does not take part.
#[inline(always)]
fn light_pdf_sa(world: &World, vertices: &Vertices, rays: &RayHitBlock, path: &Path, i: usize) -> f32 {
    let front = vertices.light[i];
    if !world.samples_lights() || front == u32::MAX {
        return 0.0;
    }
    // The back is the light after the front.
    let light = front + u32::from(vertices.cos_g[i] < 0.0);
    let (distance_m, cos_light) = (rays.ray.tfar[i], vertices.cos_g[i].abs());
    let hit = EmitterHit { light, distance_m, cos_light, area_m2: world.lights.area_m2(light) };
    world.lights.pdf_triangle(rays.ray.org(i), path.last_n, &hit)
}

/// Adds the colour of unlit surfaces and ends their paths.
#[inline(always)]
pub fn show_unlit<T: Tape>(
    world: &World,
    vertices: &mut Vertices,
    (rays, paths): (&RayHitBlock, &PathBlock),
    (sums, edge): (&mut Sums, u32),
    tape: &mut T,
) {
    for i in 0..LANES {
        let material = &world.scene.materials[vertices.material[i] as usize];
        if vertices.active[i] != 0 && material.unlit {
            let color = material::unlit(world, rays, vertices, i);
            let origin = || origin::of_surface(world, rays, i, u32::MAX);
            sums.add(paths.slot[i], edge, origin, get(&vertices.beta, i) * color);
            vertices.active[i] = 0;
            if T::ON && i == LANE {
                tape.note(|| Event::Model("unlit", (get(&vertices.n_s, i) * vertices.side[i]).into(), 1.0));
                tape.note(|| told(get(&vertices.beta, i), color, &Path::get(paths, i), [0.0, 1.0]));
                tape.note(|| Event::End(Some(End::Unlit)));
            }
        }
    }
}

/// Light as it is written down: with the density of light sampling and the MIS weight.
pub fn told(beta: Vec3, radiance: Vec3, path: &Path, [light_pdf_sa, weight]: [f32; 2]) -> Event {
    Event::Emission(vertex::Emission {
        radiance: triple(radiance),
        bsdf_pdf_sa: Number(path.last_pdf_sa),
        light_pdf_sa: Number(light_pdf_sa),
        mis_weight: Number(weight),
        contribution: triple(if weight > 0.0 { beta * radiance * weight } else { Vec3::ZERO }),
    })
}
