//! Which backend traces a scene, and why; and what each can be held to. Every constant of the choice stands here.
//!
//! The choice follows from [counted](super::count) work and the [weights](super::weights) of its units, so it depends
//! on the scene, the build and the processor's instruction set alone: what a render pins (`--rays`, `--isa`,
//! `--robust off`) is honoured by the chosen backend, or refused.

use std::fmt::Write as _;

use super::brute::Brute;
use super::count::draw::View;
use super::count::walk::Visits;
use super::count::{self, Counts};
#[cfg(feature = "embree")]
use super::embree::Embree;
use super::flat::{self, Flat};
use super::joint::{self, Joint};
use super::obvhs::Obvhs;
use super::weights;
use super::{Backend, BackendKind, BackendOptions, Kept, QueryMode};
use crate::error::{Error, Result};
use crate::math::simd::detect;
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Faces up to which `flat` is taken without counting.
pub const FLAT_ALONE: usize = 24;

/// Faces up to which it is a candidate: its time grows with their number, a hierarchy's hardly.
pub const FLAT_FACES: usize = 256;

/// Triangles up to which work is counted, instanced ones once. Of more, the hierarchies' building decides: obvhs takes
/// four times as long as Embree (2 µs a triangle), and a pass over all triangles would be felt.
pub const COUNTED_TRIANGLES: usize = 1 << 20;

/// Cost up to which `flat+obvhs` is taken without counting, in builds without Embree: of a ray whose line is uniform
/// among those that meet the scene's box, over that in one hierarchy of everything.
pub const DIVIDED_COST: f32 = 0.6;

/// How `flat+obvhs` divides a scene.
pub const DIVISION: joint::Limits = joint::Limits {
    // Beyond, hierarchies win.
    faces: 64,
    // On glass-caustics a face takes 1 to 2 ns of a ray's time with AVX-512, twice that with AVX2; a ray in the
    // hierarchy alone takes 150 to 250.
    face_cost: 0.01,
    // Chosen, not measured: a ball or box costs a ray about as much as a face.
    volumes: 32,
    // Chosen, not measured: beyond, the scene is no room with things in it, and the search not worth its time.
    corners: 1 << 16,
    bodies: 1 << 12,
};

/// A backend, and why it is this one.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Which.
    pub kind: BackendKind,
    /// Why, with the figures that decided: "faces: 17, at most 64".
    pub reason: String,
}

/// What a render pins.
#[derive(Clone, Copy, Debug)]
pub struct Pins<'a> {
    /// Query mode of every ray class.
    pub rays: Option<QueryMode>,
    /// Instruction set.
    pub isa: Option<&'a str>,
    /// Whether no ray may slip between triangles.
    pub robust: bool,
}

/// The backend that is asked for, else the [`fastest`] one of this build for `geometry`.
///
/// # Errors
/// [`Error::Option`] where the backend that is asked for is not in this build or cannot trace the scene, and where the
/// one that is taken cannot honour a pin.
pub fn select(
    asked: Option<BackendKind>,
    geometry: &Geometry,
    fastest: impl FnOnce() -> Choice,
    pins: Pins,
) -> Result<Choice> {
    let choice = match asked {
        None => fastest(),
        Some(kind) => {
            if kind == BackendKind::Flat && !geometry.triangles.is_empty() && !kind.traces(geometry) {
                return refuse("--backend", flat::LIMITS.into());
            }
            Choice { kind, reason: "asked for".into() }
        }
    };
    check(choice.kind, pins)?;
    Ok(choice)
}

/// Whether this build has `kind`, and it can be held to `pins`.
///
/// # Errors
/// [`Error::Option`] naming the flag, the backend, and what to do.
pub fn check(kind: BackendKind, pins: Pins) -> Result<()> {
    let name = kind.name();
    let advice = match kind {
        BackendKind::Embree => "",
        _ if cfg!(feature = "embree") => "; leave it out, or add --backend embree",
        _ => "; leave it out",
    };
    if kind != BackendKind::Flat && !BackendKind::available().contains(&kind) {
        return refuse("--backend", format!("{name} is not in this build; use obvhs, flat or brute"));
    }
    if let Some(isa) = pins.isa {
        if !kind.pins(isa) {
            return refuse("--isa", format!("backend '{name}' cannot be held to {isa}{advice}"));
        }
        if isa == detect::name(true) && kind != BackendKind::Embree && !detect::has_avx512() {
            return refuse("--isa", format!("backend '{name}' needs AVX-512 that this processor has not{advice}"));
        }
    }
    if let (Some(asked), Some(only)) = (pins.rays, kind.only_mode())
        && asked != only
    {
        return refuse("--rays", format!("backend '{name}' traces in no other way than {only}{advice}"));
    }
    if !pins.robust && kind != BackendKind::Embree {
        return refuse("--robust", format!("backend '{name}' is always robust{advice}"));
    }
    Ok(())
}

