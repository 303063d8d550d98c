//! A room of six Lambert walls with a square lamp in its ceiling, bounce by bounce against the published solution of
//! another solver (HARDCASES §4.3: rectangles, closed-form factors, extrapolated to 10⁻⁷).

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::plan::options::{CameraChoice, FilterKind, Roulette, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::{Projection, Scene};

use super::Case;
use super::modes::Mode;
use super::receiver::Means;
use crate::common::{Estimate, options, single_ray};

/// The unit cube of albedo ½, walls x = 0 (0.2) and x = 1 (0.8), a square lamp in the ceiling that reflects like it.
pub fn lamp_room() -> Scene {
    let mut b = SceneBuilder::new();
    let [grey, dark, bright] = [0.5, 0.2, 0.8].map(|albedo| b.lambert(Vec3::splat(albedo)));
    let lamp = b.emitter(Vec3::splat(0.5), Vec3::ONE);
    let v = Vec3::new;
    b.quad([v(0.0, 0.0, 0.0), v(1.0, 0.0, 0.0), v(1.0, 1.0, 0.0), v(0.0, 1.0, 0.0)], grey);
    b.quad([v(0.0, 0.0, 0.0), v(0.0, 1.0, 0.0), v(0.0, 1.0, 1.0), v(0.0, 0.0, 1.0)], dark);
    b.quad([v(1.0, 0.0, 0.0), v(1.0, 0.0, 1.0), v(1.0, 1.0, 1.0), v(1.0, 1.0, 0.0)], bright);
    b.quad([v(0.0, 0.0, 0.0), v(0.0, 0.0, 1.0), v(1.0, 0.0, 1.0), v(1.0, 0.0, 0.0)], grey);
    b.quad([v(0.0, 1.0, 0.0), v(1.0, 1.0, 0.0), v(1.0, 1.0, 1.0), v(0.0, 1.0, 1.0)], grey);
    // The ceiling around the lamp: three by three rectangles, the middle one shines.
    let cuts = [0.0, 0.25, 0.75, 1.0];
    for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        let (x0, x1, y0, y1) = (cuts[i], cuts[i + 1], cuts[j], cuts[j + 1]);
        let material = if (i, j) == (1, 1) { lamp } else { grey };
        b.quad([v(x0, y0, 1.0), v(x0, y1, 1.0), v(x1, y1, 1.0), v(x1, y0, 1.0)], material);
    }
    b.camera(v(0.5, 0.05, 0.5), v(0.5, 1.0, 0.4), Vec3::Z, 1.2);
    b.build()
}

/// Faces of [`lamp_room`] in the order of [`FACES`], by the direction in which they are seen: x = 0, x = 1, y = 0,
/// floor, ceiling (y = 1 is as y = 0).
const SEEN: [Vec3; 5] = [Vec3::NEG_X, Vec3::X, Vec3::NEG_Y, Vec3::NEG_Z, Vec3::Z];
/// Their albedo, and how many there are of the kind.
const ALBEDO: [(f64, f64); 5] = [(0.2, 1.0), (0.8, 1.0), (0.5, 2.0), (0.5, 1.0), (0.5, 1.0)];

/// Mean reflected radiance of the faces by term 1 … 8.
pub const FACES: [[f64; 5]; 8] = [
    [0.0096442397, 0.038576959, 0.024110599, 0.028557603, 0.0],
    [0.0046575636, 0.01381883, 0.010140339, 0.0083994679, 0.013539177],
    [0.0021308332, 0.0079576285, 0.0050619178, 0.0054207463, 0.0045026751],
    [0.0010637595, 0.0037652619, 0.0025103035, 0.0024297913, 0.0026047737],
    [0.00051750294, 0.0019191059, 0.001237933, 0.0012547487, 0.0012182836],
    [0.00025670787, 0.00094506217, 0.00061509839, 0.00061163236, 0.00061849083],
    [0.00012682244, 0.0004718042, 0.00030479175, 0.00030561122, 0.00030391657],
    [6.291706e-05, 0.00023392937, 0.00015134653, 0.00015119742, 0.00015147997],
];
const FACES_TOTAL: [f64; 5] = [0.01852229, 0.067919574, 0.044281503, 0.047280015, 0.023087925];

