//! What is measured against what: the settings of a study, each named by how it differs from the default one.
//!
//! *Techniques* change the noise and the time, not the expectation: their error is followed over several numbers of
//! samples. *Knobs* trade accuracy for time or space: they are measured at one number of samples, run by run against
//! the default with the same seeds, so that the difference shows the bias and not the noise.

use serde::Serialize;

use crate::backend::BackendKind;
use crate::plan::RenderPlan;
use crate::plan::options::{Guiding, LightPaths, Techniques};
use crate::render::{Backfaces, RenderOptions, Renderer, Roulette, SamplerKind, Strategy, TextureFilter};
use crate::scene::{Facts, Material, Scene};

/// Light paths for each pixel and sample of a setting that has them where the default has none.
const SHARE: f32 = 0.25;

/// Depth limits that are timed.
const DEPTHS: [u32; 3] = [2, 4, 8];

/// First vertices of roulette that are timed.
const ROULETTE_STARTS: [u32; 3] = [1, 4, 8];

/// What a setting is in the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The options as given; everything is compared with it.
    Default,
    /// Another way to the same picture.
    Technique,
    /// Accuracy for time.
    Knob,
}

/// One way to render.
#[derive(Clone, Debug)]
pub struct Setting {
    /// How it differs from the default, in the spelling of the command line; "default" for the default.
    pub name: String,
    /// What it is.
    pub role: Role,
    /// Everything else.
    pub options: RenderOptions,
}

fn roulette_name(roulette: Roulette) -> &'static str {
    if roulette == Roulette::Off { "off" } else { "on" }
}

/// The backend that the options mean.
pub fn backend_of(options: &RenderOptions) -> BackendKind {
    options.backend.unwrap_or(BackendKind::available()[0])
}

/// The default setting in the spelling of the command line.
pub fn describe(base: &RenderOptions) -> String {
    let mut text = format!(
        "--strategy {} --sampler {} --roulette {} --max-depth {} --backend {}",
        base.strategy.name(),
        base.sampler.name(),
        roulette_name(base.roulette),
        base.max_depth,
        backend_of(base).name()
    );
    if base.roulette == Roulette::On {
        text.push_str(&format!(" --roulette-start {}", base.roulette_start));
    }
    if base.texture_filter != TextureFilter::Exact {
        text.push_str(&format!(" --texture-filter {}", base.texture_filter.name()));
    }
    if !base.fold_normals {
        text.push_str(" --fold-normals off");
    }
    if base.multiscatter {
        text.push_str(" --multiscatter on");
    }
    if base.backfaces != Backfaces::Show {
        text.push_str(&format!(" --backfaces {}", base.backfaces.name()));
    }
    if !base.robust {
        text.push_str(" --robust off");
    }
    text
}

/// The default first, then the techniques: one factor at a time, or all combinations when `full`.
pub fn techniques(base: &RenderOptions, full: bool) -> Vec<Setting> {
    let strategies = [Strategy::MIS, Strategy::MIS_BALANCE, Strategy::LIGHT, Strategy::BSDF];
    let roulettes = [Roulette::On, Roulette::Off];
    // The loop over all triangles has no business with pictures.
    let others = BackendKind::available().iter().copied();
    let others = others.filter(|b| *b != BackendKind::Brute && *b != backend_of(base));
    let backends: Vec<BackendKind> = std::iter::once(backend_of(base)).chain(others).collect();
    let mut list = vec![Setting { name: "default".into(), role: Role::Default, options: base.clone() }];
    for &backend in &backends {
        for roulette in roulettes {
            for sampler in SamplerKind::ALL {
                for strategy in strategies {
                    let differences = [
                        (strategy != base.strategy, "--strategy", strategy.name()),
                        (sampler != base.sampler, "--sampler", sampler.name()),
                        (
                            roulette_name(roulette) != roulette_name(base.roulette),
                            "--roulette",
                            roulette_name(roulette),
                        ),
                        (backend != backend_of(base), "--backend", backend.name()),
                    ];
                    let changed = differences.iter().filter(|(differs, ..)| *differs).count();
                    if changed == 0 || (changed > 1 && !full) {
                        continue;
                    }
                    let name: Vec<String> = differences
                        .iter()
                        .filter(|(differs, ..)| *differs)
                        .map(|(_, flag, value)| format!("{flag} {value}"))
                        .collect();
                    // Another backend is held to what it can be held to.
                    let isa = base.isa.clone().filter(|isa| backend.pins(isa));
                    let rays = base.rays.filter(|rays| backend.only_mode().is_none_or(|only| only == *rays));
                    let options = RenderOptions {
                        strategy,
                        sampler,
                        roulette: if differences[2].0 { roulette } else { base.roulette },
                        backend: Some(backend),
                        isa,
                        rays,
                        robust: base.robust || backend != BackendKind::Embree,
                        ..base.clone()
                    };
                    list.push(Setting { name: name.join(" "), role: Role::Technique, options });
                }
            }
        }
    }
    list.sort_by_key(|setting| setting.name.matches("--").count());
    list
}

