//! Embree scenes from the flattened geometry. The world mesh is attached to the top scene with geometry id 0; every
//! other mesh that something places has its own scene, with its mesh index as geometry id; instance `i` is
//! attached to the top scene as `i + 1`. Vertices and indices are copied into Embree's buffers, which it pads for its
//! 16-byte reads.
//!
//! Where other frames have a part of the world mesh elsewhere ([`Frames`]) that part is a geometry of its own, behind
//! the instances, with the numbers that its triangles have in the whole. The top scene is then one of two levels, with
//! a tree for each geometry (`RTC_BUILD_QUALITY_LOW`): committing it again builds those that are new. Traced it is as
//! fast: 10⁶ triangles and a quad, packets of 16, 307 ns a ray either way (3.13.5; 336 with the rest in an instance).
//! So the world of the next frame takes over what is the same bit for bit, and has the trees of one built alone.
//!
//! Refused: indices past the vertices, transforms that are not finite or cannot be inverted within the range of `f32`.

use std::ptr::{self, NonNull};
use std::sync::Arc;

use glam::{Affine3A, Vec3};

use super::abi::sys;
use super::device::{Device, failure};
use crate::Result;
use crate::backend::batch::{Batch, Block, INVALID_ID, MAX_COORDINATE, RayBlock, RayHitBlock};
#[cfg(doc)]
use crate::scene::geometry::Frames;
use crate::scene::geometry::{Geometry, Placement, TriangleMesh};

/// Smallest magnitude of a direction component that Embree tells from zero (it clamps reciprocals there).
const MIN_DIRECTION: f32 = 1.0e-18;

/// Geometry id of instance 0 in the top scene; 0 is the world mesh.
const FIRST_INSTANCE: u32 = 1;

/// Everything that rays are traced against.
pub(super) struct World {
    top: Scene,
    /// Of the world mesh; the top scene keeps its geometry.
    still: Option<Held>,
    /// Of what other frames have elsewhere.
    moved: Option<Held>,
    /// Ids of the geometries of the top scene that are not that of `still`.
    others: Vec<u32>,
    /// Whether there are instances among them.
    instanced: bool,
    /// The instanced meshes, by mesh; their scenes are kept until the top scene, which comes before them, is gone.
    meshes: Vec<Option<(Scene, Held)>>,
    /// Largest coordinate of an origin that is traced: [`MAX_COORDINATE`], or less where an instance's transform would
    /// carry a ray beyond what Embree accepts.
    max_coordinate: f32,
    /// Rays of the widest packet that is traced as such: 4 with SSE, 8 with AVX and AVX2, 16 with AVX-512. Of wider
    /// ones 3.13.5 makes a stream, which takes no account of the mask and aborts over what lanes that are not in use
    /// hold.
    pub(super) width: usize,
    /// Triangles held, instanced ones once.
    pub(super) triangles: u64,
}

