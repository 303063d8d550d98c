//! Geometry flattened for tracing and shading: what the backends are built from and what a hit is looked up in.
//!
//! Meshes that are placed once, and small repeated ones, are baked into one world mesh in f64 (index 0); the rest, and what
//! moves, stays instanced at one level. Each triangle has one 64-byte record (a cache line) with everything flat shading needs;
//! vertex attributes are looked up only where the plan shades with them.

use std::collections::HashSet;

use glam::{Affine3A, DAffine3, DMat3, Vec2, Vec3, Vec4};

use super::placement::Moving;
pub use super::placement::Placement;
use super::{Instance, Material, Mesh, Scene};
use crate::math::float;

/// A repeated mesh of at most this many triangles is baked: the transform of each ray at an instance then costs more than
/// the copies. Larger ones stay instanced: on `interior` (50 placements of 8 meshes, 1 M triangles) baking all made the
/// render 6–17 % slower (three pairs), the build 4 times slower, and took 298 MB instead of 130.
pub const BAKE_MESH_TRIANGLES: usize = 1024;

/// Baked copies of repeated meshes may have this many triangles together (about 160 B each with their hierarchy).
pub const BAKE_TRIANGLE_BUDGET: u64 = 1 << 20;

/// A ray thinner than an f32 direction can express cannot tell a triangle from a line once its height is below 2⁻⁴⁰ of
/// its longest edge: sheared coordinates carry 24 bits, so it would have to start within 2⁻¹⁶ of the edge's length.
const LINE_HEIGHT: f64 = 1.0 / (1u64 << 40) as f64;

/// Largest coordinate, metres: beyond it the squares in ray–triangle tests overflow f32 (√f32::MAX ≈ 1.8e19; Embree itself
/// drops vertices beyond 1.8e18).
pub(crate) const LARGEST_COORDINATE_M: f32 = 1e18;

/// "No vertex attributes" in [`Triangle::attributes`].
pub const NO_ATTRIBUTES: u32 = u32::MAX;

/// One triangle as shading sees it, in the space of its mesh.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Triangle {
    /// First vertex.
    pub v0: [f32; 3],
    /// v1 − v0, rounded once.
    pub e1: [f32; 3],
    /// v2 − v0, rounded once.
    pub e2: [f32; 3],
    /// Unit geometric normal, along e1 × e2 (flipped where a baked placement mirrors), computed in f64.
    pub n_g: [f32; 3],
    /// Index into `Scene::materials`.
    pub material: u32,
    /// Index of this triangle's corners in [`Geometry::normals`] (and in `uvs`, `tangents` where below their length), or
    /// [`NO_ATTRIBUTES`].
    pub attributes: u32,
    /// Bound of the distance along `n_g` between any reported hit on this triangle and the true one, metres (world
    /// triangles; instanced ones need their transform): the largest of `math::float::hit_error` at the corners, where that
    /// convex function of the point is largest.
    pub error: f32,
    /// Index of the light this triangle is, or `u32::MAX`. Valid in the world mesh only: emissive meshes are always baked.
    pub light: u32,
}

impl Triangle {
    /// Area in m² of the mesh's space.
    pub fn area(&self) -> f32 {
        let (e1, e2) = (Vec3::from(self.e1).as_dvec3(), Vec3::from(self.e2).as_dvec3());
        (0.5 * e1.cross(e2).length()) as f32
    }
}