fn refuse<T>(option: &'static str, problem: String) -> Result<T> {
    Err(Error::Option { option, problem })
}

/// The fastest backend of this build for `geometry`, by the work of rays from `view`.
pub fn fastest(geometry: &Geometry, view: impl FnOnce() -> View) -> Choice {
    let faces = few_faces(geometry);
    if let Some(faces) = faces.filter(|&faces| faces <= FLAT_ALONE) {
        return Choice { kind: BackendKind::Flat, reason: format!("faces: {faces}, at most {FLAT_ALONE}") };
    }
    if geometry.triangles.len() > COUNTED_TRIANGLES {
        return uncounted(geometry);
    }
    let counts = count::of(geometry, &view(), &DIVISION);
    by_counts(&counts, faces)
}

/// Candidates of this build, the first of which wins ties, with their costs in visits of a node.
pub fn candidates(counts: &Counts, faces: Option<usize>) -> Vec<(BackendKind, f64)> {
    // Of the processor, not of what is pinned: a pin never changes the backend.
    let weights = if detect::is_wide(None) { &weights::AVX512 } else { &weights::AVX2 };
    let kinds = BackendKind::available().iter().copied().chain([BackendKind::Flat]);
    kinds.filter_map(|kind| Some((kind, weights::cost(kind, counts, faces, weights)?))).collect()
}

/// The candidate of the least cost.
fn by_counts(counts: &Counts, faces: Option<usize>) -> Choice {
    let mut costs = candidates(counts, faces);
    // Stable, so that the first wins.
    costs.sort_by(|a, b| a.1.total_cmp(&b.1));
    let list: Vec<String> = costs.iter().map(|(kind, cost)| format!("{} {cost:.1}", kind.name())).collect();
    let mut reason = format!("node visits a ray: {}; counted on {} rays", list.join(", "), counts.all_rays());
    let visits = |visits: &[Visits; 3], rays: u64| {
        let sum = count::sum(visits);
        let per = |count: u64| count as f64 / rays.max(1) as f64;
        let instances = match sum.instances {
            0 => String::new(),
            some => format!(" and {:.1} instances", per(some)),
        };
        format!("{:.1} nodes, {:.1} leaves{instances}", per(sum.nodes), per(sum.leaves))
    };
    let _ = write!(reason, ": {} in one hierarchy", visits(&counts.whole, counts.all_rays()));
    if let Some(faces) = faces {
        let _ = write!(reason, "; {faces} faces in all");
    }
    if let Some(divided) = &counts.divided {
        let near = divided.near.iter().sum::<u64>();
        let _ = write!(
            reason,
            "; or {} large faces, {} volumes, and for {:.0} % of the rays {} behind them",
            divided.faces,
            divided.volumes,
            100.0 * near as f64 / counts.all_rays().max(1) as f64,
            visits(&divided.rest, near)
        );
    }
    Choice { kind: costs[0].0, reason }
}

/// What is taken where counting does not pay.
fn uncounted(geometry: &Geometry) -> Choice {
    let (first, triangles) = (BackendKind::available()[0], geometry.triangles.len());
    let because = format!("{triangles} triangles, not counted beyond {COUNTED_TRIANGLES}");
    if first == BackendKind::Embree {
        return Choice { kind: first, reason: format!("{because}: it is built the fastest") };
    }
    let Some(division) = joint::divide(geometry, &DIVISION) else {
        return Choice { kind: first, reason: format!("{because}; no large faces around other things") };
    };
    let cost = cost(&division);
    let kind = if cost <= DIVIDED_COST { BackendKind::FlatObvhs } else { first };
    let near = 100.0 * division.near;
    let figures = format!("large faces: {}, volumes: {near:.0} % of the scene's surface", division.faces);
    let reason = format!("{because}; {figures}; cost {cost:.2} of one hierarchy's, flat+obvhs up to {DIVIDED_COST}");
    Choice { kind, reason }
}

