//! An irradiance meter for tests of lights, and hand-made lights to hold it to: E = ∫ L cos⁺ dω at a point with a
//! normal, estimated by light sampling alone, without visibility.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pathspace::scene::geometry::{Geometry, NO_ATTRIBUTES, Triangle, TriangleMesh};
use pathspace::scene::{Environment, Material, Scene};
use pathspace::shading::light::Lights;
use pathspace_stat::Moments;

/// SplitMix64 (Steele et al. 2014): independent of the samplers under test.
pub struct Random(pub u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform over the 2^24 multiples of 2^-24 in [0,1).
    pub fn unit(&mut self) -> f32 {
        (self.bits() >> 40) as f32 / 16_777_216.0
    }

    pub fn log_uniform(&mut self, from: f64, to: f64) -> f64 {
        (from.ln() + f64::from(self.unit()) * (to / from).ln()).exp()
    }

    pub fn direction(&mut self) -> Vec3 {
        let (z, phi) = (2.0 * f64::from(self.unit()) - 1.0, 2.0 * PI * f64::from(self.unit()));
        let r = (1.0 - z * z).sqrt();
        DVec3::new(r * phi.cos(), r * phi.sin(), z).as_vec3()
    }
}

pub fn material(radiance: f32) -> Material {
    Material { emissive: Vec3::splat(radiance), ..Material::default() }
}

/// World mesh of the given triangles and material numbers.
pub fn geometry(triangles: &[([Vec3; 3], u32)]) -> Geometry {
    let mut result = Geometry { bounds: (Vec3::MAX, Vec3::MIN), ..Geometry::default() };
    let mut mesh = TriangleMesh::default();
    for &([a, b, c], material) in triangles {
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3());
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend([a, b, c]);
        mesh.indices.push([first, first + 1, first + 2]);
        for p in [a, b, c] {
            result.bounds = (result.bounds.0.min(p), result.bounds.1.max(p));
        }
        result.triangles.push(Triangle {
            v0: a.into(),
            e1: (b - a).into(),
            e2: (c - a).into(),
            n_g: normal.normalize_or_zero().as_vec3().into(),
            material,
            attributes: NO_ATTRIBUTES,
            error: 0.0,
            light: u32::MAX,
        });
    }
    result.meshes.push(mesh);
    result
}

/// Two triangles that face `e1` × `e2`.
pub fn rectangle(corner: Vec3, e1: Vec3, e2: Vec3, material: u32) -> Vec<([Vec3; 3], u32)> {
    let opposite = corner + e1 + e2;
    vec![([corner, corner + e1, opposite], material), ([corner, opposite, corner + e2], material)]
}

/// L01's light: the square [-1,1]² at z = 1, radiance 1, facing down.
pub fn square_light() -> Vec<([Vec3; 3], u32)> {
    rectangle(Vec3::new(-1.0, -1.0, 1.0), Vec3::new(0.0, 2.0, 0.0), Vec3::new(2.0, 0.0, 0.0), 0)
}

pub fn lights_of(triangles: &[([Vec3; 3], u32)]) -> Lights {
    let scene = Scene { materials: vec![material(1.0), material(0.0)], ..Scene::default() };
    Lights::build(&scene, &geometry(triangles)).expect("valid lights")
}

/// Moments of the light-sampling estimate of the irradiance (first channel).
pub fn irradiance(lights: &Lights, p: Vec3, n: Vec3, samples: u32, seed: u64) -> Moments {
    let mut random = Random(seed);
    let mut moments = Moments::default();
    for _ in 0..samples {
        let u = [random.unit(), random.unit(), random.unit()];
        let value = lights.sample(p, n, u).map_or(0.0, |sample| {
            assert!((sample.wi.length() - 1.0).abs() < 1e-6 && sample.radiance.is_finite(), "{sample:?}");
            f64::from(sample.radiance.x) * f64::from(sample.wi.dot(n).max(0.0)) / f64::from(sample.pdf_sa)
        });
        assert!(value >= 0.0 && value.is_finite());
        moments.push(value);
    }
    moments
}

/// A map whose texels take the value of `radiance` at their centres.
pub fn environment(width: usize, height: usize, radiance: impl Fn(DVec3) -> f32) -> Environment {
    let texels: Vec<Vec3> = (0..width * height)
        .map(|i| {
            let (u, v) = (((i % width) as f64 + 0.5) / width as f64, ((i / width) as f64 + 0.5) / height as f64);
            Vec3::splat(radiance(map_direction(u, v)))
        })
        .collect();
    Environment { width, height, texels: texels.into(), rotation_rad: 0.0, intensity: 1.0 }
}

/// The convention of the shared scenes, solved for the direction.
pub fn map_direction(u: f64, v: f64) -> DVec3 {
    let (phi, theta) = (2.0 * PI * (u - 0.5), PI * v);
    DVec3::new(theta.sin() * phi.sin(), theta.cos(), -theta.sin() * phi.cos())
}

pub fn environment_lights(environment: Environment) -> Lights {
    let scene = Scene { environment: Some(environment), ..Scene::default() };
    Lights::build(&scene, &Geometry::default()).expect("valid environment")
}
