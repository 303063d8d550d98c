//! KHR_draco_mesh_compression: triangles and attributes of a primitive in a Draco stream, decoded by the crate
//! `draco-core` (pure Rust). What the stream holds takes the place of the accessors' bytes; their types and counts are
//! the stream's.
//!
//! Limit: a stream may make at most [`MOST_PER_BYTE`] triangles or points from each of its bytes; small ones as many as
//! a small file may.

use std::collections::HashMap;

use draco_core::{DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex};
use gltf::json::accessor::ComponentType;
use serde_json::Value;

use super::super::document::{Document, View, WORK_ALWAYS_ALLOWED};
use super::extension::{Extension, Place};
use crate::error::Result;

pub(crate) const NAME: &str = "KHR_draco_mesh_compression";

pub(super) const EXTENSION: Extension = Extension { name: NAME, place: Place::None };

/// Real streams stay below 30.
const MOST_PER_BYTE: u64 = 256;
/// Bytes of a point with many attributes.
const BYTES_PER_POINT: u64 = 256;

/// What a stream held.
pub(crate) struct Decoded {
    /// Triangles as 32-bit numbers of points.
    pub(crate) indices: Vec<u8>,
    /// By semantic.
    pub(crate) attributes: HashMap<String, Values>,
}

/// Tightly packed values of an attribute, one a point.
#[derive(Clone)]
pub(crate) struct Values {
    pub(crate) bytes: Vec<u8>,
    pub(crate) count: usize,
    pub(crate) components: usize,
    pub(crate) kind: ComponentType,
}

/// The stream of the primitive at `primitive`, if it has one.
pub(crate) fn decode(document: &Document, primitive: &str) -> Result<Option<Decoded>> {
    let pointer = format!("{primitive}/extensions/{}", EXTENSION.name);
    if document.value(&pointer).is_none() {
        return Ok(None);
    }
    let at = format!("{pointer}/bufferView");
    let view = document.value(&at).ok_or_else(|| document.error(&pointer, "expected a bufferView, found none"))?;
    let View { bytes, pointer: view, .. } = document.view(document.index(view, &at)?, &at)?;
    let most = WORK_ALWAYS_ALLOWED.max(MOST_PER_BYTE * bytes.len() as u64);
    let limits = DecodeLimits::default().with_max_points(most).with_max_faces(most);
    let limits = limits.with_max_decoded_bytes(BYTES_PER_POINT.saturating_mul(most));
    let mut mesh = Mesh::new();
    let decoded = MeshDecoder::new().decode(&mut DecoderBuffer::new(bytes).with_limits(limits), &mut mesh);
    decoded.map_err(|reason| document.error(&view, format!("expected a Draco mesh, found {reason}")))?;

    document.unpack(12 * mesh.num_faces() as u64, &pointer)?;
    let indices = mesh.faces().iter().flatten().flat_map(|point| point.0.to_le_bytes()).collect();
    let mut attributes = HashMap::new();
    let listed = document.value(&format!("{pointer}/attributes")).and_then(Value::as_object);
    let named = document.value(&format!("{primitive}/attributes")).and_then(Value::as_object);
    // Others are never read. One attribute may be listed under many names, and is gathered for each.
    let is_named = |semantic: &String| named.is_some_and(|named| named.contains_key(semantic));
    for (semantic, id) in listed.into_iter().flatten().filter(|(semantic, _)| is_named(semantic)) {
        let at = format!("{pointer}/attributes/{semantic}");
        let id = document.index(id, &at)?;
        let missing = || document.error(&at, format!("expected an attribute of the stream in {view}, found {id}"));
        let attribute = u32::try_from(id).ok().and_then(|id| mesh.attribute_by_unique_id(id)).ok_or_else(missing)?;
        let kind = kind(attribute).ok_or_else(missing)?;
        let size = usize::from(attribute.num_components()) * kind.size();
        document.unpack((mesh.num_points() as u64).saturating_mul(size as u64), &at)?;
        let values = gather(attribute, kind, mesh.num_points()).ok_or_else(missing)?;
        attributes.insert(semantic.clone(), values);
    }
    Ok(Some(Decoded { indices, attributes }))
}

/// Type of an attribute's components; `None` of those that glTF does not have.
fn kind(attribute: &PointAttribute) -> Option<ComponentType> {
    match attribute.data_type() {
        DataType::Int8 => Some(ComponentType::I8),
        DataType::Uint8 => Some(ComponentType::U8),
        DataType::Int16 => Some(ComponentType::I16),
        DataType::Uint16 => Some(ComponentType::U16),
        DataType::Uint32 => Some(ComponentType::U32),
        DataType::Float32 => Some(ComponentType::F32),
        _ => None,
    }
}

/// The values of `points` points, one after the other; `None` if the stream does not hold them.
fn gather(attribute: &PointAttribute, kind: ComponentType, points: usize) -> Option<Values> {
    let components = usize::from(attribute.num_components());
    let (size, stride) = (components * kind.size(), usize::try_from(attribute.byte_stride()).ok()?);
    let data = attribute.buffer().data();
    let mut bytes = Vec::with_capacity(points.checked_mul(size)?);
    for point in 0..u32::try_from(points).ok()? {
        let start = (attribute.mapped_index(PointIndex(point)).0 as usize).checked_mul(stride)?;
        bytes.extend_from_slice(data.get(start..start.checked_add(size)?)?);
    }
    Some(Values { bytes, count: points, components, kind })
}
