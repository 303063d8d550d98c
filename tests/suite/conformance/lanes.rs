//! Lanes and segments: inactive and trailing lanes, ends of segments at the hit. (Rays that must never reach a
//! traversal: `hard/watertight.rs`.) Oracles: the contract of
//! [`pathspace::backend::Backend`] and brute force. No failure is allowed.

use glam::Vec3;
use pathspace::backend::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock};
use pathspace::backend::{Backend, Coherence};

use super::shapes::{Rng, grid, mesh, soup, world};
use super::{Rule, Scenario, TestRay, any, bits, check, closest, each_backend, pack};

fn soup_rays(rng: &mut Rng, n: usize) -> Vec<TestRay> {
    (0..n)
        .map(|_| {
            let org = rng.direction() * 2.0;
            TestRay::new(org, (rng.cube() - org).normalize())
        })
        .collect()
}

/// Every length of batch from 0 to 33 gives the hits of the long batch, touches no lane past its end (they hold NaN and
/// would abort an unchecked backend), and leaves no hit there.
#[test]
fn tail_lanes() {
    let mut rng = Rng::new(21);
    let geometry = world(mesh(&soup(&mut rng, 200, 0.6)));
    let rays = soup_rays(&mut rng, 33);
    let poison = TestRay { org: Vec3::NAN, dir: Vec3::NAN, tnear: f32::NAN, tfar: 7.0 };
    each_backend(&geometry, |row, backend| {
        let whole = closest(backend, &rays, Coherence::Incoherent);
        let blocked = any(backend, &rays, Coherence::Incoherent);
        assert!(whole.iter().flatten().count() > 5, "too few hits to mean anything");
        for len in 0..=33 {
            let mut padded = rays[..len].to_vec();
            padded.resize(48, poison);
            let what = format!("{} {} length {len}", row.kind.name(), row.mode);

            let mut blocks = pack(&padded);
            assert_eq!(backend.closest_hit(&mut blocks, len, Coherence::Incoherent), 0, "{what}");
            for lane in 0..48 {
                let got = blocks[lane / LANES].hit(lane % LANES);
                let expected = if lane < len { whole[lane] } else { None };
                assert_eq!(bits(&got), bits(&expected), "{what} lane {lane}");
                if lane >= len {
                    assert_eq!(blocks[lane / LANES].ray.tfar[lane % LANES], 7.0, "{what}: lane {lane} was written");
                }
            }

            let mut blocks: Vec<RayBlock> = pack(&padded).iter().map(|b| b.ray).collect();
            assert_eq!(backend.any_hit(&mut blocks, len, Coherence::Incoherent), 0, "{what}");
            for lane in 0..48 {
                let tfar = blocks[lane / LANES].tfar[lane % LANES];
                let expected = lane < len && blocked[lane];
                assert_eq!(tfar == BLOCKED, expected, "{what} lane {lane}");
                assert!(lane < len || tfar == 7.0, "{what}: lane {lane} was written");
            }
        }
    });
}

/// Hits left in a block by an earlier batch are cleared, also when nothing is hit.
#[test]
fn old_hits_are_cleared() {
    each_backend(&world(mesh(&grid(1, 1.0, 0.0))), |row, backend| {
        let mut block = RayHitBlock::EMPTY;
        block.hit.geom = [3; LANES];
        block.hit.inst = [4; LANES];
        block.ray.set(0, Vec3::new(5.0, 5.0, 5.0), Vec3::Z, 1.0);
        backend.closest_hit(std::slice::from_mut(&mut block), 1, Coherence::Coherent);
        assert!((0..LANES).all(|lane| block.hit(lane).is_none()), "{} {}", row.kind.name(), row.mode);
        assert_eq!(block.hit.inst, [INVALID_ID; LANES], "{} {}", row.kind.name(), row.mode);
    });
}

/// Segments that end or start at a hit whose distance is exact in binary. Ends belong to the segment. Embree divides by
/// an approximate reciprocal, so only four ulps away from the hit is it held to the answer.
#[test]
fn segment_ends_at_the_hit() {
    // Planes at 1, 2 and 4 below rays that start on dyadic points at height 0, away from edges.
    let triangles: Vec<_> = [-1.0, -2.0, -4.0].into_iter().flat_map(|z| grid(4, 4.0, z)).collect();
    let geometry = world(mesh(&triangles));
    let org = Vec3::new(1.25, 2.5, 0.0);
    let step = |x: f32, ulps: i32| f32::from_bits((x.to_bits() as i32 + ulps) as u32);
    let blocked = |backend: &dyn Backend, tnear: f32, tfar: f32| {
        let ray = TestRay { org, dir: Vec3::NEG_Z, tnear, tfar };
        let blocked = any(backend, &[ray], Coherence::Incoherent)[0];
        let hit = closest(backend, &[ray], Coherence::Incoherent)[0];
        assert_eq!(blocked, hit.is_some(), "the two queries disagree on [{tnear}, {tfar}]");
        hit.map(|h| h.t)
    };
    each_backend(&geometry, |row, backend| {
        let what = format!("{} {}", row.kind.name(), row.mode);
        let ulps = if row.rule == Rule::Rounding && row.kind != pathspace::backend::BackendKind::Brute { 4 } else { 1 };
        for t in [1.0f32, 2.0, 4.0] {
            if ulps == 1 {
                assert_eq!(blocked(backend, t, t), Some(t), "{what}: [t, t]");
                assert_eq!(blocked(backend, t, 100.0), Some(t), "{what}: tnear at the hit");
                assert_eq!(blocked(backend, step(0.5 * t, 1), t), Some(t), "{what}: tfar at the hit");
            }
            assert_eq!(blocked(backend, step(0.5 * t, ulps), step(t, -ulps)), None, "{what}: tfar before {t}");
            assert!(blocked(backend, step(t, -ulps), step(t, ulps)).is_some(), "{what}: {t} inside");
            let next = blocked(backend, step(t, ulps), 100.0);
            assert_eq!(next.is_some(), t < 4.0, "{what}: tnear behind {t}");
        }
    });
}

/// Rays that start on the surface (t = 0) and segments of no length, compared with brute force.
#[test]
fn segments_of_no_length() {
    let geometry = world(mesh(&grid(4, 4.0, 0.0)));
    let mut rng = Rng::new(23);
    let rays = (0..500)
        .map(|i| {
            let org = Vec3::new(rng.unit() * 3.9, rng.unit() * 3.9, if i % 2 == 0 { 1.0 } else { 3.0 });
            TestRay { org, dir: Vec3::NEG_Z, tnear: if i % 4 < 2 { 0.0 } else { 2.0 }, tfar: 2.0 }
        })
        .collect();
    check(&[Scenario::open("segments of no length", geometry, rays)]);
}
