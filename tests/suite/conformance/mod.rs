//! The conformance matrix: backend × query mode × {closest hit, any hit} × kinds of rays and scenes.
//!
//! Each cell is checked against `brute`, and `brute` against f64 ([`exact`]). A new backend is a line in [`RULES`].
//! Backends in Rust share one triangle test and must agree with `brute` in every bit; Embree must agree up to rounding:
//! a differing hit has to be possible in f64 with no definite hit before it. Rates of failure that are allowed stand in
//! the scenarios ([`Scenario::misses_allowed`]); everything else allows none. All seeds are fixed: a cell that passes
//! always passes, so the false-alarm rate is 0. Query modes that a backend traces by the same code as one already
//! tested are not repeated. Set `PATHSPACE_SKIP_BACKENDS=embree` to leave backends out; it is said aloud.

mod closed;
pub(crate) mod exact;
mod lanes;
mod moving;
mod passing;
mod scenes;
pub(crate) mod shapes;

use std::fmt::Write as _;

use glam::Vec3;
use pathspace::backend::batch::{BLOCKED, Hit, LANES, RayBlock, RayHitBlock};
use pathspace::backend::select::FLAT_FACES;
use pathspace::backend::{self, Backend, BackendKind, BackendOptions, Coherence, QueryMode};
use pathspace::math;
use pathspace::scene::geometry::Geometry;

/// Embree's documented loss of rays aimed at vertices: at most 1600 of 200 000 (HARDCASES G02).
pub(crate) const EMBREE_VERTEX_MISSES: f64 = 1600.0 / 200_000.0;

/// How a backend's hits may differ from its oracle's.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Rule {
    /// In no bit.
    Exact,
    /// As far as f64 says that rounding allows.
    Rounding,
}

/// One line per backend: what it is held to. `brute` is held against f64, the others against `brute`.
const RULES: [(BackendKind, Rule); 5] = [
    (BackendKind::Embree, Rule::Rounding),
    (BackendKind::Obvhs, Rule::Exact),
    (BackendKind::Flat, Rule::Rounding),
    (BackendKind::FlatObvhs, Rule::Rounding),
    (BackendKind::Brute, Rule::Rounding),
];

/// One ray.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TestRay {
    pub org: Vec3,
    pub dir: Vec3,
    pub tnear: f32,
    pub tfar: f32,
}

impl TestRay {
    pub fn new(org: Vec3, dir: Vec3) -> Self {
        TestRay { org, dir, tnear: 0.0, tfar: f32::INFINITY }
    }
}

/// A scene, rays, and what must come out.
pub(crate) struct Scenario {
    pub name: &'static str,
    pub geometry: Geometry,
    pub rays: Vec<TestRay>,
    /// How many of the rays, from the first, are compared with the oracle hit by hit.
    pub compared: usize,
    /// How many of the rays, from the first, are traced in every way: by every backend in every mode, with both hints.
    /// The others are traced as renders trace such a scene ([`Row::ships`]).
    pub repeated: usize,
    /// The one backend that traces; all if `None`.
    pub only: Option<BackendKind>,
    /// Every ray must hit something.
    pub must_hit: bool,
    /// Part of the rays of a `must_hit` case that Embree may lose.
    pub misses_allowed: f64,
    /// Rays come in groups of four that differ in signs of zero only: equal bits are expected.
    pub zero_groups: bool,
}

impl Scenario {
    /// Every ray is compared; nothing else is demanded.
    pub fn open(name: &'static str, geometry: Geometry, rays: Vec<TestRay>) -> Self {
        let compared = rays.len();
        Scenario {
            name,
            geometry,
            repeated: rays.len(),
            only: None,
            rays,
            compared,
            must_hit: false,
            misses_allowed: 0.0,
            zero_groups: false,
        }
    }

    /// Every ray must hit; some hundred are compared with brute force too.
    pub fn closed(name: &'static str, geometry: Geometry, rays: Vec<TestRay>) -> Self {
        Scenario { compared: rays.len().min(400), must_hit: true, ..Scenario::open(name, geometry, rays) }
    }
}