impl World {
    /// Builds all scenes on `device`, with the same flags. What is the same in `kept`, of the same device and flags, is
    /// taken from there.
    pub(super) fn build(
        device: &Arc<Device>,
        geometry: &Geometry,
        flags: sys::RTCSceneFlags,
        kept: Option<World>,
    ) -> Result<Self> {
        let mut triangles = 0;
        let mut placed = vec![false; geometry.meshes.len()];
        for placement in &geometry.instances {
            *placed
                .get_mut(placement.mesh as usize)
                .ok_or_else(|| failure("an instance of a mesh that is not there"))? = true;
        }
        let (top, before) = match kept {
            Some(World { top, still, others, meshes, .. }) => (Some((top, still, others)), meshes),
            None => (None, Vec::new()),
        };

        // The top scene as far as it is the same: the part of the world mesh that stands still.
        let world = geometry.meshes.first().filter(|mesh| !mesh.indices.is_empty());
        let parts = world.and_then(|world| geometry.parts(world));
        let still = parts.as_ref().map_or(world, |parts| Some(&parts[0]));
        let top = top.filter(|(top, held, _)| {
            let same = || held.as_ref().zip(still).is_some_and(|(held, mesh)| held.holds(mesh));
            top.in_levels && parts.is_some() && same()
        });
        let (mut top, held) = match top {
            Some((mut top, held, others)) => {
                others.into_iter().try_for_each(|id| top.detach(id))?;
                (top, held)
            }
            None => (Scene::new(device, flags, parts.is_some())?, None),
        };

        // One scene for each mesh that something places.
        let mut before = before.into_iter();
        let mut meshes: Vec<Option<(Scene, Held)>> = Vec::with_capacity(placed.len());
        for (index, (mesh, placed)) in geometry.meshes.iter().zip(placed).enumerate() {
            let before = before.next().flatten();
            meshes.push(if placed && !mesh.indices.is_empty() {
                triangles += mesh.indices.len() as u64;
                let same = before.filter(|(_, held)| held.holds(mesh));
                let made = || {
                    let mut scene = Scene::new(device, flags, false)?;
                    let (geometry, held) = triangle_geometry(device, mesh)?;
                    scene.attach(&geometry, index as u32)?;
                    scene.commit()?;
                    Ok((scene, held))
                };
                Some(same.map_or_else(made, Ok)?)
            } else {
                None
            });
        }

        // The world mesh and the placements.
        let held = match (held, still) {
            (None, Some(mesh)) => {
                let (geometry, held) = triangle_geometry(device, mesh)?;
                top.attach(&geometry, 0)?;
                Some(held)
            }
            (held, _) => held,
        };
        if let (Some(mesh), Some(None)) = (world, meshes.first()) {
            triangles += mesh.indices.len() as u64;
        }
        let (mut max_coordinate, mut others) = (MAX_COORDINATE, Vec::new());
        for (index, placement) in geometry.instances.iter().enumerate() {
            if let Some((scene, _)) = &meshes[placement.mesh as usize] {
                let steps = geometry.moving.steps(index as u32);
                max_coordinate =
                    max_coordinate.min(if steps.is_empty() { reach(placement)? } else { reach_moving(steps)? });
                let steps = if steps.is_empty() { std::slice::from_ref(placement) } else { steps };
                let id = FIRST_INSTANCE + index as u32;
                top.attach(&instance_geometry(device, scene, steps)?, id)?;
                others.push(id);
            }
        }
        let instanced = !others.is_empty();
        let mut moved = None;
        if let Some([_, mesh]) = parts.as_ref().filter(|parts| !parts[1].indices.is_empty()) {
            let (part, held) = triangle_geometry(device, mesh)?;
            let id = FIRST_INSTANCE + geometry.instances.len() as u32;
            top.attach(&part, id)?;
            others.push(id);
            moved = Some(held);
        }
        top.commit()?;
        let width = device.width();
        Ok(World { top, still: held, moved, others, instanced, meshes, max_coordinate, width, triangles })
    }

    /// The device that it is on.
    pub(super) fn device(&self) -> &Arc<Device> {
        &self.top.device
    }

    /// Bytes of all hierarchies.
    pub(super) fn bvh_bytes(&self) -> u64 {
        let meshes = self.meshes.iter().flatten().map(|(scene, _)| scene.bytes);
        u64::try_from(self.top.bytes + meshes.sum::<i64>()).unwrap_or(0)
    }

    /// The committed top scene, alive as long as `self`.
    #[inline(always)]
    pub(super) fn raw(&self) -> sys::RTCScene {
        self.top.raw
    }

    /// Corners of a triangle of the world mesh.
    pub(super) fn corners(&self, prim: u32) -> [Vec3; 3] {
        let still = self.still.as_ref().expect("a hit without instance is on the world mesh");
        match (still.corners(prim), &self.moved) {
            // (What is elsewhere has no corners among the rest.)
            (corners, Some(moved)) if corners[0].is_nan() => moved.corners(prim),
            (corners, _) => corners,
        }
    }

    /// The rays of a call, of which those are valid that Embree takes in the world and inside every instance.
    #[inline(always)]
    pub(super) fn batch<'b, B: Block>(&self, blocks: &'b mut [B], len: usize) -> Batch<'b, B> {
        Batch::new(blocks, len).within(self.max_coordinate)
    }

    /// Direction components that Embree clamps anyway become zeros before it sees them: coherent packets of 3.13.5 lost
    /// 827 of 2000 rays with denormal components, and found other hits by the sign of a zero.
    #[inline(always)]
    pub(super) fn settle(ray: &mut RayBlock) {
        for column in [&mut ray.dir_x, &mut ray.dir_y, &mut ray.dir_z] {
            for d in column {
                *d = if d.abs() < MIN_DIRECTION { 0.0 } else { *d };
            }
        }
    }

    /// Turns the top scene's geometry ids into indices of `Geometry::instances` in the column of instances, and into 0
    /// in that of meshes.
    #[inline(always)]
    pub(super) fn name_hits(&self, block: &mut RayHitBlock) {
        let hit = &mut block.hit;
        if self.instanced {
            hit.inst.iter_mut().for_each(|inst| *inst = instance_of(*inst));
        }
        if self.moved.is_some() {
            for (geom, inst) in hit.geom.iter_mut().zip(&hit.inst) {
                *geom = if *inst == INVALID_ID && *geom != INVALID_ID { 0 } else { *geom };
            }
        }
    }

    /// The same for one hit.
    #[inline(always)]
    pub(super) fn name_hit(&self, block: &mut RayHitBlock, lane: usize) {
        let (geom, inst) = (&mut block.hit.geom[lane], &mut block.hit.inst[lane]);
        *inst = instance_of(*inst);
        if self.moved.is_some() && *inst == INVALID_ID && *geom != INVALID_ID {
            *geom = 0;
        }
    }
}

