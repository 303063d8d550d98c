//! Scenes made in code: what tests and library users call instead of writing a glTF. Adds; `build` checks nothing but
//! indices, because the values come from code, not from a file.

use glam::{Affine3A, Vec3};

use super::camera::{Camera, Projection};
use super::ids::{MaterialId, MeshId, NodeId};
use super::light::{Environment, PunctualKind, PunctualLight};
use super::motion::{Shutter, Track};
use super::{Instance, Material, Mesh, Node, Scene};

/// Collects a scene piece by piece.
///
/// ```
/// use pathspace::glam::Vec3;
/// use pathspace::scene::builder::SceneBuilder;
/// use pathspace::{RenderOptions, Renderer};
///
/// let mut builder = SceneBuilder::new();
/// let white = builder.lambert(Vec3::splat(0.7));
/// let lamp = builder.emitter(Vec3::ZERO, Vec3::splat(5.0));
/// builder.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
/// builder.quad([(-0.3, -0.3), (0.3, -0.3), (0.3, 0.3), (-0.3, 0.3)].map(|(x, z)| Vec3::new(x, 0.99, z)), lamp);
/// builder.camera(Vec3::new(0.0, 0.0, 0.9), Vec3::ZERO, Vec3::Y, 1.2);
/// let scene = builder.build();
/// assert!(scene.has_light());
/// let render = Renderer::new(&scene, RenderOptions::new(8, 8).spp(1))?.render()?;
/// assert_eq!(render.film.spp().min, 1);
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    scene: Scene,
    /// What is placed now hangs on it.
    node: Option<NodeId>,
}

impl SceneBuilder {
    /// Nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Lets what is placed from here on hang on a node of that name, in that light group if any.
    pub fn node(&mut self, name: &str, light_group: Option<&str>) -> &mut Self {
        self.node = Some(NodeId(self.scene.nodes.len() as u32));
        let light_group = light_group.map(String::from);
        self.scene.nodes.push(Node { name: name.into(), asset: name.into(), light_group });
        self
    }

    /// Adds any material.
    pub fn material(&mut self, material: Material) -> MaterialId {
        self.scene.materials.push(material);
        MaterialId(self.scene.materials.len() as u32 - 1)
    }

    /// An exact Lambert surface of this albedo.
    pub fn lambert(&mut self, albedo: Vec3) -> MaterialId {
        self.emitter(albedo, Vec3::ZERO)
    }

    /// An exact Lambert surface that also emits `radiance` from its front.
    pub fn emitter(&mut self, albedo: Vec3, radiance: Vec3) -> MaterialId {
        self.material(Material {
            base_color: albedo,
            metallic: 0.0,
            specular: 0.0,
            emissive: radiance,
            ..Material::default()
        })
    }

    /// A single-scatter GGX metal of normal-incidence reflectance `f0`.
    pub fn metal(&mut self, f0: Vec3, alpha: f32) -> MaterialId {
        self.material(Material { base_color: f0, metallic: 1.0, roughness: alpha.sqrt(), ..Material::default() })
    }

    /// A solid smooth dielectric.
    pub fn glass(&mut self, ior: f32) -> MaterialId {
        self.material(Material {
            metallic: 0.0,
            roughness: 0.0,
            transmission: 1.0,
            thickness: 1.0,
            ior,
            ..Material::default()
        })
    }

    /// A separate mesh without normals or texture coordinates; not yet placed.
    pub fn mesh(&mut self, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: MaterialId) -> MeshId {
        let name = format!("mesh {}", self.scene.meshes.len());
        let mesh = Mesh { name, positions, triangles, material, ..Mesh::default() };
        self.full_mesh(mesh)
    }

    /// A mesh with all its attributes; not yet placed.
    pub fn full_mesh(&mut self, mesh: Mesh) -> MeshId {
        self.scene.meshes.push(mesh);
        MeshId(self.scene.meshes.len() as u32 - 1)
    }

    /// Places a mesh.
    pub fn place(&mut self, mesh: MeshId, world_from_object: Affine3A) -> &mut Self {
        self.scene.instances.push(Instance { node: self.node, ..Instance::new(mesh, world_from_object) });
        self
    }

    /// Names what places the last mesh, and the asset that it is a part of, for layers of ids. Its light group stays.
    pub fn named(&mut self, name: &str, asset: &str) -> &mut Self {
        let node = NodeId(self.scene.nodes.len() as u32);
        let placed = self.scene.instances.last_mut().expect("a placed mesh to name");
        let above = placed.node.replace(node).map(|above| &self.scene.nodes[above.0 as usize]);
        let light_group = above.and_then(|node| node.light_group.clone());
        self.scene.nodes.push(Node { name: name.into(), asset: asset.into(), light_group });
        self
    }

    /// Places a mesh that moves: `steps` are its places at equal intervals of the shutter, at least two. A scene with
    /// such meshes has the shutter open for a second unless it is given another.
    pub fn place_moving(&mut self, mesh: MeshId, steps: Vec<Affine3A>) -> &mut Self {
        let world_from_object = *steps.first().expect("a moving mesh has a first place");
        let motion = &mut self.scene.motion;
        motion.shutter.get_or_insert_with(|| Shutter::new(0.0, 1.0).expect("a second"));
        motion.instances.push(Track { index: self.scene.instances.len(), steps });
        self.place(mesh, world_from_object)
    }

    /// Adds and places triangles.
    pub fn triangles(&mut self, positions: Vec<Vec3>, triangles: Vec<[u32; 3]>, material: MaterialId) -> &mut Self {
        let mesh = self.mesh(positions, triangles, material);
        self.place(mesh, Affine3A::IDENTITY)
    }