/// A backend in a mode.
pub(crate) struct Row {
    pub kind: BackendKind,
    pub rule: Rule,
    pub mode: QueryMode,
    /// Narrower instructions than the processor's; `None` for the widest.
    isa: Option<&'static str>,
}

impl Row {
    /// As `embree/packet16`; a backend that traces every mode alike has no mode in its name.
    pub fn name(&self) -> String {
        match self.kind {
            BackendKind::Embree => format!("{}/{}", self.kind.name(), self.mode),
            _ => self.kind.name().to_owned() + &self.isa.map(|isa| format!("/{isa}")).unwrap_or_default(),
        }
    }

    /// Whether renders trace such a geometry like that unless told otherwise. `flat` looks at every face for every ray,
    /// as brute force does, and is taken for few.
    fn ships(&self, geometry: &Geometry) -> bool {
        let triangles = || geometry.meshes.iter().map(|mesh| mesh.indices.len()).sum::<usize>();
        match self.kind {
            BackendKind::Brute => false,
            BackendKind::Embree => self.mode == QueryMode::Packet16,
            BackendKind::Flat => triangles() <= FLAT_FACES,
            _ => self.isa.is_none(),
        }
    }
}

/// Whether `PATHSPACE_SKIP_BACKENDS`, names with commas between them, leaves `kind` out.
pub(crate) fn is_skipped(kind: BackendKind) -> bool {
    std::env::var("PATHSPACE_SKIP_BACKENDS").is_ok_and(|names| names.split(',').any(|name| name == kind.name()))
}

/// The backends of this build in every mode; `flat` among them, which does not trace every geometry.
pub(crate) fn rows() -> Vec<Row> {
    let mut rows = Vec::new();
    for kind in BackendKind::ALL {
        if !BackendKind::available().contains(&kind) && kind != BackendKind::Flat {
            continue;
        }
        if is_skipped(kind) {
            eprintln!("conformance: {} is left out by PATHSPACE_SKIP_BACKENDS", kind.name());
            continue;
        }
        let rule = RULES.iter().find(|r| r.0 == kind).expect("every backend has a line in RULES").1;
        rows.extend(QueryMode::ALL.map(|mode| Row { kind, rule, mode, isa: None }));
        if matches!(kind, BackendKind::Obvhs | BackendKind::FlatObvhs) && math::simd::detect::has_avx512() {
            rows.push(Row { kind, rule, mode: QueryMode::Single, isa: Some("avx2") });
        }
    }
    rows
}

/// [`rows`] without those that trace like an earlier one and without `flat`: all that any picture can be rendered with.
pub(crate) fn variants() -> Vec<Row> {
    let mut variants = tracers();
    variants.retain(|row| row.kind != BackendKind::Flat);
    variants
}

/// [`variants`] and `flat`, where [`BackendKind::traces`] says so.
pub(crate) fn tracers() -> Vec<Row> {
    let mut tracers = rows();
    tracers.retain(|row| row.isa.is_none());
    tracers.dedup_by_key(|row| row.name());
    tracers
}

