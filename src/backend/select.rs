//! Which backend traces a scene, and why; and what each can be held to. Every constant of the choice stands here.
//!
//! Costs are times per ray over that in one hierarchy of everything, of a ray whose line is uniform among those that
//! meet the scene's box: it meets a convex body inside with the ratio of their surfaces (Crofton). The choice depends
//! on the scene alone: what a render pins (`--rays`, `--isa`, `--robust off`) is honoured by the chosen backend, or
//! refused.

use std::ops::RangeInclusive;

use super::brute::Brute;
#[cfg(feature = "embree")]
use super::embree::Embree;
use super::flat::{self, Flat};
use super::joint::{self, Joint};
use super::obvhs::Obvhs;
use super::{Backend, BackendKind, BackendOptions, QueryMode};
use crate::error::{Error, Result};
use crate::math::simd::detect;
use crate::scene::geometry::{Geometry, TriangleMesh};

/// Faces up to which `flat` is taken. Its time grows with their number, Embree's hardly. Measured on cornell-box with
/// more boxes in it, Embree's time over that of `flat` (best of 5): 39 faces 1.76, 59 1.19, 79 1.42, 99 1.13, 139 0.96,
/// 179 0.93.
pub const FLAT_FACES: usize = 64;

/// Cost up to which `flat+obvhs` is taken, set between scenes that gain by it and scenes that do not. Measured: times
/// of renders over Embree's (2 threads, least of five, twice) are 0.78 on glass-caustics, 0.94 on interior, 1.01 on
/// env-object (AVX2: 0.80, 0.94, 0.89) and 1.03 on veach-mis. On two scenes that nobody had tuned for, processor times
/// were 0.79 and 1.22 of Embree's.
pub const DIVIDED_COST: f32 = 0.6;

/// Triangles of all meshes together with which `flat+obvhs` is taken where there is Embree. With fewer, Embree is as
/// fast (veach-mis, 1292 triangles: 0.97); with more, building takes seconds longer (2 µs a triangle, against 0.5).
pub const DIVIDED_TRIANGLES: RangeInclusive<usize> = 1 << 14..=1 << 20;

/// How `flat+obvhs` divides a scene.
pub const DIVISION: joint::Limits = joint::Limits {
    // As many as `flat` takes alone: beyond, hierarchies win.
    faces: FLAT_FACES,
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

/// The backend that is asked for, else the fastest one of this build for `geometry`.
///
/// # Errors
/// [`Error::Option`] where the backend that is asked for is not in this build or cannot trace the scene, and where the
/// one that is taken cannot honour a pin.
pub fn select(asked: Option<BackendKind>, geometry: &Geometry, pins: Pins) -> Result<Choice> {
    let choice = match asked {
        None => fastest(geometry),
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

/// The fastest backend of this build for `geometry`.
pub fn fastest(geometry: &Geometry) -> Choice {
    if let Some(faces) = few_faces(geometry) {
        return Choice { kind: BackendKind::Flat, reason: format!("faces: {faces}, at most {FLAT_FACES}") };
    }
    let first = BackendKind::available()[0];
    let not = |reason: String| Choice { kind: first, reason };
    let triangles = geometry.triangles.len();
    if first == BackendKind::Embree && !DIVIDED_TRIANGLES.contains(&triangles) {
        let (least, most) = DIVIDED_TRIANGLES.into_inner();
        return not(format!("{triangles} triangles; flat+obvhs is tried from {least} to {most}"));
    }
    let Some(division) = joint::divide(geometry, &DIVISION) else {
        return not("no large faces around other things, so nothing for flat+obvhs".into());
    };
    let (joint::Division { faces, near }, cost) = (division, cost(&division));
    let figures = format!(
        "large faces: {faces}, volumes around the rest: {:.0} % of the scene's surface; cost {cost:.2} of one \
         hierarchy's",
        100.0 * near
    );
    if cost <= DIVIDED_COST {
        Choice { kind: BackendKind::FlatObvhs, reason: format!("{figures}, at most {DIVIDED_COST}") }
    } else {
        not(format!("{figures}; flat+obvhs is taken up to {DIVIDED_COST}"))
    }
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
    let none = TriangleMesh::default();
    let world = geometry.meshes.first().unwrap_or(&none);
    match kind {
        #[cfg(feature = "embree")]
        BackendKind::Embree => Ok(Box::new(Embree::build(geometry, options)?)),
        #[cfg(not(feature = "embree"))]
        BackendKind::Embree => Err(Error::Backend {
            backend: "embree",
            problem: "this build has no Embree (cargo feature `embree` is off); use --backend obvhs".into(),
        }),
        BackendKind::Obvhs => Ok(Box::new(Obvhs::build(geometry, world, options)?)),
        BackendKind::Flat => Ok(Box::new(Flat::build(geometry, options)?)),
        BackendKind::FlatObvhs => Ok(Box::new(Joint::build(geometry, &DIVISION, options)?)),
        BackendKind::Brute => Ok(Box::new(Brute::build(geometry))),
    }
}