/// True for a triangle that is a point, a line (see [`LINE_HEIGHT`]), not finite or out of range. No such triangle is traced.
pub(crate) fn is_degenerate(triangle: &[Vec3; 3]) -> bool {
    // Also true of NaN.
    if !triangle.iter().all(|v| v.abs().cmple(Vec3::splat(LARGEST_COORDINATE_M)).all()) {
        return true;
    }
    let [a, b, c] = triangle.map(|v| v.as_dvec3());
    let longest2 = (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
    // Twice the area = height · longest edge. `<=` also catches three equal points.
    (b - a).cross(c - a).length() <= LINE_HEIGHT * longest2
}

/// The largest hit error over the corners.
fn hit_error(v0: Vec3, e1: Vec3, e2: Vec3, corners: [Vec3; 3]) -> f32 {
    corners.into_iter().map(|p| float::hit_error(v0, e1, e2, p)).fold(0.0, f32::max)
}

/// Triangles of one mesh as a backend sees them.
#[derive(Clone, Debug, Default)]
pub struct TriangleMesh {
    /// Vertex positions; finite. One spare vertex follows the last used one, so that 16-byte reads stay inside.
    pub vertices: Vec<Vec3>,
    /// Vertex indices.
    pub indices: Vec<[u32; 3]>,
    /// Index of this mesh's first record in [`Geometry::triangles`].
    pub first_triangle: u32,
}

impl TriangleMesh {
    /// The triangles that can be traced, with their corners. Those without area and indices out of range are left out.
    pub(crate) fn traced(&self) -> impl Iterator<Item = (u32, [Vec3; 3])> {
        let corner = |i: u32| self.vertices.get(i as usize).copied().unwrap_or(Vec3::NAN);
        let all = (0u32..).zip(&self.indices).map(move |(prim, triangle)| (prim, triangle.map(corner)));
        all.filter(|(_, corners)| !is_degenerate(corners))
    }
}

/// The flattened geometry.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// Mesh 0 is the baked world mesh (possibly empty); the others are reached through `instances`.
    pub meshes: Vec<TriangleMesh>,
    /// Instanced placements, those that move last.
    pub instances: Vec<Placement>,
    /// Where the last of them are over the shutter; empty in a scene at rest.
    pub moving: Moving,
    /// One record per triangle of every mesh.
    pub triangles: Vec<Triangle>,
    /// Unit normals at the corners of the triangles that have attributes. Triangles with tangents come first, then those
    /// with texture coordinates, then those with normals alone, so that the shorter arrays below are prefixes. (Those with
    /// extras come before all, in the same order, and have every array filled.)
    pub normals: Vec<[Vec3; 3]>,
    /// Texture coordinates at the corners; only triangles whose material reads a texture have them.
    pub uvs: Vec<[Vec2; 3]>,
    /// Channels 1 and up of the texture coordinates, each as long as `colors` or empty.
    pub more_uvs: Vec<Vec<[Vec2; 3]>>,
    /// Vertex colours at the corners. Triangles with colours or more than one channel come before all others; among them,
    /// those without have white here.
    pub colors: Vec<[Vec4; 3]>,
    /// Tangents and the bitangent's sign at the corners; only triangles whose material has a normal map have them.
    pub tangents: Vec<[Vec4; 3]>,
    /// World-space bounds over all placements: min and max; min > max when there is nothing.
    pub bounds: (Vec3, Vec3),
    /// Triangles without area that were left out while baking.
    pub dropped_degenerate: usize,
    /// Emissive triangles that were left out because another one has the same corners and faces the same way.
    pub dropped_lamps: usize,
}

/// Which attributes a mesh's triangles carry, richest first: the order in which meshes are laid out.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Attributes {
    /// Colours or more than one channel of texture coordinates, and a place for all the others.
    Extras,
    Tangents,
    Uvs,
    Normals,
    None,
}

/// Whether a mesh has attributes beyond [`Attributes`] that its material reads: colours, or more than one channel of
/// texture coordinates.
fn has_extras(mesh: &Mesh, material: &Material) -> bool {
    (material.vertex_colors && mesh.colors.is_some()) || (mesh.uvs.is_some() && material.uv_channels() > 1)
}

impl Attributes {
    /// What triangles get arrays for: those with extras for all.
    fn laid_out(mesh: &Mesh, material: &Material) -> Self {
        if has_extras(mesh, material) { Attributes::Extras } else { Attributes::of(mesh, material) }
    }

    fn of(mesh: &Mesh, material: &Material) -> Self {
        if mesh.uvs.is_some() && mesh.tangents.is_some() && material.normal_texture.is_some() {
            Attributes::Tangents
        } else if mesh.uvs.is_some() && material.reads_textures() {
            Attributes::Uvs
        } else if mesh.normals.is_some() {
            Attributes::Normals
        } else {
            Attributes::None
        }
    }
}

impl Geometry {
    /// Flattens `scene`: bakes what is baked, keeps the rest instanced, computes one record per triangle.
    pub fn build(scene: &Scene) -> Self {
        let mut geometry = Geometry { bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY), ..Default::default() };
        let baked_meshes = baked_meshes(scene);
        // What moves cannot be baked, whatever becomes of other placements of its mesh.
        let baked: Vec<bool> = (scene.instances.iter().enumerate())
            .map(|(i, instance)| baked_meshes[instance.mesh.index()] && scene.motion.of_instance(i).is_none())
            .collect();
        let mut is_instanced = vec![false; scene.meshes.len()];
        for (instance, _) in scene.instances.iter().zip(&baked).filter(|(_, baked)| !**baked) {
            is_instanced[instance.mesh.index()] = true;
        }

