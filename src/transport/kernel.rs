//! The driver of every scattering model: sixteen lanes of one model at the vertices of a block. It handles frames,
//! sides and look-ups; the model computes ([`Bsdf`]). Loops over lanes of a model without branches become vector code.
//!
//! A frame's normal faces the viewer on opaque surfaces, and the authored outside on those that transmit.

use glam::Vec3;

use super::material::{self, Factors};
use super::tape::{Event, LANE, Tape};
use super::vertex::{self, Number, triple};
use super::vertices::Vertices;
use super::wave::{PathBlock, RayLanes};
use super::world::World;
use crate::backend::batch::{LANES, RayHitBlock};
use crate::math::columns::{Column, Lane, Lane3, Mask, ZERO, ZERO3, get, set};
use crate::math::frame::Frame;
use crate::shading::bsdf::model::{Bsdf, BsdfEval, BsdfSample};

/// What [`Lanes::sample`] returns for lanes of a delta lobe that was drawn about the geometric normal.
pub const FLAT: u32 = 3;

/// Sixteen surfaces with the viewer's side of them worked out.
#[repr(C, align(64))]
pub struct Lanes<'t, B: Bsdf<'t>> {
    bsdf: B::Lanes,
    view: <B::View as Column>::Lanes,
    /// Directions to the viewers in the shading frames.
    wo: Lane3,
    /// Whether layers have something to look up.
    layered: bool,
    /// Whether normal maps may tilt normals, so that lobes reach below the surface.
    folds: bool,
}

/// What [`Lanes::eval`] finds.
#[repr(C, align(64))]
pub struct Scattered {
    /// f·|cos θ_i|, sr⁻¹.
    pub f_cos: Lane3,
    /// Density, sr⁻¹.
    pub pdf_sa: Lane,
}