/// What a ray costs in a divided scene, over what it costs in one hierarchy of everything.
pub fn cost(division: &joint::Division) -> f32 {
    DIVISION.face_cost * division.faces as f32 + division.near
}

/// Faces of a scene for `flat`; `None` if they are too many, or not for it.
pub fn few_faces(geometry: &Geometry) -> Option<usize> {
    let mesh = geometry.meshes.first().filter(|mesh| mesh.indices.len() <= 2 * FLAT_FACES)?;
    let faces = flat::count(&flat::Triangle::of(mesh).collect::<Vec<_>>());
    (faces <= FLAT_FACES && flat::can_trace(geometry)).then_some(faces)
}

impl BackendKind {
    /// Whether this build has the backend and it can trace `geometry`.
    pub fn traces(self, geometry: &Geometry) -> bool {
        match self {
            BackendKind::Flat => flat::can_trace(geometry),
            _ => BackendKind::available().contains(&self),
        }
    }

    /// Whether the backend can be held to instruction set `isa`, given a processor that has it.
    pub fn pins(self, isa: &str) -> bool {
        match self {
            BackendKind::Embree => true,
            BackendKind::Obvhs | BackendKind::Flat | BackendKind::FlatObvhs => {
                [detect::name(false), detect::name(true)].contains(&isa)
            }
            BackendKind::Brute => false,
        }
    }

    /// The query mode in which the backend traces whatever it is asked for; `None` where it knows all of them.
    pub fn only_mode(self) -> Option<QueryMode> {
        match self {
            BackendKind::Embree => None,
            BackendKind::Flat => Some(QueryMode::Packet16),
            BackendKind::Obvhs | BackendKind::FlatObvhs | BackendKind::Brute => Some(QueryMode::Single),
        }
    }
}

/// Builds the backend `kind` over `geometry`.
///
/// # Errors
/// [`Error::Backend`] when the library is not in this build or refuses.
pub fn build(kind: BackendKind, geometry: &Geometry, options: &BackendOptions) -> Result<Box<dyn Backend>> {
    build_after(kind, geometry, options, Kept::NOTHING)
}

