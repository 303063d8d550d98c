//! Finding the triangles that lie on one another: see [`Coincident`].
//!
//! Two triangles are looked at where they fall into one bucket of planes (normal up to sign to 1/256, distance from the
//! origin to 2⁻¹⁶ of the mesh's size) and differ in material or, unless nothing can tell their sides apart, in
//! orientation. They count where each lies in the other's plane to within what rounding does to hits on them and their
//! interiors overlap.
//!
//! Limits: within one mesh of the flattened geometry (placements at rest whose faces lie on those of others are baked
//! into the world's, see `bake`; what moves is not looked at); beyond [`MOST_PARTNERS`] for one triangle, and beyond
//! [`MOST_PAIRS`] looks for each triangle of a crowded plane, the rest is not found: see [`Coincident::crowded`].

use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering};

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

use super::coincident::Coincident;
use super::records::{Geometry, Triangle, TriangleMesh};
use super::solids::NO_SOLID;
use crate::scene::{Fact, Facts, Material};

/// Most partners that are kept of one triangle.
const MOST_PARTNERS: usize = 64;

/// Looks at pairs for each triangle in question.
const MOST_PAIRS: usize = 256;

/// Steps of a unit normal's components.
const NORMAL_STEPS: f64 = 256.0;

/// Steps of the distance from the origin, of the mesh's size.
const DISTANCE_STEPS: f64 = 65536.0;

/// What triangles must overlap by, of the smaller one's size.
const OVERLAP: f64 = 1e-5;

/// A direction that no normal of a real plane is perpendicular to; says which of two opposite normals is the first.
const UP: DVec3 = DVec3::new(0.373_126_5, 0.549_012_7, 0.748_291_9);

/// Nothing that is looked up in the table of planes.
const NONE: u32 = 0;
/// Two kinds of triangles at least.
const MIXED: u32 = u32::MAX;

/// A plane in steps.
type Steps = ([i32; 3], i64);

/// A triangle that may have a partner.
#[derive(Clone, Copy)]
struct Candidate {
    steps: Steps,
    record: u32,
    kind: u32,
}

struct Finder<'g> {
    geometry: &'g Geometry,
    materials: &'g [Material],
    /// Whether the sides of a material look alike, however it is mapped.
    alike: Vec<bool>,
    /// Whether a material has an inside.
    solid: Vec<bool>,
}

/// Finds them.
pub(super) fn find(geometry: &Geometry, materials: &[Material]) -> Coincident {
    let alike = |material: &Material| {
        let facts = Facts::of(material);
        let sided = facts.has(Fact::Emits) || facts.has(Fact::Solid) || facts.has(Fact::Uncovered);
        facts.is_plain() && !sided
    };
    let alike: Vec<bool> = materials.iter().map(alike).collect();
    let solid = materials.iter().map(|material| Facts::of(material).has(Fact::Solid)).collect();
    let finder = Finder { geometry, materials, alike, solid };
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    let mut crowded = false;
    for mesh in &geometry.meshes {
        crowded |= finder.search(mesh, &mut pairs);
    }
    pairs.sort_unstable();
    pairs.dedup();

    let mut found = Coincident { crowded, ..Coincident::default() };
    if pairs.is_empty() {
        return found;
    }
    found.flags = vec![0; geometry.triangles.len().div_ceil(64)];
    found.contested = found.flags.clone();
    let normal = |record: u32| Vec3::from(geometry.triangles[record as usize].n_g);
    let bounds_solid = |record: u32| geometry.solids.bodies.get(record as usize).is_some_and(|&body| body != NO_SOLID);
    for of_one in pairs.chunk_by(|a, b| a[0] == b[0]) {
        let record = of_one[0][0];
        // Ranks of solids depend on the placement, the order of triangles does not.
        let group = |partner: u32| match normal(record).dot(normal(partner)) > 0.0 {
            false => 1,
            true if partner > record && !bounds_solid(record) && !bounds_solid(partner) => 2,
            true => 0,
        };
        let mut groups: [Vec<u32>; 3] = Default::default();
        of_one.iter().for_each(|&[_, partner]| groups[group(partner)].push(partner));
        found.records.push(record);
        found.first.push(found.partners.len() as u32);
        found.flags[record as usize / 64] |= 1 << (record % 64);
        found.contested[record as usize / 64] |= u64::from(!groups[0].is_empty()) << (record % 64);
        let ends = groups.map(|group| {
            found.partners.extend(group);
            found.partners.len() as u32
        });
        found.ends.push([ends[0], ends[1]]);
    }
    found.first.push(found.partners.len() as u32);
    found
}

