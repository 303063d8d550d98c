//! UDIM: several images side by side, one for each unit square of texture coordinates. Number 1001 + column + 10·row,
//! with ten columns and rows that count *upwards*, as the modelling tools count v; v of glTF points down (glTF 2.0
//! §3.8.4), so glTF's v ∈ (0, 1] is row 0 and v ∈ (−1, 0] is row 1.
//!
//! Each image is clamped at its own edge. Where there is none, the texel is black and opaque.

use glam::{Vec2, Vec4};

/// What stands in a URI for the number.
pub const MARK: &str = "<UDIM>";

/// Columns of the grid.
const COLUMNS: f32 = 10.0;
/// First number.
const FIRST: u32 = 1001;
/// Last number.
const LAST: u32 = 1100;

/// Value where there is no image.
pub(super) const ABSENT: Vec4 = Vec4::new(0.0, 0.0, 0.0, 1.0);

/// The images of one texture.
#[derive(Clone, Debug)]
pub struct Udim<T> {
    pages: Vec<(u32, T)>,
    /// Index into `pages` by number − 1001, or 255.
    place: [u8; (LAST - FIRST + 1) as usize],
}

/// Every number there can be.
pub fn numbers() -> std::ops::RangeInclusive<u32> {
    FIRST..=LAST
}

impl<T> Udim<T> {
    /// Puts images with their numbers together; numbers outside of the grid are left out.
    pub fn new(pages: Vec<(u32, T)>) -> Self {
        let mut place = [u8::MAX; (LAST - FIRST + 1) as usize];
        for (i, (number, _)) in pages.iter().enumerate() {
            if numbers().contains(number) {
                place[(number - FIRST) as usize] = i as u8;
            }
        }
        Udim { pages, place }
    }

    /// The images with their numbers.
    pub fn pages(&self) -> impl Iterator<Item = (u32, &T)> {
        self.pages.iter().map(|(number, page)| (*number, page))
    }

    /// The image at a coordinate and the coordinate within it.
    pub fn at(&self, uv: Vec2) -> Option<(&T, Vec2)> {
        // The row counts upwards, and v = 0 is its upper end.
        let (column, row) = (uv.x.floor(), -uv.y.ceil() + 1.0);
        let inside = (0.0..COLUMNS).contains(&column) && (0.0..COLUMNS).contains(&row);
        let page = self.place[if inside { (column + COLUMNS * row) as usize } else { return None }];
        let (_, image) = self.pages.get(usize::from(page))?;
        Some((image, Vec2::new(uv.x - column, uv.y + row)))
    }
}
