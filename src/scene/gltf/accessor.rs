//! Accessors: typed, strided, sparse views into buffers, read element by element with every bound checked once when
//! opened.
//!
//! Source: glTF 2.0 §3.6.2. Integers convert to floats by §3.11 when normalized and by value otherwise
//! (KHR_mesh_quantization). Nothing is allocated by an accessor's count: callers gather the elements they need. Limit:
//! of matrices MAT4 alone is read.

use std::borrow::Cow;

use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, Type};

use super::document::Document;
#[cfg(feature = "draco")]
use super::ext::khr_draco_mesh_compression::Values;
use crate::error::Result;

/// An accessor whose every element is known to lie inside its buffer.
pub(super) struct Accessor<'d> {
    /// `/accessors/N`.
    pub(super) pointer: String,
    /// Elements, > 0.
    pub(super) count: usize,
    /// 1 for SCALAR to 4 for VEC4, 16 for MAT4.
    pub(super) components: usize,
    kind: ComponentType,
    normalized: bool,
    /// `None` means zeros (glTF 2.0 §3.6.2.3).
    base: Option<Strided<'d>>,
    sparse: Option<Sparse<'d>>,
}

struct Strided<'d> {
    bytes: Cow<'d, [u8]>,
    stride: usize,
}

struct Sparse<'d> {
    /// Strictly increasing element numbers.
    elements: Vec<usize>,
    /// One tightly packed element for each.
    values: &'d [u8],
}

impl<'d> Accessor<'d> {
    /// Opens `/accessors/index`, which `from` refers to.
    pub(super) fn open(document: &'d Document, index: usize, from: &str) -> Result<Accessor<'d>> {
        let accessor: gltf::json::Accessor = document.element("accessors", index, from)?;
        let pointer = format!("/accessors/{index}");
        let at = |member: &str| format!("{pointer}/{member}");
        let GenericComponentType(kind) = document.checked(accessor.component_type, &at("componentType"))?;
        let components = match document.checked(accessor.type_, &at("type"))? {
            Type::Scalar => 1,
            Type::Vec2 => 2,
            Type::Vec3 => 3,
            Type::Vec4 => 4,
            Type::Mat4 => 16,
            other => {
                let problem = format!("expected a scalar, a vector or MAT4, found {other:?}");
                return Err(document.error(at("type"), problem));
            }
        };
        let too_many = || {
            document.error(
                at("count"),
                format!("expected at least 1 and at most what memory holds, found {}", accessor.count.0),
            )
        };
        let count = usize::try_from(accessor.count.0).ok().filter(|&count| count > 0).ok_or_else(too_many)?;
        let size = components * kind.size();
        let base = match accessor.buffer_view {
            None => None,
            Some(view) => {
                let view = document.view(view.value(), &at("bufferView"))?;
                let stride = view.stride.unwrap_or(size);
                if stride < size {
                    let problem = format!(
                        "expected at least {size}, the size of an element of {pointer}, found {stride}: elements \
                         would overlap"
                    );
                    return Err(document.error(format!("{}/byteStride", view.pointer), problem));
                }
                let offset = accessor.byte_offset.unwrap_or_default().0;
                // The last element ends at offset + stride·(count − 1) + size.
                let end = (count as u64 - 1)
                    .checked_mul(stride as u64)
                    .and_then(|last| last.checked_add(size as u64)?.checked_add(offset));
                if end.is_none_or(|end| end > view.bytes.len() as u64) {
                    let problem = format!(
                        "expected {count} elements of {size} bytes every {stride} from byte {offset} to fit in {}, \
                         found only {} bytes there",
                        view.pointer,
                        view.bytes.len()
                    );
                    return Err(document.error(&pointer, problem));
                }
                Some(Strided { bytes: view.bytes[offset as usize..].into(), stride })
            }
        };
        let sparse = match &accessor.sparse {
            None => None,
            Some(sparse) => Some(Sparse::open(document, sparse, &at("sparse"), count, size)?),
        };
        Ok(Accessor { pointer, count, components, kind, normalized: accessor.normalized, base, sparse })
    }

    /// The same with other values: what a compressed stream holds in the place of the accessor's bytes.
    #[cfg(feature = "draco")]
    pub(super) fn holding(self, values: Values) -> Accessor<'d> {
        let Values { bytes, count, components, kind } = values;
        let base = Some(Strided { bytes: bytes.into(), stride: components * kind.size() });
        Accessor { count, components, kind, base, sparse: None, ..self }
    }