        // Richest attributes first keeps `uvs` and `tangents` prefixes of `normals`, over all meshes together. The world
        // mesh must stay one range of triangles, so its members come first within each richness; record indices are per
        // mesh (`first_triangle`), attribute indices are global.
        let mut world = MeshRecords::default();
        let mut instanced: Vec<(u32, MeshRecords)> = Vec::new();
        let extras = |mesh: &&Mesh| has_extras(mesh, &scene.materials[mesh.material.index()]);
        let placed = scene.instances.iter().map(|instance| &scene.meshes[instance.mesh.index()]);
        let channels = placed.filter(extras).map(|mesh| mesh.more_uvs.len()).max();
        geometry.more_uvs.resize_with(channels.unwrap_or(0), Vec::new);
        for richness in
            [Attributes::Extras, Attributes::Tangents, Attributes::Uvs, Attributes::Normals, Attributes::None]
        {
            for (instance, &baked) in scene.instances.iter().zip(&baked) {
                let mesh = &scene.meshes[instance.mesh.index()];
                let material = &scene.materials[mesh.material.index()];
                if baked && Attributes::laid_out(mesh, material) == richness {
                    geometry.bake(&mut world, mesh, richness, &instance.world_from_object);
                }
            }
            for (id, mesh) in scene.meshes.iter().enumerate() {
                let material = &scene.materials[mesh.material.index()];
                if is_instanced[id] && Attributes::laid_out(mesh, material) == richness {
                    let mut records = MeshRecords::default();
                    geometry.bake(&mut records, mesh, richness, &Affine3A::IDENTITY);
                    instanced.push((id as u32, records));
                }
            }
        }

