//! Which images are woven: those of 8 bits and of one size that a material reads at the same point, in memory. An image
//! is woven once, with what the first material reads beside it; all textures made of it follow. No value changes.

use super::plane::Plane;
use super::texels::{Texels, Texture};

/// Weaves what can be of the textures numbered `together`.
pub fn weave(textures: &mut [Texture], together: &[usize]) {
    let Some(&first) = together.first() else { return };
    let size = (textures[first].width, textures[first].height);
    let mut planes: Vec<Plane<[u8; 4]>> = Vec::new();
    for texture in together.iter().filter_map(|&i| textures.get(i)) {
        let Texels::Eight(plane) = &texture.texels else { continue };
        let fits = (texture.width, texture.height) == size && plane.stride == 1 && plane.len() == size.0 * size.1;
        if fits && !planes.iter().any(|other| other.shares(plane)) {
            planes.push(plane.clone());
        }
    }
    let woven = match planes.as_slice() {
        [a, b] => Plane::woven([a, b]).to_vec(),
        [a, b, c] => Plane::woven([a, b, c]).to_vec(),
        _ => return,
    };
    for texture in textures {
        let Texels::Eight(plane) = &mut texture.texels else { continue };
        if let Some(place) = planes.iter().position(|old| old.shares(plane)) {
            // Its levels are those of its colour space.
            *plane = Plane { coarser: std::mem::take(&mut plane.coarser), ..woven[place].clone() };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::color::ColorSpace;
    use super::super::lookup::{lookup, lookup_filtered};
    use super::super::taps::Wrap;
    use super::*;

    fn texture(texels: Texels, (width, height): (usize, usize)) -> Texture {
        let (wrap_u, wrap_v) = (Wrap::Repeat, Wrap::MirroredRepeat);
        let color_space = ColorSpace::Linear;
        Texture { name: String::new(), width, height, texels, color_space, wrap_u, wrap_v, bilinear: true }
    }

    /// Oracle: the textures as they were; every texel, level, sum of bytes and look-up, exactly. The fourth texture is
    /// of the first one's image, the fifth of another size. Deterministic.
    #[test]
    fn weaving_changes_no_value_and_takes_no_memory() {
        let image = |seed: usize, texels: usize| -> Texels {
            (0..texels).map(|i| ((i * 4 + seed) as u32).wrapping_mul(0x9E37_79B9).to_le_bytes()).collect()
        };
        let size = (7, 4);
        let images: Vec<Texels> = (0..3).map(|seed| image(seed, 28)).collect();
        let mut before: Vec<Texture> = images.iter().map(|image| texture(image.clone(), size)).collect();
        before.push(Texture { color_space: ColorSpace::Srgb, ..texture(images[0].clone(), size) });
        before.push(texture(image(3, 15), (5, 3)));
        for together in [vec![0, 4, 1, 2], vec![2, 0, 0], vec![4, 3], vec![0], vec![]] {
            let mut after = before.clone();
            weave(&mut after, &together);
            weave(&mut after, &[1, 2]);
            let woven = |i: usize| matches!(&after[i].texels, Texels::Eight(plane) if plane.stride > 1);
            assert!(woven(2), "the last pair at least");
            assert_eq!((woven(0), woven(4)), (woven(3), false), "all textures of an image, none of another size");
            assert!(after[0].texels.shares(&after[3].texels) && !after[1].texels.shares(&after[2].texels));
            for (before, after) in before.iter().zip(&after) {
                after.make_levels();
                before.make_levels();
                assert_eq!(before.texels.eight(), after.texels.eight());
                assert_eq!(before.texels.bytes(), after.texels.bytes());
                assert_eq!((before.mean(), before.problem()), (after.mean(), after.problem()));
                for i in 0..100 {
                    let uv = glam::Vec2::new(i as f32 * 0.37 - 9.0, i as f32 * 0.11);
                    assert_eq!(lookup(before, uv), lookup(after, uv));
                    let width = i as f32 * 0.01;
                    assert_eq!(lookup_filtered(before, uv, width), lookup_filtered(after, uv, width));
                }
            }
        }
    }
}
