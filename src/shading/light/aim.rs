//! What light paths are aimed at: balls around the casters, surfaces that bundle light (mirrors, glass, smooth metal).
//!
//! Directions from a point are uniform over the cones that the balls are seen in, counted as often as they overlap;
//! parallel rays are uniform over the balls' disks. So a density is the number of balls that a ray meets over the sum
//! of all cones (or disks), and asks for no choice. At most [`MOST`] balls: a ball is cut in two as long as that
//! leaves less to aim at (Jensen 1996, projection maps, in closed form).

use std::collections::HashMap;
use std::f32::consts::{PI, TAU};

use glam::Vec3;

use crate::math::frame::Frame;
use crate::math::warp::concentric_disk;
use crate::scene::geometry::{Geometry, Placement};

/// Balls at most.
pub const MOST: usize = 32;

/// Boxes of the world mesh at most.
const MOST_BOXES: usize = 1 << 16;

/// A cut has to leave at most this share of the ball's disk.
const WORTH_A_CUT: f64 = 0.8;

/// Room for rounding: what a ball holds is met well inside of it.
const MARGIN: f32 = 1.001;

/// A ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Its centre.
    pub center: Vec3,
    /// Its radius, metres.
    pub radius: f32,
}

/// Balls around everything that light paths are aimed at; one at least.
#[derive(Clone, Debug)]
pub struct Aim {
    balls: Vec<Ball>,
    /// Σ πr², m².
    disks: f32,
}

impl Aim {
    /// Balls around the triangles whose material `is_caster` marks, wherever they are while the shutter is open; `None`
    /// where there is no such triangle. Neighbours in the mesh share a box where there are many, and placed meshes have
    /// one.
    pub fn of(geometry: &Geometry, is_caster: impl Fn(u32) -> bool) -> Option<Self> {
        let is_caster = &is_caster;
        let casters = |mesh: usize, instance: u32| {
            let mesh = &geometry.meshes[mesh];
            let such = move |prim: u32| {
                let triangle = &geometry.triangles[(mesh.first_triangle + prim) as usize];
                is_caster(geometry.material(instance, triangle))
            };
            let around = |[a, b, c]: [Vec3; 3]| (a.min(b).min(c), a.max(b).max(c));
            let still = mesh.later.is_empty().then(|| mesh.traced()).into_iter().flatten();
            let still = still.map(move |(prim, corners)| (prim, around(corners)));
            let changing = (!mesh.later.is_empty()).then(|| mesh.traced_moving()).into_iter().flatten();
            let changing =
                changing.filter_map(move |(prim, shapes)| Some((prim, shapes.into_iter().map(around).reduce(join)?)));
            still.chain(changing).filter(move |(prim, _)| such(*prim)).map(|(_, bounds)| bounds)
        };
        let mut boxes = Vec::new();
        if !geometry.meshes.is_empty() {
            let together = casters(0, u32::MAX).count().div_ceil(MOST_BOXES).max(1);
            for (number, bounds) in casters(0, u32::MAX).enumerate() {
                match boxes.last_mut() {
                    Some(last) if number % together != 0 => *last = join(*last, bounds),
                    _ => boxes.push(bounds),
                }
            }
        }
        // By mesh and material: a mesh that is placed a million times is looked at once.
        let mut of_mesh: HashMap<(u32, u32), Option<Bounds>> = HashMap::new();
        for (instance, placement) in (0u32..).zip(&geometry.instances) {
            let found = || casters(placement.mesh as usize, instance).reduce(join);
            let Some((low, high)) = *of_mesh.entry((placement.mesh, placement.material)).or_insert_with(found) else {
                continue;
            };
            let corner = |placed: &Placement, i: usize| {
                let at = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
                placed.world_from_object.transform_point3(Vec3::new(at(0), at(1), at(2)))
            };
            // Between two poses points move along straight lines.
            let poses = std::iter::once(placement).chain(geometry.moving.steps(instance));
            let corners = poses.flat_map(|placed| (0..8).map(move |i| corner(placed, i)));
            boxes.extend(corners.map(|corner| (corner, corner)).reduce(join));
        }
        Aim::at(cut(boxes))
    }

    /// At these balls; `None` without one.
    pub fn at(balls: Vec<Ball>) -> Option<Self> {
        let disks = balls.iter().map(|ball| PI * ball.radius * ball.radius).sum();
        (!balls.is_empty() && disks > 0.0 && f32::is_finite(disks)).then_some(Aim { balls, disks })
    }

    /// The balls.
    pub fn balls(&self) -> &[Ball] {
        &self.balls
    }

    /// Sum of the balls' disks, m².
    pub fn disks_m2(&self) -> f32 {
        self.disks
    }

