//! Tiled TIFF files as `maketx` writes them, without compression: what tests need and no crate here writes.
//!
//! Source: TIFF 6.0, sections 2 and 15. An ASCII tag of Pixar's, "textureformat", makes readers take the images of a
//! file as the levels of one.

use std::path::Path;

/// RGBA, row-major from the top.
#[derive(Clone)]
pub enum Texels {
    Eight(Vec<[u8; 4]>),
    Float(Vec<[f32; 4]>),
}

impl Texels {
    fn texel(&self, i: usize) -> Vec<u8> {
        match self {
            Texels::Eight(all) => all[i].to_vec(),
            Texels::Float(all) => all[i].iter().flat_map(|c| c.to_le_bytes()).collect(),
        }
    }

    fn bits(&self) -> u16 {
        if matches!(self, Texels::Eight(_)) { 8 } else { 32 }
    }
}

const SHORT: u16 = 3;
const LONG: u16 = 4;
const ASCII: u16 = 2;

/// Tags whose value is a size of the image or of its tiles.
const SIZES: [u16; 4] = [256, 257, 322, 323];

/// Writes levels: columns, rows, the side of a tile (a multiple of 16), texels.
pub fn write_tiled(path: &Path, levels: &[(usize, usize, u32, &Texels)]) {
    let mut bytes = b"II*\0\0\0\0\0".to_vec();
    let mut link = 4;
    for &(width, height, tile, texels) in levels {
        let side = tile as usize;
        let (mut places, mut lengths) = (Vec::new(), Vec::new());
        for top in (0..height).step_by(side) {
            for left in (0..width).step_by(side) {
                places.push(bytes.len() as u32);
                for y in top..top + side {
                    for x in left..left + side {
                        bytes.extend(texels.texel(y.min(height - 1) * width + x.min(width - 1)));
                    }
                }
                lengths.push(bytes.len() as u32 - places[places.len() - 1]);
            }
        }
        let [bits, kind] = [texels.bits(), if texels.bits() == 8 { 1 } else { 3 }];
        let longs = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let shorts = |values: &[u16]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let tags = [
            (256, LONG, longs(&[width as u32])),
            (257, LONG, longs(&[height as u32])),
            (258, SHORT, shorts(&[bits; 4])),
            (259, SHORT, shorts(&[1])),
            (262, SHORT, shorts(&[2])),
            (277, SHORT, shorts(&[4])),
            (284, SHORT, shorts(&[1])),
            (322, LONG, longs(&[tile])),
            (323, LONG, longs(&[tile])),
            (324, LONG, longs(&places)),
            (325, LONG, longs(&lengths)),
            (338, SHORT, shorts(&[2])),
            (339, SHORT, shorts(&[kind; 4])),
            (33302, ASCII, b"Plain Texture\0".to_vec()),
        ];
        // Values that take more than four bytes lie before the directory, which begins at an even byte.
        let mut directory = (tags.len() as u16).to_le_bytes().to_vec();
        for (tag, kind, value) in tags {
            let size = if kind == SHORT {
                2
            } else if kind == LONG {
                4
            } else {
                1
            };
            directory.extend(u16::to_le_bytes(tag));
            directory.extend(kind.to_le_bytes());
            directory.extend((value.len() as u32 / size).to_le_bytes());
            if value.len() <= 4 {
                directory.extend(value.iter().copied().chain([0; 4]).take(4));
            } else {
                bytes.resize(bytes.len().next_multiple_of(2), 0);
                directory.extend((bytes.len() as u32).to_le_bytes());
                bytes.extend(value);
            }
        }
        bytes.resize(bytes.len().next_multiple_of(2), 0);
        let place = (bytes.len() as u32).to_le_bytes();
        bytes[link..link + 4].copy_from_slice(&place);
        bytes.extend(directory);
        link = bytes.len();
        bytes.extend([0; 4]);
    }
    std::fs::write(path, bytes).expect("a temporary directory can be written");
}

/// Makes the first image of a file, and its tiles, squares of that side; the bytes of its texels stay as they are.
pub fn resize(bytes: &mut [u8], side: u32) {
    let at = |bytes: &[u8], i: usize| u32::from_le_bytes([bytes[i], bytes[i + 1], bytes[i + 2], bytes[i + 3]]) as usize;
    let directory = at(bytes, 4);
    let count = u16::from_le_bytes([bytes[directory], bytes[directory + 1]]);
    for entry in (0..usize::from(count)).map(|i| directory + 2 + 12 * i) {
        if SIZES.contains(&u16::from_le_bytes([bytes[entry], bytes[entry + 1]])) {
            bytes[entry + 8..entry + 12].copy_from_slice(&side.to_le_bytes());
        }
    }
}