        geometry.dropped_lamps = world.drop_copied_lamps(&scene.materials);
        geometry.append(world);
        let mut mesh_of = vec![0u32; scene.meshes.len()];
        for (id, records) in instanced {
            mesh_of[id as usize] = geometry.meshes.len() as u32;
            geometry.append(records);
        }
        let instances = scene.instances.iter().enumerate().zip(&baked).filter(|(_, baked)| !**baked);
        let (moving, still): (Vec<_>, Vec<_>) =
            instances.map(|((i, instance), _)| (instance, scene.motion.of_instance(i))).partition(|(_, t)| t.is_some());
        for (instance, track) in still.into_iter().chain(moving) {
            geometry.place(mesh_of[instance.mesh.index()], instance, track.map_or(&[], |track| &track.steps));
        }
        let world_vertices = &geometry.meshes[0].vertices;
        for index in geometry.meshes[0].indices.iter().flatten() {
            let p = world_vertices[*index as usize];
            geometry.bounds = (geometry.bounds.0.min(p), geometry.bounds.1.max(p));
        }
        geometry
    }

    /// Object to world of instance `instance` at `time`, a fraction of the shutter.
    #[inline]
    pub fn world_from_object(&self, instance: u32, time: f32) -> Affine3A {
        let moved = self.moving.at(instance, time);
        moved.map_or_else(|| self.instances[instance as usize].world_from_object, |moved| moved.world_from_object)
    }

    /// Record of triangle `prim` of mesh `geom`.
    #[inline(always)]
    pub fn triangle(&self, geom: u32, prim: u32) -> &Triangle {
        &self.triangles[(self.meshes[geom as usize].first_triangle + prim) as usize]
    }

    /// Texture coordinates of channel `channel` on a triangle of these [`Triangle::attributes`], by the weights of its second
    /// and third corner; `None` where it has none.
    #[inline(always)]
    pub fn uv(&self, attributes: u32, channel: u32, [u, v]: [f32; 2]) -> Option<Vec2> {
        let uvs = if channel == 0 { &self.uvs } else { self.more_uvs.get(channel as usize - 1)? };
        let [a, b, c] = uvs.get(attributes as usize)?;
        Some(*a * (1.0 - u - v) + *b * u + *c * v)
    }

    /// Vertex colour, as [`uv`](Self::uv); white where the triangle has none.
    #[inline(always)]
    pub fn color(&self, attributes: u32, [u, v]: [f32; 2]) -> Vec4 {
        let Some([a, b, c]) = self.colors.get(attributes as usize) else { return Vec4::ONE };
        *a + (*b - *a) * u + (*c - *a) * v
    }

    /// Radius of the sphere around the bounds' centre that holds everything, metres; 1 when there is nothing.
    pub fn bounding_radius(&self) -> f32 {
        let (lo, hi) = self.bounds;
        if lo.x > hi.x { 1.0 } else { (0.5 * (hi - lo).length()).max(f32::MIN_POSITIVE) }
    }

    /// Adds one placement's triangles to `out`, transformed in f64. A mirroring placement swaps two corners, so that
    /// e1 × e2 stays on the front side.
    fn bake(&mut self, out: &mut MeshRecords, mesh: &Mesh, richness: Attributes, world_from_object: &Affine3A) {
        let m = DAffine3 {
            matrix3: DMat3::from_cols(
                world_from_object.matrix3.x_axis.as_dvec3(),
                world_from_object.matrix3.y_axis.as_dvec3(),
                world_from_object.matrix3.z_axis.as_dvec3(),
            ),
            translation: world_from_object.translation.as_dvec3(),
        };
        let mirrored = m.matrix3.determinant() < 0.0;
        let normal_matrix = m.matrix3.inverse().transpose();
        let base = out.mesh.vertices.len() as u32;
        // The identity is skipped rather than multiplied by: x·1 + 0 is exact, but costs time on large meshes.
        let identity = *world_from_object == Affine3A::IDENTITY;
        out.mesh.vertices.extend(
            mesh.positions.iter().map(|&p| if identity { p } else { m.transform_point3(p.as_dvec3()).as_vec3() }),
        );

        for &[a, b, c] in &mesh.triangles {
            let corner = if mirrored { [a, c, b] } else { [a, b, c] };
            let [v0, v1, v2] = corner.map(|i| out.mesh.vertices[(base + i) as usize]);
            let cross = (v1 - v0).as_dvec3().cross((v2 - v0).as_dvec3());
            let exact = (v1.as_dvec3() - v0.as_dvec3()).cross(v2.as_dvec3() - v0.as_dvec3());
            let twice_area = exact.length();
            if is_degenerate(&[v0, v1, v2]) || !(twice_area.is_finite() && cross.length() > 0.0) {
                self.dropped_degenerate += 1;
                continue;
            }
            let n_g = (exact / twice_area).as_vec3();
            let attributes = self.push_attributes(mesh, richness, corner, n_g, &normal_matrix);
            out.mesh.indices.push(corner.map(|i| base + i));
            out.records.push(Triangle {
                v0: v0.into(),
                e1: (v1 - v0).into(),
                e2: (v2 - v0).into(),
                n_g: n_g.into(),
                material: mesh.material.0,
                attributes,
                error: hit_error(v0, v1 - v0, v2 - v0, [v0, v1, v2]),
                light: u32::MAX,
            });
        }
    }

    fn push_attributes(
        &mut self,
        mesh: &Mesh,
        richness: Attributes,
        corner: [u32; 3],
        n_g: Vec3,
        normal_matrix: &DMat3,
    ) -> u32 {
        if richness == Attributes::None {
            return NO_ATTRIBUTES;
        }
        let to_world = |v: Vec3| (*normal_matrix * v.as_dvec3()).normalize_or_zero().as_vec3();
        let at = corner.map(|i| i as usize);
        self.normals.push(match &mesh.normals {
            Some(normals) => at.map(|i| {
                let n = to_world(normals[i]);
                if n == Vec3::ZERO || !n.is_finite() { n_g } else { n }
            }),
            None => [n_g; 3],
        });
        let finite = |uvs: &Vec<Vec2>| at.map(|i| if uvs[i].is_finite() { uvs[i] } else { Vec2::ZERO });
        if richness <= Attributes::Uvs {
            self.uvs.push(mesh.uvs.as_ref().map_or([Vec2::ZERO; 3], finite));
        }
        if richness == Attributes::Extras {
            for (channel, uvs) in self.more_uvs.iter_mut().enumerate() {
                uvs.push(mesh.more_uvs.get(channel).map_or([Vec2::ZERO; 3], finite));
            }
            self.colors.push(mesh.colors.as_ref().map_or([Vec4::ONE; 3], |colors| at.map(|i| colors[i])));
        }
        if richness <= Attributes::Tangents {
            let linear = normal_matrix.inverse().transpose();
            let placed = |tangent: Vec4| {
                let t = (linear * tangent.truncate().as_dvec3()).normalize_or_zero().as_vec3();
                t.extend(if linear.determinant() < 0.0 { -tangent.w } else { tangent.w })
            };
            let tangents = mesh.tangents.as_ref();
            self.tangents.push(tangents.map_or([Vec4::ZERO; 3], |tangents| at.map(|i| placed(tangents[i]))));
        }
        (self.normals.len() - 1) as u32
    }

    fn append(&mut self, mut records: MeshRecords) {
        records.mesh.first_triangle = self.triangles.len() as u32;
        records.mesh.vertices.push(Vec3::ZERO);
        self.triangles.append(&mut records.records);
        self.meshes.push(records.mesh);
    }

    /// Places a mesh; `steps` are its poses over the shutter if it moves, and only others that do may follow.
    fn place(&mut self, mesh: u32, instance: &Instance, steps: &[Affine3A]) {
        self.cover(mesh, &instance.world_from_object);
        if !steps.is_empty() {
            steps.iter().for_each(|step| self.cover(mesh, step));
            self.moving.push(self.instances.len() as u32, mesh, steps);
        }
        self.instances.push(Placement::new(mesh, instance.world_from_object));
    }

    /// Makes the bounds hold a mesh at this place.
    fn cover(&mut self, mesh: u32, world_from_object: &Affine3A) {
        for index in self.meshes[mesh as usize].indices.iter().flatten() {
            let p = world_from_object.transform_point3(self.meshes[mesh as usize].vertices[*index as usize]);
            self.bounds = (self.bounds.0.min(p), self.bounds.1.max(p));
        }
    }
}