    /// Sum of the cones that the balls are seen in from `org`, sr.
    pub fn cones_sr(&self, org: Vec3) -> f32 {
        self.balls.iter().map(|ball| ball.cone_sr(org)).sum()
    }

    /// A unit direction from `org`; `choice` chooses the ball.
    pub fn direction(&self, org: Vec3, choice: f32, u: [f32; 2]) -> Vec3 {
        let mut left = choice * self.cones_sr(org);
        let mut ball = &self.balls[0];
        for next in &self.balls {
            ball = next;
            left -= next.cone_sr(org);
            if left < 0.0 {
                break;
            }
        }
        // As `warp::spherical_cap`, by the height of the cap: thin cones keep their precision.
        let height = ball.cone_sr(org) / TAU;
        let to = (ball.center - org).try_normalize().unwrap_or(Vec3::Z);
        let disk = concentric_disk(u);
        let below = disk.length_squared().min(1.0) * height;
        let scale = (height * (2.0 - below)).max(0.0).sqrt();
        Frame::from_normal(to).to_world(Vec3::new(disk.x * scale, disk.y * scale, 1.0 - below)).normalize()
    }

    /// Density of [`direction`](Self::direction), sr⁻¹.
    pub fn pdf_sa(&self, org: Vec3, dir: Vec3) -> f32 {
        let met = self.balls.iter().filter(|ball| ball.is_seen(org, dir)).count();
        if met == 0 { 0.0 } else { met as f32 / self.cones_sr(org) }
    }

    /// A point on a line of direction `dir`, in the plane through the centre of a ball; `choice` chooses the ball.
    pub fn line(&self, dir: Vec3, choice: f32, u: [f32; 2]) -> Vec3 {
        let mut left = choice * self.disks;
        let mut ball = &self.balls[0];
        for next in &self.balls {
            ball = next;
            left -= PI * next.radius * next.radius;
            if left < 0.0 {
                break;
            }
        }
        let disk = concentric_disk(u) * ball.radius;
        ball.center + Frame::from_normal(dir).to_world(disk.extend(0.0))
    }

    /// Density of [`line`](Self::line) on planes across `dir`, m⁻², for the line through `p`.
    pub fn pdf_across(&self, p: Vec3, dir: Vec3) -> f32 {
        let met = self.balls.iter().filter(|ball| ball.is_on_line(p, dir)).count();
        met as f32 / self.disks
    }
}

impl Ball {
    /// Solid angle that it is seen in from `org`, sr; all directions from inside.
    #[inline(always)]
    fn cone_sr(&self, org: Vec3) -> f32 {
        let sin2 = self.radius * self.radius / self.center.distance_squared(org);
        // 1 − cos = sin²/(1 + cos).
        if sin2 < 1.0 { TAU * sin2 / (1.0 + (1.0 - sin2).sqrt()) } else { 2.0 * TAU }
    }

    /// Whether a ray from `org` meets it.
    #[inline(always)]
    fn is_seen(&self, org: Vec3, dir: Vec3) -> bool {
        let to = self.center - org;
        to.length_squared() <= self.radius * self.radius || to.dot(dir) > 0.0 && self.is_on_line(org, dir)
    }

    /// Whether the line through `p` meets it.
    #[inline(always)]
    fn is_on_line(&self, p: Vec3, dir: Vec3) -> bool {
        let to = self.center - p;
        (to - dir * to.dot(dir)).length_squared() <= self.radius * self.radius
    }
}

/// Lower and upper corner.
type Bounds = (Vec3, Vec3);

/// Balls around `boxes`: the largest that a cut makes smaller is cut, until there are [`MOST`].
fn cut(mut boxes: Vec<Bounds>) -> Vec<Ball> {
    if boxes.is_empty() {
        return Vec::new();
    }
    // Parts as ranges of `boxes`; those that no cut makes smaller are done.
    let mut parts = vec![(0..boxes.len(), around(&boxes), false)];
    while parts.len() < MOST {
        let open = parts.iter().enumerate().filter(|(_, (_, _, done))| !done);
        let Some((number, _)) = open.max_by(|(_, a), (_, b)| a.1.radius.total_cmp(&b.1.radius)) else { break };
        let (range, ball, done) = &mut parts[number];
        let part = &mut boxes[range.clone()];
        let middle = |bounds: &Bounds| 0.5 * (bounds.0 + bounds.1);
        let (low, high) = part
            .iter()
            .map(middle)
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        let axis = (high - low).max_position();
        part.sort_by(|a, b| middle(a)[axis].total_cmp(&middle(b)[axis]));
        // At the widest gap, or in the middle.
        let at = |i: usize| middle(&part[i])[axis];
        let gap = (1..part.len()).max_by(|&i, &j| (at(i) - at(i - 1)).total_cmp(&(at(j) - at(j - 1))));
        let half = part.partition_point(|bounds| middle(bounds)[axis] < 0.5 * (low[axis] + high[axis]));
        let cost = |split: usize| {
            let inside = split > 0 && split < part.len();
            inside.then(|| {
                let balls = [around(&part[..split]), around(&part[split..])];
                (balls.iter().map(|ball| f64::from(ball.radius).powi(2)).sum::<f64>(), split, balls)
            })
        };
        let best = [gap, Some(half)].into_iter().flatten().filter_map(cost).min_by(|a, b| a.0.total_cmp(&b.0));
        match best {
            Some((left, split, [first, second])) if left <= WORTH_A_CUT * f64::from(ball.radius).powi(2) => {
                let (start, end) = (range.start, range.end);
                (*range, *ball) = (start..start + split, first);
                parts.push((start + split..end, second, false));
            }
            _ => *done = true,
        }
    }
    parts.into_iter().map(|(_, ball, _)| Ball { radius: ball.radius * MARGIN, ..ball }).collect()
}

