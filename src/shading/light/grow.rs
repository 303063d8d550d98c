//! Building the light hierarchy: lights that are near each other, look the same way and are alike bright come together.
//!
//! Top down. The lights of a node are cut in two, then the costliest part again, until there are eight. The cost of a
//! part is intensity × extent² × spread of directions; a cut is the cheapest of 15 planes on each axis through the
//! lights' centres. Deep down (lights that lie on a logarithmic scale) parts are halved by number, so that every path
//! fits 64 bits. Sequential and in f64: the same tree for any number of threads. Source: Conty Estevez and Kulla 2018
//! (surface area orientation heuristic), with the squared diagonal instead of the area, which lights in one plane or on
//! one line would bring to 0, and with the mean direction's length for the spread.

use glam::{DVec3, Vec3};

use super::tree::{LEAF, LightTree, NO_PATH, Node, SLOT_BITS, WIDTH};

/// Planes that are tried along an axis, plus one.
const BINS: usize = 16;
/// From this level on parts are halved by number: 9 more levels hold 2^27 lights, 21 levels fit a path.
const HALVING_LEVEL: u32 = 12;
/// Room for the roundoffs of the weights: some more than the sphere.
const RADIUS_ROUNDING: f64 = 1.0 + 1e-5;
/// Room for rounding in the reach of a spot: its edge is compared in f32 after some roundoffs.
const REACH_ROUNDING: f32 = 4e-6;

/// What the tree knows of a light.
#[derive(Clone, Copy, Debug)]
pub struct Emitter {
    /// Number of the light.
    pub light: u32,
    /// Corners (all the same for a punctual light, one twice for a triangle).
    pub corners: [Vec3; 4],
    /// Direction of the largest intensity.
    pub axis: Vec3,
    /// Half angle around the axis within which the intensity is that of the axis, rad: 0 for a triangle, π for a
    /// point.
    pub spread: f64,
    /// Angle beyond `spread` at which emission ends, rad; until then it falls off at most like the cosine of it.
    pub reach: f64,
    /// Intensity along the axis, W/sr; > 0.
    pub intensity: f64,
}

impl Emitter {
    fn center(&self) -> DVec3 {
        let [a, b, c, d] = self.corners.map(|corner| corner.as_dvec3());
        let (low, high) = (a.min(b).min(c).min(d), a.max(b).max(c).max(d));
        0.5 * (low + high)
    }
}

/// Sums over a part, which give its cost.
#[derive(Clone, Copy)]
struct Sums {
    low: DVec3,
    high: DVec3,
    /// Σ intensity · axis.
    direction: DVec3,
    intensity: f64,
    count: usize,
}

impl Sums {
    const EMPTY: Sums =
        Sums { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, direction: DVec3::ZERO, intensity: 0.0, count: 0 };

    fn add(&mut self, emitter: &Emitter) {
        for corner in emitter.corners {
            let corner = corner.as_dvec3();
            (self.low, self.high) = (self.low.min(corner), self.high.max(corner));
        }
        // A light that shines all around has no direction.
        self.direction += emitter.axis.as_dvec3() * (emitter.intensity * emitter.spread.cos().max(0.0));
        self.intensity += emitter.intensity;
        self.count += 1;
    }

    fn join(&self, other: &Sums) -> Sums {
        Sums {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            direction: self.direction + other.direction,
            intensity: self.intensity + other.intensity,
            count: self.count + other.count,
        }
    }

    fn of(emitters: &[Emitter]) -> Sums {
        let mut sums = Sums::EMPTY;
        emitters.iter().for_each(|emitter| sums.add(emitter));
        sums
    }

    /// Intensity × extent² × the solid angle into which the part shines over that of one direction.
    fn cost(&self) -> f64 {
        if self.count == 0 {
            return 0.0;
        }
        let together = self.direction.length() / self.intensity;
        self.intensity * (self.high - self.low).length_squared() * (1.0 + 3.0 * (1.0 - together).max(0.0))
    }
}

/// A run of the emitters that becomes one child.
struct Part {
    range: std::ops::Range<usize>,
    cost: f64,
}

impl LightTree {
    /// A tree over emitters (at least one; intensities positive and finite) of `lights` lights.
    pub fn grow(mut emitters: Vec<Emitter>, lights: usize) -> LightTree {
        // Weights near 1 whatever the unit of length and of power.
        let all = Sums::of(&emitters);
        let brightest = emitters.iter().fold(0.0f64, |most, emitter| most.max(emitter.intensity));
        let extent2 = (all.high - all.low).length_squared();
        let extent2 = if extent2 > 0.0 && extent2.is_finite() { extent2 } else { 1.0 };
        let scale = extent2 / brightest;
        let mut tree = LightTree { nodes: Vec::new(), paths: vec![NO_PATH; lights], unit: 1.0 / scale };
        let count = emitters.len();
        tree.append(&mut emitters, 0..count, scale, 0, 0);
        tree
    }

