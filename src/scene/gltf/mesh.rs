//! Primitives to meshes: positions, triangles with area, and the vertex attributes that shading reads.
//!
//! Source: glTF 2.0 §3.7. Missing normals mean flat shading; tangents are kept only under a normal map and computed by
//! MikkTSpace where the file has none. Non-finite positions are errors; triangles without area are dropped and counted.
//! Texture coordinates come by channel (`uv`). Limits: COLOR_0 alone of the vertex colours; of
//! those that morph targets displace while the shutter is open, positions, normals and tangents alone change.

use std::collections::BTreeMap;
use std::rc::Rc;

use glam::{DAffine3, DVec3, Vec2, Vec3, Vec4};
use gltf::json::Index;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::super::geometry::{LARGEST_COORDINATE_M, is_degenerate};
use super::super::{Dropped, MaterialId, Mesh, Shape};
use super::accessor::Accessor;
use super::changing::{self, Pose, Poses};
use super::document::Document;
use super::ext;
#[cfg(feature = "draco")]
use super::ext::khr_draco_mesh_compression;
use super::material::{MaterialTable, Variant};
use super::morph::Morph;
use super::skin::{self, Influences, Skin};
use super::uv::UvChannel;
use super::{tangent, topology};
use crate::error::Result;

/// Reads one primitive, and how far its vertices are from the straight lines between its shapes, metres; `None` if
/// nothing with an area is left of it.
pub(super) fn read(
    document: &Document,
    primitive: &Primitive,
    place: Place<'_>,
    materials: &mut MaterialTable,
    dropped: &mut Dropped,
) -> Result<Option<(Mesh, f64)>> {
    let mut reader = Reader {
        document,
        pointer: place.pointer,
        attributes: &primitive.attributes,
        #[cfg(feature = "draco")]
        decoded: khr_draco_mesh_compression::decode(document, place.pointer)?.map(Rc::new),
        morph: Morph::default(),
        is_later: false,
    };
    reader.warn_ignored();
    let Some(positions) = reader.optional(Semantic::Positions, "POSITION", &[3])? else {
        document.warn(place.pointer, "has no POSITION and is left out");
        return Ok(None);
    };
    let indices = match primitive.indices {
        #[cfg(feature = "draco")]
        _ if reader.decoded.is_some() => reader.decoded_indices(),
        None => None,
        Some(index) => {
            let indices = Accessor::open(document, index.value(), &reader.at("indices"))?;
            indices.expect_indices(document)?;
            Some(indices)
        }
    };
    let mode = document.checked(primitive.mode, &reader.at("mode"))?;
    // A stream holds plain triangles, also of strips.
    #[cfg(feature = "draco")]
    let mode = if reader.decoded.is_some() { gltf::json::mesh::Mode::Triangles } else { mode };
    let mut topology = topology::read(document, mode, indices.as_ref(), positions.count, place.pointer)?;
    dropped.points_and_lines = dropped.points_and_lines.saturating_add(topology.points_and_lines);

    reader.morph = Morph::read(document, place.pointer, place.weights, topology.vertices.len())?;

    let influences = if place.skin.is_some() { reader.influences(positions.count)? } else { Vec::new() };
    if let Some(skin) = place.skin {
        skin.check(document, &influences, &topology.vertices)?;
    }
    // One a vertex; none without a skin.
    let posed = |skin: &Skin| topology.vertices.iter().map(|&vertex| skin.matrix(&influences, vertex)).collect();
    let mut matrices: Vec<Option<DAffine3>> = place.skin.map_or_else(Vec::new, posed);
    let displaced = reader.morph.of(document, "POSITION", positions.count)?;
    let point = |(number, &vertex): (usize, &u32)| {
        let modelled = displaced.applied(vertex, positions.vector(vertex as usize));
        skin::moved(matrices.get(number).copied().flatten(), Vec3::from_array(modelled))
    };
    let mut points: Vec<Vec3> = topology.vertices.iter().enumerate().map(point).collect();
    let source = Source { document, pointer: place.pointer, positions: &positions, influences: &influences };
    let (looks, off) = match place.poses {
        None => (Vec::new(), 0.0),
        Some(poses) => changing::looks(topology.vertices.len(), topology.triangles.len(), |look, some| {
            let some: Vec<u32> = some.iter().map(|&number| topology.vertices[number]).collect();
            let pose = poses.at(look)?;
            source.posed(&pose, &some)
        })?,
    };
    document.charge(looks.len().saturating_mul(topology.triangles.len()), place.pointer)?;
    let of_looks = place.poses.iter().flat_map(|poses| looks.iter().map(|&look| poses.at(look)));
    let poses: Vec<Rc<Pose>> = of_looks.collect::<Result<_>>()?;
    let mut later: Vec<Vec<Vec3>> =
        poses.iter().map(|pose| source.posed(pose, &topology.vertices)).collect::<Result<_>>()?;
    for shape in std::iter::once(&points).chain(&later) {
        if let Some((point, vertex)) = shape.iter().zip(&topology.vertices).find(|(point, _)| !point.is_finite()) {
            let problem = format!("expected finite positions, found {point} at element {vertex}");
            return Err(document.error(&positions.pointer, problem));
        }
    }
    let all = topology.triangles.len();
    topology.triangles.retain(|triangle| {
        let has_area_in = |shape: &Vec<Vec3>| has_area(triangle.map(|corner| shape[corner as usize]));
        has_area_in(&points) || later.iter().any(has_area_in)
    });
    dropped.degenerate_triangles += all - topology.triangles.len();
    if topology.triangles.is_empty() {
        return Ok(None);
    }
    // A vertex that only dropped triangles used is not validated again.
    if topology.triangles.len() < all {
        let kept = topology::compact(&mut topology.triangles);
        topology.vertices = kept.iter().map(|&vertex| topology.vertices[vertex as usize]).collect();
        for shape in std::iter::once(&mut points).chain(&mut later) {
            *shape = kept.iter().map(|&vertex| shape[vertex as usize]).collect();
        }
        matrices = kept.iter().filter_map(|&vertex| matrices.get(vertex as usize).copied()).collect();
    }
    let (vertices, triangles) = (topology.vertices, topology.triangles);

    let mut mesh = Mesh {
        name: place.name,
        positions: points,
        material: reader.material(primitive, materials)?,
        triangles,
        ..Mesh::default()
    };
    mesh.normals = reader.normals(&vertices, positions.count, &mesh)?;
    turn_normals(&mut mesh.normals, &matrices);
    for (pose, points) in poses.iter().zip(later) {
        mesh.later.push(reader.shape(pose, points, (&vertices, positions.count), &influences, &mesh)?);
    }
    reader.channels(&vertices, positions.count, &mut mesh, materials)?;
    mesh.colors = reader.colors(&vertices, positions.count)?;
    if mesh.colors.is_some() {
        let textured = mesh.uvs.is_some() || !materials.materials[mesh.material.index()].reads_textures();
        let variant = if textured { Variant::VertexColors } else { Variant::VertexColorsAlone };
        mesh.material = materials.variant(mesh.material, variant);
    }
    let material = &materials.materials[mesh.material.index()];
    if let Some(channel) = material.tangent_channel() {
        let channels = materials.channels(mesh.material);
        let kept = channels.get(channel as usize).is_none_or(UvChannel::keeps_tangents);
        if mesh.uvs.is_none() {
            if !material.reads_textures() {
                document
                    .warn(place.pointer, format!("has no TEXCOORD_0; the grain of \"{}\" is ignored", material.name));
            }
            mesh.material = materials.variant(mesh.material, Variant::WithoutTangents);
        } else {
            // The file's tangents follow its own texture coordinates; turned ones need others.
            let usable = mesh.normals.is_some() && kept;
            let given = if usable { reader.tangents(&vertices, positions.count)? } else { None };
            match given {
                Some(mut tangents) => {
                    turn_tangents(&mut tangents, &matrices);
                    for (pose, shape) in poses.iter().zip(&mut mesh.later) {
                        let posed = reader.in_pose(pose, &vertices)?;
                        // One that has no direction any more stays as it was.
                        let mut later = posed.tangents(&vertices, positions.count)?.unwrap_or_else(|| tangents.clone());
                        turn_tangents(&mut later, &matrices_of(pose, &influences, &vertices));
                        shape.tangents = Some(later);
                    }
                    mesh.tangents = Some(tangents);
                }
                None => {
                    if let Err(reason) = tangent::generate(&mut mesh, channel) {
                        document.warn(place.pointer, format!("{reason}; its normal map and grain are ignored"));
                        mesh.material = materials.variant(mesh.material, Variant::WithoutTangents);
                    }
                }
            }
        }
    }
    Ok(Some((mesh, off)))
}