/// Number of the instance with this id in the top scene.
#[inline(always)]
fn instance_of(id: u32) -> u32 {
    if id == INVALID_ID { INVALID_ID } else { id - FIRST_INSTANCE }
}

// SAFETY: the buffers behind the pointers belong to a scene's geometry, are only read once they are full, and go with
// it.
unsafe impl Send for Held {}
// SAFETY: as above.
unsafe impl Sync for Held {}

/// A scene; traced only after [`commit`](Scene::commit).
struct Scene {
    raw: sys::RTCScene,
    device: Arc<Device>,
    /// Whether it has a tree for each geometry, and others may be attached after it was committed.
    in_levels: bool,
    /// Bytes that committing allocated.
    bytes: i64,
}

// SAFETY: a committed scene may be traced from any thread (Embree's documentation of rtcCommitScene); `World::build`
// alone changes it, as its one owner, who releases it.
unsafe impl Send for Scene {}
// SAFETY: as above.
unsafe impl Sync for Scene {}

impl Scene {
    fn new(device: &Arc<Device>, flags: sys::RTCSceneFlags, in_levels: bool) -> Result<Self> {
        // SAFETY: the device is alive.
        let raw = unsafe { sys::rtcNewScene(device.raw()) };
        if raw.is_null() {
            device.check("creating a scene")?;
            return Err(failure("cannot create a scene"));
        }
        let scene = Scene { raw, device: device.clone(), in_levels, bytes: 0 };
        // HIGH would build the same tree as MEDIUM in a robust scene, and no faster one otherwise (measured).
        let (more, quality) = match in_levels {
            true => (sys::RTCSceneFlags::RTC_SCENE_FLAG_DYNAMIC.0, sys::RTCBuildQuality::RTC_BUILD_QUALITY_LOW),
            false => (0, sys::RTCBuildQuality::RTC_BUILD_QUALITY_MEDIUM),
        };
        // SAFETY: the scene is alive and not committed yet.
        unsafe { sys::rtcSetSceneFlags(scene.raw, sys::RTCSceneFlags(flags.0 | more)) };
        // SAFETY: as above.
        unsafe { sys::rtcSetSceneBuildQuality(scene.raw, quality) };
        device.check("creating a scene")?;
        Ok(scene)
    }

    /// Adds a geometry; the scene takes its own reference.
    fn attach(&mut self, geometry: &GeometryHandle, id: u32) -> Result<()> {
        // SAFETY: both are alive, the geometry is committed, and ids are used once in a scene.
        unsafe { sys::rtcAttachGeometryByID(self.raw, geometry.raw, id) };
        self.device.check("attaching a geometry")
    }

    /// Takes the geometry of that id out; the scene is to be committed before it is traced again.
    fn detach(&mut self, id: u32) -> Result<()> {
        // SAFETY: the scene is alive and nobody else has it; a geometry was attached by this id.
        unsafe { sys::rtcDetachGeometry(self.raw, id) };
        self.device.check("detaching a geometry")
    }

    /// Builds the hierarchy, or what of it is not built yet.
    fn commit(&mut self) -> Result<()> {
        let before = self.device.bytes();
        // SAFETY: the scene is alive and nobody else has it yet.
        unsafe { sys::rtcCommitScene(self.raw) };
        self.bytes += self.device.bytes() - before;
        self.device.check("building the hierarchy")
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: created by rtcNewScene, released once; the device is still alive.
        unsafe { sys::rtcReleaseScene(self.raw) };
    }
}

/// A geometry before it is attached.
struct GeometryHandle {
    raw: sys::RTCGeometry,
}

impl GeometryHandle {
    fn new(device: &Device, kind: sys::RTCGeometryType) -> Result<Self> {
        // SAFETY: the device is alive.
        let raw = unsafe { sys::rtcNewGeometry(device.raw(), kind) };
        if raw.is_null() {
            device.check("creating a geometry")?;
            return Err(failure("cannot create a geometry"));
        }
        // All bits, said aloud: Embree 4 starts with bit 0 alone, Embree 3 with all.
        // SAFETY: the geometry is alive.
        unsafe { sys::rtcSetGeometryMask(raw, u32::MAX) };
        Ok(GeometryHandle { raw })
    }

