//! GGX where it is numerically delicate: narrow lobes, the distribution of visible normals, the corners of its domain
//! (HARDCASES B04–B06). Oracles: the closed form of D, integrated densities, and what a unit normal above the surface
//! is.

use std::f64::consts::PI;

use glam::Vec3;
use pathspace::shading::bsdf::albedo::SpecularAlbedo;
use pathspace::shading::bsdf::microfacet::{Ggx, half_vector, reflect};
use pathspace_stat::{Moments, Pcg32, SphereBins, chi2_test, sidak_level};

use super::Case;
use super::white_furnace::white;
use crate::bsdf::{direction, glossy};
use crate::common::Estimate;

#[test]
fn b04_ggx_as_alpha_goes_to_zero() {
    let mut case = Case::open("B04", "GGX as α → 0", "cancellation in D, mirror limit");
    let peaks = [
        (0.1, 31.830988),
        (0.01, 3183.099),
        (3e-3, 35367.765),
        (1e-3, 318309.86),
        (3e-4, 3536776.2),
        (1e-4, 31830990.0),
    ];
    for (alpha, peak) in peaks {
        let ggx = Ggx::isotropic(alpha as f32);
        case.number(format!("D, α = {alpha}, peak"), peak, f64::from(ggx.density(Vec3::Z)), 1e-5);
        let around = [0.5, 1.0, 3.0].into_iter().flat_map(|k| [0.0, 0.7, 2.0_f64].map(|turn| (k, turn)));
        let pairs = around.map(|(k, turn)| {
            let (s, c) = f64::atan(k * alpha).sin_cos();
            let exact = alpha * alpha / (PI * (s * s + alpha * alpha * c * c).powi(2));
            let m = Vec3::new((s * turn.cos()) as f32, (s * turn.sin()) as f32, c as f32);
            (exact, f64::from(ggx.density(m)), 1e-5)
        });
        case.numbers(format!("D, α = {alpha}, slopes to 3 α"), pairs);
    }
    // On a grid of 64 × 64 numbers: no noise.
    let ggx = Ggx::isotropic(1e-3);
    for mu in [1.0, 0.9, 0.5_f32] {
        let wo = direction(mu, 0.0);
        let weights = (0..64 * 64).map(|k| {
            let u = [(k / 64) as f32 / 64.0 + 0.5 / 64.0, (k % 64) as f32 / 64.0 + 0.5 / 64.0];
            let wi = reflect(wo, ggx.sample_visible(wo, u));
            if wi.z > 0.0 { f64::from(ggx.masking(wi)) } else { 0.0 }
        });
        case.number(format!("albedo, α = 0.001, μ = {mu}"), 1.0, weights.sum::<f64>() / 4096.0, 3e-6);
    }
    case.close();
}

/// The product has one routine, the spherical cap of 2023; its distribution is that of its density, which is the one
/// that both routines have.
#[test]
fn b05_visible_normals() {
    let mut case =
        Case::open("B05", "Visible-normal sampling: distribution and horizon loss", "the sampler matches its pdf");
    let bins = SphereBins::hemisphere();
    let alphas = [(0.05, 0.05), (0.1, 0.1), (0.5, 0.5), (1.0, 1.0), (0.3, 0.15), (0.05, 0.5_f32)];
    let level = sidak_level(30, 1e-6);
    for (k, (ax, ay)) in alphas.into_iter().enumerate() {
        let ggx = Ggx::anisotropic(ax, ay);
        for (j, mu) in [1.0, 0.9, 0.5, 0.1, 0.01_f32].into_iter().enumerate() {
            let wo = direction(mu, 0.7);
            let mut rng = Pcg32::new(k as u64, j as u64);
            let mut weights = Moments::default();
            // The mean weight of the widest lobe takes twice the draws to see 5e-3.
            let draws = if ax == 1.0 { 2_000_000 } else { 1_000_000 };
            let expected = bins.expect(draws, &|d| {
                let wi = Vec3::from_array(d.map(|x| x as f32));
                if wi.z > 0.0 { f64::from(ggx.reflection(wo, wi, half_vector(wo, wi)).pdf_sa) } else { 0.0 }
            });
            let observed = bins.observe(draws, || {
                let wi = reflect(wo, ggx.sample_visible(wo, rng.array()));
                weights.push(if wi.z > 0.0 { f64::from(ggx.masking(wi)) } else { 0.0 });
                (wi.z > 0.0).then(|| wi.to_array().map(f64::from))
            });
            let verdict = chi2_test(&observed, &expected);
            case.row(
                format!("α = {ax}, {ay}, μ = {mu}"),
                format!("p > {level:.0e}"),
                format!("{:.2e}", verdict.p_value),
                format!("χ² {:.0} on {}", verdict.statistic, verdict.dof),
                verdict.p_value > level,
            );
            if ax == ay {
                let expected = [white(f64::from(mu), f64::from(ax)).albedo; 3];
                let on = format!("α = {ax}, μ = {mu}, mean weight");
                case.mean(on, expected, 1e-5, 5e-3, &Estimate::of_moments(&weights));
            }
        }
    }
    for (k, (alpha, mu)) in
        [(0.1, 1.0), (0.5, 1.0), (1.0, 1.0), (1.0, 0.5), (1.0, 0.1), (1.0, 0.01)].into_iter().enumerate()
    {
        let expected: f64 = if mu == 1.0 { alpha * alpha / (1.0 + alpha * alpha) } else { mu / (1.0 + mu) };
        let (ggx, wo) = (Ggx::isotropic(alpha as f32), direction(mu as f32, 0.3));
        let mut rng = Pcg32::new(k as u64, 3);
        let mut lost = Moments::default();
        lost.extend((0..1_000_000).map(|_| {
            let wi = reflect(wo, ggx.sample_visible(wo, rng.array()));
            if wi.z > 0.0 { 0.0 } else { 1.0 }
        }));
        // A share of 1 % is known to 5 % from 10⁶ draws.
        let delta = if expected < 0.05 { 6e-2 } else { 2e-2 };
        let on = format!("below the horizon, α = {alpha}, μ = {mu}");
        case.mean(on, [expected; 3], 0.0, delta, &Estimate::of_moments(&lost));
    }
    case.close();
}

