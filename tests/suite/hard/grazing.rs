//! Rays nearly parallel to a triangle (HARDCASES G16): what is reported must lie on the ray, and on the triangle.
//!
//! Oracle: signs of the edge functions in f64 on the f32 inputs. The bounds are the specification's: the reported point
//! lies within 4·2⁻²⁴ (|o| + t|d| + |v0|) of the ray, t within 10⁻⁴ of the range over the vertices. A hit is
//! lost when the ray passes the inside of the triangle by more than the first bound and nothing is reported; nearer to
//! an edge f32 inputs do not say.

use glam::{DVec3, Vec3};
use pathspace::backend::batch::Hit;
use pathspace::backend::{self, BackendOptions, Coherence};

use super::Case;
use crate::conformance::shapes::{Rng, mesh, world};
use crate::conformance::{Row, TestRay, closest, tracers};

/// Rays per triangle; 500 triangles make the 200 000 of a family.
const RAYS: usize = 400;

/// What came of a family of grazing rays.
#[derive(Default)]
struct Grazing {
    rays: usize,
    hits: usize,
    off_ray: usize,
    out_of_range: usize,
    /// Hits that are none in exact arithmetic, by however little.
    false_hits: usize,
    lost: usize,
    /// Largest distance of a reported t from the range over the vertices.
    worst_t: f64,
}

/// Rays at triangles with edges of about 11, 10 and 1 in random planes, seen from `distance` at `angle` to the plane.
fn graze(row: &Row, distance: f64, angle: f64) -> Grazing {
    let mut rng = Rng::new(13);
    let mut sum = Grazing::default();
    for _ in 0..500 {
        let x = rng.direction().as_dvec3();
        let y = x.cross(rng.direction().as_dvec3()).normalize();
        let n = x.cross(y);
        let place = rng.cube().as_dvec3() * 50.0;
        let corners = [DVec3::ZERO, x * 11.0, x * 10.0 + y].map(|p| (p + place).as_vec3());
        let rays: Vec<TestRay> = (0..RAYS)
            .map(|_| {
                // A point about the triangle, half the time inside, and a direction in any azimuth.
                let (a, b) = (f64::from(rng.unit()) * 1.2 - 0.1, f64::from(rng.unit()) * 1.2 - 0.1);
                let target = place + x * (11.0 * a) + (x * 10.0 + y) * (b * (1.0 - a));
                let azimuth = f64::from(rng.unit()) * std::f64::consts::TAU;
                let along = x * azimuth.cos() + y * azimuth.sin();
                let dir = along * angle.cos() + n * angle.sin();
                TestRay::new((target - dir * distance).as_vec3(), dir.as_vec3())
            })
            .collect();
        let geometry = world(mesh(&[corners]));
        if !row.kind.traces(&geometry) {
            continue;
        }
        let options = BackendOptions { build_threads: 1, ..BackendOptions::with_mode(row.mode) };
        let backend = backend::select::build(row.kind, &geometry, &options).expect("builds");
        for (ray, hit) in rays.iter().zip(closest(backend.as_ref(), &rays, Coherence::Incoherent)) {
            sum.judge(&corners, ray, hit);
        }
    }
    sum
}

impl Grazing {
    fn judge(&mut self, corners: &[Vec3; 3], ray: &TestRay, hit: Option<Hit>) {
        let (org, dir) = (ray.org.as_dvec3(), ray.dir.as_dvec3());
        let [a, b, c] = corners.map(|p| p.as_dvec3() - org);
        let bound = |t: f64| 4.0 * 2f64.powi(-24) * (org.length() + t * dir.length() + corners[0].as_dvec3().length());

        // Distance of the ray from each side as it sees them, positive inside.
        let across = |p: DVec3| p - dir * (p.dot(dir) / dir.length_squared());
        let [p, q, r] = [a, b, c].map(across);
        let side = |p: DVec3, q: DVec3| p.cross(q).dot(dir) / ((q - p).length() * dir.length());
        let turn = (q - p).cross(r - p).dot(dir).signum();
        let inside = [side(p, q), side(q, r), side(r, p)].into_iter().map(|d| d * turn).fold(f64::MAX, f64::min);
        self.rays += 1;
        let along = [a, b, c].map(|p| p.dot(dir) / dir.length_squared());
        let (least, most) = (along.iter().copied().fold(f64::MAX, f64::min), along.iter().copied().fold(0.0, f64::max));
        let Some(hit) = hit else {
            self.lost += usize::from(inside > bound(least));
            return;
        };
        self.hits += 1;
        self.false_hits += usize::from(inside < 0.0);
        let point = a + (b - a) * f64::from(hit.u) + (c - a) * f64::from(hit.v);
        let t = f64::from(hit.t);
        self.off_ray += usize::from(across(point).length() > bound(t));
        self.worst_t = self.worst_t.max((t - most).max(least - t));
        self.out_of_range += usize::from(t > most * (1.0 + 1e-4) || t < least * (1.0 - 1e-4));
    }
}

#[test]
fn g16_near_parallel_rays() {
    let mut case = Case::open("G16", "near-parallel rays and false hits", "ill-conditioned intersection");
    for row in &tracers() {
        for (family, distance, angle) in [("mild", 500.0, 0.009), ("extreme", 5e4, 1e-4)] {
            let sum = graze(row, distance, angle);
            let judged = family == "mild";
            case.row(
                format!("{}, {family}", row.name()),
                if judged { "0 violations, 0 lost" } else { "0 violations" },
                format!("{} off the ray, {} out of range, {} lost", sum.off_ray, sum.out_of_range, sum.lost),
                format!("{} hits of {}, {} false, t off by {:.1e}", sum.hits, sum.rays, sum.false_hits, sum.worst_t),
                sum.off_ray + sum.out_of_range == 0 && (!judged || sum.lost == 0),
            );
        }
    }
    case.close();
}
