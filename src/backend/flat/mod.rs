//! Every ray against every face, sixteen rays at a time: for scenes of so few faces that there is nothing to skip.
//!
//! A hierarchy pays when most of a scene can be left out. In a Cornell box it cannot: diffuse rays start inside, every
//! lane of a packet goes its own way, and a traversal spends its time on choosing. Here 16 rays meet one face after the
//! other with no branch at all. Two triangles that make a parallelogram are one face (`faces.rs`).
//!
//! A ray passes a face if it passes all of its edges on the same side, by Plücker coordinates (`kernel`). Where the
//! rounding of these numbers leaves the side open, f64 decides, by the corners themselves: at vertices, where the edges
//! of no face may agree, and for faces seen nearly edge-on. The error is one of the scene's size, so a scene must lie
//! around its origin ([`can_trace`]). The weights of the hit that won are computed anew relative to the ray's origin,
//! in f64 where it is oblique.
//!
//! Limits: no instances, so nothing that moves; a triangle seen exactly edge-on is not hit; of two hits at equal
//! distance parallelograms come before triangles, then the lower triangle wins.

mod faces;
mod kernel;

use glam::Vec3;

pub(super) use self::faces::{Faces, Triangle};
pub(super) use self::kernel::Meets;
use self::kernel::Trace;
use super::batch::{Batch, RayBlock, RayHitBlock};
use super::past::Past;
use super::{Backend, BackendInfo, BackendKind, BackendOptions, Coherence, QueryMode};
use crate::math::simd::{detect, dispatch};
use crate::scene::geometry::Geometry;
use crate::{Error, Result};

/// Powers of two, metres, between which coordinates and sizes must lie: their squares, and those of a face a million
/// times smaller, are numbers of f32.
const SIZES_M: (f32, f32) = (1.0 / (1u64 << 40) as f32, (1u64 << 40) as f32);

/// What [`can_trace`] asks for.
pub(crate) const LIMITS: &str = "flat traces only scenes without instances, around their origin, between 10⁻¹² and \
                                 10¹² m; embree and obvhs trace any";

/// The faces of a small scene.
pub struct Flat {
    info: BackendInfo,
    faces: Faces,
    wide: bool,
}

/// Whether a scene can be traced here: one mesh, around the origin, of a size whose square f32 holds.
pub fn can_trace(geometry: &Geometry) -> bool {
    geometry.instances.is_empty() && geometry.meshes.first().is_some_and(|mesh| in_range(Triangle::of(mesh)))
}

/// Whether triangles lie around the origin and are together of a size whose square f32 holds.
pub(super) fn in_range(triangles: impl Iterator<Item = Triangle>) -> bool {
    let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for corner in triangles.flat_map(|triangle| triangle.v) {
        (low, high) = (low.min(corner), high.max(corner));
    }
    let size = (high - low).max_element();
    let far = low.abs().max(high.abs()).max_element();
    size >= SIZES_M.0 && far <= SIZES_M.1.min(2.0 * size)
}

/// Faces that triangles make.
pub(super) fn count(triangles: &[Triangle]) -> usize {
    Faces::new(triangles).count()
}

impl Flat {
    /// Prepares the faces.
    ///
    /// # Errors
    /// [`Error::Backend`] for a scene that [`can_trace`] refuses.
    pub fn build(geometry: &Geometry, options: &BackendOptions) -> Result<Self> {
        if !(can_trace(geometry) || geometry.meshes.iter().all(|mesh| mesh.indices.is_empty())) {
            return Err(Error::Backend { backend: "flat", problem: LIMITS.into() });
        }
        let triangles: Vec<Triangle> = geometry.meshes.iter().take(1).flat_map(Triangle::of).collect();
        let faces = Faces::new(&triangles);
        let wide = detect::is_wide(options.isa.as_deref());
        let packet = QueryMode::Packet16.name();
        let info = BackendInfo {
            kind: BackendKind::Flat,
            version: env!("CARGO_PKG_VERSION").into(),
            isa: detect::name(wide).into(),
            rays_incoherent: packet,
            rays_coherent: packet,
            rays_shadow: packet,
            bvh_bytes: faces.bytes(),
            triangles: faces.triangles(),
        };
        Ok(Flat { info, faces, wide })
    }
}

