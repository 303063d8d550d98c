//! From a scene to flattened geometry: what is baked into the world mesh, in f64, and what stays instanced.

use glam::{Affine3A, DAffine3, DMat3, Vec3};

use super::attributes::{Attributes, has_extras};
use super::bodies;
use super::contacts::{self, Bounds};
use super::frames::Frames;
use super::lamps::drop_copied_lamps;
use super::overlaps;
use super::owners::Part;
use super::placement::{NO_MATERIAL, Placement};
use super::records::{Geometry, MeshRecords, Triangle, hit_error, is_degenerate};
use crate::scene::{Fact, Facts, Instance, MaterialId, Mesh, Scene};

/// A repeated mesh of at most this many triangles is baked: the transform of each ray at an instance then costs more
/// than the copies. Larger ones stay instanced: on `interior` (50 placements of 8 meshes, 1 M triangles) baking all
/// made the render 6–17 % slower (three pairs), the build 4 times slower, and took 298 MB instead of 130.
pub const BAKE_MESH_TRIANGLES: usize = 1024;

/// Baked copies of repeated meshes may have this many triangles together (about 160 B each with their hierarchy).
pub const BAKE_TRIANGLE_BUDGET: u64 = 1 << 20;

/// Triangles near other placements that are looked at for faces which lie on those.
const MOST_CONTACT_LOOKS: usize = 1 << 22;

impl Geometry {
    /// Flattens `scene`: bakes what is baked, keeps the rest instanced, computes one record per triangle.
    pub fn build(scene: &Scene) -> Self {
        let mut geometry = Geometry { bounds: (Vec3::INFINITY, Vec3::NEG_INFINITY), ..Default::default() };
        let baked_meshes = baked_meshes(scene);
        // What moves cannot be baked, whatever happens to other placements of its mesh.
        let mut baked: Vec<bool> = (scene.instances.iter().enumerate())
            .map(|(i, instance)| baked_meshes[instance.mesh.index()] && scene.motion.of_instance(i).is_none())
            .collect();
        let all_known = bake_contacts(scene, &mut baked);
        let mut is_instanced = vec![false; scene.meshes.len()];
        for (instance, _) in scene.instances.iter().zip(&baked).filter(|(_, baked)| !**baked) {
            is_instanced[instance.mesh.index()] = true;
        }

        // Richest attributes first keeps `uvs` and `tangents` prefixes of `normals`, over all meshes together. The
        // world mesh must stay one range of triangles, so its members come first within each richness; record indices
        // are per mesh (`first_triangle`), attribute indices are global.
        let mut world = MeshRecords::default();
        let mut instanced: Vec<(u32, MeshRecords)> = Vec::new();
        let extras = |(mesh, material): &(&Mesh, MaterialId)| has_extras(mesh, &scene.materials[material.index()]);
        let placed = scene.instances.iter();
        let placed = placed.map(|placed| (&scene.meshes[placed.mesh.index()], scene.material_of(placed)));
        let channels = placed.filter(extras).map(|(mesh, _)| mesh.more_uvs.len()).max();
        geometry.more_uvs.resize_with(channels.unwrap_or(0), Vec::new);
        for richness in
            [Attributes::Extras, Attributes::Tangents, Attributes::Uvs, Attributes::Normals, Attributes::None]
        {
            for ((i, instance), &baked) in (0u32..).zip(&scene.instances).zip(&baked) {
                let (mesh, id) = (&scene.meshes[instance.mesh.index()], scene.material_of(instance));
                if baked && Attributes::laid_out(mesh, &scene.materials[id.index()]) == richness {
                    world.parts.push(Part { first: world.records.len() as u32, instance: i });
                    geometry.bake(&mut world, (mesh, id), richness, &instance.world_from_object);
                }
            }
            for (id, mesh) in scene.meshes.iter().enumerate() {
                let material = &scene.materials[mesh.material.index()];
                if is_instanced[id] && Attributes::laid_out(mesh, material) == richness {
                    let keeps_all = !mesh.later.is_empty();
                    let mut records = MeshRecords { keeps_all, ..MeshRecords::default() };
                    geometry.bake(&mut records, (mesh, mesh.material), richness, &Affine3A::IDENTITY);
                    for shape in &mesh.later {
                        let mut later = MeshRecords { keeps_all, ..MeshRecords::default() };
                        let shaped = mesh.shaped(shape);
                        geometry.bake(&mut later, (&shaped, mesh.material), richness, &Affine3A::IDENTITY);
                        records.mesh.later.push(later.mesh.vertices);
                        records.later.push(later.records);
                    }
                    instanced.push((id as u32, records));
                }
            }
        }

        geometry.dropped_lamps = drop_copied_lamps(&mut world, &scene.materials);
        geometry.owners.baked = std::mem::take(&mut world.parts);
        geometry.frames = Frames::of(scene, &geometry.owners.baked, world.records.len());
        geometry.append(world);
        let mut mesh_of = vec![0u32; scene.meshes.len()];
        for (id, records) in instanced {
            mesh_of[id as usize] = geometry.meshes.len() as u32;
            geometry.append(records);
        }
        let instances = scene.instances.iter().enumerate().zip(&baked).filter(|(_, baked)| !**baked);
        let (moving, still): (Vec<_>, Vec<_>) = instances
            .map(|((i, instance), _)| (i, instance, scene.motion.of_instance(i)))
            .partition(|(.., track)| track.is_some());
        for (i, instance, track) in still.into_iter().chain(moving) {
            geometry.owners.placed.push(i as u32);
            geometry.place(mesh_of[instance.mesh.index()], instance, track.map_or(&[], |track| &track.steps));
        }
        geometry.solids = bodies::find(&geometry, &scene.materials);
        geometry.coincident = overlaps::find(&geometry, &scene.materials);
        geometry.coincident.unsearched = !all_known;
        geometry.coincident.moving = !moves_apart(scene);
        let world_vertices = &geometry.meshes[0].vertices;
        for index in geometry.meshes[0].indices.iter().flatten() {
            let p = world_vertices[*index as usize];
            geometry.bounds = (geometry.bounds.0.min(p), geometry.bounds.1.max(p));
        }
        geometry
    }

