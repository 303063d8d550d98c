//! Counted work: what a few thousand of a scene's own rays visit in the structures that could trace it. No clock.
//!
//! The [rays](draw) are drawn from fixed numbers. They [walk] through a hierarchy of everything (for Embree, whose own
//! cannot be counted, and for `obvhs`), which is built (`lazy`) only where they go; and, where the scene can be
//! divided, through the real faces and volumes of `flat+obvhs` and such a hierarchy of the rest. Counts are whole
//! numbers and depend on the scene alone. `backend::weights` makes costs of them.

pub mod draw;
mod lazy;
pub mod walk;

use serde::Serialize;

use super::batch::{Block, LANES, RayBlock, RayHitBlock};
use super::joint::{Halves, Limits};
use super::triangle::Ray;
use crate::scene::geometry::Geometry;
use draw::View;
use walk::{Timed, Visits, Walk};

/// What the rays of a scene visit, by class of rays: camera, bounce, shadow.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Rays.
    pub rays: [u64; 3],
    /// Triangles that are stored, instanced ones once.
    pub triangles: u64,
    /// In a hierarchy of everything.
    pub whole: [Visits; 3],
    /// Divided into large faces and the rest; `None` where that cannot be.
    pub divided: Option<Divided>,
}

/// What they visit where the scene is divided.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Divided {
    /// Faces that every ray meets.
    pub faces: u64,
    /// Balls and boxes around the rest, for every ray.
    pub volumes: u64,
    /// Rays that come near one.
    pub near: [u64; 3],
    /// What those visit in the hierarchy of the rest.
    pub rest: [Visits; 3],
}

impl Counts {
    /// Of all classes.
    pub fn all_rays(&self) -> u64 {
        self.rays.iter().sum()
    }
}

/// Sums over classes.
pub fn sum(visits: &[Visits; 3]) -> Visits {
    visits.iter().fold(Visits::default(), |sum, class| Visits {
        nodes: sum.nodes + class.nodes,
        leaves: sum.leaves + class.leaves,
        instances: sum.instances + class.instances,
    })
}

/// Counts; `limits` say how the scene would be divided.
pub fn of(geometry: &Geometry, view: &View, limits: &Limits) -> Counts {
    let mut whole = [Visits::default(); 3];
    let rays = draw::rays(geometry, view, &mut Walk::new(geometry, |_| true), &mut whole);
    let halves = Halves::of(geometry, limits);
    Counts {
        rays: rays.each_ref().map(|class| class.len() as u64),
        triangles: geometry.triangles.len() as u64,
        whole,
        divided: halves.map(|halves| divided(geometry, &halves, &rays)),
    }
}

/// What the rays visit where the scene is divided.
fn divided(geometry: &Geometry, halves: &Halves, rays: &draw::Rays) -> Divided {
    let mut counts = Divided { faces: halves.faces() as u64, volumes: halves.volumes() as u64, ..Divided::default() };
    let mut walk = Walk::new(geometry, |prim| !halves.is_face(prim));
    for (class, rays) in rays.iter().enumerate() {
        let left = if class == 2 {
            halves.left(&mut blocks_of::<RayBlock>(rays), rays.len())
        } else {
            halves.left(&mut blocks_of::<RayHitBlock>(rays), rays.len())
        };
        counts.near[class] = left.len() as u64;
        for (place, tfar) in left {
            let Timed { ray, time, any } = rays[place];
            walk.trace(&Timed { ray: Ray { tfar, ..ray }, time, any }, &mut counts.rest[class]);
        }
    }
    counts
}

/// Rays in blocks.
fn blocks_of<B: Block>(rays: &[Timed]) -> Vec<B> {
    let mut blocks = vec![B::EMPTY; rays.len().div_ceil(LANES)];
    for (i, Timed { ray, time, .. }) in rays.iter().enumerate() {
        let block = blocks[i / LANES].rays_mut();
        block.set(i % LANES, ray.org, ray.dir, ray.tfar);
        block.time[i % LANES] = *time;
    }
    blocks
}
