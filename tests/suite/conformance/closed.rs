//! Closed meshes: no ray that starts inside may get out. Oracle: the topology; the allowed rate of misses is 0, except
//! for rays at vertices in Embree. Random rays, vertices, edges and axes: `hard/watertight.rs`.

use glam::Vec3;

use super::shapes::{Rng, sphere, world};
use super::{EMBREE_VERTEX_MISSES, Scenario, TestRay, check};

/// Denormal direction components and origins, of both signs: they may not upset reciprocals or box tests.
#[test]
fn denormal_directions_and_origins() {
    let mut rng = Rng::new(4);
    let tiny = [1e-45f32, -1e-45, 1e-40, -1e-40, 1e-38, -1e-38, 0.0, -0.0];
    let mut rays = Vec::new();
    for _ in 0..2000 {
        let mut pick = || tiny[rng.below(tiny.len())];
        let org = Vec3::new(pick(), pick(), pick());
        let mut dir = Vec3::new(pick(), pick(), pick());
        // One component of length one, or a general direction from a denormal origin.
        let axis = rng.below(4);
        if axis < 3 {
            dir[axis] = if rng.below(2) == 0 { 1.0 } else { -1.0 };
        } else {
            dir = rng.direction();
        }
        rays.push(TestRay::new(org, dir));
    }
    // All run through vertices or edges of a lat-long sphere, for they follow its axes.
    let geometry = world(sphere(Vec3::ZERO));
    check(&[Scenario {
        misses_allowed: EMBREE_VERTEX_MISSES,
        ..Scenario::closed("sphere, denormals", geometry, rays)
    }]);
}
