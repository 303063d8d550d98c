//! What options and the plan know of a pixel layer besides the beauty (an AOV, arbitrary output variable): its name and
//! what has to be gathered for it. Declared in the layer's file, `film/layer/NAME.rs`.

use std::fmt;

/// A layer that can be asked for, with `--aov` or [`RenderOptions::aovs`](super::options::RenderOptions::aovs).
///
/// ```
/// # let scene = pathspace::Scene::load("scenes/cornell-box/scene.gltf")?;
/// use pathspace::{Aov, RenderOptions, Renderer};
/// let renderer = Renderer::new(&scene, RenderOptions::new(8, 8).spp(2).aovs([Aov::DEPTH, Aov::SPP]))?;
/// let render = renderer.render()?;
/// let exr = renderer.exr_options(&render);
/// let names: Vec<&str> = exr.channels.iter().map(|channel| channel.name.as_str()).collect();
/// assert_eq!(names, ["Z", "spp.Y"]);
/// assert_eq!(render.film.layer(Aov::SPP).expect("asked for")[0][0], 2.0);
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Aov {
    name: &'static str,
    gathers: Gathers,
}

/// What the stages gather for a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Gathers {
    /// Nothing: it is made of the beauty's sums.
    Nothing,
    /// Radiance by number of path edges.
    PathLengths,
    /// Radiance of the paths that have so many edges.
    Edges {
        /// At least, from 1.
        least: usize,
        /// At most.
        most: usize,
    },
    /// Radiance by the group of its light.
    LightGroups,
    /// Radiance that the first vertex after the camera scattered so.
    Scattered(Lobes),
    /// Three numbers of the surface that each path comes to through mirrors and smooth glass.
    Followed(Guide),
    /// Three numbers of what each camera sample meets first, averaged as the beauty is.
    FirstHit,
    /// Three numbers of what the ray through the pixel's centre meets as the shutter opens: a mean across an edge is a
    /// point on no surface.
    Centre,
}

/// How a vertex scatters light, in four that are all of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Lobes {
    /// Reflected by the diffuse base of a surface.
    Diffuse,
    /// Reflected by anything else: mirrors, facets, coats, fibres.
    Glossy,
    /// Through a surface, by any lobe.
    Transmission,
    /// By the particles of a medium.
    Volume,
}

/// What denoisers are told of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Guide {
    /// Its base colour.
    Albedo,
    /// Its shading normal.
    Normal,
}

impl Aov {
    /// Declares a layer. Names are a contract: scripts and compositors know them.
    pub(crate) const fn new(name: &'static str, gathers: Gathers) -> Self {
        Aov { name, gathers }
    }

    /// Name on the command line and of the channels.
    pub fn name(self) -> &'static str {
        self.name
    }

    /// What has to be gathered for it.
    pub fn gathers(self) -> Gathers {
        self.gathers
    }

    /// Whether it is made of radiance by number of path edges.
    pub fn is_of_lengths(self) -> bool {
        matches!(self.gathers, Gathers::PathLengths | Gathers::Edges { .. })
    }

    /// Whether it shows what camera rays meet first.
    pub fn is_of_first_hit(self) -> bool {
        matches!(self.gathers, Gathers::FirstHit | Gathers::Centre)
    }
}

impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
