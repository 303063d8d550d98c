//! The runs behind the price of effects: for each that the scene calls for, for each technique, group of lamps and
//! limit of paths a copy of the scene without it, for each choice the options that it would be made by; and pairs of
//! runs, with it and without it, in turns, so that a drift of the machine falls on both alike.
//!
//! Each effect gets an equal part of the time that is left; the samples of its runs follow from a first pair, which is
//! left out by that rule. An effect for which four pairs of few samples are too much is told as such. Limit: a copy of
//! the scene and a second hierarchy are in memory at a time.

use super::effects::{self, EffectRow, LEAST_PAIRS, Shown, Side};
use super::findings::Study;
use super::reference::values;
use super::renderers::{Halt, Renderers};
use super::rounds::LEAST_SPP;
use super::settings::{self, Turns};
use crate::plan::effects::without;
use crate::plot::number::short;
use crate::render::{Absent, Render, RenderOptions, Renderer, leave_out};
use crate::scene::{LeftOut, Scene};

/// Pairs of runs that the samples are chosen for.
const PAIRS: usize = 8;

/// Share of an effect's time that its runs are to take, as far as the first pair tells.
const MARGIN: f64 = 0.7;

/// Most samples per pixel of a run.
const MOST_SPP: u64 = 1 << 12;

/// Limits of the length of paths that are priced.
const DEPTHS: [u32; 3] = [2, 4, 8];

/// Effects of which pictures are kept.
const SHOWN: usize = 3;

/// Seeds of the pairs: 2³⁴ above those of the rounds.
fn pair_seed(base: u64, pair: usize) -> u64 {
    base.wrapping_add((1 << 34) + pair as u64)
}

/// Something that is priced.
struct Priced {
    effect: LeftOut,
    /// The options that stand for its absence; `None` where it is left out by its name.
    instead: Option<RenderOptions>,
}

/// What is priced.
fn priced(scene: &Scene, base: &RenderOptions) -> Vec<Priced> {
    let limits = DEPTHS.iter().filter_map(|&edges| without::depth(base, edges));
    let left_out = without::choices(scene, base).into_iter().chain(limits);
    // Knobs that turn no length of paths: textures, robustness, multiple scattering.
    let knobs = settings::knobs(base, Turns::of(scene));
    let choices = knobs.into_iter().filter(|knob| knob.options.max_depth == base.max_depth);
    let choices = choices.filter(|knob| knob.options.roulette_start == base.roulette_start).map(|knob| Priced {
        effect: LeftOut { found: format!("{} (for the present choice)", knob.name), name: knob.name },
        instead: Some(knob.options),
    });
    left_out.map(|effect| Priced { effect, instead: None }).chain(choices).collect()
}

/// The price of something, or about how many seconds it takes, where those are too many.
type Outcome = Result<(EffectRow, Shown), f64>;

impl Study {
    /// Lists the effects that `base` calls for, none of which is priced yet.
    pub(super) fn list_effects(&mut self, scene: &Scene, base: &RenderOptions) {
        let unmeasured = |priced: &Priced| EffectRow::unmeasured(&priced.effect, "beyond the budget".into());
        self.effects = priced(scene, base).iter().map(unmeasured).collect();
    }

    /// Prices the listed effects, until the share `until` of the budget is gone.
    pub(super) fn price_effects(
        &mut self,
        renderers: &mut Renderers,
        scene: &Scene,
        base: &RenderOptions,
        until: f64,
    ) -> Result<(), Halt> {
        let list = priced(scene, base);
        let end = until * renderers.budget.as_secs_f64();
        let mut ended = Ok(());
        for (i, priced) in list.iter().enumerate() {
            let left = end - renderers.elapsed_s();
            if left <= 0.0 {
                break;
            }
            match renderers.price(scene, base, priced, (left, left / (list.len() - i) as f64)) {
                Ok(Ok((row, shown))) => {
                    self.effects[i] = row;
                    self.shown.push(shown);
                    self.shown.sort_by(|a, b| b.error.total_cmp(&a.error));
                    self.shown.truncate(SHOWN);
                }
                Ok(Err(seconds)) => {
                    let seconds = short(seconds);
                    self.effects[i].not_measured = Some(format!("beyond the budget: takes about {seconds} s"));
                }
                Err(Halt::Failed(error)) => self.effects[i].not_measured = Some(error.to_string()),
                Err(halt) => {
                    if matches!(halt, Halt::Interrupted) {
                        let rest = self.effects[i..].iter_mut();
                        rest.for_each(|row| row.not_measured = Some("ended by a signal".into()));
                    }
                    ended = Err(halt);
                    break;
                }
            }
        }
        effects::sort(&mut self.effects);
        ended
    }
}

