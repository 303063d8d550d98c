//! Which layers light paths have a share in: those that are parts of the beauty, but for `bounces`, whose many lengths
//! would take more memory than all else (light paths take no part where that is asked for). Each has sums of its own
//! in [`Splats`](super::splats::Splats), behind those of the beauty.

use super::layer::LAYERS;
use super::store::Film;
use crate::plan::aov::{Aov, Gathers, Lobes};

/// Edges of the shortest path that light paths find.
const LEAST_EDGES: usize = 3;

/// What light paths add to besides the beauty.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Shares {
    /// What the layers gather, in the order of their sums, and how many sums of R, G, B each has.
    layers: Vec<(Gathers, usize)>,
}

/// Where a light path's radiance belongs.
#[derive(Clone, Copy, Debug)]
pub struct Belongs<'a> {
    /// Edges of the whole path.
    pub edges: usize,
    /// Number of its light's group.
    pub group: usize,
    /// How it was scattered where the camera sees it: the parts of its radiance.
    pub scattered: &'a [(Lobes, [f64; 3])],
}

impl Shares {
    /// Those of a film that keeps `aovs`, where there are so many light groups.
    pub fn of(aovs: &[Aov], groups: usize) -> Self {
        Shares::in_order(LAYERS.iter().map(|layer| layer.aov).filter(|aov| aovs.contains(aov)), groups)
    }

    /// Those of a film's layers.
    pub fn of_film(film: &Film) -> Self {
        Shares::in_order(film.planes().iter().map(|plane| plane.layer.aov), film.light_groups().len())
    }

    fn in_order(aovs: impl Iterator<Item = Aov>, groups: usize) -> Self {
        let sums = |gathers: Gathers| match gathers {
            Gathers::Edges { most, .. } if most < LEAST_EDGES => 0,
            Gathers::Edges { .. } | Gathers::Scattered(_) => 1,
            Gathers::LightGroups => groups,
            Gathers::PathLengths | Gathers::Followed(_) | Gathers::FirstHit => 0,
            Gathers::Nothing | Gathers::Centre => 0,
        };
        let layers = aovs.map(|aov| (aov.gathers(), sums(aov.gathers())));
        Shares { layers: layers.filter(|(_, sums)| *sums > 0).collect() }
    }

    /// Sums of R, G, B for all layers.
    pub fn count(&self) -> usize {
        self.layers.iter().map(|(_, sums)| sums).sum()
    }

    /// The sums of the layer that gathers this: the first one's number, and how many.
    pub(super) fn place(&self, gathers: Gathers) -> Option<(usize, usize)> {
        let number = self.layers.iter().position(|&(of, _)| of == gathers)?;
        Some((self.layers[..number].iter().map(|(_, sums)| sums).sum(), self.layers[number].1))
    }

    /// Hands over what belongs to each sum, by its number, of the radiance `rgb`.
    pub fn each(&self, rgb: [f64; 3], belongs: &Belongs, mut add: impl FnMut(usize, [f64; 3])) {
        let mut first = 0;
        for &(gathers, sums) in &self.layers {
            match gathers {
                Gathers::Edges { least, most } if (least..=most).contains(&belongs.edges) => add(first, rgb),
                Gathers::LightGroups => add(first + belongs.group, rgb),
                Gathers::Scattered(kind) => {
                    for &(_, part) in belongs.scattered.iter().filter(|(of, _)| *of == kind) {
                        add(first, part);
                    }
                }
                _ => {}
            }
            first += sums;
        }
    }
}