impl Finder<'_> {
    /// Appends the pairs of a mesh, both ways round. Returns whether some may be missing.
    fn search(&self, mesh: &TriangleMesh, pairs: &mut Vec<[u32; 2]>) -> bool {
        let count = mesh.indices.len();
        let (low, high) = bounds(mesh);
        let size = f64::from((high - low).max_element());
        let first_material = |mesh: &TriangleMesh| self.record(mesh, 0).material as usize;
        if count < 2 || !(size > 0.0) {
            return false;
        }
        // One material whose sides look alike: an instanced mesh, usually.
        let only = self.materials.len() == 1 || mesh.first_triangle != 0;
        if only
            && self.alike[first_material(mesh)]
            && (1..count).all(|t| self.record(mesh, t).material as usize == first_material(mesh))
        {
            return false;
        }

        let slots = (4 * count).next_power_of_two();
        let table: Vec<AtomicU32> = (0..slots).map(|_| AtomicU32::new(NONE)).collect();
        let slot = |steps: &Steps| hash(steps) as usize & (slots - 1);
        let origin = (low.as_dvec3() + high.as_dvec3()) * 0.5;
        let candidate = |t: usize| self.candidate(mesh, t, origin, size);
        (0..count).into_par_iter().with_min_len(4096).for_each(|t| {
            let Candidate { steps, kind, .. } = candidate(t);
            let entry = &table[slot(&steps)];
            if let Err(other) = entry.compare_exchange(NONE, kind, Ordering::Relaxed, Ordering::Relaxed)
                && other != kind
            {
                entry.store(MIXED, Ordering::Relaxed);
            }
        });
        let differs = |candidate: &Candidate| {
            let (normal, distance) = candidate.steps;
            (distance - 1..=distance + 1).any(|distance| {
                let kind = table[slot(&(normal, distance))].load(Ordering::Relaxed);
                kind != NONE && kind != candidate.kind
            })
        };
        let mut candidates: Vec<Candidate> =
            (0..count).into_par_iter().with_min_len(4096).map(candidate).filter(differs).collect();
        candidates.par_sort_unstable_by_key(|candidate| (candidate.steps, candidate.record));

        let mut crowded = false;
        let mut start = 0;
        while start < candidates.len() {
            // Planes of one normal, each a step at most from the next.
            let next = |pair: &[Candidate]| pair[1].steps.0 != pair[0].steps.0 || pair[1].steps.1 > pair[0].steps.1 + 1;
            let rest = &candidates[start..];
            let len = rest.windows(2).position(next).map_or(rest.len(), |at| at + 1);
            crowded |= self.pair_up(&rest[..len], pairs);
            start += len;
        }
        crowded
    }

    fn record(&self, mesh: &TriangleMesh, triangle: usize) -> &Triangle {
        &self.geometry.triangles[mesh.first_triangle as usize + triangle]
    }

    fn candidate(&self, mesh: &TriangleMesh, t: usize, origin: DVec3, size: f64) -> Candidate {
        let triangle = self.record(mesh, t);
        let n = Vec3::from(triangle.n_g).as_dvec3();
        let [a, b, c] = corners(triangle);
        let front = n.dot(UP) > 0.0;
        let n = if front { n } else { -n };
        let distance = n.dot((a + b + c) / 3.0 - origin) / size;
        let normal = (n * NORMAL_STEPS).round();
        let steps = ([normal.x as i32, normal.y as i32, normal.z as i32], (distance * DISTANCE_STEPS).round() as i64);
        let side = u32::from(front && !self.alike[triangle.material as usize]);
        Candidate { steps, record: mesh.first_triangle + t as u32, kind: 1 + 2 * triangle.material + side }
    }

    /// Pairs among triangles of nearly one plane.
    fn pair_up(&self, candidates: &[Candidate], pairs: &mut Vec<[u32; 2]>) -> bool {
        let first = candidates[0].kind;
        if candidates.iter().all(|candidate| candidate.kind == first) {
            return false;
        }
        // A grid over the plane, as fine as the triangles are on average.
        let triangle = |candidate: &Candidate| &self.geometry.triangles[candidate.record as usize];
        let n = Vec3::from(triangle(&candidates[0]).n_g).as_dvec3();
        let (u, v) = n.any_orthonormal_pair();
        let flat: Vec<[DVec2; 3]> = candidates
            .iter()
            .map(|candidate| corners(triangle(candidate)).map(|p| DVec2::new(u.dot(p), v.dot(p))))
            .collect();
        let boxes: Vec<(DVec2, DVec2)> = flat.iter().map(|[a, b, c]| (a.min(*b).min(*c), a.max(*b).max(*c))).collect();
        let mean = boxes.iter().map(|(low, high)| (*high - *low).max_element()).sum::<f64>() / boxes.len() as f64;
        let low = boxes.iter().fold(DVec2::INFINITY, |all, (low, _)| all.min(*low));
        let cell = |p: DVec2| ((p - low) / mean).floor();
        let cells_of = |&(from, to): &(DVec2, DVec2)| {
            let (from, to) = (cell(from), cell(to));
            (from.x as i64..=to.x as i64).flat_map(move |x| (from.y as i64..=to.y as i64).map(move |y| (x, y)))
        };
        let mut looks = MOST_PAIRS * candidates.len();
        let mut partners = vec![0usize; candidates.len()];
        let mut crowded = false;
        let mut grid: HashMap<(i64, i64), Vec<u32>> = HashMap::new();
        for (i, bounds) in boxes.iter().enumerate() {
            let mut looked: Vec<u32> = Vec::new();
            for place in cells_of(bounds) {
                let there = grid.entry(place).or_default();
                if looks < there.len() + 1 {
                    return true;
                }
                looks -= there.len() + 1;
                looked.extend(there.iter());
                there.push(i as u32);
            }
            looked.sort_unstable();
            looked.dedup();
            for j in looked.into_iter().map(|j| j as usize) {
                let (a, b) = (&candidates[i], &candidates[j]);
                if a.kind == b.kind || !self.is_told_apart(a, b) {
                    continue;
                }
                if !overlap(&flat[i], &flat[j]) || !in_one_plane(triangle(a), triangle(b)) {
                    continue;
                }
                for (of, (record, partner)) in [(i, (a.record, b.record)), (j, (b.record, a.record))] {
                    partners[of] += 1;
                    if partners[of] <= MOST_PARTNERS {
                        pairs.push([record, partner]);
                    } else {
                        crowded = true;
                    }
                }
            }
        }
        crowded
    }

    /// Whether it matters which of two a ray meets. Those that face one way and look different are decided by their
    /// order, so that backends agree.
    fn is_told_apart(&self, a: &Candidate, b: &Candidate) -> bool {
        let [a, b] = [a, b].map(|of| self.geometry.triangles[of.record as usize]);
        let [x, y] = [a, b].map(|of| of.material as usize);
        x != y || !self.alike[x] || self.solid[x]
    }
}

