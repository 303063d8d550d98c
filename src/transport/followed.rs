//! Paths through perfect mirrors and smooth glass, for the layers that denoisers are told: the first surface that
//! scatters otherwise. Paths are those of the picture. Each surface that they come to is written down as they arrive
//! ([`arrive`]), and shading says of those that only reflect or refract sharply that the path goes on ([`note`]). A
//! render without such layers pays a test a wave and a block.

use super::first_hit::FirstHit;
use super::job::Job;
use super::vertices::Vertices;
use super::wave::{Followed, PathBlock, Sums, Wave};
use crate::backend::batch::LANES;
use crate::math::columns::{Mask, get};

/// Writes down what the traced paths of `wave` meet that have met nothing but mirrors and smooth glass.
#[inline(never)]
pub fn arrive(job: &Job, wave: &mut Wave, edge: u32) {
    let followed = &mut wave.sums.followed;
    if edge == 1 {
        followed.clear();
        followed.resize(wave.current.len, Followed { edge, ..Followed::default() });
    }
    for lane in 0..wave.current.len {
        let (block, i) = (lane / LANES, lane % LANES);
        let rays = &wave.current.rays[block];
        let followed = &mut followed[wave.current.paths[block].slot[i] as usize];
        if followed.edge == edge
            && let Some(hit) = rays.hit(i)
        {
            let met = FirstHit::at(job, &hit, rays.ray.dir(i));
            (followed.albedo, followed.normal) = (met.albedo.into(), met.normal.into());
        }
    }
}

/// Takes the normals of the surfaces that are shaded, with their maps. Those that scatter but do nothing with light
/// samples (`lit`) are mirrors and smooth glass: their paths are followed, and what is written down here holds where
/// they end before another surface.
#[inline(never)]
pub fn note(vertices: &Vertices, lit: &Mask, paths: &PathBlock, sums: &mut Sums, edge: u32) {
    for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
        let followed = &mut sums.followed[paths.slot[i] as usize];
        if followed.edge != edge {
            continue;
        }
        followed.normal = get(&vertices.n_s, i).into();
        if edge == 1 {
            followed.first = followed.normal;
        }
        if lit[i] == 0 {
            *followed = Followed { albedo: [1.0; 3], normal: followed.first, edge: edge + 1, ..*followed };
        }
    }
}