    /// Indices that a compressed stream holds.
    #[cfg(feature = "draco")]
    pub(super) fn of_indices(bytes: Vec<u8>, pointer: String) -> Accessor<'d> {
        let (kind, count) = (ComponentType::U32, bytes.len() / 4);
        let base = Some(Strided { bytes: bytes.into(), stride: 4 });
        Accessor { pointer, count, components: 1, kind, normalized: false, base, sparse: None }
    }

    /// Fails unless elements have one of the given numbers of components.
    pub(super) fn expect_components(&self, document: &Document, accepted: &[usize]) -> Result<()> {
        if accepted.contains(&self.components) {
            return Ok(());
        }
        let name = |n: &usize| *["SCALAR", "VEC2", "VEC3", "VEC4"].get(n - 1).unwrap_or(&"MAT4");
        let names: Vec<&str> = accepted.iter().map(name).collect();
        let problem = format!("expected {}, found {} components", names.join(" or "), self.components);
        Err(document.error(format!("{}/type", self.pointer), problem))
    }

    /// Fails unless elements are unsigned integers, as indices must be.
    pub(super) fn expect_indices(&self, document: &Document) -> Result<()> {
        self.expect_components(document, &[1])?;
        self.expect_unsigned(document)
    }

    /// Fails unless elements are of unsigned integers.
    pub(super) fn expect_unsigned(&self, document: &Document) -> Result<()> {
        match self.kind {
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32 => Ok(()),
            other => {
                let problem = format!("expected unsigned integers for indices, found {other:?}");
                Err(document.error(format!("{}/componentType", self.pointer), problem))
            }
        }
    }

    /// Fails unless elements are floats, or, where that is accepted, integers that encode them.
    pub(super) fn expect_floats(&self, document: &Document, normalized_too: bool) -> Result<()> {
        let small = !matches!(self.kind, ComponentType::F32 | ComponentType::U32);
        if self.kind == ComponentType::F32 || (normalized_too && self.normalized && small) {
            return Ok(());
        }
        let also = if normalized_too { " or normalized integers of 8 or 16 bits" } else { "" };
        let problem = format!("expected floats{also}, found {:?}", self.kind);
        Err(document.error(format!("{}/componentType", self.pointer), problem))
    }

    /// Element `element` as an index. Callers have checked `expect_indices`.
    pub(super) fn index(&self, element: usize) -> u32 {
        self.element(element).map_or(0, |bytes| unsigned(bytes, self.kind))
    }

    /// Element `element` as up to four unsigned integers.
    pub(super) fn integers(&self, element: usize) -> [u32; 4] {
        let Some(bytes) = self.element(element) else { return [0; 4] };
        let mut components = bytes.chunks_exact(self.kind.size()).map(|bytes| unsigned(bytes, self.kind));
        std::array::from_fn(|_| components.next().unwrap_or(0))
    }

    /// The first `N` components of element `element`; missing components are 0.
    pub(super) fn vector<const N: usize>(&self, element: usize) -> [f32; N] {
        let Some(bytes) = self.element(element) else { return [0.0; N] };
        if self.kind == ComponentType::F32 {
            // Without dividing by a size that is known here.
            let words = bytes.as_chunks().0;
            return std::array::from_fn(|i| words.get(i).map_or(0.0, |&word| f32::from_le_bytes(word)));
        }
        let mut components =
            bytes.chunks_exact(self.kind.size()).map(|bytes| component(bytes, self.kind, self.normalized));
        std::array::from_fn(|_| components.next().unwrap_or(0.0))
    }

    /// Bytes of one element; `None` where the accessor is implicitly zero.
    fn element(&self, element: usize) -> Option<&[u8]> {
        let size = self.components * self.kind.size();
        if let Some(sparse) = &self.sparse
            && let Ok(place) = sparse.elements.binary_search(&element)
        {
            return sparse.values.get(place * size..(place + 1) * size);
        }
        let base = self.base.as_ref()?;
        base.bytes.get(element * base.stride..element * base.stride + size)
    }
}

