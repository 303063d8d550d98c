//! Primitives to meshes: positions, triangles with area, and the vertex attributes that shading reads.
//!
//! Source: glTF 2.0 §3.7. Missing normals mean flat shading; tangents are kept only under a normal map and computed by
//! MikkTSpace where the file has none. Non-finite positions are errors; triangles without area are dropped and counted.
//! Texture coordinates come by channel (`uv`). Limits: COLOR_0 alone of the vertex colours; skins and morph targets are ignored
//! with a warning.

use std::collections::BTreeMap;

use glam::{DVec3, Vec2, Vec3, Vec4};
use gltf::json::Index;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::validation::Checked;

use super::super::geometry::{LARGEST_COORDINATE_M, is_degenerate};
use super::super::{Dropped, MaterialId, Mesh};
use super::accessor::Accessor;
use super::document::Document;
use super::material::{MaterialTable, Variant};
use super::uv::UvChannel;
use super::{tangent, topology};
use crate::error::Result;

/// Reads one primitive; `None` if nothing with an area is left of it.
pub(super) fn read(
    document: &Document,
    primitive: &Primitive,
    place: Place<'_>,
    materials: &mut MaterialTable,
    dropped: &mut Dropped,
) -> Result<Option<Mesh>> {
    let reader = Reader { document, pointer: place.pointer, attributes: &primitive.attributes };
    reader.warn_ignored(primitive);
    let positions = reader.required(Semantic::Positions, "POSITION", &[3])?;
    let indices = match primitive.indices {
        None => None,
        Some(index) => {
            let indices = Accessor::open(document, index.value(), &reader.at("indices"))?;
            indices.expect_indices(document)?;
            Some(indices)
        }
    };
    let mode = document.checked(primitive.mode, &reader.at("mode"))?;
    let mut topology = topology::read(document, mode, indices.as_ref(), positions.count, place.pointer)?;
    dropped.points_and_lines = dropped.points_and_lines.saturating_add(topology.points_and_lines);

    let at = |vertex: u32| Vec3::from_array(positions.vector(vertex as usize));
    if let Some(&vertex) = topology.vertices.iter().find(|&&vertex| !at(vertex).is_finite()) {
        let problem = format!("expected finite positions, found {} at element {vertex}", at(vertex));
        return Err(document.error(&positions.pointer, problem));
    }
    let all = topology.triangles.len();
    let vertices = &topology.vertices;
    topology.triangles.retain(|triangle| has_area(triangle.map(|corner| at(vertices[corner as usize]))));
    dropped.degenerate_triangles += all - topology.triangles.len();
    if topology.triangles.is_empty() {
        return Ok(None);
    }
    // A vertex that only dropped triangles used is not looked at again.
    if topology.triangles.len() < all {
        let kept = topology::compact(&mut topology.triangles);
        topology.vertices = kept.iter().map(|&vertex| topology.vertices[vertex as usize]).collect();
    }
    let (vertices, triangles) = (topology.vertices, topology.triangles);

    let mut mesh = Mesh {
        name: place.name,
        positions: vertices.iter().map(|&vertex| at(vertex)).collect(),
        material: reader.material(primitive, materials)?,
        triangles,
        ..Mesh::default()
    };
    mesh.normals = reader.normals(&vertices, positions.count, &mesh)?;
    reader.channels(&vertices, positions.count, &mut mesh, materials)?;
    mesh.colors = reader.colors(&vertices, positions.count)?;
    if mesh.colors.is_some() {
        let textured = mesh.uvs.is_some() || !materials.materials[mesh.material.index()].reads_textures();
        let variant = if textured { Variant::VertexColors } else { Variant::VertexColorsAlone };
        mesh.material = materials.variant(mesh.material, variant);
    }
    let material = &materials.materials[mesh.material.index()];
    if let Some(slot) = material.normal_texture {
        let channels = materials.channels(mesh.material);
        let kept = channels.get(slot.uv_set as usize).is_none_or(UvChannel::keeps_tangents);
        if mesh.uvs.is_none() {
            mesh.material = materials.variant(mesh.material, Variant::WithoutNormalMap);
        } else {
            // The file's tangents follow its own texture coordinates; turned ones need others.
            let usable = mesh.normals.is_some() && kept;
            let given = if usable { reader.tangents(&vertices, positions.count)? } else { None };
            match given {
                Some(tangents) => mesh.tangents = Some(tangents),
                None => {
                    if let Err(reason) = tangent::generate(&mut mesh, slot.uv_set) {
                        document.warn(place.pointer, format!("{reason}; its normal map is ignored"));
                        mesh.material = materials.variant(mesh.material, Variant::WithoutNormalMap);
                    }
                }
            }
        }
    }
    Ok(Some(mesh))
}

