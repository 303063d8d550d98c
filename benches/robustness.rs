//! What robustness costs: every choice that takes time so that nothing is lost, measured with and without it, and what
//! breaks without it, counted in the same run. `make robustness` prints the table (about a minute once built).
//!
//! Whole renders where the choice can be switched off (Embree's robust traversal), else the operation alone in a loop
//! that stays in the cache: its nanoseconds times how often a camera path of the Cornell box needs it, over the time of
//! such a path. Times are the least of several turns of the two sides, alternating. What breaks is counted with fixed
//! seeds and repeats exactly. Not a criterion bench: rows compare two sides of one thing.

mod common;

use std::hint::black_box;
use std::time::Instant;

use glam::Vec3;
use pathspace::Scene;
use pathspace::backend::batch::{BLOCKED, INVALID_ID, LANES, RayBlock, RayHitBlock, valid_lanes};
use pathspace::backend::past::Past;
use pathspace::backend::{self, Backend, BackendInfo, BackendKind, BackendOptions, Coherence};
use pathspace::film::Pixel;
use pathspace::math::float;
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;

/// Elements of a loop: they and their results stay in L2.
const ELEMENTS: usize = 4096;
/// Turns of each side.
const TURNS: usize = 9;
/// Rays whose losses are counted.
const RAYS: usize = 1 << 20;
/// Rows of the closed sphere that rays are lost from.
const SPHERE_ROWS: u32 = 12;

/// One line of the table.
struct Row {
    choice: String,
    /// Seconds (renders) or nanoseconds (operations), with their unit.
    with: String,
    without: String,
    /// Part of a render's time.
    share: f64,
    breaks: String,
}

/// A camera path of the Cornell box: what it takes, and how often it needs each thing.
struct Path {
    ns: f64,
    rays: f64,
    hits: f64,
}

fn main() {
    common::facts();
    let cornell = common::scene("cornell-box");
    let path = path(&cornell);
    println!(
        "cornell-box, one thread: {:.0} ns a camera path, {:.2} rays, {:.2} surfaces\n",
        path.ns, path.rays, path.hits
    );
    let mut rows = Vec::new();
    if BackendKind::available().contains(&BackendKind::Embree) {
        let lost = lost_by_default_mode();
        for (name, scene) in
            [("cornell-box", cornell), ("env-object", common::scene("env-object")), ("spheres", common::spheres())]
        {
            rows.push(robust_traversal(name, &scene, &lost));
        }
    }
    rows.extend([watertight_test(&path), ray_origins(&path), rebuilt_points(&path), validation(&path)]);
    rows.extend([film_sums(&path), finite_check(&path)]);
    print(&rows);
}

fn print(rows: &[Row]) {
    println!("| choice | with | without | of a render | without it |");
    println!("| --- | --- | --- | --- | --- |");
    for Row { choice, with, without, share, breaks } in rows {
        println!("| {choice} | {with} | {without} | {:+.1} % | {breaks} |", 100.0 * share);
    }
}

/// Least seconds of each side over alternating turns.
fn sides(mut with: impl FnMut(), mut without: impl FnMut()) -> (f64, f64) {
    let mut least = (f64::INFINITY, f64::INFINITY);
    for _ in 0..TURNS {
        let start = Instant::now();
        with();
        let middle = Instant::now();
        without();
        least = (least.0.min((middle - start).as_secs_f64()), least.1.min(middle.elapsed().as_secs_f64()));
    }
    least
}

/// [`sides`] of one operation, nanoseconds each: `with` and `without` work through [`ELEMENTS`] elements.
fn operation(mut with: impl FnMut(), mut without: impl FnMut()) -> (f64, f64) {
    let many = |f: &mut dyn FnMut()| (0..256).for_each(|_| f());
    let (a, b) = sides(|| many(&mut with), || many(&mut without));
    let each = 1e9 / (256 * ELEMENTS) as f64;
    (a * each, b * each)
}

/// A row of an operation that a path needs `times` times.
fn row(choice: &str, (with, without): (f64, f64), times: f64, path: &Path, breaks: String) -> Row {
    Row {
        choice: choice.into(),
        with: format!("{with:.2} ns"),
        without: format!("{without:.2} ns"),
        share: (with - without) * times / path.ns,
        breaks,
    }
}