    /// Adds one placement's triangles to `out`, of that material, transformed in f64. A mirroring placement swaps two
    /// corners, so that e1 × e2 stays on the front side.
    fn bake(
        &mut self,
        out: &mut MeshRecords,
        (mesh, material): (&Mesh, MaterialId),
        richness: Attributes,
        world_from_object: &Affine3A,
    ) {
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
            let mut n_g = (exact / twice_area).as_vec3();
            if is_degenerate(&[v0, v1, v2]) || !(twice_area.is_finite() && cross.length() > 0.0) {
                if !out.keeps_all {
                    self.dropped_degenerate += 1;
                    continue;
                }
                n_g = Vec3::Z;
            }
            let attributes = self.push_attributes(mesh, richness, corner, n_g, &normal_matrix);
            out.mesh.indices.push(corner.map(|i| base + i));
            out.records.push(Triangle {
                v0: v0.into(),
                e1: (v1 - v0).into(),
                e2: (v2 - v0).into(),
                n_g: n_g.into(),
                material: material.0,
                attributes,
                error: hit_error(v0, v1 - v0, v2 - v0, [v0, v1, v2]),
                light: u32::MAX,
            });
        }
    }

    fn append(&mut self, mut records: MeshRecords) {
        records.mesh.first_triangle = self.triangles.len() as u32;
        records.mesh.vertices.push(Vec3::ZERO);
        records.mesh.later.iter_mut().for_each(|shape| shape.push(Vec3::ZERO));
        self.triangles.append(&mut records.records);
        let triangles = records.later.first().map_or(0, Vec::len);
        self.deforming.push(self.meshes.len(), records.later.len(), triangles);
        records.later.iter_mut().for_each(|shape| self.later.append(shape));
        self.meshes.push(records.mesh);
    }

    /// Places a mesh; `steps` are its poses over the shutter if it moves, and only others that do may follow.
    fn place(&mut self, mesh: u32, instance: &Instance, steps: &[Affine3A]) {
        self.cover(mesh, &instance.world_from_object);
        if !steps.is_empty() {
            steps.iter().for_each(|step| self.cover(mesh, step));
            self.moving.push(self.instances.len() as u32, mesh, steps);
        }
        let material = instance.material.map_or(NO_MATERIAL, |material| material.0);
        self.instances.push(Placement { material, ..Placement::new(mesh, instance.world_from_object) });
    }

    /// Makes the bounds hold a mesh at this place.
    fn cover(&mut self, mesh: u32, world_from_object: &Affine3A) {
        let mesh = &self.meshes[mesh as usize];
        for shape in std::iter::once(&mesh.vertices).chain(&mesh.later) {
            for index in mesh.indices.iter().flatten() {
                let p = world_from_object.transform_point3(shape[*index as usize]);
                self.bounds = (self.bounds.0.min(p), self.bounds.1.max(p));
            }
        }
    }
}