/// Builds a row's backend; `None` if it traces this mode by the code of an earlier one, or this geometry not at all.
fn build(
    row: &Row,
    geometry: &Geometry,
    traced: &mut Vec<(BackendKind, &'static str, String)>,
) -> Option<Box<dyn Backend>> {
    if !row.kind.traces(geometry) {
        return None;
    }
    let options = BackendOptions { isa: row.isa.map(str::to_owned), ..BackendOptions::with_mode(row.mode) };
    let built = backend::select::build(row.kind, geometry, &options).expect("the backend builds");
    let info = built.info();
    assert_eq!(info.kind, row.kind);
    assert_eq!((info.rays_incoherent, info.rays_coherent), (info.rays_shadow, info.rays_shadow));
    let effective = (row.kind, info.rays_shadow, info.isa.clone());
    if traced.contains(&effective) {
        return None;
    }
    traced.push(effective);
    Some(built)
}

/// Rays of a closed scene that `flat` traces where renders do not take it, in whole groups of four.
const FEW_RAYS: usize = 2048;

/// Calls `check` with every backend in every mode that is a code of its own.
pub(crate) fn each_backend(geometry: &Geometry, mut check: impl FnMut(&Row, &dyn Backend)) {
    let mut traced = Vec::new();
    for row in rows() {
        if let Some(backend) = build(&row, geometry, &mut traced) {
            check(&row, backend.as_ref());
        }
    }
}

/// Rays in blocks; lanes past the last ray are empty.
pub(crate) fn pack(rays: &[TestRay]) -> Vec<RayHitBlock> {
    let mut blocks = vec![RayHitBlock::EMPTY; rays.len().div_ceil(LANES)];
    for (i, ray) in rays.iter().enumerate() {
        let block = &mut blocks[i / LANES].ray;
        block.set(i % LANES, ray.org, ray.dir, ray.tfar);
        block.tnear[i % LANES] = ray.tnear;
    }
    blocks
}

/// Rays of one batch: longer lists are cut, so that their blocks stay in the caches.
const BATCH: usize = 4096;

/// The closest hit of every ray; no ray may count as invalid.
pub(crate) fn closest(backend: &dyn Backend, rays: &[TestRay], hint: Coherence) -> Vec<Option<Hit>> {
    let mut hits = Vec::with_capacity(rays.len());
    for rays in rays.chunks(BATCH) {
        let mut blocks = pack(rays);
        assert_eq!(backend.closest_hit(&mut blocks, rays.len(), hint), 0, "valid rays were rejected");
        hits.extend((0..rays.len()).map(|i| blocks[i / LANES].hit(i % LANES)));
    }
    hits
}

/// Whether every ray is blocked.
pub(crate) fn any(backend: &dyn Backend, rays: &[TestRay], hint: Coherence) -> Vec<bool> {
    let mut blocked = Vec::with_capacity(rays.len());
    for rays in rays.chunks(BATCH) {
        let mut blocks: Vec<RayBlock> = pack(rays).iter().map(|b| b.ray).collect();
        assert_eq!(backend.any_hit(&mut blocks, rays.len(), hint), 0, "valid rays were rejected");
        blocked.extend((0..rays.len()).map(|i| blocks[i / LANES].tfar[i % LANES] == BLOCKED));
    }
    blocked
}

/// Outcome of one cell.
#[derive(Default)]
pub(crate) struct Cell {
    pub rays: usize,
    pub wrong: usize,
    pub missed: usize,
    pub missed_allowed: usize,
    /// The first thing that was wrong.
    pub example: String,
}

impl Cell {
    fn wrong(&mut self, what: impl FnOnce() -> String) {
        if self.wrong == 0 {
            self.example = what();
        }
        self.wrong += 1;
    }

    pub fn passes(&self) -> bool {
        self.wrong == 0 && self.missed <= self.missed_allowed
    }
}

/// Bits of a hit, for comparing exactly.
pub(crate) fn bits(hit: &Option<Hit>) -> Option<[u32; 6]> {
    hit.map(|h| [h.t.to_bits(), h.u.to_bits(), h.v.to_bits(), h.prim, h.geom, h.inst])
}

/// Same triangle and the same numbers up to rounding; failing that, f64 decides whether the other hit is as good.
fn agree(scenario: &Scenario, row: &Row, ray: &TestRay, expected: &Option<Hit>, got: &Option<Hit>) -> bool {
    if bits(expected) == bits(got) || row.rule == Rule::Exact {
        return bits(expected) == bits(got);
    }
    let same_triangle = |a: &Hit, b: &Hit| (a.inst, a.geom, a.prim) == (b.inst, b.geom, b.prim);
    match (expected, got) {
        (Some(a), Some(b)) if same_triangle(a, b) => exact::matches(&scenario.geometry, ray, b),
        _ => exact::plausible(&scenario.geometry, ray, got.as_ref()),
    }
}

/// Runs one query of one row over a scenario.
fn cell(scenario: &Scenario, row: &Row, backend: &dyn Backend, oracle: &[Option<Hit>], query: Query) -> Cell {
    // What looks at every face is slow: of closed scenes of many it gets the compared rays, or not many more.
    let rays = match (row.kind, query) {
        (BackendKind::Brute, _) => &scenario.rays[..scenario.compared],
        (BackendKind::Flat, _) if !row.ships(&scenario.geometry) => {
            &scenario.rays[..scenario.compared.max(FEW_RAYS.min(scenario.rays.len()))]
        }
        (_, Query::Closest(Coherence::Incoherent) | Query::Any(Coherence::Incoherent))
            if row.ships(&scenario.geometry) =>
        {
            &scenario.rays[..]
        }
        _ => &scenario.rays[..scenario.repeated.max(scenario.compared)],
    };
    let mut cell = Cell { rays: rays.len(), ..Cell::default() };
    if row.kind == BackendKind::Embree {
        cell.missed_allowed = (scenario.misses_allowed * rays.len() as f64) as usize;
    }
    match query {
        Query::Closest(hint) => {
            let hits = closest(backend, rays, hint);
            for ((ray, expected), got) in rays.iter().zip(oracle).zip(&hits) {
                if !agree(scenario, row, ray, expected, got) {
                    cell.wrong(|| format!("{ray:?}: expected {expected:?}, got {got:?}"));
                }
            }
            if scenario.must_hit {
                cell.missed = hits.iter().filter(|h| h.is_none()).count();
            }
            if scenario.zero_groups {
                for (ray, group) in rays.iter().step_by(4).zip(hits.chunks_exact(4)) {
                    if group.iter().any(|h| bits(h) != bits(&group[0])) {
                        cell.wrong(|| format!("{ray:?}: signs of zero matter: {group:?}"));
                    }
                }
            }
        }
        Query::Any(hint) => {
            let blocked = any(backend, rays, hint);
            for ((ray, expected), &got) in rays.iter().zip(oracle).zip(&blocked) {
                let same = expected.is_some() == got;
                if !same && (row.rule == Rule::Exact || !exact::plausible_any(&scenario.geometry, ray, got)) {
                    cell.wrong(|| format!("{ray:?}: closest is {expected:?}, blocked = {got}"));
                }
            }
            if scenario.must_hit {
                cell.missed = blocked.iter().filter(|b| !**b).count();
            }
        }
    }
    cell
}

/// What is asked.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Query {
    Closest(Coherence),
    Any(Coherence),
}