/// Points of the room with the direction in which they are seen.
const POINTS: [([f32; 3], Vec3); 6] = [
    ([0.5, 0.5, 0.0], Vec3::NEG_Z),
    ([0.1, 0.1, 0.0], Vec3::NEG_Z),
    ([1.0, 0.5, 0.5], Vec3::X),
    ([0.0, 0.5, 0.5], Vec3::NEG_X),
    ([0.1, 0.1, 1.0], Vec3::Z),
    ([1.0, 0.25, 0.25], Vec3::X),
];

/// Reflected radiance there by term 1 … 8.
const POINT_TERMS: [[f64; 6]; 8] = [
    [0.036738817, 0.022418119, 0.057566556, 0.014391639, 0.0, 0.028458799],
    [0.0097393884, 0.0060954121, 0.014896968, 0.0051942821, 0.0096173011, 0.015418222],
    [0.0055073807, 0.0042775955, 0.0077506835, 0.0023095103, 0.0034985301, 0.0076310821],
    [0.0024774841, 0.0018748814, 0.0035627892, 0.001142792, 0.0019874504, 0.0037684948],
    [0.0012512146, 0.00096196399, 0.0017743341, 0.00055646624, 0.00093619554, 0.0018588138],
    [0.0006109358, 0.00046637697, 0.00086852067, 0.00027607205, 0.00046988865, 0.00092143224],
    [0.00030379162, 0.00023187366, 0.00043086483, 0.00013649204, 0.00023099632, 0.00045636027],
    [0.00015031835, 0.00011454798, 0.00021321528, 6.7733278e-05, 0.00011466432, 0.000226462],
];
const POINTS_TOTAL: [f64; 6] = [0.056927479, 0.036553556, 0.08727395, 0.024141697, 0.016967786, 0.05896276];

/// Bias that the mean of `n` samples of term `k` can see: without roulette, a term of k scatterings has a relative
/// deviation of about 1.3·1.2ᵏ.
fn term_delta(k: usize, n: u64) -> f64 {
    4.9 * 1.6 * 1.2f64.powi(k as i32) / (n as f64).sqrt()
}