    /// A quadrilateral, counter-clockwise seen from its front.
    pub fn quad(&mut self, corners: [Vec3; 4], material: MaterialId) -> &mut Self {
        self.triangles(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]], material)
    }

    /// An axis-aligned box. `inward` turns the front sides inside.
    pub fn cuboid(&mut self, min: Vec3, max: Vec3, inward: bool, material: MaterialId) -> &mut Self {
        let p: Vec<Vec3> = (0..8)
            .map(|i| {
                Vec3::new(
                    if i & 1 == 0 { min.x } else { max.x },
                    if i & 2 == 0 { min.y } else { max.y },
                    if i & 4 == 0 { min.z } else { max.z },
                )
            })
            .collect();
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let mut triangles = Vec::with_capacity(12);
        for [a, b, c, d] in faces {
            for [x, y, z] in [[a, b, c], [a, c, d]] {
                triangles.push(if inward { [x, z, y] } else { [x, y, z] });
            }
        }
        self.triangles(p, triangles, material)
    }

    /// A latitude-longitude sphere of `n` rows and 2n columns (HARDCASES G01). `smooth` adds vertex normals.
    pub fn sphere(
        &mut self,
        center: Vec3,
        radius: f32,
        n: u32,
        inward: bool,
        smooth: bool,
        material: MaterialId,
    ) -> &mut Self {
        let (columns, mut positions, mut triangles) = (2 * n, Vec::new(), Vec::new());
        for row in 0..=n {
            let phi = row as f64 * std::f64::consts::PI / n as f64;
            for column in 0..columns {
                let theta = column as f64 * std::f64::consts::PI / n as f64;
                // Both poles collapse to one position, so that the mesh is closed.
                let ring = if row == 0 || row == n { 0.0 } else { phi.sin() };
                let direction = glam::DVec3::new(ring * theta.sin(), phi.cos(), ring * theta.cos());
                positions.push((center.as_dvec3() + radius as f64 * direction).as_vec3());
            }
        }
        for row in 0..n {
            for column in 0..columns {
                let next = (column + 1) % columns;
                let (a, b) = (row * columns + column, row * columns + next);
                let (c, d) = (a + columns, b + columns);
                let mut push = |x: u32, y: u32, z: u32| triangles.push(if inward { [x, z, y] } else { [x, y, z] });
                if row > 0 {
                    push(a, c, b);
                }
                if row + 1 < n {
                    push(b, c, d);
                }
            }
        }
        let sign = if inward { -1.0 } else { 1.0 };
        let normals = smooth.then(|| positions.iter().map(|p| sign * (*p - center).normalize()).collect());
        let name = format!("sphere {}", self.scene.meshes.len());
        let mesh = self.full_mesh(Mesh { name, positions, triangles, normals, material, ..Mesh::default() });
        self.place(mesh, Affine3A::IDENTITY)
    }

    /// A perspective camera. `up` must not be parallel to the view.
    pub fn camera(&mut self, eye: Vec3, target: Vec3, up: Vec3, yfov_rad: f32) -> &mut Self {
        self.any_camera(eye, target, up, Projection::Perspective { yfov_rad, aspect: None })
    }

    /// A camera of any projection.
    pub fn any_camera(&mut self, eye: Vec3, target: Vec3, up: Vec3, projection: Projection) -> &mut Self {
        let back = (eye - target).as_dvec3().normalize();
        let right = up.as_dvec3().cross(back).normalize();
        let true_up = back.cross(right);
        let world_from_camera = Affine3A {
            matrix3: glam::Mat3A::from_cols(right.as_vec3a(), true_up.as_vec3a(), back.as_vec3a()),
            translation: eye.into(),
        };
        let name = format!("camera {}", self.scene.cameras.len());
        self.scene.cameras.push(Camera { name, world_from_camera, projection });
        self
    }

    /// Cameras so far.
    pub fn cameras(&self) -> usize {
        self.scene.cameras.len()
    }

    /// A point light of this intensity, W/sr.
    pub fn point_light(&mut self, position: Vec3, intensity: Vec3) -> &mut Self {
        self.punctual(position, Vec3::NEG_Y, intensity, PunctualKind::Point)
    }

    /// Any punctual light.
    pub fn punctual(&mut self, position: Vec3, direction: Vec3, intensity: Vec3, kind: PunctualKind) -> &mut Self {
        let name = format!("light {}", self.scene.punctual.len());
        let direction = direction.normalize();
        let range_m = f32::INFINITY;
        self.scene.punctual.push(PunctualLight { name, position, direction, intensity, kind, range_m, profile: None });
        self.scene.light_nodes.push(self.node);
        self
    }

    /// The environment.
    pub fn environment(&mut self, environment: Environment) -> &mut Self {
        self.scene.environment = Some(environment);
        self
    }

    /// The scene.
    ///
    /// # Panics
    /// If a mesh names a vertex or material, or an instance a mesh, that was never added.
    pub fn build(self) -> Scene {
        for mesh in &self.scene.meshes {
            assert!(mesh.material.index() < self.scene.materials.len(), "{}: unknown material", mesh.name);
            let n = mesh.positions.len() as u32;
            assert!(mesh.triangles.iter().flatten().all(|&i| i < n), "{}: vertex index out of range", mesh.name);
        }
        let meshes = self.scene.meshes.len();
        assert!(self.scene.instances.iter().all(|i| i.mesh.index() < meshes), "an instance names an unknown mesh");
        self.scene
    }
}
