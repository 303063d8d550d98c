//! Pixel layers: the beauty, always kept, and what `--aov` adds. A layer is a file here and a line of
//! [`LAYERS`], from which flag, help text, channels and memory derive; what its values are is said in its file, or in
//! `transport/first_hit.rs` for what camera rays meet.
//!
//! Channels are dotted, `LAYER.COMPONENT`; the beauty's are plain `R`, `G`, `B`, `A`, and `Z` has no component. Names
//! are a contract: add, never rename. Means are over the pixel filter, 0 where a ray leaves the scene; values *of the
//! centre* belong to the one ray through the pixel's centre.

pub mod albedo;
pub mod background;
pub mod beauty;
pub mod bounces;
pub mod coverage;
pub mod crypto_asset;
pub mod crypto_material;
pub mod crypto_object;
pub mod denoise_albedo;
pub mod denoise_normal;
pub mod depth;
pub mod diffuse;
pub mod direct;
pub mod emission;
pub mod geometric_normal;
pub mod glossy;
pub mod indirect;
#[doc(hidden)]
pub mod kind;
pub mod light_groups;
pub mod motion;
pub mod normal;
pub mod position;
pub mod spp;
pub mod stderr;
pub mod transmission;
pub mod uv;
pub mod variance;
pub mod volume;

use self::kind::{Layer, Shape};
use super::ids::{Count, Ids};
use crate::plan::aov::Aov;

/// Every layer besides the beauty, in the order of the help text.
pub static LAYERS: &[&Layer] = &[
    &variance::LAYER,
    &stderr::LAYER,
    &spp::LAYER,
    &bounces::LAYER,
    &emission::LAYER,
    &direct::LAYER,
    &indirect::LAYER,
    &diffuse::LAYER,
    &glossy::LAYER,
    &transmission::LAYER,
    &volume::LAYER,
    &light_groups::LAYER,
    &albedo::LAYER,
    &normal::LAYER,
    &geometric_normal::LAYER,
    &depth::LAYER,
    &position::LAYER,
    &uv::LAYER,
    &motion::LAYER,
    &background::LAYER,
    &coverage::LAYER,
    &crypto_object::LAYER,
    &crypto_material::LAYER,
    &crypto_asset::LAYER,
    &denoise_albedo::LAYER,
    &denoise_normal::LAYER,
];

/// The layer that `aov` names.
pub fn find(aov: Aov) -> &'static Layer {
    LAYERS.iter().find(|layer| layer.aov == aov).expect("every Aov is declared by a layer of the list")
}

/// Bytes of a pixel for `aovs`: what `films` keep, with so many `ids` in each list, and the channels, twice while they
/// are written.
pub fn bytes_per_pixel(aovs: &[Aov], shape: &Shape, films: u64, ids: u64) -> u64 {
    let bytes = |layer: &Layer| {
        let channels = 2 * (layer.channels)(shape).len() * size_of::<f32>();
        let list = if layer.is_of_ids() { size_of::<Ids>() as u64 + ids * size_of::<Count>() as u64 } else { 0 };
        films * ((layer.width(shape.groups.len()) * size_of::<f64>()) as u64 + list) + channels as u64
    };
    aovs.iter().map(|&aov| bytes(find(aov))).sum()
}

impl Aov {
    /// Every layer besides the beauty, in the order of the help text.
    pub fn all() -> impl Iterator<Item = Aov> {
        LAYERS.iter().map(|layer| layer.aov)
    }
}

impl std::str::FromStr for Aov {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let names = || Aov::all().map(Aov::name).collect::<Vec<_>>().join(", ");
        Aov::all().find(|aov| aov.name() == s).ok_or_else(|| format!("'{s}' is not one of {}", names()))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::kind::Values;
    use super::*;
    use crate::film::cryptomatte;
    use crate::plan::aov::Gathers;

    /// Oracle: the declarations. Deterministic.
    #[test]
    fn names_are_unique_and_values_are_those_that_are_kept() {
        let mut names = BTreeSet::from(beauty::CHANNELS.map(String::from));
        let shape = Shape { max_depth: 64, groups: &["default".into(), "key".into()] };
        for layer in LAYERS {
            assert_eq!(layer.aov.name().parse(), Ok(layer.aov));
            let width = layer.width(shape.groups.len());
            for (name, value) in (layer.channels)(&shape) {
                let most = if layer.is_of_ids() { 2 * cryptomatte::LEVELS } else { width.max(3) };
                assert!(value < most, "{name}");
                assert!(names.insert(name.clone()), "two channels {name}");
                assert!(name == layer.aov.name() || name.contains('.'), "{name}");
            }
            let once = matches!(layer.values, Values::Once { .. });
            assert_eq!(once, layer.aov.gathers() == Gathers::Centre, "{}", layer.aov);
            let kept = layer.is_kept(shape.groups.len());
            assert_eq!(layer.aov.gathers() == Gathers::Nothing, !kept, "{}", layer.aov);
            // What is met first comes as three numbers.
            assert!(!layer.aov.is_of_first_hit() || layer.is_of_ids() || width == 3, "{}", layer.aov);
        }
        assert_eq!("colour".parse::<Aov>().map_err(|e| e.contains("bounces")), Err(true));
    }
}
