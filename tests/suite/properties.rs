//! Properties over whole ranges of numbers: triangles, rays, frames, materials and densities, from the smallest to the
//! largest that a scene may hold, and bits of any kind. What fails is shrunk to a small example.
//!
//! Oracles: the promises of the functions' own pages (finite, in range, normalised, the two sides of one identity), and
//! the backends against each other. Seeds are fixed: a verdict never flakes, and nothing is written.

use glam::{DVec3, Vec3};
use pathspace::backend::batch::{BLOCKED, LANES, RayBlock, RayHitBlock};
use pathspace::backend::{self, Backend, BackendKind, BackendOptions, Coherence};
use pathspace::math::frame::Frame;
use pathspace::math::table::{AliasTable, Distribution2D};
use pathspace::math::{float, warp};
use pathspace::scene::Material;
use pathspace::scene::builder::SceneBuilder;
use pathspace::scene::geometry::Geometry;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::model::{Tables, Textured};
use pathspace::shading::surface::Surface;
use pathspace::shading::{mis, roulette};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;

/// The same cases in every run, and no file of failures.
fn fixed(cases: u32, seed: u64) -> ProptestConfig {
    ProptestConfig { cases, rng_seed: RngSeed::Fixed(seed), failure_persistence: None, ..ProptestConfig::default() }
}

/// Uniform over the multiples of 2^-24 in [0, 1), ends included often.
fn unit() -> impl Strategy<Value = f32> {
    let lattice = (0u32..1 << 24).prop_map(|k| k as f32 / (1 << 24) as f32);
    prop_oneof![8 => lattice, 1 => Just(0.0), 1 => Just(float::ONE_MINUS)]
}

fn units<const N: usize>() -> impl Strategy<Value = [f32; N]> {
    proptest::collection::vec(unit(), N).prop_map(|v| v.try_into().expect("N of them"))
}

/// Either sign, magnitudes 2^`low` to 2^`high`, any mantissa, and 0.
fn wide(low: i32, high: i32) -> impl Strategy<Value = f32> {
    let number = (low..high, 1.0f32..2.0, any::<bool>())
        .prop_map(|(power, mantissa, minus)| mantissa * 2f32.powi(power) * if minus { -1.0 } else { 1.0 });
    prop_oneof![9 => number, 1 => Just(0.0)]
}

fn wide_vector(low: i32, high: i32) -> impl Strategy<Value = Vec3> {
    (wide(low, high), wide(low, high), wide(low, high)).prop_map(Vec3::from)
}

/// Unit vectors: all over the sphere, along axes, and a hair beside them.
fn direction() -> impl Strategy<Value = Vec3> {
    let tiny = wide_vector(-130, -1);
    let axis = (0usize..3, any::<bool>()).prop_map(|(axis, minus)| Vec3::AXES[axis] * if minus { -1.0 } else { 1.0 });
    let beside = (axis, tiny).prop_map(|(axis, tiny)| (axis + tiny).try_normalize().unwrap_or(axis));
    prop_oneof![units::<2>().prop_map(warp::uniform_sphere), beside].prop_map(|v| v.as_dvec3().normalize().as_vec3())
}

/// A triangle of any size and place, with a height that f32 can tell from 0.
fn triangle() -> impl Strategy<Value = [Vec3; 3]> {
    let sized =
        (wide_vector(-30, 30), wide_vector(-8, 0), wide_vector(-8, 0), -30i32..30).prop_map(|(at, e1, e2, size)| {
            let size = 2f32.powi(size);
            [at, at + e1 * size, at + e2 * size]
        });
    sized.prop_filter("a triangle with an area", |[a, b, c]| {
        let (e1, e2) = ((*b - *a).as_dvec3(), (*c - *a).as_dvec3());
        let extent = e1.length().max(e2.length()).max((e2 - e1).length());
        e1.cross(e2).length() > 1e-3 * extent * extent && extent > 0.0
    })
}

