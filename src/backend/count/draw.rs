//! The rays that are counted: paths from the scene's first camera, a few scatterings long, with a segment towards a
//! lamp from every hit. All is drawn from fixed numbers; of materials nothing is known, so all surfaces are matte.

use std::f32::consts::FRAC_PI_4;

use glam::Vec3;

use super::walk::{Met, Timed, Visits, Walk};
use crate::backend::triangle::Ray;
use crate::math::float;
use crate::scene::camera::{Camera, Projection};
use crate::scene::geometry::Geometry;

/// Columns and rows of paths.
const PATHS: (u32, u32) = (32, 16);

/// Scatterings of a path.
const BOUNCES: usize = 3;

/// How far along a segment towards a lamp ends: it must not meet the lamp.
const SHORT: f32 = 1.0 - 1.0 / 1024.0;

/// What a scene's rays begin at and go to.
#[derive(Clone, Debug, Default)]
pub struct View {
    /// The first camera.
    pub camera: Option<Camera>,
    /// Corners of some lamps; of points three times the same.
    pub lamps: Vec<[Vec3; 3]>,
    /// Whether there is light from infinity.
    pub sky: bool,
}

/// The rays by class: camera, bounce, shadow.
pub(super) type Rays = [Vec<Timed>; 3];

/// Draws the rays; hits are found in `walk`, and what they visit there is counted by class.
pub(super) fn rays(geometry: &Geometry, view: &View, walk: &mut Walk, visits: &mut [Visits; 3]) -> Rays {
    let mut rays = Rays::default();
    let Some(camera) = &view.camera else { return rays };
    let mut random = Random(0x5eed);
    let moves = !geometry.moving.is_empty();
    for row in 0..PATHS.1 {
        for column in 0..PATHS.0 {
            let x = (column as f32 + random.unit()) / PATHS.0 as f32 * 2.0 - 1.0;
            let y = 1.0 - (row as f32 + random.unit()) / PATHS.1 as f32 * 2.0;
            let time = if moves { random.unit() } else { 0.0 };
            let mut ray = camera_ray(camera, x, y);
            for bounce in 0..=BOUNCES {
                let class = usize::from(bounce > 0);
                let timed = Timed { ray, time, any: false };
                rays[class].push(timed);
                let Some(met) = walk.trace(&timed, &mut visits[class]) else { break };
                let Some(place) = Place::of(geometry, &met, &ray, time) else { break };
                if let Some(ray) = place.towards_lamp(view, &mut random) {
                    let timed = Timed { ray, time, any: true };
                    rays[2].push(timed);
                    walk.trace(&timed, &mut visits[2]);
                }
                ray = place.leave(place.around(&mut random), f32::INFINITY);
            }
        }
    }
    rays
}

/// Through a place of the film, −1 to 1 each way.
fn camera_ray(camera: &Camera, x: f32, y: f32) -> Ray {
    let to_world = &camera.world_from_camera;
    let (org, dir) = match camera.projection {
        Projection::Perspective { yfov_rad, aspect } => {
            let tan = half_tangent(yfov_rad);
            (Vec3::ZERO, Vec3::new(x * tan * aspect.unwrap_or(1.0), y * tan, -1.0))
        }
        Projection::Orthographic { xmag_m, ymag_m } => (Vec3::new(x * xmag_m, y * ymag_m, 0.0), Vec3::NEG_Z),
    };
    let dir = to_world.transform_vector3(dir).normalize();
    Ray::new(to_world.transform_point3(org), dir, 0.0, f32::INFINITY)
}

/// tan(x/2) by what every machine rounds alike: the functions of the system's library differ in their last bits, and a
/// choice should not. Exact to 10⁻³ up to 120°, and held there.
fn half_tangent(x: f32) -> f32 {
    let half = (0.5 * x).clamp(0.0, 4.0 / 3.0 * FRAC_PI_4);
    let square = half * half;
    // Lambert's continued fraction.
    half / (1.0 - square / (3.0 - square / (5.0 - square / (7.0 - square / 9.0))))
}

/// Where a path has arrived.
struct Place {
    p: Vec3,
    /// Geometric normal towards where the ray came from.
    normal: Vec3,
    error: f32,
}

impl Place {
    fn of(geometry: &Geometry, met: &Met, ray: &Ray, time: f32) -> Option<Self> {
        let world_from_object = met.instance.map(|instance| geometry.world_from_object(instance, time));
        let mesh = met.instance.map_or(0, |instance| geometry.instances[instance as usize].mesh);
        let mesh = &geometry.meshes[mesh as usize];
        let corners = mesh.indices[met.prim as usize].map(|i| mesh.vertices[i as usize]);
        let [a, b, c] = world_from_object.map_or(corners, |map| corners.map(|corner| map.transform_point3(corner)));
        let (e1, e2) = (b - a, c - a);
        let normal = e1.as_dvec3().cross(e2.as_dvec3()).normalize_or_zero().as_vec3();
        let p = float::hit_point(a, e1, e2, met.hit.u, met.hit.v);
        // A placement rounds as often again.
        let error = float::hit_error(a, e1, e2, p) * if met.instance.is_some() { 4.0 } else { 1.0 };
        let normal = if normal.dot(ray.dir) > 0.0 { -normal } else { normal };
        (normal != Vec3::ZERO && p.is_finite() && error.is_finite()).then_some(Place { p, normal, error })
    }

    /// A direction with the density of the cosine: a point of the unit ball, drawn by rejection, put onto its surface
    /// and moved by the normal.
    fn around(&self, random: &mut Random) -> Vec3 {
        let dir = self.normal + random.direction();
        if dir.length_squared() > 1e-6 { dir.normalize() } else { self.normal }
    }

    fn leave(&self, dir: Vec3, tfar: f32) -> Ray {
        Ray::new(float::spawn_origin(self.p, self.normal, self.error, dir), dir, 0.0, tfar)
    }

    /// A segment towards a lamp or the sky, each as likely; `None` where that lies behind the surface.
    fn towards_lamp(&self, view: &View, random: &mut Random) -> Option<Ray> {
        let choices = view.lamps.len() + usize::from(view.sky) * view.lamps.len().max(1);
        let (pick, u, v) = (random.unit(), random.unit(), random.unit());
        let Some(&[a, b, c]) = view.lamps.get((pick * choices as f32) as usize) else {
            let dir = self.around(random);
            return view.sky.then(|| self.leave(dir, f32::INFINITY));
        };
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let way = float::hit_point(a, b - a, c - a, u, v) - self.p;
        let distance = way.length();
        let dir = way / distance;
        (dir.is_finite() && dir.dot(self.normal) > 0.0).then(|| self.leave(dir, distance * SHORT))
    }
}

/// Numbers of a linear congruential generator (Knuth, MMIX).
struct Random(u64);

impl Random {
    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    /// Uniform over the sphere.
    fn direction(&mut self) -> Vec3 {
        loop {
            let p = Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0;
            if (1e-4..=1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the library's function, within what the comment says.
    #[test]
    fn half_tangents() {
        for degrees in 1..=120 {
            let angle = (degrees as f32).to_radians();
            assert!((half_tangent(angle) / (0.5 * angle).tan() - 1.0).abs() < 1e-3, "{degrees}");
        }
        assert_eq!(half_tangent(3.1), half_tangent(2.2));
    }
}
