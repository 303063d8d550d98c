//! What counted work costs in each backend, in visits of a node by `obvhs` (19 ns on the machine below).
//!
//! A cost is a sum of counts times weights. Those for AVX2 were fitted (non-negative least squares of relative errors,
//! times of a ray by class) to every other scene of `pathspace bench --suite` up to 170 000 triangles, on an AMD EPYC
//! (Milan, 2 threads under load, processor time), and tried on the others: benches/RESULTS.md has both halves. The
//! form of Embree's cost was chosen of five with both in sight, and counting was made cheaper after the fit. Those for
//! AVX-512 are derived: sixteen lanes take half of the instructions, everything else the same. Instances were on no
//! scene of the fit; they cost every hierarchy the same here, so they decide nothing.

use super::BackendKind;
use super::count::walk::Visits;
use super::count::{self, Counts};

/// The unit costs of an instruction set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// Beginning and end of a ray in `obvhs`.
    pub ray: f64,
    /// A leaf in `obvhs`.
    pub leaf: f64,
    /// An instance in any hierarchy.
    pub instance: f64,
    /// A ray, of sixteen, into and out of `flat`.
    pub flat: f64,
    /// A face for a ray.
    pub face: f64,
    /// A volume for a ray.
    pub volume: f64,
    /// A node in Embree, by class of rays: camera, bounce, shadow.
    pub embree_node: [f64; 3],
    /// A leaf in Embree.
    pub embree_leaf: [f64; 3],
    /// What a node or leaf costs more in Embree for every doubling of the triangles beyond [`NEAR_TRIANGLES`], but for
    /// camera rays: it waits for memory, where `obvhs` has other rays under way.
    pub embree_far: f64,
}

/// Triangles whose hierarchy, about 70 bytes each, stays in the second-level cache of a core (1 MiB or less).
pub const NEAR_TRIANGLES: u64 = 1 << 14;

/// Kernels compiled for the baseline, AVX2.
pub const AVX2: Weights = Weights {
    ray: 0.70,
    leaf: 3.15,
    instance: 3.0,
    flat: 2.44,
    face: 0.113,
    volume: 0.022,
    embree_node: [0.91, 0.82, 1.24],
    embree_leaf: [1.44, 3.22, 1.85],
    embree_far: 0.37,
};

/// Kernels compiled for AVX-512.
pub const AVX512: Weights = Weights { flat: 1.22, face: 0.057, volume: 0.011, ..AVX2 };

/// Cost of a ray in `kind`, the mean over all that were counted; `None` where that is not known. `faces` are those of a
/// scene for `flat`.
pub fn cost(kind: BackendKind, counts: &Counts, faces: Option<usize>, weights: &Weights) -> Option<f64> {
    let rays = counts.all_rays().max(1) as f64;
    let flat = |faces: u64, volumes: u64| weights.flat + weights.face * faces as f64 + weights.volume * volumes as f64;
    match kind {
        BackendKind::Embree => Some(embree(counts, weights) / rays),
        BackendKind::Obvhs => Some(obvhs(&counts.whole, counts.all_rays(), weights) / rays),
        BackendKind::FlatObvhs => {
            let divided = counts.divided.as_ref()?;
            let rest = obvhs(&divided.rest, divided.near.iter().sum(), weights);
            Some(flat(divided.faces, divided.volumes) + rest / rays)
        }
        BackendKind::Flat => Some(flat(faces? as u64, 0)),
        BackendKind::Brute => None,
    }
}

fn obvhs(visits: &[Visits; 3], rays: u64, weights: &Weights) -> f64 {
    let sum = count::sum(visits);
    let (nodes, leaves, instances) = (sum.nodes as f64, sum.leaves as f64, sum.instances as f64);
    weights.ray * rays as f64 + nodes + weights.leaf * leaves + weights.instance * instances
}

/// By the counts of the hierarchy of everything, a proxy: Embree's own cannot be counted.
fn embree(counts: &Counts, weights: &Weights) -> f64 {
    let mut cost = 0.0;
    for (class, visits) in counts.whole.iter().enumerate() {
        let far = if class == 0 { 0.0 } else { weights.embree_far * doublings(counts.triangles) };
        cost += (weights.embree_node[class] + far) * visits.nodes as f64;
        cost += (weights.embree_leaf[class] + far) * visits.leaves as f64;
        cost += weights.instance * visits.instances as f64;
    }
    cost
}

/// Binary logarithm of triangles over [`NEAR_TRIANGLES`], linear between powers of two so that every machine rounds it
/// alike; 0 below.
fn doublings(triangles: u64) -> f64 {
    let over = triangles.max(NEAR_TRIANGLES) as f64 / NEAR_TRIANGLES as f64;
    let whole = (over as u64).ilog2();
    f64::from(whole) + over / (1u64 << whole) as f64 - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: powers of two, and that it rises.
    #[test]
    fn doublings_are_logarithms() {
        for power in 0..20 {
            assert_eq!(doublings(NEAR_TRIANGLES << power), f64::from(power));
            assert!(doublings((NEAR_TRIANGLES << power) * 5 / 4) > f64::from(power));
        }
        assert_eq!(doublings(3), 0.0);
    }

    /// Oracle: sums by hand.
    #[test]
    fn costs_are_sums() {
        let visits = Visits { nodes: 10, leaves: 2, instances: 0 };
        let counts = Counts {
            rays: [0, 4, 0],
            triangles: NEAR_TRIANGLES,
            whole: [Visits::default(), visits, Visits::default()],
            divided: None,
        };
        let cost = |kind| cost(kind, &counts, Some(10), &AVX2);
        assert!((cost(BackendKind::Obvhs).unwrap() - (0.70 + 2.5 + 3.15 / 2.0)).abs() < 1e-12);
        assert!((cost(BackendKind::Embree).unwrap() - (0.82 * 2.5 + 3.22 / 2.0)).abs() < 1e-12);
        assert!((cost(BackendKind::Flat).unwrap() - (2.44 + 1.13)).abs() < 1e-12);
        assert_eq!((cost(BackendKind::FlatObvhs), cost(BackendKind::Brute)), (None, None));
    }
}
