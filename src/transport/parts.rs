//! Radiance in parts: what the layers keep that are shares of the beauty, by camera sample. Whatever adds radiance says
//! of how many edges the path was and where it began ([`Origin`]); this page alone knows which parts that is.
//!
//! What is added to the beauty is added to a part of each kind, so the parts of a sample sum to its radiance, up to the
//! rounding of f32 sums.

use glam::Vec3;

use crate::film::layer::bounces::LENGTHS;
use crate::plan::RenderPlan;
use crate::plan::aov::Lobes;

/// Where radiance began, as layers tell it apart: see `origin.rs`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Origin {
    /// Number of the light's group.
    pub group: u16,
    /// What the first surface does to a light sample that it draws; `None` elsewhere: as the path was scattered there.
    pub first: Option<First>,
}

/// How the first vertex after the camera scatters, as layers tell it apart: see `lobes.rs`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum First {
    /// There is none: the path ends where it is seen.
    #[default]
    Nowhere,
    /// A surface reflects.
    Reflected {
        /// Share of its diffuse base, by channel; the rest is glossy.
        diffuse: [f32; 3],
    },
    /// Through a surface.
    Transmitted,
    /// By a medium.
    InMedium,
}

impl First {
    /// Hands over the parts of radiance that was scattered so.
    #[inline]
    pub fn split(self, radiance: Vec3, mut add: impl FnMut(Lobes, Vec3)) {
        match self {
            First::Nowhere => {}
            First::Reflected { diffuse } => {
                let base = radiance * Vec3::from(diffuse);
                add(Lobes::Diffuse, base);
                add(Lobes::Glossy, radiance - base);
            }
            First::Transmitted => add(Lobes::Transmission, radiance),
            First::InMedium => add(Lobes::Volume, radiance),
        }
    }
}

/// Which parts are kept.
#[derive(Clone, Copy, Debug, Default)]
pub struct Wanted {
    /// By number of edges.
    pub lengths: bool,
    /// By light group: how many there are, 0 where none are wanted.
    pub groups: usize,
    /// By kind of lobe at the first vertex.
    pub lobes: bool,
    /// No part: what paths come to through mirrors and glass.
    pub followed: bool,
}

impl Wanted {
    /// What the stages of a plan gather.
    pub fn by(plan: &RenderPlan) -> Self {
        let features = &plan.features;
        let (lengths, lobes, followed) = (features.per_length, features.lobes, features.followed);
        Wanted { lengths, groups: plan.light_groups.names.len(), lobes, followed }
    }

    /// Bytes a camera sample.
    pub fn bytes(&self) -> usize {
        let lengths = if self.lengths { size_of::<[[f32; 3]; LENGTHS]>() } else { 0 };
        let lobes = if self.lobes { size_of::<[[f32; 3]; LOBES]>() + size_of::<First>() } else { 0 };
        lengths + self.groups * size_of::<[f32; 3]>() + lobes
    }
}

/// The parts of the camera samples of a wave.
pub struct Parts {
    /// Whether any are kept.
    any: bool,
    /// By camera sample and number of edges; empty unless wanted.
    lengths: Vec<[[f32; 3]; LENGTHS]>,
    /// By camera sample, then by light group; empty unless wanted.
    groups: Vec<[f32; 3]>,
    /// Number of groups.
    width: usize,
    /// By camera sample and kind of lobe; empty unless wanted.
    lobes: Vec<[[f32; 3]; LOBES]>,
    /// How the first vertices scattered, by camera sample; empty unless wanted.
    first: Vec<First>,
}

/// Kinds of lobes.
const LOBES: usize = 4;

impl Parts {
    /// For `capacity` camera samples.
    pub fn new(capacity: usize, wanted: &Wanted) -> Self {
        Parts {
            any: wanted.lengths || wanted.groups > 0 || wanted.lobes,
            lengths: vec![[[0.0; 3]; LENGTHS]; if wanted.lengths { capacity } else { 0 }],
            groups: vec![[0.0; 3]; capacity * wanted.groups],
            width: wanted.groups,
            lobes: vec![[[0.0; 3]; LOBES]; if wanted.lobes { capacity } else { 0 }],
            first: vec![First::Nowhere; if wanted.lobes { capacity } else { 0 }],
        }
    }

    /// Whether any are kept.
    #[inline(always)]
    pub fn any(&self) -> bool {
        self.any
    }

    /// For new camera samples.
    pub fn clear(&mut self) {
        self.lengths.fill([[0.0; 3]; LENGTHS]);
        self.groups.fill([0.0; 3]);
        self.lobes.fill([[0.0; 3]; LOBES]);
        self.first.fill(First::Nowhere);
    }

    /// Adds radiance of a path of `edge` edges to the parts of a camera sample. Out of line: most renders have none.
    #[cold]
    #[inline(never)]
    pub fn add(&mut self, slot: u32, edge: u32, origin: Origin, radiance: Vec3) {
        let slot = slot as usize;
        if let Some(lengths) = self.lengths.get_mut(slot) {
            increase(&mut lengths[(edge as usize).min(LENGTHS - 1)], radiance);
        }
        if self.width > 0 {
            increase(&mut self.groups[slot * self.width + usize::from(origin.group)], radiance);
        }
        if let Some(lobes) = self.lobes.get_mut(slot) {
            let first = origin.first.unwrap_or(self.first[slot]);
            first.split(radiance, |kind, part| increase(&mut lobes[kind as usize], part));
        }
    }

    /// Notes how the path of a camera sample is scattered at its first vertex.
    pub fn scatter_first(&mut self, slot: u32, first: First) {
        if let Some(of) = self.first.get_mut(slot as usize) {
            *of = first;
        }
    }

    /// Of a camera sample, by kind of lobe at the first vertex.
    pub fn by_lobe(&self, slot: usize, kind: Lobes) -> &[f32; 3] {
        &self.lobes[slot][kind as usize]
    }

    /// Of a camera sample, by number of edges.
    pub fn by_length(&self, slot: usize) -> &[[f32; 3]; LENGTHS] {
        &self.lengths[slot]
    }

    /// Of a camera sample, by light group.
    pub fn by_group(&self, slot: usize) -> &[[f32; 3]] {
        &self.groups[slot * self.width..][..self.width]
    }
}

#[inline(always)]
fn increase(sum: &mut [f32; 3], radiance: Vec3) {
    for c in 0..3 {
        sum[c] += radiance[c];
    }
}
