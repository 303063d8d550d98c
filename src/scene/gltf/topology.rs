//! From a primitive's mode and indices to plain triangles over the vertices that they use.
//!
//! Source: glTF 2.0 §3.7.2.1 (winding of strips and fans). Points and lines are counted, not kept.

use std::collections::HashMap;

use gltf::json::mesh::Mode;

use super::accessor::Accessor;
use super::document::Document;
use crate::error::Result;

/// Vertices for each corner up to which they are marked one by one.
const MARKS_PER_CORNER: usize = 2;

/// Triangles of one primitive.
#[derive(Debug, Default)]
pub(super) struct Topology {
    /// Corners as positions in `vertices`.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The vertices in use, as element numbers of the attribute accessors, ascending.
    pub(super) vertices: Vec<u32>,
    /// Points and lines that were left out.
    pub(super) points_and_lines: usize,
}

/// Reads the topology of a primitive with `vertex_count` vertices. Memory is bounded by the indices that the file
/// holds.
pub(super) fn read(
    document: &Document,
    mode: Mode,
    indices: Option<&Accessor<'_>>,
    vertex_count: usize,
    pointer: &str,
) -> Result<Topology> {
    if vertex_count as u64 > u64::from(u32::MAX) {
        return Err(document.error(pointer, format!("expected at most {} vertices, found {vertex_count}", u32::MAX)));
    }
    let count = indices.map_or(vertex_count, |indices| indices.count);
    let points_and_lines = match mode {
        Mode::Points | Mode::LineLoop => count,
        Mode::Lines => count / 2,
        Mode::LineStrip => count - 1,
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => 0,
    };
    if points_and_lines > 0 {
        return Ok(Topology { points_and_lines, ..Topology::default() });
    }
    let vertex = |corner: usize| -> Result<u32> {
        let Some(indices) = indices else { return Ok(corner as u32) };
        let vertex = indices.index(corner);
        if vertex as usize >= vertex_count {
            let problem =
                format!("expected indices below {vertex_count}, the number of vertices, found {vertex} at {corner}");
            return Err(document.error(&indices.pointer, problem));
        }
        Ok(vertex)
    };
    if mode == Mode::Triangles && !count.is_multiple_of(3) {
        document.warn(
            pointer,
            format!("has {count} corners, which is not a multiple of 3; the last {} are ignored", count % 3),
        );
    }
    let number = if mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
    document.charge(number, pointer)?;
    let mut triangles = Vec::with_capacity(number);
    for n in 0..number {
        let corners = match mode {
            Mode::TriangleStrip => [n, n + 1 + n % 2, n + 2 - n % 2],
            Mode::TriangleFan => [n + 1, n + 2, 0],
            _ => [3 * n, 3 * n + 1, 3 * n + 2],
        };
        triangles.push([vertex(corners[0])?, vertex(corners[1])?, vertex(corners[2])?]);
    }
    let vertices = compact(&mut triangles);
    Ok(Topology { triangles, vertices, points_and_lines })
}

/// Renumbers corners to the vertices in use, keeping their order, and returns those. Many primitives may share one
/// large accessor, and a sparse accessor may claim more vertices than memory holds: neither costs more than the
/// corners.
pub(super) fn compact(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let most = triangles.as_flattened().iter().max().map_or(0, |&largest| largest as usize);
    // A mark for each vertex where there are not many more than corners: sorting those took half as long as decoding a
    // Draco stream of them.
    if most < MARKS_PER_CORNER * 3 * triangles.len() {
        let mut places = vec![u32::MAX; most + 1];
        triangles.as_flattened().iter().for_each(|&corner| places[corner as usize] = 0);
        let mut used = Vec::new();
        for (vertex, place) in (0u32..).zip(&mut places).filter(|(_, place)| **place == 0) {
            *place = used.len() as u32;
            used.push(vertex);
        }
        if used.len() <= most {
            triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = places[*corner as usize]);
        }
        return used;
    }
    let mut used: Vec<u32> = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    let largest = used.last().map_or(0, |&largest| largest as usize);
    if largest + 1 == used.len() {
        return used;
    }
    let places: HashMap<u32, u32> = used.iter().zip(0..).map(|(&vertex, place)| (vertex, place)).collect();
    triangles.as_flattened_mut().iter_mut().for_each(|corner| *corner = places[corner]);
    used
}
