//! Whether a scene calls for a guide.

use super::asked::Asked;
use crate::plan::options::{Guiding, Techniques};
use crate::scene::Fact;

/// Pixels of a picture below which a survey may cost what it saves: the small renders have 4096 pixels, so one of this
/// size pays half a sample of each of its pixels where there is no promise, and two where the guide is learnt.
const LEAST_PIXELS: u64 = 1 << 16;

/// Whether light may come to rough surfaces by way of others, and the options leave directions to a guide.
pub fn wanted(asked: &Asked) -> bool {
    match asked.options.guiding {
        Guiding::Off => false,
        Guiding::Auto => refusal(asked).is_none() && unasked(asked).is_none(),
        Guiding::On => refusal(asked).is_none(),
    }
}

/// Why there is a guide, or none, as far as scene and options say.
pub fn reason(asked: &Asked) -> String {
    match (asked.options.guiding, refusal(asked)) {
        (Guiding::Off, _) => "not asked for".into(),
        (_, Some(why)) => why.into(),
        (Guiding::Auto, None) => unasked(asked).unwrap_or("by a survey").into(),
        (Guiding::On, None) => "asked for".into(),
    }
}

/// Whether anything shines.
pub fn is_lit(asked: &Asked) -> bool {
    asked.scene.environment.is_some()
        || asked.placed.iter().any(|placed| placed.facts.has(Fact::Emits))
        || asked.scene.punctual.iter().any(|light| light.intensity.max_element() > 0.0)
}

/// What leaves a guide nothing to do.
fn refusal(asked: &Asked) -> Option<&'static str> {
    let scatters = asked.placed.iter().any(|placed| placed.facts.has(Fact::Base) || placed.facts.has(Fact::Rough));
    if !(is_lit(asked) && scatters) {
        Some("no rough surface has light")
    } else if asked.options.max_depth <= 2 {
        Some("paths have two edges at most")
    } else {
        None
    }
}

/// What keeps a survey from a render that does not ask for it.
fn unasked(asked: &Asked) -> Option<&'static str> {
    let options = asked.options;
    if options.strategy.techniques != Techniques::ALL {
        Some("the strategy leaves it out")
    } else if u64::from(options.width) * u64::from(options.height) < LEAST_PIXELS {
        Some("the picture is too small for a survey")
    } else {
        None
    }
}