fn path(scene: &Scene) -> Path {
    let renderer = Renderer::new(scene, common::options(128, 16)).unwrap_or_else(|e| panic!("{e}"));
    let mut least = f64::INFINITY;
    let mut counters = None;
    for _ in 0..5 {
        let render = renderer.render().expect("a render");
        least = least.min(render.render_time.as_secs_f64());
        counters = Some(render.counters);
    }
    let counters = counters.expect("five renders");
    let per_path = |n: u64| n as f64 / counters.paths as f64;
    // Each surface sends on about one ray; the last rays of paths meet surfaces too.
    Path {
        ns: least * 1e9 / counters.paths as f64,
        rays: per_path(counters.rays()),
        hits: per_path(counters.rays_bounce),
    }
}

/// Embree with and without: whole renders.
fn robust_traversal(name: &str, scene: &Scene, lost: &str) -> Row {
    let renderer = |robust| {
        let options = common::options(128, 16).backend(BackendKind::Embree).robust(robust);
        Renderer::new(scene, options).unwrap_or_else(|e| panic!("{e}"))
    };
    let (with, without) = (renderer(true), renderer(false));
    let render = |renderer: &Renderer| drop(black_box(renderer.render().expect("a render")));
    let (a, b) = sides(|| render(&with), || render(&without));
    Row {
        choice: format!("Embree's robust traversal, {name}"),
        with: format!("{a:.3} s"),
        without: format!("{b:.3} s"),
        share: (a - b) / a,
        breaks: lost.into(),
    }
}

/// A closed sphere of radius 1; far away an ulp is 1/64 m, so there it has a radius of 1000.
fn sphere(far: bool) -> (Geometry, Vec3) {
    let (center, radius) = if far { (Vec3::new(1e5, -2e5, 5e4), 1000.0) } else { (Vec3::ZERO, 1.0) };
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    b.sphere(center, radius, SPHERE_ROWS, false, false, white);
    b.camera(center, center + Vec3::X, Vec3::Y, 1.0);
    (Geometry::build(&b.build()), center)
}

/// How many rays get out of a closed sphere: from inside, at random, and at points of edges.
fn lost(backend: &dyn Backend, geometry: &Geometry, center: Vec3, at_edges: bool) -> usize {
    let mut random = Random(1);
    let mesh = &geometry.meshes[0];
    let mut lost = 0;
    let mut blocks = vec![RayHitBlock::EMPTY; ELEMENTS / LANES];
    for _ in 0..RAYS / ELEMENTS {
        for lane in 0..ELEMENTS {
            let origin = center + random.direction() * (0.3 * geometry.bounding_radius());
            let direction = if at_edges {
                let [a, b, _] = mesh.indices[random.below(mesh.indices.len())].map(|i| mesh.vertices[i as usize]);
                a.lerp(b, random.unit()) - origin
            } else {
                random.direction()
            };
            blocks[lane / LANES].ray.set(lane % LANES, origin, direction.normalize(), f32::INFINITY);
        }
        backend.closest_hit(&mut blocks, ELEMENTS, Coherence::Incoherent);
        lost += (0..ELEMENTS).filter(|&lane| blocks[lane / LANES].hit(lane % LANES).is_none()).count();
    }
    lost
}

fn lost_by_default_mode() -> String {
    let count = |far, at_edges, robust| {
        let (geometry, center) = sphere(far);
        let options = BackendOptions { robust, ..BackendOptions::default() };
        let backend =
            backend::select::build(BackendKind::Embree, &geometry, &options).unwrap_or_else(|e| panic!("{e}"));
        lost(backend.as_ref(), &geometry, center, at_edges)
    };
    let told = |far, at_edges| format!("{} ({} with it)", count(far, at_edges, false), count(far, at_edges, true));
    format!(
        "rays of 2^20 out of a closed sphere: {} at random, {} at edges; far from the origin {} and {}",
        told(false, false),
        told(false, true),
        told(true, false),
        told(true, true)
    )
}