impl Renderers<'_, '_> {
    /// Prices one effect in about `part` of the seconds that are `left`, if they are not too few.
    fn price(
        &mut self,
        scene: &Scene,
        base: &RenderOptions,
        Priced { effect, instead }: &Priced,
        (left, part): (f64, f64),
    ) -> Result<Outcome, Halt> {
        let begun = self.elapsed_s();
        let (mut bare, mut options) = (scene.clone(), instead.as_ref().unwrap_or(base).clone());
        if instead.is_none() {
            leave_out(&mut bare, &mut options, std::slice::from_ref(&effect.name), Absent::Refused)?;
        }
        let mut changed = Renderer::new(&bare, options.clone().spp(1))?;
        let what = if instead.is_some() { effect.name.clone() } else { format!("without {}", effect.name) };
        let mut pair = |renderers: &mut Self, index: usize, spp: u64| -> Result<[Side; 2], Halt> {
            let seed = pair_seed(base.seed, index);
            let mut without = |renderers: &mut Self| {
                changed.retarget(&options.clone().seed(seed).spp(spp))?;
                renderers.watched(&changed, &what)
            };
            // In turns: the first of a pair is the last of the one before.
            let (with, without) = if index.is_multiple_of(2) {
                let with = renderers.render(base, seed, spp, &what)?;
                (with, without(renderers)?)
            } else {
                let without = without(renderers)?;
                (renderers.render(base, seed, spp, &what)?, without)
            };
            let side = |(render, cost): (Render, _)| Side {
                cost,
                relmse: render.film.error_estimate().map(|estimate| estimate.relmse).filter(|e| *e > 0.0),
                rays_per_path: render.counters.rays() as f64 / render.counters.paths.max(1) as f64,
                picture: values(&render.film),
            };
            Ok([side(with), side(without)])
        };

        let built = self.elapsed_s();
        pair(self, 0, LEAST_SPP)?;
        let first = self.elapsed_s() - built;
        let (spent, per_pair) = (self.elapsed_s() - begun, first.max(1e-4));
        let room = part.max(spent + 1.1 * LEAST_PAIRS as f64 * per_pair).min(left) - spent;
        let affordable = (room / per_pair) as usize;
        if affordable < LEAST_PAIRS {
            return Ok(Err(spent + 1.1 * LEAST_PAIRS as f64 * per_pair));
        }
        let count = affordable.min(PAIRS) & !1;
        let mut spp = LEAST_SPP;
        let fits = |spp: u64| count as f64 * per_pair * (spp / LEAST_SPP) as f64 <= MARGIN * room;
        while 2 * spp <= MOST_SPP && fits(2 * spp) {
            spp *= 2;
        }
        let mut pairs = Vec::new();
        // In twos, of which halves are made; fewer where the machine does more besides than it did for the first pair.
        while pairs.len() < count && (pairs.len() < LEAST_PAIRS || self.elapsed_s() - begun < spent + room) {
            for _ in 0..2 {
                pairs.push(pair(self, pairs.len(), spp)?);
            }
        }
        let width = base.crop.map_or(base.width, |crop| crop.width) as usize;
        Ok(Ok(EffectRow::of(effect, spp, width, &pairs)))
    }
}
