//! Two spheres with closed forms, both as meshes: an integrating sphere with a lamp in it, and a Lambert sphere under a
//! distant light at all phases. The meshes have exact values of their own, which tend to the sphere's.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use pathspace::plan::options::{CameraChoice, FilterKind, Roulette, SamplerKind, Strategy};
use pathspace::render::Renderer;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::ids::MeshId;
use pathspace::scene::{Instance, Projection, PunctualKind, Scene};
use pathspace_stat::GaussLegendre;

use super::Case;
use super::modes::Mode;
use super::receiver::{Means, delta, polygon_irradiance};
use crate::common::{Estimate, options, render, single_ray};

/// Albedo of the wall and radiance of the lamp, by channel.
const WALL: [f32; 3] = [0.8, 0.5, 0.2];
const LAMP: [f32; 3] = [10.0, 5.0, 2.5];
/// Share of the sphere that a cap of 30° covers.
const CAP: f64 = 0.066_987_298_11;
/// Terms that are compared.
const TERMS: usize = 4;

/// The sphere of radius 1, a lamp in its polar cap of 30°: `rows` is a multiple of 6, so that a row ends there.
fn integrating_sphere(rows: u32) -> Scene {
    let mut b = SceneBuilder::new();
    let wall = b.lambert(Vec3::from(WALL));
    let lamp = b.emitter(Vec3::ZERO, Vec3::from(LAMP));
    b.sphere(Vec3::ZERO, 1.0, rows, true, false, wall);
    let mut scene = b.build();
    let polar = |t: &[u32; 3]| t.iter().all(|&i| i < (rows / 6 + 1) * 2 * rows);
    let (cap, rest) = scene.meshes[0].triangles.iter().copied().partition::<Vec<_>, _>(polar);
    let mut second = scene.meshes[0].clone();
    (second.triangles, second.material) = (cap, lamp);
    scene.meshes[0].triangles = rest;
    scene.meshes.push(second);
    scene.instances.push(Instance { mesh: MeshId(1), ..scene.instances[0].clone() });
    scene
}

/// Term `k` (from 1) in any point of the sphere's wall, for a lamp of radiance 1: the kernel is constant in a sphere.
fn closed_form(rho: f64, k: usize) -> f64 {
    rho * CAP * ((1.0 - CAP) * rho).powi(k as i32 - 1)
}

/// The mesh of [`integrating_sphere`] solved without random numbers. Its faces are flat trapezoids in rows; all faces
/// of a row are alike, and a row is what two caps leave, each of which is seen as the polygon that bounds it. So a form
/// factor is a difference of two of Lambert's sums, exact but for the mean over the face.
struct Rows {
    rows: usize,
}

impl Rows {
    fn corner(&self, row: usize, column: usize) -> DVec3 {
        let (phi, theta) = (PI * row as f64 / self.rows as f64, PI * column as f64 / self.rows as f64);
        DVec3::new(phi.sin() * theta.sin(), phi.cos(), phi.sin() * theta.cos())
    }

    /// Inward normal of a row's faces in a column.
    fn normal(&self, row: usize, column: usize) -> DVec3 {
        let [a, b] = [self.corner(row, column), self.corner(row + 1, column + 1)];
        let [c, d] = [self.corner(row + 1, column), self.corner(row, column + 1)];
        let cross = (b - a).cross(d - c).normalize();
        if cross.dot(a) < 0.0 { cross } else { -cross }
    }

    /// Where the plane of a face touches a sphere: the normal is the sphere's there.
    fn tangent_point(&self, row: usize, column: usize) -> DVec3 {
        let normal = self.normal(row, column);
        normal * normal.dot(self.corner(row, column))
    }

    /// Form factors from a point of a face in `row` to all rows.
    fn factors(&self, row: usize, p: DVec3, n: DVec3) -> Vec<f64> {
        let above: Vec<f64> = (0..=self.rows)
            .map(|edge| {
                if edge == 0 || edge == self.rows {
                    return if edge == 0 { 0.0 } else { 1.0 };
                }
                let ring: Vec<DVec3> = (0..2 * self.rows).map(|column| self.corner(edge, column)).collect();
                let seen = (polygon_irradiance(p, n, &ring) / PI).abs();
                if row >= edge { seen } else { 1.0 - seen }
            })
            .collect();
        above.windows(2).map(|pair| pair[1] - pair[0]).collect()
    }