/// Corners in the space of the mesh.
pub(crate) fn corners(triangle: &Triangle) -> [DVec3; 3] {
    let v0 = Vec3::from(triangle.v0).as_dvec3();
    [v0, v0 + Vec3::from(triangle.e1).as_dvec3(), v0 + Vec3::from(triangle.e2).as_dvec3()]
}

fn bounds(mesh: &TriangleMesh) -> (Vec3, Vec3) {
    let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for index in mesh.indices.iter().flatten() {
        let p = mesh.vertices[*index as usize];
        bounds = (bounds.0.min(p), bounds.1.max(p));
    }
    bounds
}

/// Spreads planes over the table (constants of SplitMix64).
fn hash((normal, distance): &Steps) -> u64 {
    let mut h = *distance as u64;
    for &step in normal {
        h = (h ^ u64::from(step as u32)).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        h ^= h >> 29;
    }
    h = h.wrapping_mul(0xBF58_476D_1CE4_E5B9);
    h ^ h >> 32
}

/// Whether every corner of each lies in the plane of the other, as far as hits can tell.
fn in_one_plane(a: &Triangle, b: &Triangle) -> bool {
    let within = 2.0 * (f64::from(a.error) + f64::from(b.error));
    let lies = |a: &Triangle, b: &Triangle| {
        let (n, from) = (Vec3::from(a.n_g).as_dvec3(), Vec3::from(a.v0).as_dvec3());
        corners(b).into_iter().all(|p| n.dot(p - from).abs() <= within)
    };
    lies(a, b) && lies(b, a)
}

/// Whether the interiors of two triangles of a plane share a point: no edge of either has the other outside.
fn overlap(a: &[DVec2; 3], b: &[DVec2; 3]) -> bool {
    let size = |t: &[DVec2; 3]| (t[1] - t[0]).length().max((t[2] - t[0]).length());
    let least = OVERLAP * size(a).min(size(b));
    let apart = |of: &[DVec2; 3], other: &[DVec2; 3]| {
        (0..3).any(|i| {
            let (from, to, opposite) = (of[i], of[(i + 1) % 3], of[(i + 2) % 3]);
            let along = to - from;
            let normal = DVec2::new(-along.y, along.x) / along.length();
            let normal = if normal.dot(opposite - from) > 0.0 { normal } else { -normal };
            other.iter().all(|p| normal.dot(*p - from) <= least)
        })
    };
    !apart(a, b) && !apart(b, a)
}
