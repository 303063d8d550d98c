//! The tiles that workers take: squares of the window, their pixels along a Morton curve (Morton 1966), so that
//! neighbours share packets of rays. Pixels are those of the full image; the cut has no part in the picture.

use crate::plan::options::Crop;

/// Side of a tile, pixels; a power of two, as the curve needs it.
const SIDE: u32 = 16;

/// Pixels of one tile, full-image coordinates.
pub(super) struct Tile {
    /// Columns and rows, along the curve.
    pub pixels: Vec<(u32, u32)>,
}

/// The window cut into tiles, row by row; those at the right and lower border are cut.
pub(super) fn tiles(window: Crop) -> Vec<Tile> {
    let mut tiles = Vec::new();
    for ty in (0..window.height).step_by(SIDE as usize) {
        for tx in (0..window.width).step_by(SIDE as usize) {
            let mut pixels = Vec::with_capacity((SIDE * SIDE) as usize);
            for code in 0..SIDE * SIDE {
                let (x, y) = (tx + even_bits(code), ty + even_bits(code >> 1));
                if x < window.width && y < window.height {
                    pixels.push((window.x + x, window.y + y));
                }
            }
            tiles.push(Tile { pixels });
        }
    }
    tiles
}

/// Bits 0, 2, 4, … of `code`, packed.
fn even_bits(code: u32) -> u32 {
    (0..8).fold(0, |packed, bit| packed | (((code >> (2 * bit)) & 1) << bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: the window itself. Deterministic.
    #[test]
    fn every_pixel_of_the_window_lies_in_one_tile() {
        let window = Crop { x: 5, y: 3, width: 37, height: 18 };
        let tiles = tiles(window);
        assert_eq!(tiles.iter().map(|tile| tile.pixels.len()).collect::<Vec<_>>(), [256, 256, 80, 32, 32, 10]);
        let mut pixels: Vec<_> = tiles.iter().flat_map(|tile| tile.pixels.iter().map(|&(x, y)| (y, x))).collect();
        pixels.sort_unstable();
        let expected = (3..21).flat_map(|y| (5..42).map(move |x| (y, x)));
        assert!(pixels.into_iter().eq(expected));
    }

    /// Oracle: the curve drawn by hand; four pixels in a row are a square of two by two.
    #[test]
    fn neighbours_on_the_curve_are_neighbours_in_the_picture() {
        let tile = &tiles(Crop { x: 0, y: 0, width: 16, height: 16 })[0];
        assert_eq!(tile.pixels[..8], [(0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (3, 0), (2, 1), (3, 1)]);
        assert_eq!(tile.pixels[255], (15, 15));
    }
}
