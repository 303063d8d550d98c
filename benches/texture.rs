//! Look-ups: `texture/FILTER/ORDER` in a picture of 1024 × 1024 texels (4 MB), along a line or anywhere.

mod common;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput};
use glam::Vec2;
use pathspace::scene::{ColorSpace, Texture, Wrap};
use pathspace::texture;

const SIDE: usize = 1024;
const LOOKUPS: usize = 4096;

fn picture(bilinear: bool) -> Texture {
    let texels = (0..SIDE * SIDE).map(|i| (i as u32).wrapping_mul(0x9e37_79b9).to_le_bytes());
    Texture {
        name: "noise".into(),
        width: SIDE,
        height: SIDE,
        texels: texels.collect(),
        color_space: ColorSpace::Srgb,
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        bilinear,
    }
}

fn texture(criterion: &mut Criterion) {
    // Weyl sequences of the golden and the plastic number.
    let anywhere = |i: usize| Vec2::new((i as f32 * 0.618_034).fract(), (i as f32 * 0.754_877_7).fract());
    let line = |i: usize| Vec2::new(i as f32 / LOOKUPS as f32, 0.4);
    for (filter, bilinear) in [("bilinear", true), ("nearest", false)] {
        let picture = picture(bilinear);
        let mut group = criterion.benchmark_group(format!("texture/{filter}"));
        group.throughput(Throughput::Elements(LOOKUPS as u64));
        for (order, at) in [("line", &line as &dyn Fn(usize) -> Vec2), ("anywhere", &anywhere)] {
            let uvs: Vec<Vec2> = (0..LOOKUPS).map(at).collect();
            group.bench_function(BenchmarkId::from_parameter(order), |bencher| {
                bencher.iter(|| {
                    for &uv in &uvs {
                        black_box(texture::lookup(&picture, black_box(uv)));
                    }
                });
            });
        }
    }
}

fn main() {
    let mut criterion = common::criterion();
    texture(&mut criterion);
    criterion.final_summary();
}