/// Bakes placements at rest that would stay instanced where their faces lie on those of others and it matters which of
/// them is met. Returns whether all such are known and baked.
fn bake_contacts(scene: &Scene, baked: &mut [bool]) -> bool {
    let at_rest: Vec<bool> = (0..baked.len()).map(|i| scene.motion.of_instance(i).is_none()).collect();
    let instanced: Vec<bool> = baked.iter().zip(&at_rest).map(|(&baked, &at_rest)| at_rest && !baked).collect();
    let Some(found) = contacts_of(scene, &at_rest, &instanced) else { return false };
    let (mut all_known, mut left) = (found.all_seen, BAKE_TRIANGLE_BUDGET);
    for of in found.pairs.into_iter().flatten() {
        if baked[of] {
            continue;
        }
        let cost = scene.meshes[scene.instances[of].mesh.index()].triangles.len() as u64;
        match left.checked_sub(cost) {
            Some(rest) => (left, baked[of]) = (rest, true),
            None => all_known = false,
        }
    }
    all_known
}

/// Whether placements that move have no faces on those of others that move, as far as can be told when the shutter
/// opens, or it does not matter which of them is met.
fn moves_apart(scene: &Scene) -> bool {
    let moving: Vec<bool> = (0..scene.instances.len()).map(|i| scene.motion.of_instance(i).is_some()).collect();
    contacts_of(scene, &moving, &moving).is_some_and(|found| found.all_seen && found.pairs.is_empty())
}

/// Placements with faces that lie on one another.
struct Contacts {
    /// Once for each two faces, where it matters which of them is met: they look one way, or one lets light pass.
    pairs: Vec<[usize; 2]>,
    /// Whether all were looked at.
    all_seen: bool,
}

/// What lies on what among some placements, in pairs of which one is `asked` for; `None` where there are too many.
fn contacts_of(scene: &Scene, among: &[bool], asked: &[bool]) -> Option<Contacts> {
    if !asked.contains(&true) {
        return Some(Contacts { pairs: Vec::new(), all_seen: true });
    }
    let nowhere = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    let grow = |(low, high): Bounds, &p: &Vec3| (low.min(p), high.max(p));
    let bounds: Vec<Bounds> = scene.meshes.iter().map(|mesh| mesh.positions.iter().fold(nowhere, grow)).collect();
    let boxes: Vec<Bounds> = (scene.instances.iter().zip(among))
        .map(|(instance, &among)| {
            let bounds = bounds[instance.mesh.index()];
            let somewhere = among && bounds.0.x <= bounds.1.x;
            if somewhere { contacts::placed(bounds, &instance.world_from_object) } else { nowhere }
        })
        .collect();
    let reached = contacts::reached(&boxes, asked)?;

    // What lies near others, placed, and whose it is.
    let (mut near, mut owners, mut looks) = (MeshRecords::default(), Vec::new(), MOST_CONTACT_LOOKS);
    let mut geometry = Geometry::default();
    let triangles = |i: usize| scene.meshes[scene.instances[i].mesh.index()].triangles.len();
    let mut order: Vec<(usize, Bounds)> =
        reached.into_iter().enumerate().filter_map(|(i, region)| Some((i, region?))).collect();
    order.sort_by_key(|&(i, _)| (triangles(i), i));
    let mut all_seen = true;
    for (i, region) in order {
        let (instance, id) = (&scene.instances[i], scene.material_of(&scene.instances[i]));
        let mesh = &scene.meshes[instance.mesh.index()];
        // Largest last: of a forest on a terrain, the trees.
        let Some(rest) = looks.checked_sub(mesh.triangles.len()) else {
            all_seen = false;
            break;
        };
        looks = rest;
        let part = contacts::part_within(mesh, &instance.world_from_object, region);
        geometry.bake(&mut near, (&part, id), Attributes::None, &instance.world_from_object);
        owners.resize(near.records.len(), i);
    }
    geometry.append(near);
    let found = overlaps::find(&geometry, &scene.materials);
    let passes = |triangle: &Triangle| {
        let facts = Facts::of(&scene.materials[triangle.material as usize]);
        facts.transmits() || facts.has(Fact::Uncovered)
    };
    let mut pairs = Vec::new();
    for &record in found.records() {
        for &partner in found.of(record).all {
            let [a, b] = [record, partner].map(|record| &geometry.triangles[record as usize]);
            let one_way = Vec3::from(a.n_g).dot(Vec3::from(b.n_g)) > 0.0;
            let owners = [record, partner].map(|record| owners[record as usize]);
            if owners[0] != owners[1] && (one_way || passes(a) || passes(b)) {
                pairs.push(owners);
            }
        }
    }
    Some(Contacts { pairs, all_seen: all_seen && !found.crowded() })
}