fn geometry(triangle: [Vec3; 3]) -> Geometry {
    let mut b = SceneBuilder::new();
    let white = b.lambert(Vec3::ONE);
    b.triangles(triangle.to_vec(), vec![[0, 1, 2]], white);
    b.camera(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
    Geometry::build(&b.build())
}

fn backends(geometry: &Geometry) -> Vec<(BackendKind, Box<dyn Backend>)> {
    let options = BackendOptions { build_threads: 1, ..BackendOptions::default() };
    let build = |kind| backend::select::build(kind, geometry, &options).unwrap_or_else(|e| panic!("{e}"));
    BackendKind::available().iter().map(|&kind| (kind, build(kind))).collect()
}

fn of_rays(rays: &[(Vec3, Vec3)]) -> Vec<RayHitBlock> {
    let mut blocks = vec![RayHitBlock::EMPTY; rays.len().div_ceil(LANES)];
    for (lane, &(org, dir)) in rays.iter().enumerate() {
        blocks[lane / LANES].ray.set(lane % LANES, org, dir, f32::INFINITY);
    }
    blocks
}

proptest! {
    #![proptest_config(fixed(400, 1))]

    /// A ray from the front of a triangle to a point well inside it hits it, at the distance that f64 says, on every
    /// backend.
    #[test]
    fn rays_to_the_inside_of_a_triangle_hit_it(
        triangle in triangle(),
        [u, v, w] in units::<3>(),
        away in direction(),
        far in -2i32..8,
    ) {
        let [a, b, c] = triangle.map(|p| p.as_dvec3());
        // A twentieth of the height from every edge, as is asked for below.
        let (u, v) = (0.2 + 0.275 * f64::from(u), 0.2 + 0.275 * f64::from(v));
        let target = a + (b - a) * u + (c - a) * v;
        let normal = (b - a).cross(c - a).normalize();
        let away = away.as_dvec3();
        prop_assume!(away.dot(normal).abs() > 0.1);
        let extent = (b - a).length().max((c - a).length());
        let origin = (target + away * (extent * f64::from(1.0 + w) * f64::from(far).exp2())).as_vec3();
        let exact = target - origin.as_dvec3();
        // What rounding of the origin, the direction and the vertices may do to the point has to stay inside.
        let size = exact.length() + origin.as_dvec3().length() + a.length() + extent;
        let height = (b - a).cross(c - a).length() / extent;
        prop_assume!(size * 2f64.powi(-20) < 0.05 * height);
        let dir = exact.normalize().as_vec3();
        for (kind, backend) in backends(&geometry(triangle)) {
            let mut blocks = of_rays(&[(origin, dir)]);
            prop_assert_eq!(backend.closest_hit(&mut blocks, 1, Coherence::Incoherent), 0);
            let hit = blocks[0].hit(0);
            prop_assert!(hit.is_some(), "{} lost {origin} → {target}", kind.name());
            let hit = hit.expect("just looked");
            let error = (f64::from(hit.t) - exact.length()).abs();
            prop_assert!(error <= 20.0 * size * 2f64.powi(-20), "{}: t {} for {}", kind.name(), hit.t, exact.length());
            prop_assert!(hit.u >= 0.0 && hit.v >= 0.0 && hit.u + hit.v <= 1.0 + 1e-6, "{hit:?}");
        }
    }

    /// Rays of any bits at all: none stops a backend, those that are refused are counted by all alike, and hits are
    /// finite.
    #[test]
    fn rays_of_any_bits_are_survived(
        triangle in triangle(),
        rays in proptest::collection::vec(any::<[u32; 6]>(), 24),
        mixed in any::<u64>(),
    ) {
        let mut random = mixed;
        let rays: Vec<_> = rays.iter().map(|bits| {
            // A third of the components become ordinary numbers, or else hardly any ray would be traced.
            let v = bits.map(|bits| {
                random = random.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
                if random >> 62 == 0 { f32::from_bits(bits) } else { (bits >> 8) as f32 / (1 << 23) as f32 - 1.0 }
            });
            let dir = Vec3::new(v[3], v[4], v[5]);
            (Vec3::new(v[0], v[1], v[2]), if random >> 61 & 1 == 0 { dir.normalize() } else { dir })
        }).collect();
        let mut refused = Vec::new();
        for (kind, backend) in backends(&geometry(triangle)) {
            let mut blocks = of_rays(&rays);
            let invalid = backend.closest_hit(&mut blocks, rays.len(), Coherence::Incoherent);
            refused.push(invalid);
            for lane in 0..rays.len() {
                let hit = blocks[lane / LANES].hit(lane % LANES);
                let sound = hit.is_none_or(|hit| [hit.t, hit.u, hit.v].iter().all(|x| x.is_finite()) && hit.t >= 0.0);
                prop_assert!(sound, "{}: {:?} gave {hit:?}", kind.name(), rays[lane]);
            }
            let mut shadows: Vec<RayBlock> = of_rays(&rays).iter().map(|block| block.ray).collect();
            prop_assert_eq!(backend.any_hit(&mut shadows, rays.len(), Coherence::Incoherent), invalid);
        }
        prop_assert!(refused.iter().all(|&n| n == refused[0]), "{refused:?}");
    }

    /// A ray that leaves a triangle does not meet it again, whatever the size and place.
    #[test]
    fn rays_do_not_meet_the_triangle_they_leave(
        triangle in triangle(),
        points in proptest::collection::vec((units::<2>(), direction()), 16),
    ) {
        let geometry = geometry(triangle);
        let record = &geometry.triangles[0];
        let (v0, e1, e2, n_g) = (record.v0.into(), record.e1.into(), record.e2.into(), Vec3::from(record.n_g));
        let rays: Vec<_> = points.iter().map(|&(uv, dir)| {
            let [u, v] = warp::triangle_barycentric(uv);
            let p = float::hit_point(v0, e1, e2, u, v);
            (float::spawn_origin(p, n_g, record.error, dir), dir)
        }).collect();
        for (kind, backend) in backends(&geometry) {
            let mut blocks: Vec<RayBlock> = of_rays(&rays).iter().map(|block| block.ray).collect();
            prop_assert_eq!(backend.any_hit(&mut blocks, rays.len(), Coherence::Incoherent), 0);
            for (lane, ray) in rays.iter().enumerate() {
                let free = blocks[lane / LANES].tfar[lane % LANES] != BLOCKED;
                prop_assert!(free, "{}: {ray:?} from {triangle:?}", kind.name());
            }
        }
    }

    /// A shadow segment to a triangle ends short of it.
    #[test]
    fn shadow_segments_end_short_of_their_light(
        triangle in triangle(),
        uv in units::<2>(),
        away in direction(),
        far in -3i32..10,
    ) {
        let geometry = geometry(triangle);
        let record = &geometry.triangles[0];
        let n_g = Vec3::from(record.n_g);
        prop_assume!(away.dot(n_g) > 0.05);
        let [u, v] = warp::triangle_barycentric(uv);
        let p = float::hit_point(record.v0.into(), record.e1.into(), record.e2.into(), u, v);
        let extent = Vec3::from(record.e1).length().max(Vec3::from(record.e2).length());
        let origin = p + away * (extent * 2f32.powi(far));
        let Some(segment) = float::shadow_segment(origin, p, n_g, record.error) else { return Ok(()) };
        prop_assert!((segment.dir.length() - 1.0).abs() < 1e-6);
        for (kind, backend) in backends(&geometry) {
            let mut block = [RayBlock::EMPTY];
            block[0].set(0, origin, segment.dir, segment.tfar);
            backend.any_hit(&mut block, 1, Coherence::Incoherent);
            // A receiver behind the plane by rounding alone is no segment to that side.
            let in_front = (origin - p).dot(n_g) > 4.0 * record.error;
            prop_assert!(!in_front || block[0].tfar[0] != BLOCKED, "{}: {origin} to {p} of {triangle:?}", kind.name());
        }
    }
}

proptest! {
    #![proptest_config(fixed(20_000, 2))]

    /// Frames are orthonormal to 2.5e-7 about every unit normal, and take vectors there and back.
    #[test]
    fn frames_are_orthonormal(n in direction(), v in direction()) {
        let frame = Frame::from_normal(n);
        let axes = [frame.t, frame.b, frame.n].map(|axis| axis.as_dvec3());
        for i in 0..3 {
            for j in 0..3 {
                let expected = if i == j { 1.0 } else { 0.0 };
                prop_assert!((axes[i].dot(axes[j]) - expected).abs() < 3e-7, "{frame:?}");
            }
        }
        prop_assert!(axes[0].cross(axes[1]).dot(axes[2]) > 0.999, "left-handed: {frame:?}");
        prop_assert!(frame.to_world(frame.to_local(v)).distance(v) < 1e-6);
    }

    /// Any tangent gives a frame: also one of no length, along the normal, or not finite.
    #[test]
    fn frames_survive_any_tangent(
        n in direction(),
        bits in any::<[u32; 3]>(),
        wild in wide_vector(-120, 60),
        choose in 0..3,
    ) {
        let tangent = [Vec3::from(bits.map(f32::from_bits)), wild, n * wild.x][choose as usize];
        let frame = Frame::from_normal_tangent(n, tangent);
        let (t, b) = (frame.t.as_dvec3(), frame.b.as_dvec3());
        prop_assert!(t.is_finite() && b.is_finite(), "{n} {tangent}: {frame:?}");
        let off = (t.length() - 1.0).abs().max((b.length() - 1.0).abs()).max(t.dot(b).abs());
        prop_assert!(off < 1e-5, "{n} {tangent}: {frame:?}");
    }

    /// Weights of two densities lie in [0, 1] and sum to 1; the ends are as specified.
    #[test]
    fn weights_of_any_densities_sum_to_one(a in wide(-126, 127), b in wide(-126, 127)) {
        let (a, b) = (a.abs(), b.abs());
        for weight in [mis::power_weight, mis::balance_weight] {
            let (wa, wb) = (weight(a, b), weight(b, a));
            prop_assert!((0.0..=1.0).contains(&wa) && (0.0..=1.0).contains(&wb), "{a} {b}: {wa} {wb}");
            let expected = if a == 0.0 && b == 0.0 { 0.0 } else { 1.0 };
            prop_assert!((wa + wb - expected).abs() <= 3e-7, "{a} {b}: {wa} + {wb}");
            prop_assert_eq!((weight(f32::INFINITY, a), weight(0.0, a)), (1.0, 0.0));
            prop_assert!(weight(f32::NAN, a).is_nan() || a == f32::INFINITY);
        }
    }

    /// Survival is a probability on the lattice of the random numbers, 0 for nothing alone, and a survivor carries at
    /// most a half more than it had to.
    #[test]
    fn survival_is_a_probability(beta in wide_vector(-140, 100), eta in wide(-20, 20), vertex in 1u32..9) {
        let (beta, eta) = (beta.abs(), eta.abs().max(1e-6));
        let q = roulette::survival(beta, eta, vertex, 3);
        prop_assert!((0.0..=1.0).contains(&q) && (q == 0.0) == (beta.max_element() <= 0.0), "{beta} {eta}: {q}");
        prop_assert!((q * (1 << 24) as f32).fract() == 0.0, "{q} is off the lattice");
    }

    /// Warps give unit vectors of the right side with a density above 0, at every point of the square.
    #[test]
    fn warps_stay_in_their_domains(u in units::<2>(), cos_max in -1.0f32..1.0) {
        let hemisphere = warp::cosine_hemisphere(u);
        prop_assert!((hemisphere.length() - 1.0).abs() < 1e-6 && hemisphere.z > 0.0);
        prop_assert!(warp::cosine_hemisphere_pdf(hemisphere.z) > 0.0);
        prop_assert!(warp::concentric_disk(u).length() <= 1.0 + 1e-6);
        let cap = warp::spherical_cap(u, cos_max);
        prop_assert!((cap.length() - 1.0).abs() < 1e-6 && cap.z >= cos_max - 1e-6);
        prop_assert!(warp::spherical_cap_pdf(cos_max) > 0.0);
        let [v, w] = warp::triangle_barycentric(u);
        prop_assert!(v >= 0.0 && w >= 0.0 && v + w <= 1.0);
    }
}

/// Materials with factors over their whole ranges, ends and hair's breadths included.
fn material() -> impl Strategy<Value = Material> {
    let fraction =
        || prop_oneof![3 => 0.0f32..=1.0, 1 => Just(0.0), 1 => Just(1.0), 1 => wide(-30, -1).prop_map(f32::abs)];
    let ior = prop_oneof![
        4 => 1.0f32..3.0,
        1 => Just(1.0),
        1 => Just(0.0),
        1 => wide(0, 60).prop_map(|x| 1.0 + x.abs()),
        1 => wide(-23, -8).prop_map(|x| 1.0 + x.abs()),
    ];
    let color = (fraction(), fraction(), fraction()).prop_map(Vec3::from);
    let specular_color = wide_vector(-20, 20).prop_map(Vec3::abs);
    let transmission = prop_oneof![Just(0.0), Just(1.0), 0.0f32..1.0];
    (color, fraction(), fraction(), fraction(), specular_color, ior, transmission, any::<bool>()).prop_map(
        |(base_color, metallic, roughness, specular, specular_color, ior, transmission, solid)| Material {
            base_color,
            metallic,
            roughness,
            specular,
            specular_color,
            ior,
            transmission,
            thickness: if solid { 1.0 } else { 0.0 },
            ..Material::default()
        },
    )
}

/// Whatever the material: samples are unit vectors of finite weight and a density above 0, `eval` is finite and not
/// negative, it agrees with the sample where the lobe is wide enough for f32 directions to say, and energy is not made.
#[test]
fn surfaces_of_any_material_scatter_sound_numbers() {
    let tables = SpecularAlbedo::compute();
    let strategy = (material(), direction(), direction(), units::<4>());
    let mut runner = proptest::test_runner::TestRunner::new(fixed(30_000, 3));
    let outcome = runner.run(&strategy, |(material, wo, other, u)| {
        let surface =
            Surface::from_material(&material, Textured::constant(&material), &Tables::new(&tables, true), u[3]);
        // A viewer of an opaque surface is in front of it.
        let wo = if surface.is_transmissive() { wo } else { Vec3::new(wo.x, wo.y, wo.z.abs()) };
        let sound = |wi: Vec3| {
            let eval = surface.eval(wo, wi);
            let finite = eval.f_cos.is_finite() && eval.pdf_sa.is_finite();
            prop_assert!(
                finite && eval.f_cos.min_element() >= 0.0 && eval.pdf_sa >= 0.0,
                "{wo} → {wi}: {eval:?}, {material:?}"
            );
            // A base that has less than a step of the random numbers beside its coat is never drawn.
            let drawn = eval.f_cos.max_element() <= float::UNIT_ROUNDOFF || eval.pdf_sa > 0.0;
            prop_assert!(drawn, "{wo} → {wi} is never sampled: {eval:?}, {material:?}");
            Ok(eval)
        };
        sound(other)?;
        let Some(sample) = surface.sample(wo, [u[0], u[1], u[2]]) else { return Ok(()) };
        prop_assert!((sample.wi.as_dvec3().length() - 1.0).abs() < 2e-6, "{wo}: {sample:?}, {material:?}");
        let weight = sample.weight;
        prop_assert!(
            weight.is_finite() && weight.min_element() >= 0.0 && sample.eta > 0.0,
            "{wo}: {sample:?}, {material:?}"
        );
        prop_assert!(sample.pdf_sa > 0.0, "{wo}: {sample:?}, {material:?}");
        // One technique of a mixture of lobes may carry more than 1, a delta lobe or a dielectric never, but for
        // 1/η².
        if surface.is_delta() || surface.is_transmissive() {
            let most = weight.max_element() * sample.eta * sample.eta;
            prop_assert!(most <= 1.0 + 1e-5, "{wo}: {most}, {sample:?}, {material:?}");
        }
        if sample.pdf_sa.is_finite() {
            let eval = sound(sample.wi)?;
            // The facet between both, which f32 directions tell well where nothing grazes anything.
            let through_wall = sample.eta == 1.0 && (wo.z > 0.0) != (sample.wi.z > 0.0);
            let wi = if through_wall { Vec3::new(sample.wi.x, sample.wi.y, -sample.wi.z) } else { sample.wi };
            let facet = (wo + wi * sample.eta).normalize_or_zero();
            let cosines = [wo.z, wi.z, facet.z, wo.dot(facet), wi.dot(facet)];
            let told = material.roughness >= 0.3 && cosines.iter().all(|cos| cos.abs() > 0.05);
            let index = material.ior == 1.0 || (1.05..3.0).contains(&material.ior);
            if told && index {
                let ratio = eval.pdf_sa / sample.pdf_sa;
                prop_assert!((ratio - 1.0).abs() < 1e-2, "{wo}: {eval:?}, {sample:?}, {material:?}");
            }
        }
        Ok(())
    });
    outcome.unwrap_or_else(|e| panic!("{e}"));
}

proptest! {
    #![proptest_config(fixed(2000, 4))]

    /// Tables of any weights, 200 powers of ten apart: what is drawn had a weight, the probabilities sum to 1.
    #[test]
    fn tables_of_any_weights_draw_what_has_weight(
        weights in proptest::collection::vec(
            prop_oneof![3 => (-100i32..100).prop_map(|p| 10f64.powi(p)), 1 => Just(0.0)],
            1..40,
        ),
        us in proptest::collection::vec(unit(), 8),
    ) {
        let total: f64 = weights.iter().sum();
        match AliasTable::new(&weights) {
            Err(_) => prop_assert_eq!(total, 0.0),
            Ok(table) => {
                let sum: f64 = (0..weights.len() as u32).map(|i| f64::from(table.p(i))).sum();
                prop_assert!((sum - 1.0).abs() < 1e-5, "{sum}");
                for u in us {
                    let choice = table.sample(u);
                    let index = choice.index as usize;
                    prop_assert!(index < weights.len() && weights[index] > 0.0, "{choice:?} of {weights:?}");
                    prop_assert!(choice.p > 0.0 && choice.p <= 1.0 && (0.0..1.0).contains(&choice.u), "{choice:?}");
                }
            }
        }
    }

    /// The same for grids: the point lies in the square, and its density is that of `pdf`.
    #[test]
    fn grids_of_any_weights_agree_with_their_density(
        width in 1u32..9,
        height in 1u32..9,
        seed in any::<u64>(),
        uv in units::<2>(),
    ) {
        let mut state = seed;
        let weights: Vec<f64> = (0..width * height).map(|_| {
            state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
            if state >> 61 == 0 { 0.0 } else { 10f64.powi((state >> 40) as i32 % 12 - 6) }
        }).collect();
        let made = Distribution2D::new(width, height, |row, out| {
            out.copy_from_slice(&weights[(row * width) as usize..((row + 1) * width) as usize]);
        });
        if let Ok(grid) = made {
            let point = grid.sample(uv[0], uv[1]);
            prop_assert!(point.uv.iter().all(|x| (0.0..1.0).contains(x)) && point.pdf_uv > 0.0, "{point:?}");
            let cell = grid.sample_cell(uv[0], uv[1]);
            let weight = weights[(cell.row * width + cell.column) as usize];
            prop_assert!(weight > 0.0 && cell.p > 0.0, "{cell:?} has no weight");
            // A point may round onto the border to the next cell.
            let inside = |x: f32, number: u32, count: u32| (x * count as f32) as u32 == number;
            if inside(point.uv[0], cell.column, width) && inside(point.uv[1], cell.row, height) {
                let pdf = grid.pdf(point.uv);
                prop_assert!((pdf / point.pdf_uv - 1.0).abs() < 1e-4, "{point:?}: {pdf}");
            } else {
                prop_assert!(cell.within.iter().any(|&within| within > 0.999_999), "{cell:?}: {point:?}");
            }
        }
    }

    /// The point rebuilt from barycentrics is within its error bound of the exact one, along the normal.
    #[test]
    fn hit_points_lie_within_their_bound(triangle in triangle(), uv in units::<2>()) {
        let geometry = geometry(triangle);
        let record = &geometry.triangles[0];
        let [u, v] = warp::triangle_barycentric(uv);
        let p = float::hit_point(record.v0.into(), record.e1.into(), record.e2.into(), u, v).as_dvec3();
        let [a, b, c] = triangle.map(|p| p.as_dvec3());
        let normal: DVec3 = (b - a).cross(c - a).normalize();
        let off = (p - a).dot(normal).abs();
        prop_assert!(off <= f64::from(record.error), "{off} m off, bound {}", record.error);
    }
}