/// The watertight test against Möller and Trumbore's, every ray against every triangle.
fn watertight_test(path: &Path) -> Row {
    let (geometry, center) = sphere(false);
    let ours = backend::select::build(BackendKind::Brute, &geometry, &BackendOptions::default()).expect("always there");
    let plain = MollerTrumbore::new(&geometry, ours.info().clone());
    let mut random = Random(7);
    let rays: Vec<RayHitBlock> = (0..64)
        .map(|_| {
            let mut block = RayHitBlock::EMPTY;
            (0..LANES).for_each(|lane| block.ray.set(lane, center, random.direction(), f32::INFINITY));
            block
        })
        .collect();
    let trace = |backend: &dyn Backend| {
        let mut rays = rays.clone();
        black_box(backend.closest_hit(&mut rays, 64 * LANES, Coherence::Incoherent));
    };
    let (a, b) = sides(|| trace(ours.as_ref()), || trace(&plain));
    let per_test = 1e9 / (64 * LANES * geometry.meshes[0].indices.len()) as f64;
    let (lost_plain, lost_ours) = (lost(&plain, &geometry, center, true), lost(ours.as_ref(), &geometry, center, true));
    let breaks = format!("{lost_plain} of 2^20 rays at edges get out of a closed sphere ({lost_ours} with it)");
    // A ray of the Rust backend tests some ten triangles.
    row(
        "watertight triangle test (10 tests a ray, obvhs)",
        (a * per_test, b * per_test),
        10.0 * path.rays,
        path,
        breaks,
    )
}

/// Origins moved off the surface by their error bound, against the point itself.
fn ray_origins(path: &Path) -> Row {
    let mut random = Random(3);
    let hits: Vec<_> = (0..ELEMENTS).map(|_| Hit::random(&mut random)).collect();
    let mut origins = vec![Vec3::ZERO; ELEMENTS];
    let mut copies = vec![Vec3::ZERO; ELEMENTS];
    let times = operation(
        || {
            for (hit, origin) in hits.iter().zip(&mut origins) {
                *origin = float::spawn_origin(hit.p, hit.n_g, hit.error, hit.wi);
            }
            black_box(&mut origins);
        },
        || {
            for (hit, origin) in hits.iter().zip(&mut copies) {
                *origin = hit.p;
            }
            black_box(&mut copies);
        },
    );
    let (mut with, mut without, mut fixed) = (0, 0, 0);
    for _ in 0..RAYS / 64 {
        let hit = Hit::random(&mut random);
        let geometry = hit.alone();
        let backend = backend::select::build(BackendKind::available()[0], &geometry, &BackendOptions::default());
        let backend = backend.unwrap_or_else(|e| panic!("{e}"));
        let directions: Vec<Vec3> = (0..64).map(|_| random.direction()).collect();
        let met = |origin: &dyn Fn(Vec3) -> Vec3| {
            let mut blocks = [RayBlock::EMPTY; 4];
            for (lane, &dir) in directions.iter().enumerate() {
                blocks[lane / LANES].set(lane % LANES, origin(dir), dir, f32::INFINITY);
            }
            backend.any_hit(&mut blocks, 64, Coherence::Incoherent);
            blocks.iter().flat_map(|block| block.tfar).filter(|&tfar| tfar == BLOCKED).count()
        };
        with += met(&|dir| float::spawn_origin(hit.p, hit.n_g, hit.error, dir));
        without += met(&|_| hit.p);
        fixed += met(&|dir| float::spawn_origin(hit.p, hit.n_g, 1e-4, dir));
    }
    let breaks = format!(
        "{without} of 2^20 rays meet the triangle they leave; {fixed} with a fixed 10⁻⁴ m, {with} with the bound"
    );
    // A light sample (receiver and shadow ray) and a scattered ray a surface.
    row("ray origins off the surface by their error bound", times, 3.0 * path.hits, path, breaks)
}

/// A triangle between 1e-3 and 1e3 in every coordinate, a point of it, and a direction.
struct Hit {
    triangle: [Vec3; 3],
    p: Vec3,
    n_g: Vec3,
    error: f32,
    wi: Vec3,
}

impl Hit {
    fn random(random: &mut Random) -> Self {
        loop {
            let triangle = [(); 3].map(|_| {
                let mut axis = || 10f32.powf(6.0 * random.unit() - 3.0) * if random.unit() < 0.5 { -1.0 } else { 1.0 };
                Vec3::new(axis(), axis(), axis())
            });
            let [v0, e1, e2] = [triangle[0], triangle[1] - triangle[0], triangle[2] - triangle[0]];
            let normal = e1.as_dvec3().cross(e2.as_dvec3());
            if normal.length() < 1e-3 * (e1.length() * e2.length()) as f64 {
                continue;
            }
            let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
            let p = float::hit_point(v0, e1, e2, u, v);
            let error = float::hit_error(v0, e1, e2, p);
            return Hit { triangle, p, n_g: normal.normalize().as_vec3(), error, wi: random.direction() };
        }
    }