#[test]
fn b06_corners_of_visible_normals() {
    let mut case = Case::open(
        "B06",
        "Visible-normal sampling at the corners of its domain",
        "u of 0 and 1 − 2⁻²⁴, grazing, anisotropy",
    );
    let numbers = [0.0, 0.5_f32.powi(32), 0.5, 1.0 - 0.5_f32.powi(24)];
    let alphas = [(1e-4, 1e-4), (1e-3, 1e-3), (1.0, 1.0), (1e-3, 1.0), (1.0, 1e-3)];
    let cosines = [1.0, 1.0 - 0.5_f32.powi(24), 1e-3, 1e-6, 1e-30];
    let (mut length, mut sunken, mut bad_pdf, mut weight) = (0.0_f64, 0, 0, 0.0_f64);
    for (wo, (ax, ay)) in cosines
        .into_iter()
        .flat_map(|mu| [0.0, 0.3, 1.6, 4.0].map(|turn| direction(mu, turn)))
        .flat_map(|wo| alphas.map(|alpha| (wo, alpha)))
    {
        let ggx = Ggx::anisotropic(ax, ay);
        for u in numbers.iter().flat_map(|&a| numbers.map(|b| [a, b])) {
            let m = ggx.sample_visible(wo, u);
            let error = (m.as_dvec3().length() - 1.0).abs();
            length = if error <= length { length } else { error };
            sunken += u64::from(!(m.z > 0.0));
            let wi = reflect(wo, m);
            if wi.z > 0.0 {
                let r = ggx.reflection(wo, wi, m);
                bad_pdf += u64::from(!(r.pdf_sa > 0.0 && r.pdf_sa < f32::INFINITY && r.f_cos >= 0.0));
                let ratio = f64::from(r.f_cos) / f64::from(r.pdf_sa);
                weight = if ratio <= weight { weight } else { ratio };
            }
        }
    }
    case.number("| |m| − 1 |, worst of 1600", 0.0, length, 0.5_f64.powi(21));
    case.count("m.z ≤ 0", 0, sunken);
    case.count("densities 0 or not finite", 0, bad_pdf);
    let most = 1.0 + 0.5_f64.powi(20);
    let (got, above) = (format!("{weight:.9}"), format!("{:.1e}", weight - 1.0));
    case.row("weight, largest", "≤ 1 + 2⁻²⁰", got, above, weight <= most);
    // Viewers in or below the surface are refused.
    let none = SpecularAlbedo::empty();
    let seen = alphas.into_iter().flat_map(|(alpha, _)| {
        let surface = glossy(&none, Vec3::ONE, 1.0, alpha, 1.0);
        let below = [0.0, -1e-30, -1e-6, -0.5, -1.0].map(|mu| direction(mu, 0.3));
        below.into_iter().filter(move |&wo| surface.sample(wo, [0.0, 0.5, 0.5]).is_some())
    });
    case.count("samples for μ ≤ 0", 0, seen.count() as u64);
    case.close();
}
