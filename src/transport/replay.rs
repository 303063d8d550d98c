//! One camera sample again, by the very functions of the render, with every vertex written down.
//!
//! A wave of one path runs through the loop and its kernels with a [`Story`] for a tape; they are compiled for the
//! baseline, which gives the bits of every instruction set. [`Replay::told`] adds up what was written down: tests hold
//! it against the sums, bit for bit.

use glam::Vec3;
use serde::Serialize;

use super::counters::Counters;
use super::job::Job;
use super::parts::Wanted;
use super::path;
use super::raygen::{self, Chunk};
use super::story::Story;
use super::vertex::{Number, Shadow, Triple, Vertex, triple};
use super::wave::Wave;
use crate::film::Pixel;

/// A camera sample and its path.
#[derive(Clone, Debug, Serialize)]
pub struct Replay {
    /// Pixel of the full image.
    pub pixel: [u32; 2],
    /// Sample index of the pixel.
    pub sample: u64,
    /// Where on the film the ray went through, pixels from the top left corner.
    pub film_position: [Number; 2],
    /// Signed weight of the pixel filter.
    pub filter_weight: Number,
    /// Time of the path, a fraction of the shutter; `None` where nothing moves.
    pub time: Option<Number>,
    /// The path.
    pub vertices: Vec<Vertex>,
    /// Radiance of the sample: the last vertex's `gathered`.
    pub radiance: Triple,
    /// 1 where the camera ray met something visible.
    pub coverage: Number,
    /// What the film adds for this sample: weight · (R, G, B, coverage); 0 in place of a radiance that is not finite.
    pub film: [f64; 4],
    /// Scatterings of the contribution with which the sum ceased to be finite; `None` for a finite sample.
    pub nonfinite_bounce: Option<u32>,
}

impl Replay {
    /// Sum of the contributions that the vertices list, in the order of the path. It has the bits of `radiance`.
    pub fn told(&self) -> [f32; 3] {
        let mut sum = Vec3::ZERO;
        for vertex in &self.vertices {
            let seen = vertex.emission.map(|emission| emission.contribution);
            let lit = vertex.light.filter(|light| light.outcome == Shadow::Visible).map(|light| light.contribution);
            for contribution in [seen, lit].into_iter().flatten() {
                sum += Vec3::from(contribution.map(|c| c.0));
            }
        }
        sum.into()
    }
}

/// Renders sample `sample` of `pixel` again and writes it down; `pixel` lies in the full image.
pub fn run(job: &Job, pixel: (u32, u32), sample: u64) -> Replay {
    let (film, wave, story) = single(job, pixel, sample);
    let gathered = &wave.sums.gathered[0];
    Replay {
        pixel: [pixel.0, pixel.1],
        sample,
        film_position: raygen::film_position(job, pixel, sample).map(Number),
        filter_weight: Number(gathered.weight),
        time: wave.times.first().copied().map(Number),
        vertices: story.vertices,
        radiance: triple(gathered.radiance),
        coverage: Number(gathered.coverage),
        film: film.sum[(sample & 1) as usize],
        nonfinite_bounce: story.nonfinite,
    }
}

/// Scatterings of the contribution with which the sum of a sample ceases to be finite; `None` if it stays finite.
pub(crate) fn nonfinite_bounce(job: &Job, pixel: (u32, u32), sample: u64) -> Option<u32> {
    single(job, pixel, sample).2.nonfinite
}

/// The loop over a wave of one path.
fn single(job: &Job, pixel: (u32, u32), sample: u64) -> (Pixel, Wave, Story) {
    let mut wave = Wave::new(1, &Wanted::default());
    let chunk = Chunk { pixels: &[pixel], first_sample: sample, samples: 1 };
    let (mut film, mut counters, mut story) = ([Pixel::default()], Counters::default(), Story::default());
    let output = path::Output { pixels: &mut film, counters: &mut counters };
    path::told(job, &chunk, &mut wave, output, &mut story);
    (film[0], wave, story)
}
