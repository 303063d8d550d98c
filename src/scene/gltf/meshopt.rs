//! Streams of meshoptimizer: the bytes of a buffer view by EXT_meshopt_compression and KHR_meshopt_compression, decoded
//! by the crate `meshoptimizer-rs` (pure Rust). Knows nothing of documents.
//!
//! Source: the two extensions' appendices; KHR adds version 1 of the attribute stream and the filter COLOR. Both are
//! read under either name. Limit: a stream of n bytes is taken to hold at most [`MOST_PER_BYTE`]·n.

use meshoptimizer_rs::codec;
use meshoptimizer_rs::{Error, Limits, Workspace};

/// Bytes that a byte of a stream may make: attribute streams of version 1 state four constant bytes of 256 elements
/// in one.
const MOST_PER_BYTE: usize = 1024;

/// What a view says of its stream.
pub(super) struct Stream<'s> {
    pub(super) bytes: &'s [u8],
    pub(super) mode: &'s str,
    /// `NONE` where the file has none.
    pub(super) filter: &'s str,
    /// Elements.
    pub(super) count: usize,
    /// Bytes of an element.
    pub(super) stride: usize,
}

impl Stream<'_> {
    /// Bytes of the elements; the error says what was expected.
    pub(super) fn length(&self) -> Result<usize, String> {
        let length = self.count.checked_mul(self.stride).filter(|&length| length > 0);
        let most = self.bytes.len().saturating_mul(MOST_PER_BYTE);
        length.filter(|&length| length <= most).ok_or_else(|| {
            let (count, stride, held) = (self.count, self.stride, self.bytes.len());
            format!("expected at most {most} bytes of elements in {held} bytes, found {count} elements of {stride}")
        })
    }

    /// The elements, one after the other; the error says what was expected. Callers have accounted for
    /// [`length`](Self::length).
    pub(super) fn decode(&self) -> Result<Vec<u8>, String> {
        let length = self.length()?;
        let mut workspace = Workspace::new(Limits { max_bytes: length.saturating_add(1 << 20), ..Limits::default() });
        self.decode_within(&mut workspace).map_err(|reason| {
            let (mode, count, stride) = (self.mode, self.count, self.stride);
            format!("expected a meshopt stream ({mode}) of {count} elements of {stride} bytes, found {reason}")
        })
    }

    fn decode_within(&self, workspace: &mut Workspace) -> Result<Vec<u8>, Error> {
        let Stream { bytes, mode, filter, count, stride } = *self;
        let mut elements = match mode {
            "ATTRIBUTES" => codec::decode_vertex_buffer(count, stride, bytes, workspace)?,
            "TRIANGLES" => codec::decode_index_buffer(count, stride, bytes, workspace)?,
            "INDICES" => codec::decode_index_sequence(count, stride, bytes, workspace)?,
            _ => return Err(Error::InvalidParameter),
        };
        match filter {
            "NONE" => {}
            // Filters are of attributes.
            _ if mode != "ATTRIBUTES" => return Err(Error::InvalidParameter),
            "OCTAHEDRAL" => codec::decode_filter_oct(&mut elements, count, stride, workspace)?,
            "QUATERNION" => codec::decode_filter_quat(&mut elements, count, stride, workspace)?,
            "EXPONENTIAL" => codec::decode_filter_exp(&mut elements, count, stride, workspace)?,
            "COLOR" => codec::decode_filter_color(&mut elements, count, stride, workspace)?,
            _ => return Err(Error::InvalidParameter),
        }
        Ok(elements)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use meshoptimizer_rs::codec::{IndexEncoding, VertexEncoding};

    fn stream<'s>(bytes: &'s [u8], mode: &'s str, filter: &'s str, (count, stride): (usize, usize)) -> Stream<'s> {
        Stream { bytes, mode, filter, count, stride }
    }

    /// Oracle: what went into the encoder of the crate, in both versions of the attribute stream. Exact.
    #[test]
    fn streams_hold_what_was_put_in() {
        let mut workspace = Workspace::default();
        let numbers: Vec<u8> = (0..600u32).flat_map(|i| (i * i % 977).to_le_bytes()).collect();
        for version in [0, 1] {
            let encoding = VertexEncoding::new(version, 2).expect("a version and a level");
            let bytes = codec::encode_vertex_buffer(&numbers, 200, 12, encoding, &mut workspace).expect("encoded");
            assert_eq!(stream(&bytes, "ATTRIBUTES", "NONE", (200, 12)).decode().as_deref(), Ok(&numbers[..]));
            for wrong in [(200, 16), (2000, 12), (200, 0), (usize::MAX, 12), (0, 12)] {
                assert!(stream(&bytes, "ATTRIBUTES", "NONE", wrong).decode().is_err(), "{wrong:?}");
            }
            assert!(stream(&bytes, "TRIANGLES", "NONE", (600, 4)).decode().is_err());
            assert!(stream(&bytes, "ATTRIBUTES", "OCTAHEDRAL", (200, 12)).decode().is_err());
            assert!(stream(&bytes, "ATTRIBUTES", "ELSE", (200, 12)).decode().is_err());
        }
        let indices: Vec<u32> = (0..300).map(|i| i / 3 + i % 3).collect();
        let bytes = codec::encode_index_sequence_generic(&indices, IndexEncoding::DEFAULT, &mut workspace);
        let expected: Vec<u8> = indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect();
        assert_eq!(stream(&bytes.expect("encoded"), "INDICES", "NONE", (300, 2)).decode(), Ok(expected));
    }

    /// Oracle: the filters' definitions. Octahedral: (0, 0) at scale 127 is +z, (127, 0) is +x; w stays. Exponential:
    /// mantissa 3 and exponent −1 make 1.5. Exact.
    #[test]
    fn filters_make_the_numbers_that_their_text_says() {
        let mut workspace = Workspace::default();
        let mut decoded = |elements: &[u8], filter: &str, stride: usize| {
            let count = elements.len() / stride;
            let bytes = codec::encode_vertex_buffer(elements, count, stride, VertexEncoding::DEFAULT, &mut workspace);
            stream(&bytes.expect("encoded"), "ATTRIBUTES", filter, (count, stride)).decode().expect("decoded")
        };
        assert_eq!(decoded(&[0, 0, 127, 5, 127, 0, 127, 6], "OCTAHEDRAL", 4), [0, 0, 127, 5, 127, 0, 0, 6]);
        let exponential = (255u32 << 24 | 3).to_le_bytes();
        assert_eq!(decoded(&exponential, "EXPONENTIAL", 4), 1.5f32.to_le_bytes());
    }
}