/// What moves each vertex; empty without a skin.
fn matrices_of(pose: &Pose, influences: &[Influences], vertices: &[u32]) -> Vec<Option<DAffine3>> {
    let posed = |skin: &Skin| vertices.iter().map(|&vertex| skin.matrix(influences, vertex)).collect();
    pose.skin.as_ref().map_or_else(Vec::new, posed)
}

fn turn_normals(normals: &mut Option<Vec<Vec3>>, matrices: &[Option<DAffine3>]) {
    for (normal, matrix) in normals.iter_mut().flatten().zip(matrices) {
        let turned = matrix.map(|matrix| matrix.matrix3.inverse().transpose() * normal.as_dvec3());
        *normal = turned.and_then(DVec3::try_normalize).map_or(*normal, |turned| turned.as_vec3());
    }
}

fn turn_tangents(tangents: &mut [Vec4], matrices: &[Option<DAffine3>]) {
    for (tangent, matrix) in tangents.iter_mut().zip(matrices) {
        let turned = matrix.map(|matrix| matrix.matrix3 * tangent.truncate().as_dvec3());
        let turned = turned.and_then(DVec3::try_normalize);
        *tangent = turned.map_or(*tangent, |turned| turned.as_vec3().extend(tangent.w));
    }
}

/// What positions of a primitive follow from.
struct Source<'s, 'd> {
    document: &'d Document,
    /// `/meshes/N/primitives/M`.
    pointer: &'s str,
    positions: &'s Accessor<'d>,
    influences: &'s [Influences<'d>],
}