/// A mesh under construction and its records.
#[derive(Default)]
struct MeshRecords {
    mesh: TriangleMesh,
    records: Vec<Triangle>,
}

impl MeshRecords {
    /// Leaves out emissive triangles that repeat the corners of an earlier one in the same turn, and says how many: a ray meets
    /// one of the two, but light sampling would find both, and the picture would depend on who found the light. Lamps that
    /// overlap otherwise (cut another way, moved a little, back to back) are not recognised.
    fn drop_copied_lamps(&mut self, materials: &[Material]) -> usize {
        let mut seen = HashSet::new();
        let vertices = &self.mesh.vertices;
        let keep: Vec<bool> = (self.mesh.indices.iter().zip(&self.records))
            .map(|(corners, record)| {
                !materials[record.material as usize].is_emissive() || {
                    // Whichever corner comes first, and whatever the sign of a zero.
                    let mut bits = corners.map(|i| (vertices[i as usize] + Vec3::ZERO).to_array().map(f32::to_bits));
                    let least = (0..3).min_by_key(|&i| bits[i]).expect("three corners");
                    bits.rotate_left(least);
                    // A mirroring placement has swapped two corners, so their turn says where the front is.
                    seen.insert(bits)
                }
            })
            .collect();
        let mut kept = keep.iter();
        self.mesh.indices.retain(|_| *kept.next().expect("a verdict each"));
        let mut kept = keep.iter();
        self.records.retain(|_| *kept.next().expect("a verdict each"));
        keep.len() - self.records.len()
    }
}

/// How many emissive triangles repeat others: what [`Geometry::dropped_lamps`] will be.
pub(crate) fn copied_lamps(scene: &Scene) -> usize {
    let (mut geometry, mut lamps) = (Geometry::default(), MeshRecords::default());
    for (_, instance) in scene.instances.iter().enumerate().filter(|(i, _)| scene.motion.of_instance(*i).is_none()) {
        let mesh = &scene.meshes[instance.mesh.index()];
        if scene.materials[mesh.material.index()].is_emissive() {
            geometry.bake(&mut lamps, mesh, Attributes::None, &instance.world_from_object);
        }
    }
    lamps.drop_copied_lamps(&scene.materials)
}

/// Which meshes are baked where they are at rest: emissive ones (lights need world triangles), those placed once, and small
/// repeated ones from the smallest up until the budget is spent.
fn baked_meshes(scene: &Scene) -> Vec<bool> {
    let mut placements = vec![0u64; scene.meshes.len()];
    for (i, instance) in scene.instances.iter().enumerate() {
        placements[instance.mesh.index()] += u64::from(scene.motion.of_instance(i).is_none());
    }
    let mut order: Vec<usize> = (0..scene.meshes.len()).collect();
    order.sort_by_key(|&i| (scene.meshes[i].triangles.len(), i));
    let mut baked = vec![false; scene.meshes.len()];
    let mut spent = 0u64;
    for i in order {
        let mesh = &scene.meshes[i];
        let cost = mesh.triangles.len() as u64 * placements[i];
        let emissive = scene.materials[mesh.material.index()].is_emissive();
        if emissive || placements[i] == 1 {
            baked[i] = true;
        } else if mesh.triangles.len() <= BAKE_MESH_TRIANGLES && spent + cost <= BAKE_TRIANGLE_BUDGET {
            baked[i] = true;
            spent += cost;
        }
    }
    baked
}
