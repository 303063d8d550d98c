//! What a hit may be, in f64: the judge of every disagreement, and the oracle of brute force.
//!
//! For one ray and one triangle, [`look`] gives the parameter at the plane, the signed distance of that point from the
//! triangle's border, and how far f32 rounding may move both. A triangle is *definitely* hit when it is hit by more
//! than its tolerance, *possibly* hit when it is missed by less. A backend may report any possible hit with no definite
//! one before it, and may report nothing only if there is no definite hit at all.

use glam::{DAffine3, DVec3};
use pathspace::backend::batch::{Hit, INVALID_ID};
use pathspace::scene::geometry::Geometry;

use super::TestRay;

/// Roundings that a triangle test may stack up, in units of 2⁻²⁴ of the distances involved. Differences, shear or
/// cross products, and sums: 5 (Woop) to 12 (Plücker with an approximate reciprocal); 16 covers both.
const ROUNDINGS: f64 = 16.0 / (1u64 << 24) as f64;

/// A ray and the plane of a triangle.
#[derive(Clone, Copy, Debug)]
struct Look {
    /// Parameter at the plane.
    t: f64,
    /// Tolerance of `t`.
    t_slack: f64,
    /// Distance of the point from the border, positive inside.
    border: f64,
    border_slack: f64,
    u: f64,
    v: f64,
    /// Largest move of the hit point that the tolerances allow.
    point_slack: f64,
    edges: (f64, f64),
    segment: (f64, f64),
}

impl Look {
    fn definite(&self) -> bool {
        let (tnear, tfar) = self.segment;
        self.border > self.border_slack && self.t > tnear + self.t_slack && self.t < tfar - self.t_slack
    }

    fn possible(&self) -> bool {
        let (tnear, tfar) = self.segment;
        self.border >= -self.border_slack && self.t >= tnear - self.t_slack && self.t <= tfar + self.t_slack
    }

    fn exact(&self) -> bool {
        self.border >= 0.0 && self.t >= self.segment.0 && self.t <= self.segment.1
    }

    /// Whether a reported hit is this triangle's, up to rounding.
    fn matches(&self, hit: &Hit) -> bool {
        let du = (f64::from(hit.u) - self.u).abs() * self.edges.0;
        let dv = (f64::from(hit.v) - self.v).abs() * self.edges.1;
        (f64::from(hit.t) - self.t).abs() <= self.t_slack && du + dv <= self.point_slack
    }
}

/// Looks along `ray` at one triangle; `None` for one that is a line or parallel to the ray.
fn look(geometry: &Geometry, ray: &TestRay, (inst, geom, prim): (u32, u32, u32)) -> Option<Look> {
    let mesh = geometry.meshes.get(geom as usize)?;
    let world = match inst {
        INVALID_ID => DAffine3::IDENTITY,
        _ => DAffine3::from_cols_array(
            &geometry.instances.get(inst as usize)?.world_from_object.to_cols_array().map(f64::from),
        ),
    };
    let corners =
        mesh.indices.get(prim as usize)?.map(|i| world.transform_point3(mesh.vertices[i as usize].as_dvec3()));
    let (org, dir) = (ray.org.as_dvec3(), ray.dir.as_dvec3());

    let [a, b, c] = corners.map(|p| p - org);
    let (e1, e2) = (b - a, c - a);
    let cross = e1.cross(e2);
    let n = cross.try_normalize()?;
    let cos = n.dot(dir) / dir.length();
    if cos == 0.0 {
        return None;
    }
    let t = a.dot(n) / dir.dot(n);
    let p = dir * t;
    // Signed distances from the three edges, inside positive.
    let inward = |p0: DVec3, p1: DVec3| n.cross((p1 - p0).normalize()).dot(p - p0);
    let border = inward(a, b).min(inward(b, c)).min(inward(c, a));

    // Roundings of an instance's transform act on coordinates, not on differences, and are stretched by its scales.
    let mut scale = a.length().max(b.length()).max(c.length()) + (t * dir).length();
    if inst != INVALID_ID {
        let norm = |m: DAffine3| m.matrix3.to_cols_array().iter().map(|x| x * x).sum::<f64>().sqrt();
        let condition = (norm(world) * norm(world.inverse()) / 3.0).max(1.0);
        let absolute =
            org.length() + corners.iter().fold(0.0f64, |m, p| m.max(p.length())) + world.translation.length();
        scale = (scale + absolute) * condition;
    }
    let shift = ROUNDINGS * scale;
    // A thin triangle's normal turns by more than a round one's.
    let thinness = e1.length() * e2.length() / cross.length();
    let border_slack = shift / cos.abs();
    let point_slack = 2.0 * shift * thinness / cos.abs();
    let uv = |q: DVec3, r: DVec3| q.cross(r).dot(n) / cross.length();
    Some(Look {
        t,
        t_slack: shift * thinness / (cos.abs() * dir.length()),
        border,
        border_slack,
        u: uv(p - a, e2),
        v: uv(e1, p - a),
        point_slack,
        edges: (e1.length(), e2.length()),
        segment: (f64::from(ray.tnear), f64::from(ray.tfar)),
    })
}

/// Every triangle of the scene as (instance, mesh, triangle).
fn everything(geometry: &Geometry) -> impl Iterator<Item = (u32, u32, u32)> + '_ {
    let world = std::iter::once((INVALID_ID, 0)).filter(|_| !geometry.meshes.is_empty());
    let placed = (0u32..).zip(&geometry.instances).map(|(i, p)| (i, p.mesh));
    world.chain(placed).flat_map(|(inst, geom)| {
        (0..geometry.meshes[geom as usize].indices.len() as u32).map(move |prim| (inst, geom, prim))
    })
}

/// The nearest hit in f64.
pub fn nearest(geometry: &Geometry, ray: &TestRay) -> Option<Hit> {
    everything(geometry)
        .filter_map(|id| look(geometry, ray, id).filter(Look::exact).map(|look| (id, look)))
        .min_by(|a, b| a.1.t.total_cmp(&b.1.t))
        .map(|((inst, geom, prim), l)| Hit { t: l.t as f32, u: l.u as f32, v: l.v as f32, prim, geom, inst, time: 0.0 })
}

/// Whether the numbers of `hit` are those of the triangle it names, up to rounding.
pub fn matches(geometry: &Geometry, ray: &TestRay, hit: &Hit) -> bool {
    look(geometry, ray, (hit.inst, hit.geom, hit.prim)).is_some_and(|look| look.possible() && look.matches(hit))
}

/// Whether a backend may report `got` for `ray`.
pub fn plausible(geometry: &Geometry, ray: &TestRay, got: Option<&Hit>) -> bool {
    let mut limit = f64::INFINITY;
    if let Some(hit) = got {
        let Some(own) = look(geometry, ray, (hit.inst, hit.geom, hit.prim)) else { return false };
        if !own.possible() || !own.matches(hit) {
            return false;
        }
        limit = own.t - own.t_slack;
    }
    !everything(geometry)
        .filter_map(|id| look(geometry, ray, id))
        .any(|other| other.definite() && other.t + other.t_slack < limit)
}

/// Whether a backend may say that the segment is blocked, or that it is not.
pub fn plausible_any(geometry: &Geometry, ray: &TestRay, blocked: bool) -> bool {
    let mut looks = everything(geometry).filter_map(|id| look(geometry, ray, id));
    if blocked { looks.any(|l| l.possible()) } else { !looks.any(|l| l.definite()) }
}