    fn alone(&self) -> Geometry {
        let mut b = SceneBuilder::new();
        let white = b.lambert(Vec3::ONE);
        b.triangles(self.triangle.to_vec(), vec![[0, 1, 2]], white);
        b.camera(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
        Geometry::build(&b.build())
    }
}

/// Hit points from barycentrics, against o + t·d.
fn rebuilt_points(path: &Path) -> Row {
    let mut random = Random(4);
    let side = [Vec3::new(-0.5, -0.5, 0.0), Vec3::X, Vec3::new(0.5, 1.0, 0.0)];
    let rays: Vec<_> = (0..ELEMENTS)
        .map(|_| {
            let (u, v) = (random.unit() * 0.5, random.unit() * 0.5);
            let mut towards = random.direction();
            towards.z = towards.z.abs().max(0.1);
            let exact = (side[0] + side[1] * u + side[2] * v).as_dvec3();
            let origin = (exact + towards.normalize().as_dvec3() * 1e6).as_vec3();
            let dir = (exact - origin.as_dvec3()).normalize();
            // Where the ray in f32 really meets the plane.
            let dir = dir.as_vec3();
            let t = -f64::from(origin.z) / f64::from(dir.z);
            let p = origin.as_dvec3() + dir.as_dvec3() * t;
            let (y, x) = (p.y + 0.5, p.x + 0.5);
            let (v, u) = (y, x - 0.5 * y);
            (origin, dir, t as f32, u as f32, v as f32, p)
        })
        .collect();
    let mut points = vec![Vec3::ZERO; ELEMENTS];
    let mut along = vec![Vec3::ZERO; ELEMENTS];
    let times = operation(
        || {
            for (&(_, _, _, u, v, _), point) in rays.iter().zip(&mut points) {
                *point = float::hit_point(side[0], side[1], side[2], u, v);
            }
            black_box(&mut points);
        },
        || {
            for (&(origin, dir, t, ..), point) in rays.iter().zip(&mut along) {
                *point = origin + dir * t;
            }
            black_box(&mut along);
        },
    );
    let worst =
        |points: &[Vec3]| rays.iter().zip(points).map(|(ray, p)| p.as_dvec3().distance(ray.5)).fold(0.0, f64::max);
    let breaks = format!(
        "on a triangle of 1 m seen from 10⁶ m the point is up to {:.1e} m off ({:.1e} with it)",
        worst(&along),
        worst(&points)
    );
    row("hit points from barycentrics, not o + t·d", times, path.hits, path, breaks)
}

/// Rays are validated before they are traced.
fn validation(path: &Path) -> Row {
    let mut random = Random(5);
    let mut blocks = vec![RayBlock::EMPTY; ELEMENTS / LANES];
    for lane in 0..ELEMENTS {
        blocks[lane / LANES].set(lane % LANES, random.direction(), random.direction(), f32::INFINITY);
    }
    let mut masks = vec![0u16; ELEMENTS / LANES];
    let times = operation(
        || {
            for (block, mask) in blocks.iter().zip(&mut masks) {
                *mask = valid_lanes(black_box(block), LANES);
            }
            black_box(&mut masks);
        },
        || {
            for block in &blocks {
                black_box(block);
            }
        },
    );
    let breaks = "one ray with a NaN ends the process: Debian's Embree 3.13.5 keeps its assertions (HARDCASES G06)";
    row("rays validated before tracing", times, path.rays, path, breaks.into())
}

/// Film sums in f64, by the film's own function, against f32.
fn film_sums(path: &Path) -> Row {
    let mut random = Random(6);
    let samples: Vec<[f32; 3]> = (0..ELEMENTS).map(|_| [(); 3].map(|_| random.unit())).collect();
    let (mut pixel, mut narrow) = (Pixel::default(), [[0.0f32; 4]; 2]);
    let times = operation(
        || {
            for (number, &rgb) in samples.iter().enumerate() {
                pixel.add(number & 1, rgb, 1.0, 1.0);
            }
            black_box(&mut pixel);
        },
        || {
            for (number, &[r, g, b]) in samples.iter().enumerate() {
                for (sum, value) in narrow[number & 1].iter_mut().zip([r, g, b, 1.0]) {
                    *sum += value;
                }
            }
            black_box(&mut narrow);
        },
    );
    let (mut wide, mut narrow) = (0.0f64, 0.0f32);
    for _ in 0..1u32 << 26 {
        wide += f64::from(0.1f32);
        narrow += 0.1;
    }
    let exact = f64::from(0.1f32) * f64::from(1u32 << 26);
    let off = |sum: f64| 100.0 * (sum / exact - 1.0);
    let breaks = format!(
        "after 2^26 samples of 0.1 the mean is {:+.1} % off ({:+.1e} % with it)",
        off(narrow.into()),
        off(wide)
    );
    row("film sums in f64", times, 1.0, path, breaks)
}

/// Samples that are not finite are kept out of the film and counted.
fn finite_check(path: &Path) -> Row {
    let mut random = Random(8);
    let samples: Vec<[f32; 3]> = (0..ELEMENTS).map(|_| [(); 3].map(|_| random.unit())).collect();
    let (mut checked, mut unchecked) = ([0.0f64; 3], [0.0f64; 3]);
    let mut count = 0u64;
    let times = operation(
        || {
            for &rgb in &samples {
                if !rgb.iter().all(|c| c.is_finite()) {
                    count += 1;
                    continue;
                }
                (0..3).for_each(|c| checked[c] += f64::from(rgb[c]));
            }
            black_box((&mut checked, &mut count));
        },
        || {
            for &rgb in &samples {
                (0..3).for_each(|c| unchecked[c] += f64::from(rgb[c]));
            }
            black_box(&mut unchecked);
        },
    );
    row(
        "samples checked, counted and located",
        times,
        1.0,
        path,
        "one NaN is in its pixel for ever, and in every mean".into(),
    )
}

/// Every ray against every triangle by the common test, without care for edges.
struct MollerTrumbore {
    info: BackendInfo,
    faces: Vec<[Vec3; 3]>,
}

impl MollerTrumbore {
    fn new(geometry: &Geometry, info: BackendInfo) -> Self {
        let mesh = &geometry.meshes[0];
        MollerTrumbore {
            info,
            faces: mesh.indices.iter().map(|face| face.map(|i| mesh.vertices[i as usize])).collect(),
        }
    }