/// The ways to light besides BSDF and light samples: which of them the default takes, and which it may take.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ways {
    /// Light paths for each pixel and sample.
    pub light_paths: f32,
    /// Whether there may be any.
    pub may_have_light_paths: bool,
    /// A guide.
    pub guide: bool,
    /// Whether there may be one.
    pub may_have_guide: bool,
}

impl Ways {
    /// What a renderer's plan takes of them, and what else it could.
    pub fn of(renderer: &Renderer, base: &RenderOptions) -> Ways {
        let (plan, geometry) = (renderer.plan(), renderer.geometry());
        let may = |options: RenderOptions, takes: fn(&RenderPlan) -> bool| {
            RenderPlan::new(renderer.scene(), geometry, &options).is_ok_and(|plan| takes(&plan))
        };
        let light_paths = base.clone().light_paths(LightPaths::Share(SHARE));
        Ways {
            light_paths: plan.light_paths,
            may_have_light_paths: may(light_paths, |plan| plan.features.light_paths),
            guide: plan.features.guide,
            may_have_guide: may(base.clone().guiding(Guiding::On), |plan| plan.features.guide),
        }
    }
}

/// The default with one of these ways more or less, the other as it is there. A guide is learnt anew for every run, so
/// that one that the default has not is for `full` lists.
pub fn ways(base: &RenderOptions, has: Ways, full: bool) -> Vec<Setting> {
    if base.strategy.techniques != Techniques::ALL || matches!(base.light_paths, LightPaths::Alone(_)) {
        return Vec::new();
    }
    let setting = |share: f32, guide: bool| {
        let paths = if share > 0.0 { format!(",light-paths:{share}") } else { String::new() };
        Setting {
            name: format!("--techniques bsdf,light{}{paths}", if guide { ",guide" } else { "" }),
            role: Role::Technique,
            options: RenderOptions {
                light_paths: if share > 0.0 { LightPaths::Share(share) } else { LightPaths::Off },
                guiding: if guide { Guiding::On } else { Guiding::Off },
                ..base.clone()
            },
        }
    };
    let other_share = if has.light_paths > 0.0 { 0.0 } else { SHARE };
    let with_paths = (has.light_paths > 0.0 || has.may_have_light_paths).then(|| setting(other_share, has.guide));
    let with_guide = (has.guide || full && has.may_have_guide).then(|| setting(has.light_paths, !has.guide));
    with_paths.into_iter().chain(with_guide).collect()
}

/// What a scene has that knobs turn.
#[derive(Clone, Copy, Debug, Default)]
pub struct Turns {
    /// Textures.
    pub textures: bool,
    /// Rough metals or glass, which lose light between facets.
    pub loses: bool,
}

impl Turns {
    /// What `scene` has.
    pub fn of(scene: &Scene) -> Self {
        let mut drawn = scene.instances.iter().map(|instance| &scene.materials[scene.material_of(instance).index()]);
        let textures = drawn.clone().any(Material::reads_textures);
        Turns { textures, loses: drawn.any(|material| Facts::of(material).loses()) }
    }
}