    /// Appends the node over a run of emitters; `path` leads to it.
    fn append(
        &mut self,
        emitters: &mut [Emitter],
        range: std::ops::Range<usize>,
        scale: f64,
        level: u32,
        path: u64,
    ) -> u32 {
        let number = self.nodes.len() as u32;
        self.nodes.push(Node::EMPTY);
        let parts = parts(emitters, range, level);
        for (slot, part) in parts.into_iter().enumerate() {
            bound(&mut self.nodes[number as usize], slot, &emitters[part.range.clone()], scale);
            let path = path | (slot as u64) << (SLOT_BITS * level);
            let child = if part.range.len() == 1 {
                let light = emitters[part.range.start].light;
                self.paths[light as usize] = path;
                LEAF | light
            } else {
                self.append(emitters, part.range, scale, level + 1, path)
            };
            self.nodes[number as usize].child[slot] = child;
        }
        number
    }
}

/// Cuts a run into at most [`WIDTH`] parts; orders the emitters accordingly.
fn parts(emitters: &mut [Emitter], range: std::ops::Range<usize>, level: u32) -> Vec<Part> {
    let halve = level >= HALVING_LEVEL;
    let part = |emitters: &[Emitter], range: std::ops::Range<usize>| {
        let cost = if halve { range.len() as f64 } else { Sums::of(&emitters[range.clone()]).cost() };
        Part { range, cost }
    };
    let mut parts = vec![part(emitters, range)];
    while parts.len() < WIDTH {
        let largest = (parts.iter().enumerate())
            .filter(|(_, part)| part.range.len() > 1)
            .max_by(|(_, a), (_, b)| a.cost.total_cmp(&b.cost).then(a.range.len().cmp(&b.range.len())));
        let Some((position, _)) = largest else { break };
        let range = parts[position].range.clone();
        let middle = range.start + if halve { range.len() / 2 } else { cut(&mut emitters[range.clone()]) };
        parts[position] = part(emitters, range.start..middle);
        parts.insert(position + 1, part(emitters, middle..range.end));
    }
    parts
}

/// Orders the emitters along the best plane; returns how many lie before it, at least one and not all.
fn cut(emitters: &mut [Emitter]) -> usize {
    let centers = emitters.iter().map(Emitter::center);
    let (low, high) = centers.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)));
    let extent = high - low;
    let bin = |emitter: &Emitter, axis: usize| {
        let place = (emitter.center()[axis] - low[axis]) / extent[axis] * BINS as f64;
        (place as usize).min(BINS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| extent[axis] > 0.0) {
        let mut bins = [Sums::EMPTY; BINS];
        emitters.iter().for_each(|emitter| bins[bin(emitter, axis)].add(emitter));
        let mut above = [Sums::EMPTY; BINS];
        for i in (1..BINS).rev() {
            above[i - 1] = above[i].join(&bins[i]);
        }
        let mut below = Sums::EMPTY;
        for plane in 0..BINS - 1 {
            below = below.join(&bins[plane]);
            let cost = below.cost() + above[plane].cost();
            let splits = below.count > 0 && above[plane].count > 0;
            if splits && best.is_none_or(|(least, ..)| cost < least) {
                best = Some((cost, axis, plane));
            }
        }
    }
    match best {
        Some((_, axis, plane)) => {
            // Stable, so that ties keep the scene's order.
            emitters.sort_by_key(|emitter| bin(emitter, axis) > plane);
            emitters.partition_point(|emitter| bin(emitter, axis) <= plane)
        }
        // All in one place.
        None => emitters.len() / 2,
    }
}

/// Writes the bounds of some emitters into a slot of their parent.
fn bound(node: &mut Node, slot: usize, emitters: &[Emitter], scale: f64) {
    let sums = Sums::of(emitters);
    // Rounded first: the sphere is around the centre that the node holds.
    let center = (0.5 * (sums.low + sums.high)).as_vec3();
    let corners = || emitters.iter().flat_map(|emitter| emitter.corners);
    let radius2 = corners().map(|c| c.as_dvec3().distance_squared(center.as_dvec3())).fold(0.0, f64::max);

    let mean = emitters.iter().map(|e| e.axis.as_dvec3() * e.intensity).sum::<DVec3>().normalize_or_zero();
    let axis = if mean == DVec3::ZERO { emitters[0].axis } else { mean.as_vec3() };
    let angle = |e: &Emitter| e.axis.as_dvec3().angle_between(axis.as_dvec3()) + e.spread;
    // One light's own spread stays exact.
    let spread = if emitters.len() == 1 { emitters[0].spread } else { emitters.iter().map(angle).fold(0.0, f64::max) };
    let spread = spread.min(std::f64::consts::PI);
    let reach = emitters.iter().map(|e| e.reach).fold(0.0, f64::max).min(std::f64::consts::PI);

    for (axis_of, value) in node.center.iter_mut().zip(center.to_array()) {
        axis_of[slot] = value;
    }
    for (axis_of, value) in node.axis.iter_mut().zip(axis.to_array()) {
        axis_of[slot] = value;
    }
    node.radius[slot] = (radius2.sqrt() * RADIUS_ROUNDING) as f32;
    node.cos_spread[slot] = spread.cos() as f32;
    node.sin_spread[slot] = spread.sin().max(0.0) as f32;
    node.cos_reach[slot] = reach.cos() as f32 - REACH_ROUNDING;
    node.intensity[slot] = ((sums.intensity * scale) as f32).clamp(1e-30, 1e30);
}