impl Source<'_, '_> {
    /// Where some of the vertices are in a pose.
    fn posed(&self, pose: &Pose, vertices: &[u32]) -> Result<Vec<Vec3>> {
        let morph = Morph::read(self.document, self.pointer, &pose.weights, vertices.len())?;
        let displaced = morph.of(self.document, "POSITION", self.positions.count)?;
        let at = |&vertex: &u32| {
            let modelled = Vec3::from_array(displaced.applied(vertex, self.positions.vector(vertex as usize)));
            match &pose.skin {
                Some(skin) => skin::moved(skin.matrix(self.influences, vertex), modelled),
                None => modelled,
            }
        };
        Ok(vertices.iter().map(at).collect())
    }
}

/// Where a primitive stands in the file.
pub(super) struct Place<'p> {
    /// `/meshes/N/primitives/M`.
    pub(super) pointer: &'p str,
    /// What the mesh is to be called.
    pub(super) name: String,
    /// What moves its vertices.
    pub(super) skin: Option<&'p Skin>,
    /// Of its morph targets.
    pub(super) weights: &'p [f64],
    /// What poses it while the shutter is open, if that moves.
    pub(super) poses: Option<&'p Poses<'p>>,
}

/// Whether a triangle's area is positive and finite as `f32`, which is what light sampling divides by.
fn has_area(corners: [Vec3; 3]) -> bool {
    let [a, b, c] = corners.map(Vec3::as_dvec3);
    let area = 0.5 * (b - a).cross(c - a).length();
    // One that lies out of range is kept: where it is placed, that is an error.
    let huge = corners.iter().any(|p| p.abs().max_element() > LARGEST_COORDINATE_M);
    area as f32 > 0.0 && (area as f32).is_finite() && (huge || !is_degenerate(&corners))
}

