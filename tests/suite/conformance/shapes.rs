//! Geometry and rays made by hand. Only what a backend reads is filled in: `meshes`, `instances` and `bounds`; the
//! shading records (`Geometry::triangles`, `attributes`) stay empty, for backends never look at them.

use glam::{Affine3A, DAffine3, DVec3, Mat3A, Vec3};
use pathspace::scene::geometry::{Geometry, NO_MATERIAL, Placement, TriangleMesh};

/// Centre far from the origin of HARDCASES G01, where an ulp is 1/64 m.
pub const FAR: Vec3 = Vec3::new(148_376.0, 1_234.0, -223_423.0);

/// Radius of [`sphere`].
pub const RADIUS: f64 = 2.0;

/// PCG32 (O'Neill 2014), so that rays are the same on every machine.
pub struct Rng(u64);

impl Rng {
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng(seed.wrapping_mul(2).wrapping_add(1));
        rng.next();
        rng
    }

    fn next(&mut self) -> u32 {
        let old = self.0;
        self.0 = old.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((((old >> 18) ^ old) >> 27) as u32).rotate_right((old >> 59) as u32)
    }

    /// In [0, n).
    pub fn below(&mut self, n: usize) -> usize {
        ((u64::from(self.next()) * n as u64) >> 32) as usize
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f32 {
        (self.next() >> 8) as f32 / (1 << 24) as f32
    }

    /// In [−1, 1)³.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// Uniform on the sphere, by rejection.
    pub fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.cube();
            let l2 = v.length_squared();
            if (0.01..1.0).contains(&l2) {
                return v / l2.sqrt();
            }
        }
    }
}

/// A mesh from loose triangles, with the spare vertex that 16-byte reads need.
pub fn mesh(triangles: &[[Vec3; 3]]) -> TriangleMesh {
    let mut vertices: Vec<Vec3> = triangles.iter().flatten().copied().collect();
    vertices.push(Vec3::ZERO);
    let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    TriangleMesh { vertices, indices, ..TriangleMesh::default() }
}

/// A scene of one world mesh.
pub fn world(mesh: TriangleMesh) -> Geometry {
    with_instances(vec![mesh], Vec::new())
}

/// A scene of meshes (0 is the world) and instances; fills the bounds.
pub fn with_instances(meshes: Vec<TriangleMesh>, instances: Vec<Placement>) -> Geometry {
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let mut cover = |mesh: &TriangleMesh, world_from_object: Affine3A| {
        for corner in mesh.indices.iter().flatten() {
            let p = world_from_object.transform_point3(mesh.vertices[*corner as usize]);
            (lo, hi) = (lo.min(p), hi.max(p));
        }
    };
    if let Some(mesh) = meshes.first() {
        cover(mesh, Affine3A::IDENTITY);
    }
    for placement in &instances {
        cover(&meshes[placement.mesh as usize], placement.world_from_object);
    }
    Geometry { meshes, instances, bounds: (lo, hi), ..Geometry::default() }
}

/// Mesh `mesh` placed by `world_from_object`; inverses in f64.
pub fn placed(mesh: u32, world_from_object: Affine3A) -> Placement {
    let world = DAffine3::from_cols_array(&world_from_object.to_cols_array().map(f64::from));
    let object = world.inverse();
    let narrow = |m: DAffine3| Affine3A::from_cols_array(&m.to_cols_array().map(|x| x as f32));
    let normal = object.matrix3.transpose().to_cols_array().map(|x| x as f32);
    Placement {
        mesh,
        world_from_object,
        object_from_world: narrow(object),
        world_from_normal: Mat3A::from_cols_array(&normal),
        material: NO_MATERIAL,
    }
}

/// `n` triangles with corners within `size` of points of [−1, 1)³.
pub fn soup(rng: &mut Rng, n: usize, size: f32) -> Vec<[Vec3; 3]> {
    (0..n)
        .map(|_| {
            let center = rng.cube();
            std::array::from_fn(|_| center + rng.cube() * size)
        })
        .collect()
}

/// The closed lat-long sphere of HARDCASES G01: n = 50, so of 9800 triangles.
pub fn sphere(center: Vec3) -> TriangleMesh {
    sphere_of(50, center)
}

/// A closed lat-long sphere of `n` rows, evaluated in f32, with the poles collapsed, without the degenerate triangles
/// there (4n(n − 1) remain). Vertices are shared, so that edges are.
pub fn sphere_of(n: u32, center: Vec3) -> TriangleMesh {
    let mut vertices = Vec::new();
    for row in 0..=n {
        for column in 0..2 * n {
            let phi = row as f32 * std::f32::consts::PI / n as f32;
            let theta = column as f32 * std::f32::consts::PI / n as f32;
            let ring = if row == 0 || row == n { 0.0 } else { phi.sin() };
            let unit = Vec3::new(ring * theta.sin(), phi.cos(), ring * theta.cos());
            vertices.push(center + RADIUS as f32 * unit);
        }
    }
    vertices.push(Vec3::ZERO);
    let mut indices = Vec::new();
    let at = |row: u32, column: u32| match row {
        // One vertex for a pole, whatever the column.
        0 => 0,
        _ if row == n => n * 2 * n,
        _ => row * 2 * n + column % (2 * n),
    };
    for row in 0..n {
        for column in 0..2 * n {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            if row > 0 {
                indices.push([a, c, b]);
            }
            if row + 1 < n {
                indices.push([b, c, d]);
            }
        }
    }
    TriangleMesh { vertices, indices, ..TriangleMesh::default() }
}

/// n × n squares, two triangles each, over [0, size]² at height `z`; corners are dyadic when size/n is.
pub fn grid(n: u32, size: f32, z: f32) -> Vec<[Vec3; 3]> {
    let point = |i: u32, j: u32| Vec3::new(i as f32 * size / n as f32, j as f32 * size / n as f32, z);
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let [a, b, c, d] = [point(i, j), point(i + 1, j), point(i, j + 1), point(i + 1, j + 1)];
            triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    triangles
}

/// The unit cube of HARDCASES G18 about the origin, 12 triangles.
pub fn cube() -> Vec<[Vec3; 3]> {
    let corner = |i: usize| Vec3::new((i & 1) as f32, (i >> 1 & 1) as f32, (i >> 2 & 1) as f32) - 0.5;
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        .into_iter()
        .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
        .map(|t| t.map(corner))
        .collect()
}

/// `to − from` as a unit vector, computed in f64 and rounded once.
pub fn toward(from: Vec3, to: DVec3) -> Vec3 {
    (to - from.as_dvec3()).normalize().as_vec3()
}