#[test]
fn p07_room_by_bounces() {
    let mut case = Case::open("P07", "box scene against the operator solver", "Neumann series of a room, per bounce");
    let mut scene = lamp_room();
    for (point, direction) in POINTS {
        scene.cameras.push(single_ray(Vec3::from(point) - direction * 0.25, direction));
    }
    for direction in SEEN {
        let mut b = SceneBuilder::new();
        let up = if direction.z == 0.0 { Vec3::Z } else { Vec3::Y };
        let (middle, projection) = (Vec3::splat(0.5), Projection::Orthographic { xmag_m: 0.5, ymag_m: 0.5 });
        b.any_camera(middle - 0.49 * direction, middle, up, projection);
        scene.cameras.extend(b.build().cameras);
    }
    for mode in Mode::all() {
        let spp = if mode.is_main() { 4 } else { 1 };
        let side = if mode.is_main() { 128 } else { 32 };
        let n = u64::from(side * side) * spp;
        // Terms without roulette, so that the late ones are as well known as the first; totals with it.
        let at = |camera: usize, spp: u64, roulette: Roulette| {
            mode.options(
                options(side, side, spp)
                    .roulette(roulette)
                    .max_depth(if roulette == Roulette::Off { 9 } else { 64 })
                    .camera(CameraChoice::Index(camera))
                    .sampler(SamplerKind::Independent)
                    .filter(FilterKind::Box)
                    .strategy(Strategy::MIS)
                    .per_length(true),
            )
        };
        let mut renderer = Renderer::new(&scene, at(1, 1, Roulette::On)).expect("valid options");
        let mut run = |camera: usize, spp: u64, roulette: Roulette, seed: u64| {
            renderer.retarget(&at(camera, spp, roulette).seed(seed)).expect("valid options");
            renderer.render().expect("renders")
        };
        let mut points = Means::default();
        for i in 0..POINTS.len() {
            let film = run(1 + i, spp, Roulette::Off, i as u64).film;
            let lengths = film.path_lengths().expect("asked for");
            for (k, terms) in POINT_TERMS.iter().enumerate().filter(|(_, terms)| terms[i] > 0.0) {
                let estimate = Estimate::of(lengths.image(k + 2).into_iter());
                points.add(
                    format!("point {i}, term {}", k + 1),
                    terms[i],
                    2e-6 * terms[i],
                    term_delta(k + 1, n),
                    estimate,
                );
            }
            let total = Estimate::of_pixels(&run(1 + i, spp, Roulette::On, 100 + i as u64).film);
            points.add(format!("point {i}, total"), POINTS_TOTAL[i], 2e-5 * POINTS_TOTAL[i], term_delta(2, n), total);
        }
        points.judge(&mut case, format!("{} (points)", mode.name));
        let (mut faces, mut absorbed) = (Means::default(), Estimate { n: 1.0, ..Estimate::default() });
        for face in 0..SEEN.len() {
            // Pixels of a face differ; two runs tell the noise of each.
            let mut pair =
                |roulette| [200, 300].map(|seed| run(1 + POINTS.len() + face, spp, roulette, seed + face as u64));
            let (fixed, whole) = (pair(Roulette::Off), pair(Roulette::On));
            let lengths = fixed.each_ref().map(|render| render.film.path_lengths().expect("asked for"));
            let term = |edge: usize| two_runs(lengths.map(|lengths| lengths.image(edge)));
            for (k, terms) in FACES.iter().enumerate().filter(|(_, terms)| terms[face] > 0.0) {
                let band = term_delta(k + 1, 2 * n);
                faces.add(format!("face {face}, term {}", k + 1), terms[face], 2e-6 * terms[face], band, term(k + 2));
            }
            let films = whole.each_ref().map(|render| {
                // Emission is seen directly on the ceiling, and is not reflected light.
                let direct = render.film.path_lengths().expect("asked for").image(1);
                let pixels = render.film.pixels.iter().zip(direct);
                pixels
                    .map(|(pixel, direct)| std::array::from_fn(|c| pixel.mean()[c] - direct[c]))
                    .collect::<Vec<[f64; 3]>>()
            });
            let total = two_runs(films);
            faces.add(
                format!("face {face}, total"),
                FACES_TOTAL[face],
                2e-6 * FACES_TOTAL[face],
                term_delta(2, 2 * n),
                total,
            );
            // Each face takes (1-ρ) of what it receives, πL/ρ.
            let (rho, count) = ALBEDO[face];
            let taken = total.scaled(count * PI * (1.0 - rho) / rho);
            absorbed.mean = std::array::from_fn(|c| absorbed.mean[c] + taken.mean[c]);
            absorbed.variance = std::array::from_fn(|c| absorbed.variance[c] + taken.standard_error(c).powi(2));
        }
        faces.judge(&mut case, format!("{} (face means)", mode.name));
        let mut flux = Means::default();
        flux.add("absorbed flux", PI / 4.0, 2e-6, term_delta(2, 2 * n), absorbed);
        flux.judge(&mut case, &mode.name);
    }
    case.close();
}

/// Mean of two runs of one picture, and its noise from their differences.
fn two_runs(runs: [Vec<[f64; 3]>; 2]) -> Estimate {
    let pairs = runs[0].iter().zip(&runs[1]);
    let mean = Estimate::of(pairs.clone().map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))));
    let half = Estimate::of(pairs.map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] - b[c]))));
    Estimate { variance: half.variance, ..mean }
}