    /// Copies `items` into a new buffer of the geometry, which lives as long as that.
    fn upload<T: bytemuck::Pod>(
        &self,
        device: &Device,
        kind: sys::RTCBufferType,
        format: sys::RTCFormat,
        (slot, items): (u32, &[T]),
    ) -> Result<NonNull<T>> {
        // SAFETY: the geometry is alive; Embree allocates `items.len()` items of the stride given, padded for vertices.
        let buffer = unsafe { sys::rtcSetNewGeometryBuffer(self.raw, kind, slot, format, size_of::<T>(), items.len()) };
        device.check("allocating a buffer")?;
        let Some(buffer) = NonNull::new(buffer.cast::<T>()) else {
            return Err(failure("allocating a buffer: no memory"));
        };
        // SAFETY: `buffer` is a fresh allocation of at least as many bytes as `items` has.
        unsafe { ptr::copy_nonoverlapping(items.as_ptr(), buffer.as_ptr(), items.len()) };
        Ok(buffer)
    }

    fn commit(&self, device: &Device) -> Result<()> {
        // SAFETY: the geometry is alive and complete.
        unsafe { sys::rtcCommitGeometry(self.raw) };
        device.check("committing a geometry")
    }
}

impl Drop for GeometryHandle {
    fn drop(&mut self) {
        // SAFETY: created by rtcNewGeometry, released once; scenes that hold it have their own references.
        unsafe { sys::rtcReleaseGeometry(self.raw) };
    }
}

/// A triangle mesh, committed, and its buffers.
fn triangle_geometry(device: &Device, mesh: &TriangleMesh) -> Result<(GeometryHandle, Held)> {
    // Embree reads vertices by index without asking.
    let vertices = mesh.vertices.len();
    if mesh.indices.iter().flatten().any(|&index| index as usize >= vertices) {
        return Err(failure(format!("a vertex index is not below {vertices}, the number of vertices")));
    }
    let geometry = GeometryHandle::new(device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_TRIANGLE)?;
    let (vertex, index) = (sys::RTCBufferType::RTC_BUFFER_TYPE_VERTEX, sys::RTCBufferType::RTC_BUFFER_TYPE_INDEX);
    if mesh.later.iter().any(|shape| shape.len() != vertices) {
        return Err(failure(format!("a shape of a mesh has not {vertices} vertices, as its first has")));
    }
    if !mesh.later.is_empty() {
        // SAFETY: the geometry is alive; it gets a vertex buffer for each step below.
        unsafe { sys::rtcSetGeometryTimeStepCount(geometry.raw, 1 + mesh.later.len() as u32) };
    }
    let float3 = sys::RTCFormat::RTC_FORMAT_FLOAT3;
    let mut shapes = Vec::with_capacity(1 + mesh.later.len());
    for (slot, shape) in (0u32..).zip(std::iter::once(&mesh.vertices).chain(&mesh.later)) {
        shapes.push(geometry.upload(device, vertex, float3, (slot, shape))?);
    }
    let indices = geometry.upload(device, index, sys::RTCFormat::RTC_FORMAT_UINT3, (0, &mesh.indices))?;
    geometry.commit(device)?;
    Ok((geometry, Held { shapes, vertices, indices, triangles: mesh.indices.len() }))
}

/// A mesh in Embree's memory, which its geometry owns.
struct Held {
    /// Vertices as the shutter opens and later.
    shapes: Vec<NonNull<Vec3>>,
    /// How many they are, in each.
    vertices: usize,
    indices: NonNull<[u32; 3]>,
    triangles: usize,
}

impl Held {
    /// Corners of a triangle as the shutter opens.
    fn corners(&self, prim: u32) -> [Vec3; 3] {
        assert!((prim as usize) < self.triangles, "triangle {prim} of {}", self.triangles);
        // SAFETY: within the buffer, which lives as long as its geometry; nobody writes to it any more.
        let index = unsafe { self.indices.add(prim as usize).read() };
        // SAFETY: as above; every index was checked against the number of vertices before it was copied.
        index.map(|i| unsafe { self.shapes[0].add(i as usize).read() })
    }