    fn closest(&self, org: Vec3, dir: Vec3, tfar: f32) -> Option<(u32, f32)> {
        let mut closest = None;
        let mut end = tfar;
        for (number, [v0, v1, v2]) in self.faces.iter().enumerate() {
            let (e1, e2) = (*v1 - *v0, *v2 - *v0);
            let p = dir.cross(e2);
            let inverse = 1.0 / e1.dot(p);
            let s = org - *v0;
            let u = s.dot(p) * inverse;
            let q = s.cross(e1);
            let v = dir.dot(q) * inverse;
            let t = e2.dot(q) * inverse;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t >= 0.0 && t <= end {
                (end, closest) = (t, Some((number as u32, t)));
            }
        }
        closest
    }
}

impl Backend for MollerTrumbore {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn closest_hit(&self, blocks: &mut [RayHitBlock], len: usize, _hint: Coherence) -> u64 {
        for block in blocks.iter_mut() {
            block.hit.geom = [INVALID_ID; LANES];
        }
        for lane in 0..len {
            let block = &mut blocks[lane / LANES];
            let i = lane % LANES;
            if let Some((prim, t)) = self.closest(block.ray.org(i), block.ray.dir(i), block.ray.tfar[i]) {
                (block.hit.geom[i], block.hit.prim[i], block.ray.tfar[i]) = (0, prim, t);
            }
        }
        0
    }

    fn closest_hit_past(&self, _blocks: &mut [RayHitBlock], _len: usize, _past: &Past) -> u64 {
        unreachable!("no ray goes on")
    }

    fn any_hit(&self, _blocks: &mut [RayBlock], _len: usize, _hint: Coherence) -> u64 {
        unreachable!("only closest hits are compared")
    }
}

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// In [0, 1).
    fn unit(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u32 << 24) as f32
    }

    fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// Uniform over the sphere.
    fn direction(&mut self) -> Vec3 {
        let (z, phi) = (1.0 - 2.0 * self.unit(), std::f32::consts::TAU * self.unit());
        let r = (1.0 - z * z).max(0.0).sqrt();
        Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize()
    }
}