/// Where a primitive stands in the file.
pub(super) struct Place<'p> {
    /// `/meshes/N/primitives/M`.
    pub(super) pointer: &'p str,
    /// What the mesh is to be called.
    pub(super) name: String,
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
}

impl<'d> Reader<'d> {
    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }

    fn optional(&self, semantic: Semantic, name: &str, components: &[usize]) -> Result<Option<Accessor<'d>>> {
        let Some(index) = self.attributes.get(&Checked::Valid(semantic)) else { return Ok(None) };
        let accessor = Accessor::open(self.document, index.value(), &self.at(&format!("attributes/{name}")))?;
        accessor.expect_components(self.document, components)?;
        Ok(Some(accessor))
    }

    fn required(&self, semantic: Semantic, name: &str, components: &[usize]) -> Result<Accessor<'d>> {
        let missing = || self.document.error(self.at("attributes"), format!("expected {name}, found none"));
        self.optional(semantic, name, components)?.ok_or_else(missing)
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
        let unit = |&vertex: &u32| Vec3::from_array(accessor.vector(vertex as usize)).as_dvec3().try_normalize();
        let read: Vec<Option<DVec3>> = vertices.iter().map(unit).collect();
        let invalid = read.iter().filter(|normal| normal.is_none()).count();
        let mut normals: Vec<DVec3> = read.iter().map(|normal| normal.unwrap_or(DVec3::ZERO)).collect();
        if invalid > 0 {
            self.document
                .warn(&accessor.pointer, format!("{invalid} normals have no direction; those of the surface are used"));
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
            if uvs.is_none() && material.reads_textures() {
                let what = format!("has no TEXCOORD_{}; textures of \"{}\" that read it", channel.set, material.name);
                let fate = if channels.len() == 1 { "are ignored" } else { "are read at (0, 0)" };
                self.document.warn(self.pointer, format!("{what} {fate}"));
            }
            read.push(uvs.map(|uvs| uvs.into_iter().map(|uv| channel.apply(uv)).collect::<Vec<Vec2>>()));
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
        let finite = |&vertex: &u32| {
            let uv: [f32; 2] = accessor.vector(vertex as usize);
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
        let unit = |&vertex: &u32| {
            let tangent = Vec4::from_array(accessor.vector(vertex as usize));
            let sign = if tangent.w < 0.0 { -1.0 } else { 1.0 };
            Some(tangent.truncate().as_dvec3().try_normalize()?.as_vec3().extend(sign))
        };
        let tangents: Option<Vec<Vec4>> = vertices.iter().map(unit).collect();
        if tangents.is_none() {
            self.document.warn(&accessor.pointer, "has tangents without direction; all are computed anew");
        }
        Ok(tangents)
    }

    /// Vertex colours in [0, 1]; `None` where the file has none, or white alone.
    fn colors(&self, vertices: &[u32], count: usize) -> Result<Option<Vec<Vec4>>> {
        let Some(accessor) = self.matching(Semantic::Colors(0), "COLOR_0", &[3, 4], count)? else { return Ok(None) };
        let mut clamped = 0;
        let read = |&vertex: &u32| {
            let mut color = Vec4::from_array(accessor.vector(vertex as usize));
            if accessor.components == 3 {
                color.w = 1.0;
            }
            // NaN becomes 0.
            let inside = color.to_array().map(|channel| channel.max(0.0).min(1.0));
            clamped += usize::from(inside != color.to_array());
            Vec4::from_array(inside)
        };
        let colors: Vec<Vec4> = vertices.iter().map(read).collect();
        if clamped > 0 {
            let problem = format!("{clamped} vertex colours have channels outside [0, 1], which are clamped");
            self.document.warn(&accessor.pointer, problem);
        }
        Ok(colors.iter().any(|color| *color != Vec4::ONE).then_some(colors))
    }

    fn warn_ignored(&self, primitive: &Primitive) {
        if primitive.targets.as_ref().is_some_and(|targets| !targets.is_empty()) {
            self.document.warn(self.pointer, "morph targets are not supported; the mesh is shown unmorphed");
        }
        if let Some(extensions) = self.document.value(&self.at("extensions")).and_then(|value| value.as_object()) {
            for name in extensions.keys() {
                self.document.warn(self.pointer, format!("{name} is not supported and ignored"));
            }
        }
    }
}
