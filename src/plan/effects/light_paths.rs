//! Whether a scene calls for light paths, and what they cannot do.

use super::asked::Asked;
use super::found;
use crate::plan::aov::Gathers;
use crate::plan::options::{FilterKind, LightPaths, RenderOptions, Techniques};
use crate::scene::Fact;

/// Whether light may be bundled, and the options leave it to light paths.
pub fn wanted(asked: &Asked) -> bool {
    let options = asked.options;
    let allowed = match options.light_paths {
        LightPaths::Off => false,
        // Strategies are compared by those who leave a technique out.
        LightPaths::Auto => options.strategy.techniques == Techniques::ALL,
        LightPaths::Share(_) | LightPaths::Alone(_) => true,
    };
    allowed && options.max_depth > 2 && calls(asked)
}

/// Whether there is a light, something that bundles its light, and something that scatters it.
pub fn calls(asked: &Asked) -> bool {
    let scene = asked.scene;
    let lit = scene.environment.is_some()
        || asked.placed.iter().any(|placed| placed.facts.has(Fact::Emits))
        || scene.punctual.iter().any(|light| light.intensity.max_element() > 0.0);
    let casts = asked.placed.iter().any(|placed| placed.facts.has(Fact::Casts));
    let receives = asked.placed.iter().any(|placed| placed.facts.has(Fact::Base) || placed.facts.has(Fact::Rough));
    lit && casts && receives
}

/// Why there are light paths, or none, as far as scene and options say.
pub fn reason(asked: &Asked) -> String {
    let options = asked.options;
    match (options.light_paths, refusal(asked)) {
        (LightPaths::Off, _) => "not asked for".into(),
        (LightPaths::Auto, _) if options.strategy.techniques != Techniques::ALL => {
            "the strategy leaves them out".into()
        }
        _ if !calls(asked) => "nothing bundles light".into(),
        _ if options.max_depth <= 2 => "paths have two edges at most".into(),
        (_, Some(why)) => format!("not where {why}"),
        (LightPaths::Auto, None) => "by a survey".into(),
        (LightPaths::Share(_) | LightPaths::Alone(_), None) => "asked for".into(),
    }
}

/// What keeps light paths from a render that they would serve.
pub fn refusal(asked: &Asked) -> Option<&'static str> {
    if found::moving_solid(asked) {
        Some("a solid moves while the shutter is open, and lights may be in it")
    } else if found::scattering(asked).is_some() {
        Some("media scatter")
    } else if found::hidden_backs(asked).is_some() {
        Some("backs of surfaces are hidden, which light and camera do not see alike")
    } else if found::texture_filter(asked).is_some() {
        Some("textures are filtered by the width of paths")
    } else if every_length(asked.options) {
        Some("a layer of every path length is asked for, which would take too much memory")
    } else if asked.options.filter == FilterKind::Point {
        Some("there is no pixel filter")
    } else {
        None
    }
}

/// Whether a layer keeps every path length apart.
fn every_length(options: &RenderOptions) -> bool {
    options.per_length || options.aovs.iter().any(|aov| aov.gathers() == Gathers::PathLengths)
}
