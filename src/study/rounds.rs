//! The rounds of a study: every setting in order and then in reverse order, each at its numbers of samples, and the run
//! that tells what each length of path carries. Within a round all settings use the same seeds.

use std::time::Instant;

use super::findings::{Run, Study};
use super::reference::values;
use super::renderers::{Halt, Renderers};
use super::settings::Role;
use crate::accuracy::flip;
use crate::film::layer::bounces::LENGTHS;
use crate::render::{Render, RenderOptions};

/// More rounds than this say little more.
const MOST_ROUNDS: usize = 12;

/// Numbers of samples at which techniques are followed: this many, each half of the next.
const LEVELS: u32 = 5;

/// Fewest samples of a run that is measured.
pub(super) const LEAST_SPP: u64 = 4;

/// Bytes of pictures that are kept for the biases.
const MOST_BYTES: usize = 1 << 29;

impl Study {
    /// Rounds of all settings until the share `until` of the budget is gone; one at least.
    pub(super) fn go_rounds(
        &mut self,
        renderers: &mut Renderers,
        base: &RenderOptions,
        until: f64,
    ) -> Result<(), Halt> {
        let bytes = self.series.len() * 2 * 4 * self.reference.as_ref().map_or(0, |r| r.values.len());
        let most = MOST_ROUNDS.min(MOST_BYTES / bytes.max(1)).max(1);
        let end = until * renderers.budget.as_secs_f64();
        let mut last = self.round_s;
        while self.rounds < most && (self.rounds == 0 || renderers.elapsed_s() + last < end) {
            let begun = Instant::now();
            for (half, order) in [false, true].into_iter().enumerate() {
                let index = 2 * self.rounds + half;
                let what = format!("round {} at up to {} spp", self.rounds + 1, self.top_spp);
                let n = self.series.len();
                for i in (0..n).map(|i| if order { n - 1 - i } else { i }) {
                    self.visit(renderers, i, index, &what)?;
                }
                let deep = RenderOptions { max_depth: deep(base), per_length: true, ..base.clone() };
                let (render, _) = renderers.render(&deep, run_seed(base.seed, 0, index), self.top_spp, &what)?;
                self.lengths.extend(length_means(&render));
            }
            self.rounds += 1;
            last = begun.elapsed().as_secs_f64();
            self.round_s = last;
        }
        Ok(())
    }

    /// Renders one setting at its numbers of samples.
    fn visit(&mut self, renderers: &mut Renderers, i: usize, index: usize, what: &str) -> Result<(), Halt> {
        let series = &mut self.series[i];
        let reference = self.reference.as_ref().expect("rounds begin with a reference");
        let options = &series.setting.options;
        for (level, spp) in levels(series.setting.role, self.top_spp) {
            let (render, cost) = renderers.render(options, run_seed(options.seed, level, index), spp, what)?;
            let picture = values(&render.film);
            let width = render.film.window.width as usize;
            let counters = &render.counters;
            series.runs.push(Run {
                index,
                spp,
                cost,
                difference: reference.difference(&picture),
                flip: (level == 0).then(|| flip::hdr_flip(&pixels(&picture), &pixels_f64(&reference.values), width)),
                nonfinite: counters.nonfinite,
                capped_paths: counters.capped_paths,
                rays: [counters.rays_camera, counters.rays_bounce, counters.rays_shadow],
            });
            if level == 0 {
                series.pictures.push(picture);
                if i == 0 && self.film.is_none() {
                    self.film = Some(render.film);
                }
            }
        }
        Ok(())
    }
}

/// Depth at which truncation no longer matters for the reference and the path lengths.
pub(super) fn deep(base: &RenderOptions) -> u32 {
    base.max_depth.max(RenderOptions::default().max_depth)
}

/// Seed of a run. The reference's lie 2³² above these, the price list's 2³³.
fn run_seed(base: u64, level: u32, index: usize) -> u64 {
    base.wrapping_add(1 + u64::from(level) * 4096 + index as u64)
}

/// Numbers of samples of a setting's runs, the largest last; level 0 is the largest.
pub(super) fn levels(role: Role, top: u64) -> Vec<(u32, u64)> {
    let count = if role == Role::Knob { 1 } else { LEVELS };
    let all = (0..count).rev().map(|level| (level, top >> level));
    all.filter(|(_, spp)| *spp >= LEAST_SPP).collect()
}

fn length_means(render: &Render) -> Option<[f64; LENGTHS]> {
    let lengths = render.film.path_lengths()?;
    let pixels = render.film.pixels.len() as f64;
    Some(std::array::from_fn(|edge| lengths.image(edge).iter().flatten().sum::<f64>() / (3.0 * pixels)))
}

fn pixels(values: &[f32]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect()
}

fn pixels_f64(values: &[f64]) -> Vec<[f32; 3]> {
    values.chunks_exact(3).map(|p| [p[0] as f32, p[1] as f32, p[2] as f32]).collect()
}
