//! KTX2 images of Basis Universal (ETC1S and UASTC, with Zstandard or without): KHR_texture_basisu. Decoded to 8 bits a
//! channel by the crate `basisu` (pure Rust), whatever else decodes images.
//!
//! The largest level alone is read: pyramids are made as for any other image. Limits: no cubes, arrays, videos or
//! volumes, no high dynamic range, no KTX2 of other formats (the extension allows none of them).

use std::borrow::Cow;

use basisu::{DecodeFlags, SourceFormat, TargetFormat, Transcoder};

use super::encoded::{Encoded, Header, check_size};
use super::image::Image;
use crate::input;

/// Reads the header alone. The error says what was expected and found.
pub(super) fn inspect(encoded: Encoded) -> Result<Header, String> {
    let bytes = bytes(encoded)?;
    let (width, height) = size(&bytes)?;
    let texels = check_size(u64::from(width), u64::from(height), bytes.len() as u64)?;
    Ok(Header { texels, bytes: 4 * texels })
}

/// Decodes the largest level. The error says what was expected and found.
pub(super) fn decode(encoded: Encoded) -> Result<Image, String> {
    let bytes = bytes(encoded)?;
    let (width, height) = size(&bytes)?;
    check_size(u64::from(width), u64::from(height), bytes.len() as u64)?;
    let transcoder = Transcoder::new(&bytes).map_err(|reason| broken(&format!("{reason:?}")))?;
    if !matches!(transcoder.source_format(), SourceFormat::Etc1s | SourceFormat::UastcLdr) {
        return Err(broken(&format!("{:?}", transcoder.source_format())));
    }
    let texels = transcoder.transcode(0, TargetFormat::Rgba32, DecodeFlags::NONE);
    let texels = texels.map_err(|reason| broken(&format!("{reason:?}")))?;
    let (width, height) = (width as usize, height as usize);
    if texels.len() != 4 * width * height {
        return Err(broken("another number of texels than its header says"));
    }
    let texels: Vec<[u8; 4]> = texels.as_chunks().0.to_vec();
    Ok(Image { width, height, texels: texels.into(), integers: true })
}

fn broken(reason: &str) -> String {
    format!("expected a KTX2 image of Basis Universal (ETC1S or UASTC), found {reason}")
}

fn bytes(encoded: Encoded<'_>) -> Result<Cow<'_, [u8]>, String> {
    match encoded {
        Encoded::File(path) => input::read(path).map(Cow::Owned).map_err(|reason| reason.to_string()),
        Encoded::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
    }
}

/// Columns and rows, as the header says (KTX 2.0 §3: words after the magic). What the decoder would believe is looked
/// at before: the kind of image, its model of colours (163: ETC1S, 166: UASTC), and the bytes that the largest level
/// has without Zstandard.
fn size(bytes: &[u8]) -> Result<(u32, u32), String> {
    let word = |at: usize| {
        let four = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?))
    };
    let cut_off = || broken("a header that is cut off");
    let mut header = [0; 11];
    for (place, number) in header.iter_mut().enumerate() {
        *number = word(12 + 4 * place).ok_or_else(cut_off)?;
    }
    let [format, _, width, height, depth, layers, faces, _, packed, descriptor, _] = header;
    let model = word((descriptor as usize).saturating_add(12)).ok_or_else(cut_off)? & 0xff;
    if format != 0 || depth > 0 || layers > 1 || faces != 1 || !matches!((model, packed), (163, 1) | (166, 0 | 2)) {
        let what =
            format!("format {format} (model {model}, supercompression {packed}), {depth} slices, {layers} layers");
        return Err(broken(&format!("{what} and {faces} faces")));
    }
    let [low, high] = [word(96).ok_or_else(cut_off)?, word(100).ok_or_else(cut_off)?];
    let (unpacked, blocks) = ((u64::from(high) << 32) | u64::from(low), |texels: u32| u64::from(texels).div_ceil(4));
    let most = blocks(width).saturating_mul(blocks(height)).saturating_mul(16);
    if unpacked > most {
        return Err(broken(&format!("{unpacked} bytes of a level of {width} × {height} texels")));
    }
    Ok((width, height))
}

#[cfg(test)]
mod tests {
    use super::super::encoded::KTX2;
    use super::*;
    use base64::Engine;