/// The knobs that this base leaves to turn, of a scene that has these things.
pub fn knobs(base: &RenderOptions, scene: Turns) -> Vec<Setting> {
    let knob = |name: String, options: RenderOptions| Setting { name, role: Role::Knob, options };
    let mut list = Vec::new();
    for depth in DEPTHS.into_iter().filter(|depth| *depth < base.max_depth) {
        list.push(knob(format!("--max-depth {depth}"), RenderOptions { max_depth: depth, ..base.clone() }));
    }
    if base.roulette == Roulette::On {
        for start in ROULETTE_STARTS.into_iter().filter(|start| *start != base.roulette_start) {
            let options = RenderOptions { roulette_start: start, ..base.clone() };
            list.push(knob(format!("--roulette-start {start}"), options));
        }
    }
    if base.texture_filter == TextureFilter::Exact && scene.textures {
        let options = RenderOptions { texture_filter: TextureFilter::Trilinear, ..base.clone() };
        list.push(knob("--texture-filter trilinear".into(), options));
    }
    if scene.loses && !base.multiscatter {
        list.push(knob("--multiscatter on".into(), RenderOptions { multiscatter: true, ..base.clone() }));
    }
    if backend_of(base) == BackendKind::Embree {
        let (name, robust) = if base.robust { ("--robust off", false) } else { ("--robust on", true) };
        list.push(knob(name.into(), RenderOptions { robust, ..base.clone() }));
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_factor_at_a_time_or_all_of_them() {
        let base = RenderOptions::new(8, 8);
        let others = BackendKind::available().len() - 1; // Without the brute one.
        let names = |full| techniques(&base, full).into_iter().map(|s| s.name).collect::<Vec<_>>();
        assert_eq!(names(false).len(), 1 + 3 + 1 + 1 + (others - 1));
        assert_eq!(names(true).len(), 4 * 2 * 2 * others);
        assert_eq!(names(true)[0], "default");
        assert!(names(false).contains(&"--sampler independent".to_string()));
        let unique: std::collections::BTreeSet<_> = names(true).into_iter().collect();
        assert_eq!(unique.len(), 16 * others);
    }

    /// Oracle: by hand.
    #[test]
    fn ways_to_light_are_added_or_left_out_one_at_a_time() {
        let base = RenderOptions::new(8, 8);
        let names = |has| ways(&base, has, true).into_iter().map(|s| s.name).collect::<Vec<_>>();
        assert!(names(Ways::default()).is_empty());
        let both = Ways { light_paths: 0.5, may_have_light_paths: true, guide: true, may_have_guide: true };
        assert_eq!(names(both), ["--techniques bsdf,light,guide", "--techniques bsdf,light,light-paths:0.5"]);
        let neither = Ways { light_paths: 0.0, guide: false, ..both };
        assert_eq!(names(neither), ["--techniques bsdf,light,light-paths:0.25", "--techniques bsdf,light,guide"]);
        assert_eq!(ways(&base, neither, false).len(), 1);
        assert!(ways(&RenderOptions { strategy: Strategy::BSDF, ..base.clone() }, both, true).is_empty());
        let options = &ways(&base, both, true)[0].options;
        assert_eq!((options.light_paths, options.guiding), (LightPaths::Off, Guiding::On));
    }

    #[test]
    fn knobs_follow_the_base() {
        let names =
            |base: &RenderOptions| knobs(base, Turns::default()).into_iter().map(|s| s.name).collect::<Vec<_>>();
        let shallow = RenderOptions { max_depth: 4, roulette: Roulette::Off, ..RenderOptions::new(8, 8) };
        let shallow = RenderOptions { backend: Some(BackendKind::Obvhs), ..shallow };
        assert_eq!(names(&shallow), ["--max-depth 2"]);
        let all = names(&RenderOptions { backend: Some(BackendKind::Obvhs), ..RenderOptions::new(8, 8) });
        assert_eq!(all.len(), 3 + 2);
        assert!(all.contains(&"--roulette-start 8".to_string()));
        let rough = Turns { loses: true, ..Turns::default() };
        assert!(knobs(&shallow, rough).iter().any(|knob| knob.name == "--multiscatter on"));
        assert_eq!(knobs(&RenderOptions { multiscatter: true, ..shallow }, rough).len(), 1);
    }
}