/// How many emissive triangles repeat others: what [`Geometry::dropped_lamps`] will be.
pub(crate) fn copied_lamps(scene: &Scene) -> usize {
    let (mut geometry, mut lamps) = (Geometry::default(), MeshRecords::default());
    for (_, instance) in scene.instances.iter().enumerate().filter(|(i, _)| scene.motion.of_instance(*i).is_none()) {
        let (mesh, material) = (&scene.meshes[instance.mesh.index()], scene.material_of(instance));
        if scene.materials[material.index()].is_emissive() {
            geometry.bake(&mut lamps, (mesh, material), Attributes::None, &instance.world_from_object);
        }
    }
    drop_copied_lamps(&mut lamps, &scene.materials)
}

/// Which meshes are baked where they are at rest: emissive ones (lights need world triangles), those placed once, and
/// small repeated ones from the smallest up until the budget is spent.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builder::SceneBuilder;
    use crate::scene::{Material, MeshId};

    /// Two glasses of wine: sheets of 1152 triangles, placed twice, that are too large to be baked for being repeated.
    fn glasses(gap_m: f32) -> Geometry {
        let mut b = SceneBuilder::new();
        let solid = |ior| Material { metallic: 0.0, transmission: 1.0, thickness: 1.0, ior, ..Material::default() };
        let materials = [b.material(solid(1.5)), b.material(solid(1.33))];
        let corner = |i: u32| Vec3::new((i % 25) as f32, 0.0, (i / 25) as f32) * 0.04;
        let cells = || (0..24 * 24).map(|i| i / 24 * 25 + i % 24);
        let meshes: Vec<MeshId> = (materials.into_iter().enumerate())
            .map(|(side, material)| {
                let turned = |[a, b, c]: [u32; 3]| if side == 0 { [a, b, c] } else { [a, c, b] };
                let halves = |i: u32| [[i, i + 25, i + 1], [i + 1, i + 25, i + 26]].map(turned);
                let positions = (0..25 * 25).map(corner).collect();
                b.full_mesh(Mesh {
                    positions,
                    triangles: cells().flat_map(halves).collect(),
                    material,
                    ..Mesh::default()
                })
            })
            .collect();
        for x in [0.0, 3.0] {
            b.place(meshes[0], Affine3A::from_translation(Vec3::new(x, 0.0, 0.0)));
            b.place(meshes[1], Affine3A::from_translation(Vec3::new(x, gap_m, 0.0)));
        }
        Geometry::build(&b.build())
    }

    #[test]
    fn repeated_meshes_that_touch_are_baked() {
        let apart = glasses(0.01);
        assert_eq!((apart.instances.len(), apart.coincident.records().len()), (4, 0));
        let touching = glasses(0.0);
        assert_eq!((touching.instances.len(), touching.coincident.records().len()), (0, 4 * 1152));
        assert!(!touching.coincident.crowded());
    }
}
