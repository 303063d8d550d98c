//! A tape that keeps everything: the vertices of one path.

use super::tape::{Event, Tape};
use super::vertex::{Met, Number, Shadow, Vertex, triple};

/// The path as it went.
#[derive(Default)]
pub struct Story {
    /// Its vertices.
    pub vertices: Vec<Vertex>,
    /// Scatterings of the contribution with which the sum ceased to be finite.
    pub nonfinite: Option<u32>,
}

impl Tape for Story {
    const ON: bool = true;

    fn note(&mut self, event: impl FnOnce() -> Event) {
        let event = event();
        if let Event::Vertex(vertex) = event {
            self.vertices.push(*vertex);
            return;
        }
        let vertex = self.vertices.last_mut().expect("a ray is traced before anything is decided");
        match event {
            Event::Vertex(_) => unreachable!("handled above"),
            Event::Surface(surface) => vertex.met = Met::Surface(surface),
            Event::Medium(medium) => vertex.met = Met::Medium(medium),
            Event::Emission(emission) => vertex.emission = Some(emission),
            Event::Roulette(roulette) => vertex.roulette = Some(roulette),
            Event::Model(name, n, alpha) => {
                if let Met::Surface(surface) = &mut vertex.met {
                    surface.kind = Some(name);
                    surface.normal_shading = triple(n);
                    surface.widest_alpha = Some(Number(alpha));
                }
            }
            Event::Light(light) => vertex.light = Some(light),
            Event::Scattering(scattering) => vertex.scattering = Some(scattering),
            Event::End(end) => vertex.end = end,
            Event::Shadow(carried) => {
                if let Some(light) = &mut vertex.light {
                    match carried {
                        // Surfaces on the way may have taken their share.
                        Some(radiance) => light.contribution = radiance.map(Number),
                        None => light.outcome = Shadow::Blocked,
                    }
                }
            }
            Event::Gathered(radiance, scatterings) => {
                vertex.gathered = radiance.map(Number);
                if self.nonfinite.is_none() && !radiance.iter().all(|c| c.is_finite()) {
                    self.nonfinite = Some(scatterings);
                }
            }
        }
    }
}
