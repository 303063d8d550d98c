//! Directional albedo of rough solid dielectrics: what one reflection or refraction at a facet returns of a unit of
//! light, by cosine and alpha, for each index of refraction that a scene has and each side. The rest is light that hits
//! other facets, which single scattering loses.
//!
//! Origin: quadrature in f64 as in `albedo`, over visible normals, weight F·G1 of the reflected direction plus (1 −
//! F)·G1 of the refracted one, F exact. White glass of `specularFactor` 1; of others it is an approximation.

use super::albedo::{SpecularAlbedo, VisibleNormals};
use super::fresnel::{self, MAX_INDEX, relative_index};
use crate::scene::{Fact, Facts, Material};

/// Tables of both sides of one boundary.
#[derive(Clone, Debug, PartialEq)]
struct Boundary {
    /// n(denser)/n(thinner), > 1.
    index: f32,
    /// From the thinner side, from the denser side.
    sides: [SpecularAlbedo; 2],
}

/// See the module.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlassAlbedo {
    boundaries: Vec<Boundary>,
}

impl GlassAlbedo {
    /// Tables for the solids among `materials`: in air, and in each other where they are `nested`; some tenths of a
    /// second for each pair of indices.
    pub fn for_materials(materials: &[Material], nested: bool) -> Self {
        let solid = materials.iter().filter(|material| {
            let facts = Facts::of(material);
            facts.has(Fact::Solid) && facts.has(Fact::Rough)
        });
        let inner: Vec<f32> = solid.map(|material| relative_index(material.ior)).collect();
        let around = materials.iter().filter(|material| nested && Facts::of(material).has(Fact::Solid));
        let outer = around.map(|material| relative_index(material.ior)).chain([1.0]);
        let mut indices: Vec<f32> =
            outer.flat_map(|outer| inner.iter().map(move |n| n / outer)).map(index_of).collect();
        indices.sort_by(f32::total_cmp);
        indices.dedup();
        GlassAlbedo::new(&indices)
    }

    /// Tables for these relative indices.
    pub fn new(indices: &[f32]) -> Self {
        let rough = indices.iter().map(|&eta| index_of(eta)).filter(|&index| index > 1.0);
        let table = |index: f32| Boundary {
            index,
            sides: [index, 1.0 / index]
                .map(|eta| SpecularAlbedo::tabulate(|mu, alpha| [returned(mu, alpha, eta), 0.0])),
        };
        GlassAlbedo { boundaries: rough.map(table).collect() }
    }

    /// The tables from outside and from inside of a boundary of index n(inside)/n(outside): those of the nearest index.
    #[inline(always)]
    pub fn at(&self, eta: f32) -> Option<[&SpecularAlbedo; 2]> {
        let index = index_of(eta);
        let off = |boundary: &&Boundary| (boundary.index / index).ln().abs();
        let nearest = self.boundaries.iter().min_by(|a, b| off(a).total_cmp(&off(b)))?;
        let [thin, dense] = &nearest.sides;
        Some(if eta >= 1.0 { [thin, dense] } else { [dense, thin] })
    }
}

/// The denser over the thinner.
#[inline(always)]
fn index_of(eta: f32) -> f32 {
    let eta = eta.min(MAX_INDEX);
    eta.max(1.0 / eta)
}

/// What comes back from both sides of one facet, of light under the cosine `mu`; `eta` is n(far side)/n(near side).
fn returned(mu: f64, alpha: f64, eta: f32) -> f64 {
    if alpha == 0.0 {
        return 1.0;
    }
    let normals = VisibleNormals { mu, alpha };
    normals.mean(|facet| {
        let interface = fresnel::dielectric(facet.o_m as f32, eta);
        let f = f64::from(interface.reflectance);
        let reflected = 2.0 * facet.o_m * facet.m_z - mu;
        let eta = f64::from(interface.eta);
        let refracted = facet.m_z * (facet.o_m / eta - f64::from(interface.cos_t)) - mu / eta;
        normals.masked(f, reflected) + normals.masked(1.0 - f, -refracted)
    })
}