impl Backend for Flat {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, _hint: Coherence) -> u64 {
        dispatch::widest(self.wide, Trace { faces: &self.faces, batch: Batch::new(blocks, len), without: () })
    }

    fn closest_hit_past(&self, blocks: &mut [RayHitBlock], len: usize, past: &Past) -> u64 {
        let without = past.lanes();
        dispatch::widest(self.wide, Trace { faces: &self.faces, batch: Batch::new(blocks, len), without })
    }

    fn any_hit(&self, blocks: &mut [RayBlock], len: usize, _hint: Coherence) -> u64 {
        dispatch::widest(self.wide, Trace { faces: &self.faces, batch: Batch::new(blocks, len), without: () })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::batch::{BLOCKED, LANES};
    use crate::backend::brute::Brute;
    use crate::math::float;
    use crate::scene::geometry::TriangleMesh;

    /// A room of parallelograms with some loose triangles in it, and rays from inside.
    fn scene() -> (Geometry, Vec<RayHitBlock>) {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut point = || Vec3::new(next(), next(), next());
        let mut mesh = TriangleMesh::default();
        for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
            for n in [axis, -axis] {
                let u = n.any_orthonormal_vector();
                let v = n.cross(u);
                let first = mesh.vertices.len() as u32;
                mesh.vertices.extend([n - u - v, n + u - v, n + u + v, n - u + v]);
                mesh.indices.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
            }
        }
        for _ in 0..6 {
            let first = mesh.vertices.len() as u32;
            mesh.vertices.extend([point() * 0.9, point() * 0.9, point() * 0.9]);
            mesh.indices.push([first, first + 1, first + 2]);
        }
        let mut blocks = vec![RayHitBlock::EMPTY; 2000];
        for (i, block) in blocks.iter_mut().enumerate() {
            for lane in 0..LANES {
                let tfar = if i % 2 == 0 { f32::INFINITY } else { 0.7 };
                block.ray.set(lane, point() * 0.8, point().normalize(), tfar);
            }
        }
        (Geometry { meshes: vec![mesh], ..Geometry::default() }, blocks)
    }

    fn flat(geometry: &Geometry, wide: bool) -> Flat {
        let flat = Flat::build(geometry, &BackendOptions::default()).expect("a small scene");
        Flat { wide: wide && flat.wide, ..flat }
    }

    /// Oracle: `brute`. The same triangle and numbers within rounding, but for rays that pass an edge within the slack:
    /// at most 3 of 32 000. Both instruction sets give the same bits.
    #[test]
    fn hits_are_those_of_every_triangle() {
        let (geometry, rays) = scene();
        let narrow = flat(&geometry, false);
        assert_eq!((narrow.faces.quads.len(), narrow.faces.triangles.len()), (6, 6));
        let len = rays.len() * LANES;
        let trace = |backend: &dyn Backend| {
            let mut blocks = rays.clone();
            assert_eq!(backend.closest_hit(&mut blocks, len, Coherence::Incoherent), 0);
            (0..len).map(|i| blocks[i / LANES].hit(i % LANES)).collect::<Vec<_>>()
        };
        let block = |backend: &dyn Backend| {
            let mut blocks: Vec<_> = rays.iter().map(|block| block.ray).collect();
            assert_eq!(backend.any_hit(&mut blocks, len, Coherence::Incoherent), 0);
            (0..len).map(|i| blocks[i / LANES].tfar[i % LANES] == BLOCKED).collect::<Vec<_>>()
        };
        let (hits, blocked) = (trace(&narrow), block(&narrow));
        assert_eq!(hits, trace(&flat(&geometry, true)));
        assert_eq!(blocked, block(&flat(&geometry, true)));

        let brute = Brute::build(&geometry);
        let mut other = 0;
        for (a, b) in hits.iter().zip(trace(&brute)) {
            match (a, b) {
                (Some(a), Some(b)) if a.prim == b.prim => {
                    let near = |x: f32, y: f32| (x - y).abs() < 1e-4;
                    assert!(near(a.t, b.t) && near(a.u, b.u) && near(a.v, b.v), "{a:?} {b:?}");
                }
                (None, None) => {}
                _ => other += 1,
            }
        }
        other += blocked.iter().zip(block(&brute)).filter(|(a, b)| *a != b).count();
        assert!(other <= 3, "{other} differ");
    }

    /// Oracle: exact arithmetic. A scene and its rays scaled by a power of two give the same weights, and distances so
    /// scaled.
    #[test]
    fn scale_does_not_matter() {
        let (geometry, rays) = scene();
        let trace = |scale: f32| {
            let mut scaled = geometry.clone();
            scaled.meshes[0].vertices.iter_mut().for_each(|vertex| *vertex *= scale);
            let mut blocks = rays.clone();
            for ray in blocks.iter_mut().map(|block| &mut block.ray) {
                for column in [&mut ray.org_x, &mut ray.org_y, &mut ray.org_z, &mut ray.tfar] {
                    column.iter_mut().for_each(|x| *x *= scale);
                }
            }
            let len = blocks.len() * LANES;
            flat(&scaled, true).closest_hit(&mut blocks, len, Coherence::Incoherent);
            let hit = |i: usize| blocks[i / LANES].hit(i % LANES);
            (0..len).map(|i| hit(i).map(|h| (h.t / scale, h.u, h.v, h.prim))).collect::<Vec<_>>()
        };
        let plain = trace(1.0);
        for exponent in [-38, -20, 20, 38] {
            assert_eq!(trace(2f32.powi(exponent)), plain, "2^{exponent}");
        }
    }

    /// Oracle: none of them is met again. Rays leave small parallelograms about (1, y, 1), whose corners rounding has
    /// bent out of their plane, some further than rays start above it.
    #[test]
    fn bent_parallelograms_do_not_shadow_themselves() {
        let mut state = 7u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1 << 23) as f32 - 1.0
        };
        let (mut joined, mut apart, mut again) = (0, 0, 0);
        for round in 0..400 {
            let n = if round % 2 == 0 { Vec3::Y } else { Vec3::new(next(), next(), next()).normalize() };
            let (u, v) = n.any_orthonormal_pair();
            let (c, bend) = (Vec3::new(1.0, 0.0, 1.0) + u * next(), 2.4e-7 * next() * next().abs());
            let corners = [c, c + u * 0.05, c + u * 0.05 + v * 0.05 + n * bend, c + v * 0.05];
            let far = [-Vec3::ONE, -Vec3::ONE + Vec3::X * 0.1, -Vec3::ONE + Vec3::Y * 0.1];
            let indices = vec![[0, 1, 3], [2, 3, 1], [4, 5, 6]];
            let mesh = TriangleMesh { vertices: [&corners[..], &far].concat(), indices, ..TriangleMesh::default() };
            let geometry = Geometry { meshes: vec![mesh], ..Geometry::default() };
            let flat = flat(&geometry, true);
            joined += flat.faces.quads.len();
            apart += 1 - flat.faces.quads.len();
            for [a, b, c] in [[corners[0], corners[1], corners[3]], [corners[2], corners[3], corners[1]]] {
                let (e1, e2) = (b - a, c - a);
                let n_g = e1.as_dvec3().cross(e2.as_dvec3()).normalize().as_vec3();
                let mut block = RayHitBlock::EMPTY;
                for lane in 0..LANES {
                    let (s, t) = (next().abs(), next().abs());
                    let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                    let p = float::hit_point(a, e1, e2, s, t);
                    let dir = (n_g * (next().abs() + 0.01) + Vec3::new(next(), next(), next())).normalize();
                    let org = float::spawn_origin(p, n_g, float::hit_error(a, e1, e2, p), dir);
                    block.ray.set(lane, org, dir, 0.5);
                }
                flat.closest_hit(std::slice::from_mut(&mut block), LANES, Coherence::Incoherent);
                again += (0..LANES).filter(|&lane| block.hit(lane).is_some()).count();
            }
        }
        assert!(joined > 50 && apart > 50, "{joined} parallelograms, {apart} pairs of triangles");
        assert_eq!(again, 0);
    }

    /// Oracle: the plane. A metre seen from 10 km, whose rounding of rays is a millimetre: rays that pass 10⁻⁵ m
    /// beside it miss.
    #[test]
    fn distance_makes_nothing_larger() {
        let (geometry, _) = scene();
        let flat = flat(&geometry, true);
        let mut blocks = vec![RayHitBlock::EMPTY; 100];
        for (i, block) in blocks.iter_mut().enumerate() {
            for lane in 0..LANES {
                let across = (i * LANES + lane) as f32 / 1600.0 - 0.5;
                let x = if lane % 2 == 0 { 1.0 + 1e-5 } else { 1.0 - 1e-5 };
                block.ray.set(lane, Vec3::new(x, across, 1e4), Vec3::NEG_Z, f32::INFINITY);
            }
        }
        flat.closest_hit(&mut blocks, 1600, Coherence::Coherent);
        for (i, block) in blocks.iter().enumerate() {
            for lane in 0..LANES {
                assert_eq!(block.hit(lane).is_some(), lane % 2 == 1, "ray {}", i * LANES + lane);
            }
        }
    }

    /// What lies off its origin, has instances or is too small for f32 is refused with the reason.
    #[test]
    fn scenes_off_their_origin_are_refused() {
        let (mut geometry, _) = scene();
        assert!(can_trace(&geometry));
        for vertex in &mut geometry.meshes[0].vertices {
            *vertex += Vec3::X * 100.0;
        }
        assert!(!can_trace(&geometry));
        let refused = Flat::build(&geometry, &BackendOptions::default()).err().expect("refused").to_string();
        assert!(refused.contains("around their origin"), "{refused}");
    }
}
