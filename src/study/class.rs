//! Classes of light paths: what stands between the eye and the light, as far as it decides which technique finds such a
//! path. Read off a path that is written down, one contribution at a time.
//!
//! A scattering is *smooth* where its lobe has no density (mirror, smooth glass), *narrow* up to a GGX alpha of
//! [`NARROW`], *wide* otherwise; or it happens in a medium. It is that of the lobe which was drawn. A light sample
//! reaches all lobes of a surface and counts by the widest. So one path may be narrow by the BSDF sample and wide by
//! the light sample of a coat over a diffuse base; each is how that technique sees it.
//!
//! In the expressions E is the eye, L the light, S a smooth scattering, N one that is smooth or narrow, D one that is
//! not smooth; + is one or more, … any number of any. Limit: where only BSDF sampling takes part there are no light
//! samples, and all indirect light counts as blocked.

use serde::Serialize;

use crate::transport::replay::Replay;
use crate::transport::vertex::{Met, Shadow, Vertex};

/// Largest GGX alpha of a narrow lobe.
pub const NARROW: f32 = 0.2;

/// What a light path is like; the order is that of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// A lamp or the sky, seen directly.
    Seen,
    /// A lamp or the sky, seen in mirrors and through glass.
    SeenThrough,
    /// What is seen directly is lit directly.
    Direct,
    /// What is seen in mirrors and through glass is lit directly.
    DirectThrough,
    /// Lit by other surfaces, where the first surface's own light sample arrived.
    Indirect,
    /// Lit by other surfaces, where the first surface's own light sample did not arrive.
    IndirectBlocked,
    /// What is seen directly is lit, at last, by way of mirrors, glass or narrow lobes.
    Caustic,
    /// What is seen in mirrors and through glass is lit so.
    CausticThrough,
    /// A medium scatters on the way.
    Volume,
}

impl Class {
    /// Every class, in that order.
    pub const ALL: [Class; 9] = [
        Class::Seen,
        Class::SeenThrough,
        Class::Direct,
        Class::DirectThrough,
        Class::Indirect,
        Class::IndirectBlocked,
        Class::Caustic,
        Class::CausticThrough,
        Class::Volume,
    ];

    /// Its name, and the paths in it.
    pub fn told(self) -> (&'static str, &'static str) {
        match self {
            Class::Seen => ("seen", "E L"),
            Class::SeenThrough => ("seen-through", "E S+ L"),
            Class::Direct => ("direct", "E D L"),
            Class::DirectThrough => ("direct-through", "E S+ D L"),
            Class::Indirect => ("indirect", "E S* D … D L, the light sample at the first D arrived"),
            Class::IndirectBlocked => ("indirect-blocked", "E S* D … D L, that light sample did not arrive"),
            Class::Caustic => ("caustic", "E D … N L"),
            Class::CausticThrough => ("caustic-through", "E S+ D … N L"),
            Class::Volume => ("volume", "scattered in a medium"),
        }
    }
}

/// What a scattering is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Smooth,
    Narrow,
    Wide,
    Medium,
}

impl Kind {
    fn of_alpha(alpha: f32) -> Self {
        match alpha {
            0.0 => Kind::Smooth,
            a if a <= NARROW => Kind::Narrow,
            _ => Kind::Wide,
        }
    }

    /// Of the direction that was drawn at a vertex; `None` if none was.
    fn of_sample(vertex: &Vertex) -> Option<Self> {
        let alpha = vertex.scattering?.alpha.0;
        Some(if let Met::Medium(_) = vertex.met { Kind::Medium } else { Kind::of_alpha(alpha) })
    }

    /// Of a light sample at a vertex.
    fn of_light_sample(vertex: &Vertex) -> Self {
        match &vertex.met {
            Met::Surface(surface) => Kind::of_alpha(surface.widest_alpha.map_or(1.0, |alpha| alpha.0)),
            _ => Kind::Medium,
        }
    }
}

/// The scatterings of a path from the eye on.
#[derive(Clone, Copy, Debug, Default)]
struct Way {
    first: Option<Kind>,
    last: Option<Kind>,
    /// Whether all but the last are smooth.
    smooth_before: bool,
    medium: bool,
    /// Whether the light sample at the first that is not smooth arrived.
    reached: bool,
}

impl Way {
    /// One scattering further, at `vertex`.
    fn then(self, kind: Kind, vertex: &Vertex) -> Self {
        let smooth_so_far = self.last.is_none() || self.smooth_before && self.last == Some(Kind::Smooth);
        let is_first_rough = smooth_so_far && kind != Kind::Smooth;
        let arrived = || vertex.light.is_some_and(|light| light.outcome == Shadow::Visible);
        Way {
            first: self.first.or(Some(kind)),
            last: Some(kind),
            smooth_before: smooth_so_far,
            medium: self.medium || kind == Kind::Medium,
            reached: if is_first_rough { arrived() } else { self.reached },
        }
    }