/// Around both.
fn join(a: Bounds, b: Bounds) -> Bounds {
    (a.0.min(b.0), a.1.max(b.1))
}

/// A ball around boxes.
fn around(boxes: &[Bounds]) -> Ball {
    let (low, high) = boxes
        .iter()
        .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), bounds| (low.min(bounds.0), high.max(bounds.1)));
    let center = 0.5 * (low + high);
    let farthest = |bounds: &Bounds| (center - bounds.0).abs().max((bounds.1 - center).abs()).length();
    Ball { center, radius: boxes.iter().map(farthest).fold(0.0, f32::max) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(n: usize) -> impl Iterator<Item = [f32; 2]> {
        let at = move |i: usize| (i as f32 + 0.5) / n as f32;
        (0..n * n).map(move |i| [at(i % n), at(i / n)])
    }

    /// Oracle: the mean of 1/density over the draws is the solid angle (the area) of the union of what is aimed at,
    /// here of two balls that are apart and of a second one inside of the first. Deterministic grids of 256² points,
    /// whose error at the rims is below 1 %.
    #[test]
    fn densities_are_those_of_the_draws() {
        let ball = |x: f32, radius: f32| Ball { center: Vec3::new(x, 1.0, -2.0), radius };
        for (balls, parts) in [(vec![ball(-4.0, 1.0), ball(4.0, 0.5)], 2), (vec![ball(0.0, 1.0), ball(0.1, 0.5)], 1)] {
            let aim = Aim::at(balls.clone()).expect("balls");
            let org = Vec3::new(0.5, -3.0, 1.0);
            let (mut angle, mut area, mut n) = (0.0f64, 0.0f64, 0.0);
            let dir = Vec3::new(1.0, 2.0, -0.5).normalize();
            for choice in 0..16 {
                for u in grid(256) {
                    let choice = (choice as f32 + 0.5) / 16.0;
                    let drawn = aim.direction(org, choice, u);
                    angle += f64::from(1.0 / aim.pdf_sa(org, drawn).max(1e-9));
                    area += f64::from(1.0 / aim.pdf_across(aim.line(dir, choice, u), dir).max(1e-9));
                    n += 1.0;
                }
            }
            let expected: f32 = balls[..parts].iter().map(|ball| ball.cone_sr(org)).sum();
            assert!((angle / n / f64::from(expected) - 1.0).abs() < 0.02, "{} for {expected}", angle / n);
            if parts == 2 {
                assert!((area / n / f64::from(aim.disks_m2()) - 1.0).abs() < 0.02, "{}", area / n);
            }
        }
        let inside = Aim::at(vec![ball(0.0, 10.0)]).expect("a ball");
        assert!((inside.pdf_sa(Vec3::ZERO, Vec3::Y) - 1.0 / (2.0 * TAU)).abs() < 1e-6);
        assert!(Aim::at(Vec::new()).is_none());
    }

    /// Every box lies in a ball, and things that are apart get balls of their own.
    #[test]
    fn cuts_leave_less_to_aim_at() {
        let cube = |x: f32| (Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 1.0));
        let boxes: Vec<Bounds> = (0..100).map(|i| cube(if i % 2 == 0 { 0.0 } else { 50.0 })).collect();
        let balls = cut(boxes.clone());
        assert_eq!(balls.len(), 2);
        for (low, high) in boxes {
            let holds =
                |ball: &Ball| ball.center.distance(low) <= ball.radius && ball.center.distance(high) <= ball.radius;
            assert!(balls.iter().any(holds));
        }
        assert!(cut((0..1000).map(|i| cube(3.0 * i as f32)).collect()).len() <= MOST);
    }
}