const QUERIES: [Query; 4] = [
    Query::Closest(Coherence::Incoherent),
    Query::Closest(Coherence::Coherent),
    Query::Any(Coherence::Incoherent),
    Query::Any(Coherence::Coherent),
];

/// Puts every query to every row over a scenario and tells what came of each cell.
pub(crate) fn judge(scenario: &Scenario, mut tell: impl FnMut(&Row, Query, Cell)) {
    let brute = backend::select::build(BackendKind::Brute, &scenario.geometry, &BackendOptions::default())
        .expect("brute builds");
    let compared = &scenario.rays[..scenario.compared];
    let by_brute = closest(brute.as_ref(), compared, Coherence::Incoherent);
    let mut by_f64 = None;
    each_backend(&scenario.geometry, |row, backend| {
        if scenario.only.is_some_and(|only| only != row.kind) {
            return;
        }
        let oracle = match row.kind {
            BackendKind::Brute => {
                by_f64.get_or_insert_with(|| compared.iter().map(|r| exact::nearest(&scenario.geometry, r)).collect())
            }
            _ => &by_brute,
        };
        for query in QUERIES {
            tell(row, query, cell(scenario, row, backend, oracle, query));
        }
    });
}

/// Runs the matrix over `scenarios` and panics with its table if a cell fails.
fn check(scenarios: &[Scenario]) {
    let mut table = String::new();
    let mut failed = 0;
    for scenario in scenarios {
        judge(scenario, |row, query, cell| {
            let verdict = if cell.passes() { "ok  " } else { "FAIL" };
            failed += usize::from(!cell.passes());
            let Cell { rays, wrong, missed, missed_allowed, example } = cell;
            let _ = writeln!(
                table,
                "{verdict} {:28} {:16} {:22} {rays:7} rays {wrong:6} wrong {missed:6} missed \
                 (≤ {missed_allowed}) {example}",
                scenario.name,
                row.name(),
                format!("{query:?}"),
            );
        });
    }
    assert!(failed == 0, "{failed} cells of the conformance matrix fail\n{table}");
}