/// [`build`], taking over from that of another frame what is the same there ([`Frames`]). Hits are those of a backend
/// that is built alone, bit for bit.
///
/// [`Frames`]: crate::scene::geometry::Frames
///
/// # Errors
/// As [`build`].
pub fn build_after(
    kind: BackendKind,
    geometry: &Geometry,
    options: &BackendOptions,
    kept: Kept,
) -> Result<Box<dyn Backend>> {
    let none = TriangleMesh::default();
    let world = geometry.meshes.first().unwrap_or(&none);
    match kind {
        #[cfg(feature = "embree")]
        BackendKind::Embree => {
            let kept = kept.take::<Embree>().map(|kept| *kept);
            Ok(Box::new(Embree::build_after(geometry, options, kept)?))
        }
        #[cfg(not(feature = "embree"))]
        BackendKind::Embree => Err(Error::Backend {
            backend: "embree",
            problem: "this build has no Embree (cargo feature `embree` is off); use --backend obvhs".into(),
        }),
        BackendKind::Obvhs => Ok(Box::new(Obvhs::build_after(geometry, world, options, kept)?)),
        BackendKind::Flat => Ok(Box::new(Flat::build(geometry, options)?)),
        BackendKind::FlatObvhs => Ok(Box::new(Joint::build_after(geometry, &DIVISION, options, kept)?)),
        BackendKind::Brute => Ok(Box::new(Brute::build(geometry))),
    }
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec3};

    use super::*;
    use crate::backend::Coherence;
    use crate::backend::batch::{INVALID_ID, LANES, RayHitBlock};
    use crate::scene::geometry::{Frames, Placement};

    /// A wavy ground of 2·12² triangles in the world, with a quad above it that frames have elsewhere and whose
    /// triangles stand in the middle; and two more such grounds by instances.
    fn frame(x: f32) -> Geometry {
        let side = 12u32;
        let at = |i: u32| Vec3::new((i % 13) as f32, 0.7 * (i as f32).sin(), (i / 13) as f32) / 6.0 - 1.0;
        let ground = TriangleMesh {
            vertices: (0..13 * 13).map(at).chain([Vec3::ZERO]).collect(),
            indices: (0..side * side)
                .map(|i| i / side * 13 + i % side)
                .flat_map(|i| [[i, i + 13, i + 1], [i + 1, i + 13, i + 14]])
                .collect(),
            ..TriangleMesh::default()
        };
        let mut world = ground.clone();
        let first = world.vertices.len() as u32;
        let corners = [(-0.3, -0.3), (-0.3, 0.3), (0.3, 0.3), (0.3, -0.3)];
        world.vertices.extend(corners.map(|(dx, z)| Vec3::new(x + dx, -0.5, z)).into_iter().chain([Vec3::ZERO]));
        world.indices.splice(100..100, [[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        let instances = [-2.0, 2.0].map(|y| Placement::new(1, Affine3A::from_translation(Vec3::Y * y))).into();
        let bounds = (Vec3::new(-2.0, -4.0, -2.0), Vec3::new(2.0, 4.0, 2.0));
        Geometry {
            meshes: vec![world, ground],
            instances,
            frames: Frames::apart(100..102),
            bounds,
            // So many that Embree chooses its nodes, as in scenes that are worth it.
            triangles: vec![bytemuck::Zeroable::zeroed(); 600],
            ..Geometry::default()
        }
    }

    /// Backends of frames that take over what they can have the bits of those that are built alone, in all modes.
    /// Oracles: the latter; for what is met `brute`, but for rays on edges.
    #[test]
    fn what_is_kept_changes_no_bit() {
        let mut state = 1u32;
        let mut random = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        let mut rays = vec![RayHitBlock::EMPTY; 16];
        for i in 0..16 * LANES {
            let org = Vec3::new(1.6 * random() - 0.8, random() - 0.6, 1.6 * random() - 0.8);
            let dir = Vec3::new(random() - 0.5, random() - 0.7, random() - 0.5).normalize();
            rays[i / LANES].ray.set(i % LANES, org, dir, f32::INFINITY);
        }
        let met = |hits: &[RayHitBlock]| -> Vec<[u32; 3]> {
            let hit = |i: usize| (&hits[i / LANES].hit, i % LANES);
            (0..hits.len() * LANES)
                .map(hit)
                .map(|(hit, lane)| [hit.geom[lane], hit.inst[lane], hit.prim[lane]])
                .collect()
        };
        let mut oracle = std::collections::HashMap::new();
        for &kind in BackendKind::available().iter().filter(|kind| **kind != BackendKind::Brute) {
            for mode in [QueryMode::Packet16, QueryMode::Single, QueryMode::Stream] {
                let options = BackendOptions::with_mode(mode);
                let mut kept = Kept::NOTHING;
                for x in [-0.5f32, 0.25, 0.25, 0.5] {
                    let geometry = frame(x);
                    let after = build_after(kind, &geometry, &options, std::mem::take(&mut kept)).expect("it builds");
                    let alone = build(kind, &geometry, &options).expect("it builds");
                    let trace = |backend: &dyn Backend| {
                        let mut hits = rays.clone();
                        assert_eq!(backend.closest_hit(&mut hits, 16 * LANES, Coherence::Incoherent), 0);
                        let mut shadow: Vec<_> = rays.iter().map(|block| block.ray).collect();
                        backend.any_hit(&mut shadow, 16 * LANES, Coherence::Incoherent);
                        (hits, shadow)
                    };
                    let [(hits, shadow), (hits_alone, shadow_alone)] = [&after, &alone].map(|one| trace(one.as_ref()));
                    let bytes = |hits: &[RayHitBlock]| bytemuck::cast_slice::<_, u8>(hits).to_vec();
                    assert!(bytes(&hits) == bytes(&hits_alone), "{kind:?} {mode} {x}");
                    assert!(
                        bytemuck::cast_slice::<_, u8>(&shadow) == bytemuck::cast_slice::<_, u8>(&shadow_alone),
                        "{kind:?} {mode} {x}: shadow rays"
                    );
                    let theirs = oracle.entry(x.to_bits()).or_insert_with(|| met(&trace(&Brute::build(&geometry)).0));
                    let ours = met(&hits);
                    let missed = |of: &[u32; 3]| of[0] == INVALID_ID;
                    let other =
                        ours.iter().zip(theirs.iter()).filter(|(a, b)| a != b && !(missed(a) && missed(b))).count();
                    let quad = ours
                        .iter()
                        .filter(|[geom, inst, prim]| (*geom, *inst) == (0, INVALID_ID) && (100..102).contains(prim));
                    assert!(other <= 2 && quad.count() > 4, "{kind:?} {mode} {x}: {other} differ");
                    kept = after.keep();
                }
            }
        }
    }
}