    /// Terms 1 … [`TERMS`] at the tangent points of each row's faces, for a lamp of radiance 1 and a wall of albedo
    /// 1: albedo ρ makes ρᵏ of them.
    fn solve(&self) -> Vec<[f64; TERMS]> {
        let rule = GaussLegendre::new(3);
        let first = self.rows / 6;
        let matrix: Vec<Vec<f64>> = (first..self.rows)
            .map(|row| {
                let [a, b] = [0, 1].map(|column| self.corner(row, column));
                let [d, c] = [0, 1].map(|column| self.corner(row + 1, column));
                let n = self.normal(row, 0);
                let mut mean = vec![0.0; self.rows];
                let mut area = 0.0;
                for &(t, weight_t) in rule.nodes() {
                    let (left, right) = (a.lerp(d, t), b.lerp(c, t));
                    for &(s, weight_s) in rule.nodes() {
                        let weight = weight_t * weight_s * (right - left).length();
                        area += weight;
                        let found = self.factors(row, left.lerp(right, s), n);
                        mean.iter_mut().zip(found).for_each(|(mean, f)| *mean += weight * f);
                    }
                }
                mean.into_iter().map(|f| f / area).collect()
            })
            .collect();
        // Radiance by row: first the lamp, then what one scattering makes of it.
        let mut radiance: Vec<f64> = (0..self.rows).map(|row| f64::from(u8::from(row < first))).collect();
        let at: Vec<Vec<f64>> =
            (first..self.rows).map(|row| self.factors(row, self.tangent_point(row, 0), self.normal(row, 0))).collect();
        let gather = |factors: &[f64], radiance: &[f64]| factors.iter().zip(radiance).map(|(f, l)| f * l).sum::<f64>();
        let mut terms = vec![[0.0; TERMS]; self.rows - first];
        for k in 0..TERMS {
            for (terms, factors) in terms.iter_mut().zip(&at) {
                terms[k] = gather(factors, &radiance);
            }
            let next: Vec<f64> = matrix.iter().map(|factors| gather(factors, &radiance)).collect();
            radiance = vec![0.0; first].into_iter().chain(next).collect();
        }
        terms
    }
}

#[test]
fn p04_integrating_sphere() {
    let mut case =
        Case::open("P04", "integrating sphere with a cap light (mesh of 48 rows)", "emission and albedo that vary");
    // The mesh's own solution tends to the closed form as 1/rows²: twice the rows, less than a third of the error.
    let off = |terms: &[[f64; TERMS]]| {
        let of = |terms: &[f64; TERMS]| {
            (0..TERMS).map(|k| (terms[k] / closed_form(1.0, k + 1) - 1.0).abs()).fold(0.0, f64::max)
        };
        terms.iter().map(of).fold(0.0, f64::max)
    };
    let (coarse, fine) = (Rows { rows: 24 }.solve(), Rows { rows: 48 }.solve());
    let (coarse, found) = (off(&coarse), off(&fine));
    let rows = Rows { rows: 48 };
    case.row(
        "- (mesh solved without random numbers)",
        format!("below {:.1e}", coarse / 3.0),
        format!("{found:.1e}"),
        format!("{found:.1e}, with 24 rows {coarse:.1e}"),
        found < coarse / 3.0,
    );

    let mut scene = integrating_sphere(48);
    let first = rows.rows / 6;
    let faces: Vec<(usize, usize)> = (0..64).map(|i| (first + 5 * (i / 8) + i % 2, 12 * (i % 8) + i / 8)).collect();
    for &(row, column) in &faces {
        scene.cameras.push(single_ray(Vec3::ZERO, rows.tangent_point(row, column).as_vec3()));
    }
    for mode in Mode::all() {
        for roulette in [Roulette::Off, Roulette::On] {
            let side = match (mode.is_main(), roulette) {
                (true, Roulette::Off) => 64,
                (true, _) => 16,
                _ => 8,
            };
            if !mode.is_main() && roulette == Roulette::Off {
                continue;
            }
            let at = |camera: usize| {
                mode.options(
                    options(side, side, if mode.is_main() { 1 } else { 4 })
                        .camera(CameraChoice::Index(camera))
                        .sampler(SamplerKind::Independent)
                        .per_length(true)
                        .max_depth(6)
                        .roulette(roulette)
                        .seed(camera as u64),
                )
            };
            let mut renderer = Renderer::new(&scene, at(0)).expect("valid options");
            let (mut points, mut pooled) = (Means::default(), Vec::new());
            for (camera, &(row, column)) in faces.iter().enumerate().step_by(if mode.is_brute() { 8 } else { 1 }) {
                renderer.retarget(&at(camera)).expect("valid options");
                let film = renderer.render().expect("renders").film;
                let lengths = film.path_lengths().expect("asked for");
                for k in 1..=TERMS {
                    let estimate = Estimate::of(lengths.image(k + 1).into_iter());
                    let of = |c: usize| f64::from(LAMP[c]) * f64::from(WALL[c]).powi(k as i32);
                    let expected: [f64; 3] = std::array::from_fn(|c| of(c) * fine[row - first][k - 1]);
                    let closed: [f64; 3] = std::array::from_fn(|c| of(c) * closed_form(1.0, k));
                    // Near the lamp, and with every bounce, a term spreads more.
                    let n = u64::from(side * side) * if mode.is_main() { 1 } else { 4 };
                    let band = delta(n) * 1.5f64.powi(k as i32) * if roulette == Roulette::On { 2.0 } else { 1.0 };
                    points.add_color(
                        format!("term {k}, row {row}, column {column}"),
                        expected,
                        1e-5 * expected[2],
                        band,
                        estimate,
                    );
                    pooled.push((k, closed, expected, n, estimate));
                }
            }
            let on = format!("{}, roulette {roulette:?}", mode.name);
            points.judge(&mut case, format!("{on}, mesh's own values"));
            // All points together against the closed form, give or take what the mesh of 48 rows is off.
            let mut means = Means::default();
            for k in 1..=TERMS {
                let of: Vec<_> = pooled.iter().filter(|entry| entry.0 == k).collect();
                let count = of.len() as f64;
                let mean = |f: &dyn Fn(usize) -> f64| (0..of.len()).map(f).sum::<f64>() / count;
                let estimate = Estimate {
                    n: of[0].4.n * count,
                    mean: std::array::from_fn(|c| mean(&|i| of[i].4.mean[c])),
                    variance: std::array::from_fn(|c| mean(&|i| of[i].4.variance[c])),
                };
                let off = (mean(&|i| of[i].2[0]) / of[0].1[0] - 1.0).abs();
                let n = of[0].3 * of.len() as u64;
                let band = delta(n) * 1.5f64.powi(k as i32 - 1) * if roulette == Roulette::On { 2.0 } else { 1.0 };
                means.add_color(format!("term {k}, mesh off by {off:.1e}"), of[0].1, off * of[0].1[2], band, estimate);
            }
            means.judge(&mut case, format!("{on}, closed form"));
        }
    }
    case.close();
}