impl<'t, B: Bsdf<'t>> Lanes<'t, B> {
    /// Looks the materials of the active lanes up. Switches off lanes that scatter nothing; normal maps tilt shading
    /// normals.
    #[inline(always)]
    pub fn resolve(world: &World<'t>, rays: &RayHitBlock, vertices: &mut Vertices, u_material: &Lane) -> Self {
        // Layers may have the normals of the mesh, where the surface below has a map's.
        let n_mesh = vertices.n_s;
        let factors =
            if B::TEXTURED { Factors::look_up(world, rays, vertices) } else { Factors::base_color(world, vertices) };
        let tables = &world.tables;
        let idle = B::idle(tables);
        let mut lanes = Self {
            bsdf: idle.splat(),
            view: idle.view(Vec3::Z, 1.0).splat(),
            wo: ZERO3,
            layered: B::LAYERED && tables.coated,
            folds: B::TEXTURED && world.features.folded_normals,
        };
        for i in 0..LANES {
            if B::COLUMNS || vertices.active[i] != 0 {
                let material = &world.scene.materials[vertices.material[i] as usize];
                let (textured, u) = (factors.textured(i), u_material[i]);
                let bsdf = if B::EXTENDED {
                    let extended = material::extended(world, rays, vertices, i, get(&n_mesh, i));
                    B::extended(material, &textured, &extended, tables, u)
                } else {
                    B::new(material, &textured, tables, u)
                };
                B::set(&mut lanes.bsdf, i, bsdf);
            }
        }
        for i in 0..LANES {
            if B::COLUMNS || vertices.active[i] != 0 {
                let mut bsdf = lanes.bsdf(i);
                if B::EXTENDED {
                    bsdf.orient(&lanes.frame(vertices, i));
                    B::set(&mut lanes.bsdf, i, bsdf);
                }
                let wo = lanes.to_local(vertices, i, get(&vertices.wo, i));
                put::<B>(&mut lanes.wo, i, wo);
                // A normal map may have turned an opaque surface away.
                let seen = bsdf.outward() | (wo.z > 0.0);
                vertices.active[i] &= u32::from(seen) & u32::from(bsdf.scatters());
            }
        }
        let mut below_o = [1.0; LANES];
        if lanes.layered {
            for i in 0..LANES {
                let mut bsdf = lanes.bsdf(i);
                bsdf.look_up(tables);
                B::set(&mut lanes.bsdf, i, bsdf);
                below_o[i] = bsdf.below(lanes.wo[2][i]);
            }
        }
        for i in 0..LANES {
            if B::COLUMNS || vertices.active[i] != 0 {
                let view = lanes.bsdf(i).view(get(&lanes.wo, i), below_o[i]);
                B::View::set(&mut lanes.view, i, view);
            }
        }
        lanes
    }

    /// Active lanes for which a light sample can find anything; all of them if `at_deltas`.
    #[inline(always)]
    pub fn lit(&self, vertices: &Vertices, at_deltas: bool) -> Mask {
        let mut lit = vertices.active;
        if B::DELTAS {
            for i in 0..LANES {
                lit[i] &= u32::from(at_deltas | !self.bsdf(i).is_delta());
            }
        }
        lit
    }

    /// Normals with which lights are chosen, 0 where light from both sides counts.
    #[inline(always)]
    pub fn receiver_n(&self, vertices: &Vertices) -> Lane3 {
        let mut n = vertices.n_s;
        if B::TRANSMITS {
            for i in 0..LANES {
                if self.bsdf(i).outward() {
                    set(&mut n, i, Vec3::ZERO);
                }
            }
        }
        n
    }

    /// f·|cos θ_i| and the density of `sample` for unit world directions; 0 where nothing can be scattered.
    #[inline(always)]
    pub fn eval(&self, vertices: &Vertices, wi: &Lane3) -> Scattered {
        let (mut local, mut seen) = (ZERO3, [0; LANES]);
        for i in 0..LANES {
            if B::COLUMNS || vertices.active[i] != 0 {
                let world = get(wi, i);
                let wi = self.to_local(vertices, i, world);
                put::<B>(&mut local, i, wi);
                seen[i] = consistent::<B>(self.wo[2][i], wi.z, get(&vertices.n_g, i).dot(world));
            }
        }
        let split = self.split(&local[2]);
        let mut scattered = Scattered { f_cos: ZERO3, pdf_sa: ZERO };
        for i in 0..LANES {
            if B::COLUMNS || seen[i] != 0 {
                let eval = self.bsdf(i).eval(get(&self.wo, i), get(&local, i), &self.view(i), split[i]);
                let seen = seen[i] != 0;
                for c in 0..3 {
                    scattered.f_cos[c][i] = if seen { eval.f_cos[c] } else { 0.0 };
                }
                scattered.pdf_sa[i] = if seen { eval.pdf_sa } else { 0.0 };
            }
        }
        if self.folds {
            self.unfold(vertices, wi, &mut scattered);
        }
        scattered
    }

    /// Adds what is scattered into the mirror images of `wi` below the surface, which comes out above: see
    /// [`fold`](Self::fold).
    #[inline(never)]
    fn unfold(&self, vertices: &Vertices, wi: &Lane3, scattered: &mut Scattered) {
        for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
            let (wi, n_g) = (get(wi, i), get(&vertices.n_g, i));
            let cos = n_g.dot(wi);
            if cos > 0.0
                && let Some(below) = self.eval_beyond(vertices, i, wi - n_g * (2.0 * cos))
            {
                let f_cos = get(&scattered.f_cos, i) + below.f_cos;
                set(&mut scattered.f_cos, i, f_cos);
                scattered.pdf_sa[i] += below.pdf_sa;
            }
        }
    }

    /// A lobe about a tilted normal reaches below the surface, where nothing can go. An opaque surface sends that part
    /// of it to its mirror image about the surface, so that no light is lost; density and value there are sums of both.
    #[inline(never)]
    fn fold(&self, vertices: &Vertices, rays: &mut RayLanes, to: &mut PathBlock, keep: &mut Mask) {
        for i in (0..LANES).filter(|&i| vertices.active[i] != 0) {
            let pdf_sa = to.last_pdf_sa[i];
            let (wi, n_g) = (get(&rays.dir, i), get(&vertices.n_g, i));
            if !(pdf_sa > 0.0 && pdf_sa < f32::INFINITY && get(&vertices.n_s, i).dot(wi) > 0.0) {
                continue;
            }
            let cos = n_g.dot(wi);
            let mirrored = wi - n_g * (2.0 * cos);
            if cos < 0.0 && !self.bsdf(i).outward() {
                set(&mut rays.dir, i, mirrored);
                keep[i] = 1;
            }
            if let Some(other) = self.eval_beyond(vertices, i, mirrored) {
                to.last_pdf_sa[i] += other.pdf_sa;
            }
        }
    }

    /// Value and density of lane `i` about its tilted normal, whatever the surface says; `None` where it is
    /// transmissive or the lobe does not reach.
    fn eval_beyond(&self, vertices: &Vertices, i: usize, wi: Vec3) -> Option<BsdfEval> {
        let local = self.beyond(vertices, i, wi)?;
        let (bsdf, view) = (self.bsdf(i), self.view(i));
        let split = if self.layered { bsdf.split(&view, local.z) } else { 1.0 };
        Some(bsdf.eval(get(&self.wo, i), local, &view, split))
    }

    /// A direction within the reach of the tilted lobe of lane `i`, in its shading frame; `None` as above.
    fn beyond(&self, vertices: &Vertices, i: usize, wi: Vec3) -> Option<Vec3> {
        if !(get(&vertices.n_s, i).dot(wi) > 0.0) || self.bsdf(i).outward() {
            return None;
        }
        Some(self.to_local(vertices, i, wi)).filter(|local| local.z > 0.0)
    }

    /// The part of f·|cos θ_i| in [`eval`](Self::eval) that the diffuse base of lane `i` reflects, for a unit world
    /// direction.
    pub fn diffuse(&self, vertices: &Vertices, i: usize, wi: Vec3) -> Vec3 {
        let (bsdf, view, wo, n_g) = (self.bsdf(i), self.view(i), get(&self.wo, i), get(&vertices.n_g, i));
        let of = |local: Vec3| {
            let split = if self.layered { bsdf.split(&view, local.z) } else { 1.0 };
            bsdf.diffuse(wo, local, &view, split)
        };
        let (local, cos) = (self.to_local(vertices, i, wi), n_g.dot(wi));
        let seen = consistent::<B>(wo.z, local.z, cos) != 0;
        let own = if seen { of(local) } else { Vec3::ZERO };
        match self.folds && cos > 0.0 {
            true => own + self.beyond(vertices, i, wi - n_g * (2.0 * cos)).map_or(Vec3::ZERO, of),
            false => own,
        }
    }

    /// Value and density of the way back in one lane: seen from `wi`, lit from where the path came from. (Without what
    /// normal maps fold.)
    #[inline]
    pub fn reverse(&self, vertices: &Vertices, i: usize, wi: Vec3) -> BsdfEval {
        self.bsdf(i).value(self.to_local(vertices, i, wi), get(&self.wo, i))
    }

    /// Draws directions by `u[0]` (lobe), `u[1]`, `u[2]`: fills the rays' directions and what paths carry, `beta` with
    /// weights f·|cos θ_i|/pdf. Returns the lanes that continue, as 1 or [`FLAT`]. Refused are directions on the wrong
    /// geometric side.
    #[inline(always)]
    pub fn sample<T: Tape>(
        &self,
        vertices: &Vertices,
        u: &[Lane; 4],
        to: (&mut RayLanes, &mut PathBlock),
        tape: &mut T,
    ) -> Mask {
        let (rays, to) = to;
        let mut split = [1.0; LANES];
        if self.layered {
            let mut cos_i = ZERO;
            for i in 0..LANES {
                cos_i[i] = B::wi(&self.draw(i, u)).z;
            }
            split = self.split(&cos_i);
        }
        let (mut keep, mut eta): (Mask, Lane) = ([0; LANES], [1.0; LANES]);
        for i in 0..LANES {
            if B::COLUMNS || vertices.active[i] != 0 {
                // Drawn again rather than kept: sixteen facets would leave the registers.
                let drawn = self.draw(i, u);
                let sample = self.bsdf(i).weigh(get(&self.wo, i), &drawn, &self.view(i), split[i]);
                let wi = self.frame(vertices, i).to_world(sample.wi);
                set(&mut rays.dir, i, wi);
                set(&mut to.beta, i, sample.weight);
                to.last_pdf_sa[i] = sample.pdf_sa;
                eta[i] = sample.eta;
                let side = consistent::<B>(self.wo[2][i], sample.wi.z, get(&vertices.n_g, i).dot(wi));
                keep[i] = u32::from(sample.pdf_sa > 0.0) & side;
            }
        }
        if self.folds {
            self.fold(vertices, rays, to, &mut keep);
        }
        if B::DELTAS {
            for i in 0..LANES {
                let refused = keep[i] == 0 && vertices.active[i] != 0 && to.last_pdf_sa[i] > 0.0;
                if refused
                    && self.bsdf(i).is_delta()
                    && let Some((sample, wi)) = self.draw_flat(vertices, i, [u[0][i], u[1][i], u[2][i]])
                {
                    set(&mut rays.dir, i, wi);
                    set(&mut to.beta, i, sample.weight);
                    (to.last_pdf_sa[i], eta[i], keep[i]) = (sample.pdf_sa, sample.eta, FLAT);
                }
            }
        }
        if B::TRANSMITS {
            Self::cross((&eta, &keep), to);
        }
        if T::ON && keep[LANE] & vertices.active[LANE] != 0 {
            tape.note(|| Event::Scattering(self.told(vertices, [u[0][LANE], eta[LANE]], &rays.dir, to)));
        }
        keep
    }

    /// Whether the active lane `i` is opaque and has a lobe of GGX alpha `least_alpha` or more.
    #[inline]
    pub fn spreads(&self, i: usize, least_alpha: f32) -> bool {
        let bsdf = self.bsdf(i);
        !bsdf.outward() && bsdf.widest_alpha() >= least_alpha
    }

    /// Notes what the surface of the path that is written down is.
    #[inline(always)]
    pub fn tell<T: Tape>(&self, vertices: &Vertices, tape: &mut T) {
        tape.note(|| {
            let bsdf = self.bsdf(LANE);
            Event::Model(bsdf.name(), self.frame(vertices, LANE).n.into(), bsdf.widest_alpha())
        });
    }

    /// The direction of the path that is written down: `u` chose the lobe.
    pub fn told(&self, vertices: &Vertices, [u, eta]: [f32; 2], dir: &Lane3, to: &PathBlock) -> vertex::Scattering {
        let wi = get(dir, LANE);
        let reflected = get(&vertices.n_g, LANE).dot(wi) > 0.0;
        let lobe = self.bsdf(LANE).lobe(get(&self.wo, LANE), u, &self.view(LANE), reflected);
        vertex::Scattering {
            lobe: lobe.name,
            alpha: Number(lobe.alpha),
            wi: triple(wi),
            pdf_sa: Number(to.last_pdf_sa[LANE]),
            weight: triple(get(&to.beta, LANE)),
            eta: Number(eta),
        }
    }

    #[inline(always)]
    fn bsdf(&self, i: usize) -> B {
        B::get(&self.bsdf, i)
    }

    #[inline(always)]
    fn view(&self, i: usize) -> B::View {
        B::View::get(&self.view, i)
    }

    #[inline(always)]
    fn draw(&self, i: usize, u: &[Lane; 4]) -> B::Drawn {
        self.bsdf(i).draw(get(&self.wo, i), [u[0][i], u[1][i], u[2][i]], &self.view(i))
    }

    /// Shading frame of one lane.
    #[inline(always)]
    fn frame(&self, vertices: &Vertices, i: usize) -> Frame {
        let n_s = get(&vertices.n_s, i);
        Frame::from_normal(if B::TRANSMITS && self.bsdf(i).outward() { n_s * vertices.side[i] } else { n_s })
    }

    /// A direction in the shading frame of one lane, as far as the model asks for it.
    #[inline(always)]
    fn to_local(&self, vertices: &Vertices, i: usize, world: Vec3) -> Vec3 {
        if B::COSINES {
            return Vec3::new(0.0, 0.0, get(&vertices.n_s, i).dot(world));
        }
        self.frame(vertices, i).to_local(world)
    }

    /// What upper layers leave to lower ones for light under these cosines.
    #[inline(always)]
    fn split(&self, cos_i: &Lane) -> Lane {
        let mut split = [1.0; LANES];
        if self.layered {
            for i in 0..LANES {
                split[i] = self.bsdf(i).split(&self.view(i), cos_i[i]);
            }
        }
        split
    }

    /// A delta lobe whose interpolated normal sends light to the wrong side: drawn about the geometric normal, so that
    /// smooth mirrors and glass lose nothing at their silhouettes. With the direction in the world.
    fn draw_flat(&self, vertices: &Vertices, i: usize, u: [f32; 3]) -> Option<(BsdfSample, Vec3)> {
        let (bsdf, n_g) = (self.bsdf(i), get(&vertices.n_g, i));
        let frame = Frame::from_normal(if bsdf.outward() { n_g * vertices.side[i] } else { n_g });
        let wo = frame.to_local(get(&vertices.wo, i));
        let sample = bsdf.sampled(wo, u)?;
        let wi = frame.to_world(sample.wi);
        (consistent::<B>(wo.z, sample.wi.z, n_g.dot(wi)) != 0).then_some((sample, wi))
    }

    /// What changes for paths that crossed a surface.
    #[inline(always)]
    fn cross((eta, keep): (&Lane, &Mask), to: &mut PathBlock) {
        for i in (0..LANES).filter(|&i| keep[i] != 0) {
            to.eta_scale[i] *= eta[i] * eta[i];
        }
    }
}

/// Writes a direction in the shading frame of one lane, as far as the model asks for it.
#[inline(always)]
fn put<'t, B: Bsdf<'t>>(column: &mut Lane3, i: usize, local: Vec3) {
    if B::COSINES {
        column[2][i] = local.z;
    } else {
        set(column, i, local);
    }
}

/// 1 where a direction lies on the same side (reflection) or the other side (transmission) of both normals: by its
/// local cosine and that with the geometric normal, which faces the viewer.
#[inline(always)]
fn consistent<'t, B: Bsdf<'t>>(wo_z: f32, wi_z: f32, cos_g: f32) -> u32 {
    if B::TRANSMITS {
        let reflected = (wo_z > 0.0) == (wi_z > 0.0);
        u32::from(reflected == (cos_g > 0.0))
    } else {
        u32::from(wi_z > 0.0) & u32::from(cos_g > 0.0)
    }
}