impl<'d> Sparse<'d> {
    fn open(
        document: &'d Document,
        sparse: &gltf::json::accessor::sparse::Sparse,
        pointer: &str,
        elements: usize,
        size: usize,
    ) -> Result<Sparse<'d>> {
        let at = |member: &str| format!("{pointer}/{member}");
        let count =
            usize::try_from(sparse.count.0).ok().filter(|count| (1..=elements).contains(count)).ok_or_else(|| {
                document.error(
                    at("count"),
                    format!("expected 1 to {elements}, the accessor's count, found {}", sparse.count.0),
                )
            })?;
        let IndexComponentType(kind) = document.checked(sparse.indices.component_type, &at("indices/componentType"))?;
        let packed = |member: &str, view: usize, offset: u64, size: usize| -> Result<&'d [u8]> {
            let view = document.view(view, &at(&format!("{member}/bufferView")))?;
            let range =
                (count as u64).checked_mul(size as u64).and_then(|length| Some((offset, offset.checked_add(length)?)));
            let range = range.filter(|&(_, end)| end <= view.bytes.len() as u64);
            range.map(|(start, end)| &view.bytes[start as usize..end as usize]).ok_or_else(|| {
                let (whole, found) = (&view.pointer, view.bytes.len());
                let wanted = format!("{count} elements of {size} bytes from byte {offset} to fit in {whole}");
                document.error(at(member), format!("expected {wanted}, found {found} bytes"))
            })
        };
        let indices = packed("indices", sparse.indices.buffer_view.value(), sparse.indices.byte_offset.0, kind.size())?;
        let values = packed("values", sparse.values.buffer_view.value(), sparse.values.byte_offset.0, size)?;
        document.charge(count, pointer)?;
        let chosen: Vec<usize> =
            indices.chunks_exact(kind.size()).map(|bytes| unsigned(bytes, kind) as usize).collect();
        if let Some(place) = chosen.windows(2).position(|pair| pair[0] >= pair[1]) {
            let problem =
                format!("expected strictly increasing indices, found {} after {}", chosen[place + 1], chosen[place]);
            return Err(document.error(at("indices"), problem));
        }
        match chosen.last() {
            Some(&last) if last >= elements => Err(document.error(
                at("indices"),
                format!("expected indices below {elements}, the accessor's count, found {last}"),
            )),
            _ => Ok(Sparse { elements: chosen, values }),
        }
    }
}

fn unsigned(bytes: &[u8], kind: ComponentType) -> u32 {
    match (kind, bytes) {
        (ComponentType::U8, &[a, ..]) => a.into(),
        (ComponentType::U16, &[a, b, ..]) => u16::from_le_bytes([a, b]).into(),
        (ComponentType::U32, &[a, b, c, d, ..]) => u32::from_le_bytes([a, b, c, d]),
        _ => 0,
    }
}

fn component(bytes: &[u8], kind: ComponentType, normalized: bool) -> f32 {
    let (value, largest) = match (kind, bytes) {
        (ComponentType::F32, &[a, b, c, d]) => return f32::from_le_bytes([a, b, c, d]),
        (ComponentType::I8, &[a]) => (f64::from(a as i8), f64::from(i8::MAX)),
        (ComponentType::U8, &[a]) => (f64::from(a), f64::from(u8::MAX)),
        (ComponentType::I16, &[a, b]) => (f64::from(i16::from_le_bytes([a, b])), f64::from(i16::MAX)),
        (ComponentType::U16, &[a, b]) => (f64::from(u16::from_le_bytes([a, b])), f64::from(u16::MAX)),
        (ComponentType::U32, &[a, b, c, d]) => (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX)),
        _ => return 0.0,
    };
    // Signed integers have one value below −1, which is −1 (glTF 2.0 §3.11).
    (if normalized { (value / largest).max(-1.0) } else { value }) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the table of glTF 2.0 §3.11. Exact. No randomness.
    #[test]
    fn integers_convert_as_the_specification_says() {
        let normalized = |bytes: &[u8], kind| component(bytes, kind, true);
        assert_eq!(normalized(&[255], ComponentType::U8), 1.0);
        assert_eq!(normalized(&[51], ComponentType::U8), 0.2);
        assert_eq!(normalized(&[0x80], ComponentType::I8), -1.0);
        assert_eq!(normalized(&[0x81], ComponentType::I8), -1.0);
        assert_eq!(normalized(&[0xff, 0xff], ComponentType::U16), 1.0);
        assert_eq!(normalized(&[0x00, 0x80], ComponentType::I16), -1.0);
        assert_eq!(component(&[0x00, 0x80], ComponentType::I16, false), -32768.0);
        assert_eq!(component(&1.5f32.to_le_bytes(), ComponentType::F32, true), 1.5);
    }
}