    fn class(self) -> Class {
        let (Some(first), Some(last)) = (self.first, self.last) else { return Class::Seen };
        let (direct, through) = (first != Kind::Smooth, self.smooth_before);
        match last {
            _ if self.medium => Class::Volume,
            Kind::Smooth if through => Class::SeenThrough,
            // The last is the first that is not smooth.
            _ if through && direct => Class::Direct,
            _ if through => Class::DirectThrough,
            Kind::Smooth | Kind::Narrow if direct => Class::Caustic,
            Kind::Smooth | Kind::Narrow => Class::CausticThrough,
            _ if self.reached => Class::Indirect,
            _ => Class::IndirectBlocked,
        }
    }
}

/// Light that a sample gathered along one path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contribution {
    /// What the path is like.
    pub class: Class,
    /// Its edges.
    pub edges: u32,
    /// What it adds to the sample.
    pub radiance: [f32; 3],
}

/// Tells `each` what a sample gathered, in the order in which it was added up: [`Replay::told`], one by one.
pub fn contributions(replay: &Replay, mut each: impl FnMut(Contribution)) {
    let mut way = Way::default();
    for vertex in &replay.vertices {
        if let Some(emission) = vertex.emission {
            let radiance = emission.contribution.map(|c| c.0);
            each(Contribution { class: way.class(), edges: vertex.edge, radiance });
        }
        if let Some(light) = vertex.light.filter(|light| light.outcome == Shadow::Visible) {
            let class = way.then(Kind::of_light_sample(vertex), vertex).class();
            each(Contribution { class, edges: vertex.edge + 1, radiance: light.contribution.map(|c| c.0) });
        }
        if let Some(kind) = Kind::of_sample(vertex) {
            way = way.then(kind, vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transport::vertex::{LightSample, Number};

    fn vertex(arrived: bool) -> Vertex {
        let none = [Number(0.0); 3];
        let light = LightSample {
            wi: none,
            distance_m: None,
            radiance: none,
            light_pdf_sa: Number(1.0),
            bsdf_pdf_sa: Number(0.0),
            f_cos: none,
            mis_weight: Number(1.0),
            contribution: none,
            outcome: if arrived { Shadow::Visible } else { Shadow::Blocked },
        };
        Vertex {
            edge: 1,
            origin_m: [0.0; 3],
            direction: none,
            throughput: none,
            met: Met::Infinity,
            emission: None,
            roulette: None,
            light: Some(light),
            scattering: None,
            end: None,
            gathered: none,
        }
    }

    /// Oracle: the expressions by hand. S smooth, N narrow, W wide, M a medium; a small letter where the light sample
    /// did not arrive.
    #[test]
    fn paths_belong_to_the_first_class_that_fits() {
        for (path, expected) in [
            ("", Class::Seen),
            ("S", Class::SeenThrough),
            ("SS", Class::SeenThrough),
            ("W", Class::Direct),
            ("n", Class::Direct),
            ("SW", Class::DirectThrough),
            ("SSN", Class::DirectThrough),
            ("WS", Class::Caustic),
            ("wSS", Class::Caustic),
            ("WN", Class::Caustic),
            ("NN", Class::Caustic),
            ("WWS", Class::Caustic),
            ("WSWN", Class::Caustic),
            ("SWS", Class::CausticThrough),
            ("SSwSS", Class::CausticThrough),
            ("SNS", Class::CausticThrough),
            ("WW", Class::Indirect),
            ("Ww", Class::Indirect),
            ("wW", Class::IndirectBlocked),
            ("wWW", Class::IndirectBlocked),
            ("SWSw", Class::Indirect),
            ("SwSW", Class::IndirectBlocked),
            ("M", Class::Volume),
            ("SMS", Class::Volume),
            ("WMS", Class::Volume),
        ] {
            let way = path.chars().fold(Way::default(), |way, letter| {
                let kind = match letter.to_ascii_uppercase() {
                    'S' => Kind::Smooth,
                    'N' => Kind::Narrow,
                    'W' => Kind::Wide,
                    _ => Kind::Medium,
                };
                way.then(kind, &vertex(letter.is_ascii_uppercase()))
            });
            assert_eq!(way.class(), expected, "{path}");
        }
        assert!(Class::ALL.iter().all(|class| Class::ALL.iter().filter(|other| *other == class).count() == 1));
    }

    /// Oracle: the definition.
    #[test]
    fn kinds_follow_alpha() {
        let kinds = [0.0, 1e-3, NARROW, 0.21, 1.0].map(Kind::of_alpha);
        assert_eq!(kinds, [Kind::Smooth, Kind::Narrow, Kind::Narrow, Kind::Wide, Kind::Wide]);
    }
}