/// HARDCASES P14: a Lambert sphere (albedo ½) under a directional light of 1 W/m² at a phase angle, seen from afar.
fn moon(rows: u32, smooth: bool, phase: f64) -> Scene {
    let mut b = SceneBuilder::new();
    let ground = b.lambert(Vec3::splat(0.5));
    b.sphere(Vec3::ZERO, 1.0, rows, false, smooth, ground);
    let (sin, cos) = phase.sin_cos();
    b.punctual(Vec3::ZERO, DVec3::new(-sin, 0.0, -cos).as_vec3(), Vec3::ONE, PunctualKind::Directional);
    b.any_camera(Vec3::Z * 3.0, Vec3::ZERO, Vec3::Y, Projection::Orthographic { xmag_m: HALF, ymag_m: HALF });
    b.build()
}

/// Half the side of the picture of [`moon`], m.
const HALF: f32 = 1.02;

#[test]
fn p14_phase_curve() {
    let mut case =
        Case::open("P14", "phase curve of a Lambert sphere (meshes)", "direct light, normals, the terminator");
    let phases = [
        (0.0f64, 0.6666666667),
        (60.0, 0.4059985207),
        (90.0, 0.2122065908),
        (120.0, 0.07266518736),
        (150.0, 0.00987825053),
    ];
    let curve = |a: f64| 2.0 / 3.0 * (a.sin() + (PI - a) * a.cos()) / PI;
    case.numbers("- (closed form)", phases.map(|(degrees, expected)| (expected, curve(degrees.to_radians()), 1e-8)));
    // Mean over the disc in units of ρ E/π.
    let seen = |mode: &Mode, scene: &Scene, side: u32| {
        let options = options(side, side, 4).filter(FilterKind::Box).max_depth(2).strategy(Strategy::MIS);
        let mean = render(scene, mode.options(options)).film.mean()[0];
        mean * f64::from(4.0 * HALF * HALF) / PI * PI / 0.5
    };
    // What a flat-shaded convex mesh shows: faces that see both light and eye, by both cosines.
    let exact = |rows: u32, a: f64| {
        let scene = moon(rows, false, a);
        let (light, mesh) = (DVec3::new(a.sin(), 0.0, a.cos()), &scene.meshes[0]);
        let cross = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| mesh.positions[i as usize].as_dvec3());
            0.5 * (b - a).cross(c - a)
        };
        let face = |t: &[u32; 3]| {
            let cross = cross(t);
            cross.dot(light).max(0.0) * cross.z.max(0.0) / cross.length()
        };
        mesh.triangles.iter().map(face).sum::<f64>() / PI
    };
    let absolute = |expected: f64, got: f64, bound: f64| (expected, got, bound / expected);
    for mode in Mode::all() {
        let (rows, side, bound) = if mode.is_main() { (64, 512, 1e-4) } else { (12, 128, 1e-3) };
        let flat = phases.map(|(degrees, _)| {
            let a = degrees.to_radians();
            absolute(exact(rows, a), seen(&mode, &moon(rows, false, a), side), bound)
        });
        case.numbers(format!("{} (flat mesh of {rows} rows)", mode.name), flat);
        if mode.is_main() {
            let smooth = phases.map(|(degrees, expected)| {
                absolute(expected, seen(&mode, &moon(256, true, degrees.to_radians()), side), bound)
            });
            case.numbers(format!("{} (smooth mesh of 256 rows)", mode.name), smooth);
        }
    }
    case.close();
}