    /// Four blocks of 4 × 4 texels, the lower ones cut off after two rows: red, green; blue, grey. By the reference
    /// encoder (Basis Universal 2.10): ETC1S; UASTC with alpha ¼ on the left; UASTC in Zstandard with four levels.
    const FILES: [(&str, u8, u8); 3] = [
        (
            "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAABgAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAACwAAACUAAAAJAAAALgAAAAAAAAAlAAA\
             AAAAAABMAQAAAAAAAAIAAAAAAAAAAAAAAAAAAAAsAAAAAAAAAAIAKACjAQIAAwMAAAgAAAAAAAAAAAA/AAAAAAAAAAAA/////x8A\
             AABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAwA0AAAADQAAACsAAAAAAAAAAAAAAAAAAAACAAAAAAAAAAAAAAAg\
             QBQAAQAAQBA9d/i9AKYEAAAAAACQ7AALYErAAAAAAAgrwHBHAKYACAAAAIAg6YT12g4AVFVVVQUAAACoqqqqAgDBRAAAAAAAAPJf\
             TQCYAAAAAAAAQCAAJgAIAAAAQKA4AJgAAAAAAABAAAHUAw==",
            255,
            8,
        ),
        (
            "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAABgAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAAAAAAAAAA\
             AAAAAADAAAAAAAAAAEAAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8A\
             AABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAAFxkFBSjIxgAAAAAAAAAAABcFGeU/MNkAAAAAAAAAAAAX\
             BQUZKDAmAwAAAAAAAAAAFw8P7x81xgAAAAAAAAAAAA==",
            64,
            1,
        ),
        (
            "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAABgAAAAAAAAAAAAAAAQAAAAQAAAACAAAAsAAAACwAAADcAAAAJAAAAAAAAAAAAAAAAAAA\
             AAAAAABLAQAAAAAAAC8AAAAAAAAAQAAAAAAAAAAyAQAAAAAAABkAAAAAAAAAEAAAAAAAAAAZAQAAAAAAABkAAAAAAAAAEAAAAAAA\
             AAAAAQAAAAAAABkAAAAAAAAAEAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AAAAAAAAAAAA/////x8AAABL\
             VFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAACi1L/0gEIEAALfQMO0/iNEBAAAAAAAAAAAotS/9IBCBAAAxQnv2Zb2UR/H/\
             8P/w//D/KLUv/SAQgQAAEzQAnnXhc5Q0eZYRiP9/ACi1L/0gQDUBANAXGQXlP8jGABcFGeU/MNkF+T8wJgMPD+8fNQQAU20NSplp\
             DAG4",
            255,
            1,
        ),
    ];

    fn file(place: usize) -> Vec<u8> {
        base64::engine::general_purpose::STANDARD.decode(FILES[place].0).expect("base64")
    }

    /// Oracle: the picture that the reference encoder was given, within what its formats keep: 8 in ETC1S (colours of 5
    /// bits), 1 in UASTC.
    #[test]
    fn files_of_the_reference_encoder_are_read() {
        for (place, &(_, left_alpha, off)) in FILES.iter().enumerate() {
            let bytes = file(place);
            assert!(bytes.starts_with(KTX2));
            assert_eq!(inspect(Encoded::Bytes(&bytes)), Ok(Header { texels: 48, bytes: 192 }));
            let image = decode(Encoded::Bytes(&bytes)).expect("a valid file");
            let super::super::texels::Texels::Eight(plane) = &image.texels else { panic!("eight bits") };
            for (i, texel) in plane.base.iter().enumerate() {
                let (left, upper) = (i % 8 < 4, i / 8 < 4);
                let [r, g, b] = match (left, upper) {
                    (true, true) => [200, 40, 40],
                    (false, true) => [40, 200, 40],
                    (true, false) => [40, 40, 200],
                    (false, false) => [120; 3],
                };
                let expected = [r, g, b, if left { left_alpha } else { 255 }];
                assert!(texel.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= off), "{i}: {texel:?}, {expected:?}");
            }
        }
    }

    /// Oracle: no panic, and a word of what was expected. The seeds are fixed.
    #[test]
    fn broken_files_are_refused() {
        let mut random = 0x9e37_79b9_7f4a_7c15u64;
        let mut refused = 0;
        for round in 0..600 {
            let mut bytes = file(round % 3);
            for _ in 0..3 {
                random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                let at = KTX2.len() + (random >> 34) as usize % (bytes.len() - KTX2.len());
                bytes[at] ^= 1 << (random >> 61);
            }
            if round % 5 == 0 {
                bytes.truncate(bytes.len() / 2);
            }
            if let Err(problem) = decode(Encoded::Bytes(&bytes)) {
                assert!(problem.contains("expected"), "{problem}");
                refused += 1;
            }
        }
        assert!(refused > 60, "{refused} of 600");
    }
}