struct Reader<'d> {
    document: &'d Document,
    pointer: &'d str,
    attributes: &'d BTreeMap<Checked<Semantic>, Index<gltf::json::Accessor>>,
    #[cfg(feature = "draco")]
    decoded: Option<Rc<khr_draco_mesh_compression::Decoded>>,
    morph: Morph,
    /// Whether a shape after the first is read, of which nothing is said that was said of that.
    is_later: bool,
}

impl<'d> Reader<'d> {
    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }

    /// The same of another pose.
    fn in_pose(&self, pose: &Pose, vertices: &[u32]) -> Result<Reader<'d>> {
        let morph = Morph::read(self.document, self.pointer, &pose.weights, vertices.len())?;
        Ok(Reader {
            document: self.document,
            pointer: self.pointer,
            attributes: self.attributes,
            #[cfg(feature = "draco")]
            decoded: self.decoded.clone(),
            morph,
            is_later: true,
        })
    }

    /// The shape of `mesh`, a mesh of these vertices, whose positions are `points`, in a pose; without tangents.
    fn shape(
        &self,
        pose: &Pose,
        points: Vec<Vec3>,
        (vertices, count): (&[u32], usize),
        influences: &[Influences],
        mesh: &Mesh,
    ) -> Result<Shape> {
        let mut normals = self.in_pose(pose, vertices)?.normals(vertices, count, mesh)?;
        turn_normals(&mut normals, &matrices_of(pose, influences, vertices));
        Ok(Shape { positions: points, normals, tangents: None })
    }

    fn optional(&self, semantic: Semantic, name: &str, components: &[usize]) -> Result<Option<Accessor<'d>>> {
        let Some(index) = self.attributes.get(&Checked::Valid(semantic)) else { return Ok(None) };
        let accessor = Accessor::open(self.document, index.value(), &self.at(&format!("attributes/{name}")))?;
        #[cfg(feature = "draco")]
        let accessor = match self.decoded.as_ref().and_then(|decoded| decoded.attributes.get(name)) {
            Some(values) => accessor.holding(values.clone()),
            None => accessor,
        };
        accessor.expect_components(self.document, components)?;
        Ok(Some(accessor))
    }

    /// The triangles of the primitive's stream.
    #[cfg(feature = "draco")]
    fn decoded_indices(&self) -> Option<Accessor<'d>> {
        let pointer = self.at(&format!("extensions/{}", khr_draco_mesh_compression::NAME));
        self.decoded.as_ref().map(|decoded| Accessor::of_indices(decoded.indices.clone(), pointer))
    }

    /// An attribute that must have as many elements as there are vertices.
    fn matching(
        &self,
        semantic: Semantic,
        name: &str,
        components: &[usize],
        count: usize,
    ) -> Result<Option<Accessor<'d>>> {
        let accessor = self.optional(semantic, name, components)?;
        match accessor.as_ref().filter(|accessor| accessor.count != count) {
            None => Ok(accessor),
            Some(other) => {
                let problem = format!("expected {count} elements as POSITION has, found {}", other.count);
                Err(self.document.error(format!("{}/count", other.pointer), problem))
            }
        }
    }

    /// Every set of joints and weights.
    fn influences(&self, count: usize) -> Result<Vec<Influences<'d>>> {
        let mut sets = Vec::new();
        for set in 0.. {
            let joints = self.matching(Semantic::Joints(set), &format!("JOINTS_{set}"), &[4], count)?;
            let weights = self.matching(Semantic::Weights(set), &format!("WEIGHTS_{set}"), &[4], count)?;
            let Some((joints, weights)) = joints.zip(weights) else { break };
            joints.expect_unsigned(self.document)?;
            weights.expect_floats(self.document, true)?;
            sets.push(Influences { joints, weights });
        }
        if sets.is_empty() {
            self.document.warn(self.pointer, "has a skin and no JOINTS_0 and WEIGHTS_0; it is shown as modelled");
        }
        Ok(sets)
    }

    fn material(&self, primitive: &Primitive, materials: &mut MaterialTable) -> Result<MaterialId> {
        let Some(index) = primitive.material else { return Ok(materials.default_material()) };
        let index = index.value();
        if index >= self.document.table("materials")?.len() {
            return Err(self.document.out_of_range("materials", index, &self.at("material")));
        }
        Ok(MaterialId(index as u32))
    }

    /// Unit normals. One without direction is replaced by the mean normal of the triangles around it.
    fn normals(&self, vertices: &[u32], count: usize, mesh: &Mesh) -> Result<Option<Vec<Vec3>>> {
        let Some(accessor) = self.matching(Semantic::Normals, "NORMAL", &[3], count)? else { return Ok(None) };
        let displaced = self.morph.of(self.document, "NORMAL", count)?;
        let unit = |&vertex: &u32| {
            let normal: [f32; 3] = displaced.applied(vertex, accessor.vector(vertex as usize));
            Vec3::from_array(normal).as_dvec3().try_normalize()
        };
        let read: Vec<Option<DVec3>> = vertices.iter().map(unit).collect();
        let invalid = read.iter().filter(|normal| normal.is_none()).count();
        let mut normals: Vec<DVec3> = read.iter().map(|normal| normal.unwrap_or(DVec3::ZERO)).collect();
        if invalid > 0 {
            self.warn(&accessor, format!("{invalid} normals have no direction; those of the surface are used"));
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|corner| mesh.positions[corner as usize].as_dvec3());
                let weighted = (b - a).cross(c - a);
                for &corner in triangle.iter().filter(|&&corner| read[corner as usize].is_none()) {
                    normals[corner as usize] += weighted;
                }
            }
        }
        // Opposite triangles may cancel; any direction is then as good.
        Ok(Some(normals.iter().map(|normal| normal.try_normalize().unwrap_or(DVec3::Y).as_vec3()).collect()))
    }

    /// Texture coordinates of every channel that the mesh's material reads; set 0 where it reads none.
    fn channels(&self, vertices: &[u32], count: usize, mesh: &mut Mesh, materials: &MaterialTable) -> Result<()> {
        let channels = match materials.channels(mesh.material) {
            [] => &[UvChannel::plain(0)][..],
            channels => channels,
        };
        let material = &materials.materials[mesh.material.index()];
        let mut read = Vec::new();
        for channel in channels {
            let uvs = self.uvs(vertices, count, channel.set)?;
            read.push(uvs.map(|uvs| uvs.into_iter().map(|uv| channel.apply(uv)).collect::<Vec<Vec2>>()));
        }
        let fate = if read.iter().any(Option::is_some) { "are read at (0, 0)" } else { "are ignored" };
        for (channel, _) in channels.iter().zip(&read).filter(|(_, uvs)| uvs.is_none() && material.reads_textures()) {
            let what = format!("has no TEXCOORD_{}; textures of \"{}\" that read it", channel.set, material.name);
            self.document.warn(self.pointer, format!("{what} {fate}"));
        }
        if read.iter().any(Option::is_some) {
            let at_zero = || vec![channels[0].apply(Vec2::ZERO); vertices.len()];
            let mut read = read.into_iter().map(|uvs| uvs.unwrap_or_else(at_zero));
            mesh.uvs = read.next();
            mesh.more_uvs = read.collect();
        }
        Ok(())
    }

    /// Texture coordinates of a set; one that is not finite is taken as 0.
    fn uvs(&self, vertices: &[u32], count: usize, set: u32) -> Result<Option<Vec<Vec2>>> {
        let Some(accessor) = self.matching(Semantic::TexCoords(set), &format!("TEXCOORD_{set}"), &[2], count)? else {
            return Ok(None);
        };
        let mut invalid = 0;
        let displaced = self.morph.of(self.document, &format!("TEXCOORD_{set}"), count)?;
        let finite = |&vertex: &u32| {
            let uv: [f32; 2] = displaced.applied(vertex, accessor.vector(vertex as usize));
            let finite = uv.map(|x| if x.is_finite() { x } else { 0.0 });
            invalid += usize::from(uv.iter().any(|x| !x.is_finite()));
            Vec2::from_array(finite)
        };
        let uvs = vertices.iter().map(finite).collect();
        if invalid > 0 {
            self.document
                .warn(&accessor.pointer, format!("{invalid} texture coordinates are not finite and taken as 0"));
        }
        Ok(Some(uvs))
    }

    /// The file's tangents, unless one of them has no direction.
    fn tangents(&self, vertices: &[u32], count: usize) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.matching(Semantic::Tangents, "TANGENT", &[4], count)? else { return Ok(None) };
        let displaced = self.morph.of(self.document, "TANGENT", count)?;
        let unit = |&vertex: &u32| {
            let [x, y, z, w]: [f32; 4] = accessor.vector(vertex as usize);
            let tangent = Vec3::from_array(displaced.applied(vertex, [x, y, z]));
            let sign = if w < 0.0 { -1.0 } else { 1.0 };
            Some(tangent.as_dvec3().try_normalize()?.as_vec3().extend(sign))
        };
        let tangents: Option<Vec<Vec4>> = vertices.iter().map(unit).collect();
        if tangents.is_none() {
            self.warn(&accessor, "has tangents without direction; all are computed anew".into());
        }
        Ok(tangents)
    }

    /// Vertex colours in [0, 1]; `None` where the file has none, or white alone.
    fn colors(&self, vertices: &[u32], count: usize) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.matching(Semantic::Colors(0), "COLOR_0", &[3, 4], count)? else { return Ok(None) };
        let mut clamped = 0;
        let displaced = self.morph.of(self.document, "COLOR_0", count)?;
        let read = |&vertex: &u32| {
            let mut color: [f32; 4] = accessor.vector(vertex as usize);
            if accessor.components == 3 {
                color[3] = 1.0;
            }
            // Of displaced colours the clamped ones are meant (glTF 2.0 §3.7.2.2).
            let color = Vec4::from_array(displaced.applied(vertex, color));
            let inside = color.to_array().map(|c| if c.is_nan() { 0.0 } else { c.clamp(0.0, 1.0) });
            clamped += usize::from(inside != color.to_array() && !displaced.is_some());
            Vec4::from_array(inside)
        };
        let colors: Vec<Vec4> = vertices.iter().map(read).collect();
        if clamped > 0 {
            let problem = format!("{clamped} vertex colours have channels outside [0, 1], which are clamped");
            self.document.warn(&accessor.pointer, problem);
        }
        Ok(colors.iter().any(|color| *color != Vec4::ONE).then_some(colors))
    }

    /// Says something of an attribute, once.
    fn warn(&self, accessor: &Accessor, what: String) {
        if !self.is_later {
            self.document.warn(&accessor.pointer, what);
        }
    }

    fn warn_ignored(&self) {
        if let Some(extensions) = self.document.value(&self.at("extensions")).and_then(|value| value.as_object()) {
            for name in extensions.keys().filter(|name| !ext::is_known(name)) {
                self.document.warn(self.pointer, format!("{name} is not supported and ignored"));
            }
        }
    }
}