    /// Whether it is this mesh, bit for bit.
    fn holds(&self, mesh: &TriangleMesh) -> bool {
        let shapes = || std::iter::once(&mesh.vertices).chain(&mesh.later);
        (self.vertices, self.triangles, self.shapes.len())
            == (mesh.vertices.len(), mesh.indices.len(), 1 + mesh.later.len())
            && same(self.indices, &mesh.indices)
            && self.shapes.iter().zip(shapes()).all(|(&held, shape)| shape.len() == self.vertices && same(held, shape))
    }
}

/// Whether a buffer of at least as many items holds these, bit for bit.
fn same<T: bytemuck::Pod>(buffer: NonNull<T>, items: &[T]) -> bool {
    // SAFETY: the callers' buffers have that many items, were filled, and live as long as their geometry; nobody writes
    // to them any more.
    let held = unsafe { std::slice::from_raw_parts(buffer.as_ptr(), items.len()) };
    bytemuck::cast_slice::<T, u8>(held) == bytemuck::cast_slice::<T, u8>(items)
}

/// A committed scene placed once, committed; `steps` are its poses at equal intervals of the shutter, one if it is at
/// rest.
fn instance_geometry(device: &Device, scene: &Scene, steps: &[Placement]) -> Result<GeometryHandle> {
    let geometry = GeometryHandle::new(device, sys::RTCGeometryType::RTC_GEOMETRY_TYPE_INSTANCE)?;
    // SAFETY: both are alive; the geometry takes a reference of the scene.
    unsafe { sys::rtcSetGeometryInstancedScene(geometry.raw, scene.raw) };
    // SAFETY: the geometry is alive.
    unsafe { sys::rtcSetGeometryTimeStepCount(geometry.raw, steps.len() as u32) };
    let format = sys::RTCFormat::RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR;
    for (step, placement) in (0u32..).zip(steps) {
        let columns: [f32; 12] = placement.world_from_object.to_cols_array();
        // SAFETY: twelve floats, three for each of four columns, copied during the call; the step is below their
        // number.
        unsafe { sys::rtcSetGeometryTransform(geometry.raw, step, format, columns.as_ptr().cast()) };
    }
    geometry.commit(device)?;
    Ok(geometry)
}

/// The rest of the range that Embree asserts in object space: a tenth is for its own inverse, which is computed in f32.
const OBJECT_LIMIT: f32 = 0.9 * 1.8e18;

/// As [`reach`] for an instance that moves. Elements of an inverse are sums of two products of elements over the
/// determinant, which stays above a 64th of the largest at the ends of its part of the shutter
/// (`scene::motion::Track::problem`).
fn reach_moving(steps: &[Placement]) -> Result<f32> {
    let mut limit = f64::from(OBJECT_LIMIT);
    for pair in steps.windows(2) {
        let matrices = [pair[0].world_from_object, pair[1].world_from_object];
        let element =
            |m: &Affine3A| f64::from(m.matrix3.to_cols_array().into_iter().fold(0.0, |a: f32, x| a.max(x.abs())));
        let largest = matrices.iter().map(element).fold(0.0, f64::max);
        let volume = matrices.iter().map(|m| m.matrix3.as_dmat3().determinant().abs()).fold(0.0, f64::max);
        let away = matrices.iter().map(|m| f64::from(m.translation.abs().max_element())).fold(0.0, f64::max);
        let stretch = 3.0 * 2.0 * largest * largest * 64.0 / volume;
        limit = limit.min(f64::from(OBJECT_LIMIT) / stretch - away);
    }
    // False of NaN as well.
    if limit > 2.0 {
        Ok(limit as f32)
    } else {
        Err(failure("an instance's transform is not finite or cannot be inverted while it moves"))
    }
}

/// The largest origin coordinate that an instance takes: Embree asserts the range (1.844·10¹⁸) again in object
/// space.
fn reach(placement: &Placement) -> Result<f32> {
    let (there, back) = (&placement.world_from_object, &placement.object_from_world);
    let finite = |affine: &Affine3A| affine.to_cols_array().into_iter().all(f32::is_finite);
    let columns = [back.matrix3.x_axis, back.matrix3.y_axis, back.matrix3.z_axis].map(|axis| axis.abs());
    // No coordinate grows by more than the largest sum over a row. A zero here means that there is no way back.
    let stretch = (columns[0] + columns[1] + columns[2]).max_element();
    let limit = (OBJECT_LIMIT - back.translation.abs().max_element()) / stretch;
    // Directions are shorter than 2 and must stay in range, too.
    if finite(there) && finite(back) && limit > 2.0 && limit.is_finite() {
        Ok(limit)
    } else {
        Err(failure("an instance's transform is not finite or cannot be inverted"))
    }
}
