//! Bounding balls and boxes of what the hierarchy traces, and which of sixteen rays come near one.

use std::f32::consts::TAU;

use super::parts::Body;
use crate::backend::batch::{LANES, RayBlock};
use crate::backend::bounds::Bounds;
use crate::backend::obvhs::tree::{Below, Tree};
use crate::math::float::UNIT_ROUNDOFF;

/// Roundings, over the coordinates of ray and volumes, by which volumes are larger than what is in them.
const SLACK: f32 = 16.0 * UNIT_ROUNDOFF;

/// Direction components are at least this, so that reciprocals are numbers.
const LEAST_DIRECTION: f32 = 1e-18;

/// All volumes.
#[derive(Clone, Debug, Default)]
pub(super) struct Volumes {
    /// Centre and radius.
    balls: Vec<[f32; 4]>,
    /// Lower and upper corner.
    boxes: Vec<[f32; 6]>,
    /// Largest sum of a corner's coordinates, metres.
    reach: f32,
    /// Times that errors of origins may grow on their way into an instance and back.
    stretch: f32,
    /// Half of all surfaces together, m².
    pub half_area: f32,
}

impl Volumes {
    /// Around all bodies, `most` volumes at most. `stretch` ≥ 1 is how much an error of a ray's origin may grow.
    pub fn new(bodies: &[Body], most: usize, stretch: f32) -> Self {
        let mut volumes = Volumes { stretch, ..Volumes::default() };
        for body in clusters(bodies, most) {
            let Bounds { lo, hi } = body.bounds;
            let (ball, cuboid) = (TAU * body.radius * body.radius, body.bounds.half_area());
            volumes.reach = volumes.reach.max(lo.abs().max(hi.abs()).element_sum());
            volumes.half_area += ball.min(cuboid);
            if ball < cuboid {
                let c = body.bounds.center();
                volumes.balls.push([c.x, c.y, c.z, body.radius]);
            } else {
                volumes.boxes.push([lo.x, lo.y, lo.z, hi.x, hi.y, hi.z]);
            }
        }
        volumes
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.balls.len() + self.boxes.len()
    }

    /// The lanes of `valid` whose segment comes near a volume. Errs towards yes.
    #[inline(always)]
    pub fn near(&self, ray: &RayBlock, valid: u16) -> u16 {
        let mut near = [0u32; LANES];
        let (mut slack, mut inverse) = ([0.0; LANES], [[0.0; LANES]; 3]);
        for i in 0..LANES {
            let from = ray.org_x[i].abs() + ray.org_y[i].abs() + ray.org_z[i].abs();
            slack[i] = SLACK * self.stretch * (from + self.reach);
            inverse[0][i] = reciprocal(ray.dir_x[i]);
            inverse[1][i] = reciprocal(ray.dir_y[i]);
            inverse[2][i] = reciprocal(ray.dir_z[i]);
        }
        for &[cx, cy, cz, r] in &self.balls {
            for i in 0..LANES {
                let (dx, dy, dz) = (ray.dir_x[i], ray.dir_y[i], ray.dir_z[i]);
                let (sx, sy, sz) = (cx - ray.org_x[i], cy - ray.org_y[i], cz - ray.org_z[i]);
                // Directions need not be unit vectors: `valid_lanes` asks for 0.25 < d² < 4.
                let over = 1.0 / dx.mul_add(dx, dy.mul_add(dy, dz * dz));
                let along = sx.mul_add(dx, sy.mul_add(dy, sz * dz)) * over;
                let (lx, ly, lz) = (along.mul_add(-dx, sx), along.mul_add(-dy, sy), along.mul_add(-dz, sz));
                let wide = r + slack[i];
                let left = wide.mul_add(wide, -lx.mul_add(lx, ly.mul_add(ly, lz * lz)));
                let half = ((if left > 0.0 { left } else { 0.0 }) * over).sqrt() + slack[i] + slack[i];
                near[i] |= u32::from((left >= 0.0) & (along + half >= ray.tnear[i]) & (along - half <= ray.tfar[i]));
            }
        }
        for &[lx, ly, lz, hx, hy, hz] in &self.boxes {
            for i in 0..LANES {
                let (sx, x) = ((ray.org_x[i], inverse[0][i]), slack[i]);
                let (sy, sz) = ((ray.org_y[i], inverse[1][i]), (ray.org_z[i], inverse[2][i]));
                let slab = |(o, inverse): (f32, f32), lo: f32, hi: f32| {
                    let (a, b) = ((lo - x - o) * inverse, (hi + x - o) * inverse);
                    if a < b { (a, b) } else { (b, a) }
                };
                let ((ax, bx), (ay, by), (az, bz)) = (slab(sx, lx, hx), slab(sy, ly, hy), slab(sz, lz, hz));
                let first = larger(larger(ax, ay), larger(az, ray.tnear[i]));
                let last = smaller(smaller(bx, by), smaller(bz, ray.tfar[i]));
                near[i] |= u32::from(first <= last * (1.0 + SLACK));
            }
        }
        near.iter().enumerate().fold(0, |mask, (i, &near)| mask | (near as u16) << i) & valid
    }
}

#[inline(always)]
fn reciprocal(d: f32) -> f32 {
    1.0 / if d.abs() < LEAST_DIRECTION { LEAST_DIRECTION.copysign(d) } else { d }
}

#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

#[inline(always)]
fn smaller(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Bodies as they are, or neighbours together where they are too many.
fn clusters(bodies: &[Body], most: usize) -> Vec<Body> {
    if bodies.len() <= most {
        return bodies.to_vec();
    }
    let boxes: Vec<Bounds> = bodies.iter().map(|body| body.bounds).collect();
    let tree = Tree::build(&boxes, (0..bodies.len() as u32).collect(), 1);
    let mut open = vec![0usize];
    while open.len() < most {
        let area = |&at: &usize| match tree.nodes[open[at]].below {
            Below::Nodes(..) => tree.nodes[open[at]].bounds.half_area(),
            Below::Leaf { .. } => -1.0,
        };
        let Some(at) = (0..open.len()).max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
        let Below::Nodes(left, right) = tree.nodes[open[at]].below else { break };
        open[at] = left as usize;
        open.push(right as usize);
    }
    open.into_iter()
        .map(|root| {
            let bounds = tree.nodes[root].bounds;
            let center = bounds.center();
            let (mut radius, mut pending) = (0.0f32, vec![root]);
            while let Some(at) = pending.pop() {
                match tree.nodes[at].below {
                    Below::Nodes(left, right) => pending.extend([left as usize, right as usize]),
                    Below::Leaf { first, count } => {
                        for &i in &tree.order[first as usize..][..count as usize] {
                            let body = bodies[i as usize];
                            radius = radius.max(center.distance(body.bounds.center()) + body.radius);
                        }
                    }
                }
            }
            Body { bounds, radius: radius * (1.0 + 4.0 * f32::EPSILON) }
        })
        .collect()
}