#[test]
fn p12_bound_on_truncation() {
    let mut case = Case::open("P12", "spectral-radius bound on truncation", "what is said of a depth limit");
    let scene = lamp_room();
    // Rigorous: ρ^(M+1) Le/(1-ρ) with the largest albedo, as the plan states it.
    let stated = [1u32, 2, 4, 8, 16].map(|scatterings| {
        let options = options(8, 8, 1).max_depth(scatterings + 1);
        let renderer = Renderer::new(&scene, options).expect("valid options");
        let found = renderer.plan().bias[0].radiance_removed_at_most.expect("bounded");
        (f64::from(0.8f32).powi(scatterings as i32 + 1) / (1.0 - f64::from(0.8f32)), found, 1e-6)
    });
    case.numbers("- (bound that the plan states)", stated);

    // Sharp, by the solver: the late ratio of terms, what a limit removes from the floor, and the tail that the ratio
    // predicts.
    let floor = floor_terms(&scene);
    let total: f64 = floor.iter().sum();
    let observed = [(1, -0.39599), (2, -0.218336), (4, -0.0522928), (8, -0.00315602), (16, -1.16573e-05)];
    let removed = observed.map(|(last, expected)| (expected, floor[..last].iter().sum::<f64>() / total - 1.0, 0.01));
    case.numbers("- (solver: share removed from the floor)", removed);
    let ratio = floor[15] / floor[14];
    case.number("- (solver: late ratio of terms)", 0.4965469, ratio, 1e-3);
    let tails = [4, 8, 16].map(|last| (floor[last..].iter().sum(), floor[last - 1] * ratio / (1.0 - ratio), 0.05));
    case.numbers("- (solver: tail from the last term)", tails);

    // The same from what the path tracer shows of the floor, within 5 % as its own noise allows.
    let mut scene = scene;
    let mut b = SceneBuilder::new();
    let projection = Projection::Orthographic { xmag_m: 0.5, ymag_m: 0.5 };
    b.any_camera(Vec3::new(0.5, 0.5, 0.99), Vec3::splat(0.5), Vec3::Y, projection);
    scene.cameras = b.build().cameras;
    let left: f64 = FACES_TOTAL[3] - FACES[..4].iter().map(|term| term[3]).sum::<f64>();
    for mode in Mode::all() {
        let side = if mode.is_main() { 256 } else { 64 };
        let sampler = SamplerKind::Independent;
        let render =
            crate::common::render(&scene, mode.options(options(side, side, 16).per_length(true).sampler(sampler)));
        // Term 4, and the tail that it predicts by the late ratio.
        let term = Estimate::of(render.film.path_lengths().expect("asked for").image(5).into_iter());
        let mut means = Means::default();
        means.add("tail from term 4", left, 0.05 * left, 0.5, term.scaled(0.4965469 / (1.0 - 0.4965469)));
        means.judge(&mut case, &mode.name);
    }
    case.close();
}

/// Mean reflected radiance of the floor by term, from 1 on, by the deterministic solver.
fn floor_terms(scene: &Scene) -> Vec<f64> {
    let geometry = pathspace::scene::geometry::Geometry::build(scene);
    let kind = pathspace::backend::BackendKind::available()[0];
    let backend =
        pathspace::backend::select::build(kind, &geometry, &Default::default()).expect("a backend of this build");
    let solution = pathspace::verify::solve(scene, backend.as_ref(), 600, 3).expect("a diffuse scene");
    let of = |term: &[[f64; 3]]| {
        let floor = solution.patches.iter().zip(term.chunks_exact(6)).filter(|(patch, _)| patch.normal.z > 0.5);
        let (sum, area) = floor.fold((0.0, 0.0), |(sum, area), (patch, nodes)| {
            let mean = nodes[..3].iter().map(|node| node[1]).sum::<f64>() / 3.0;
            (sum + patch.area * mean, area + patch.area)
        });
        sum / area
    };
    solution.series.terms.iter().skip(1).map(|term| of(term)).collect()
}
