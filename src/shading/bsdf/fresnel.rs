//! Fresnel reflectance of smooth interfaces, unpolarised.
//!
//! The dielectric form is exact and stable at index match and at the critical angle (HARDCASES B07–B09): with
//! g² = (η−1)(η+1) + cos², r_s = −(η−1)(η+1)/(cos+g)² and r_p = (η²cos − g)/(η²cos + g). It is computed in f64, because
//! monotonicity over consecutive f32 cosines and a relative index of exactly 1/η from the inside both need it.

use glam::Vec3;

/// Hemispherical average of Schlick's (1−μ)⁵: 2∫(1−μ)⁵ μ dμ.
pub const SCHLICK_AVERAGE: f32 = 1.0 / 21.0;

/// (1−cos)⁵.
#[inline(always)]
pub fn schlick_weight(cos: f32) -> f32 {
    let x = (1.0 - cos).clamp(0.0, 1.0);
    let x2 = x * x;
    x2 * x2 * x
}

/// Schlick's reflectance between `f0` at the normal and `f90` at grazing (Schlick 1994; glTF 2.0 appendix B).
#[inline(always)]
pub fn schlick(f0: Vec3, f90: f32, cos: f32) -> Vec3 {
    f0 + (Vec3::splat(f90) - f0) * schlick_weight(cos)
}

/// What a dielectric interface does to a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interface {
    /// Reflected fraction of the energy, from 0 to 1; 1 beyond the critical angle.
    pub reflectance: f32,
    /// Cosine of the refracted ray with the far side of the normal; 0 beyond the critical angle.
    pub cos_t: f32,
    /// n(far side)/n(near side).
    pub eta: f32,
}

/// Exact dielectric reflectance. `cos_o` > 0 arrives from outside, < 0 from inside; `eta` = n(inside)/n(outside).
#[inline(always)]
pub fn dielectric(cos_o: f32, eta: f32) -> Interface {
    let c = f64::from(cos_o.abs());
    let eta = if cos_o < 0.0 { 1.0 / f64::from(eta) } else { f64::from(eta) };
    let d = (eta - 1.0) * (eta + 1.0);
    let g = (d + c * c).max(0.0).sqrt();
    let s = c + g;
    let r_s = d / (s * s);
    let p = eta * eta * c;
    let r_p = (p - g) / (p + g);
    // d = 0 is an interface that is not there (0/0 above when the cosine underflows); g = 0 is total reflection.
    let reflectance = if d == 0.0 {
        0.0
    } else if g == 0.0 {
        1.0
    } else {
        (0.5 * (r_s * r_s + r_p * r_p)).min(1.0)
    };
    let cos_t = if d == 0.0 { c } else { g / eta };
    Interface { reflectance: reflectance as f32, cos_t: cos_t as f32, eta: eta as f32 }
}

/// Exact reflectance of a conductor of complex index n + ik seen from vacuum (Born and Wolf §14.2).
#[inline(always)]
pub fn conductor(cos_o: f32, n: f32, k: f32) -> f32 {
    let (c, n, k) = (f64::from(cos_o.abs().min(1.0)), f64::from(n), f64::from(k));
    let c2 = c * c;
    let s2 = 1.0 - c2;
    // a² + b² = |n̂² − sin²| with a + ib the refracted ray's complex cosine times n̂.
    let q = n * n - k * k - s2;
    let ab = (q * q + 4.0 * n * n * k * k).sqrt();
    let a = (0.5 * (ab + q)).max(0.0).sqrt();
    let denominator = ab + c2 + 2.0 * a * c;
    if denominator == 0.0 {
        // Index 1 at exactly grazing: nothing there to reflect.
        return 0.0;
    }
    let r_s = (ab + c2 - 2.0 * a * c) / denominator;
    let t = (c2 * ab + s2 * s2 - 2.0 * a * c * s2) / (c2 * ab + s2 * s2 + 2.0 * a * c * s2);
    (0.5 * r_s * (1.0 + t)) as f32
}

/// Hemispherical average 2∫F(μ)μ dμ of a dielectric; `eta` > 1 as seen from the thin medium, < 1 from the dense one.
/// Closed form for the thin side (Walsh 1926), 1 − F_in = (1 − F_out)/η² for the other. Absolute error about
/// 1e-16/(η−1)² by cancellation; exactly 0 at an index match.
pub fn dielectric_average(eta: f64) -> f64 {
    if eta == 1.0 {
        return 0.0;
    }
    if eta < 1.0 {
        return 1.0 - (1.0 - dielectric_average(1.0 / eta)) * (eta * eta);
    }
    let n = eta;
    let (n2, n3, n4) = (n * n, n * n * n, n * n * n * n);
    let f = 0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0).powi(2))
        + n2 * (n2 - 1.0).powi(2) / (n2 + 1.0).powi(3) * ((n - 1.0) / (n + 1.0)).ln()
        - 2.0 * n3 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0).powi(2)) * n.ln();
    f.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pathspace_stat::GaussLegendre;

    /// 1 − F inside a relative index of 1.5, in f64 with the same f32 cosine, by the textbook form.
    fn transmitted_from_inside(cos: f32) -> f64 {
        let (n, c) = (1.0 / 1.5_f64, f64::from(cos));
        let t = (1.0 - (1.0 - c * c) / (n * n)).sqrt();
        let (s, p) = ((c - n * t) / (c + n * t), (n * c - t) / (n * c + t));
        1.0 - 0.5 * (s * s + p * p)
    }

    /// HARDCASES B07. Oracle: 40-digit table; 1e-6 absolute.
    #[test]
    fn b07_dielectric_table() {
        let cosines = [1.0, 0.8, 0.5, 0.1, 0.01, 0.001];
        let table = [
            (1.5, [0.04, 0.043894736, 0.0891867128, 0.57159252, 0.943752543, 0.994205573]),
            (1.33, [0.0200593122, 0.022808414, 0.0591255992, 0.538989758, 0.938940902, 0.993706005]),
            (2.4, [0.169550173, 0.173269167, 0.209351261, 0.585988703, 0.940796621, 0.993831729]),
        ];
        for (eta, row) in table {
            for (cos, expected) in cosines.into_iter().zip(row) {
                let got = f64::from(dielectric(cos, eta).reflectance);
                assert!((got - expected).abs() <= 1e-6, "eta {eta} cos {cos}: {got} against {expected}");
            }
        }
        let brewster = f64::from(dielectric(0.554_700_2, 1.5).reflectance);
        assert!((brewster - 0.073964497).abs() <= 1e-6, "{brewster}");
    }

    /// HARDCASES B08. Oracle: 40-digit table where an f32 cosine can hold it, the textbook form in f64 at the rounded
    /// cosine everywhere; 1e-3 relative in 1 − F. Monotone over 10⁶ consecutive cosines.
    #[test]
    fn b08_near_the_critical_angle() {
        let critical = 0.745_355_992_5_f64;
        let table =
            [(1e-1, 0.935156191), (1e-2, 0.631894948), (1e-3, 0.280391173), (1e-4, 0.100270356), (1e-5, 0.0330294212)];
        for (d, expected) in table {
            let cos = (critical + d) as f32;
            let got = 1.0 - f64::from(dielectric(-cos, 1.5).reflectance);
            let at_rounded = transmitted_from_inside(cos);
            assert!((got / at_rounded - 1.0).abs() <= 1e-3, "d {d}: {got} against {at_rounded}");
            // The cosine's rounding, 2⁻²⁵, moves 1 − F by half of its share of d.
            let rounding = 0.5 * (0.5_f64.powi(25) / d);
            assert!((got / expected - 1.0).abs() <= 1e-3 + rounding, "d {d}: {got} against {expected}");
        }
        for below in [0.745355, 0.7, 0.1, 1e-6] {
            let interface = dielectric(-below, 1.5);
            assert_eq!((interface.reflectance, interface.cos_t), (1.0, 0.0), "cos {below}");
        }
        let first = (critical as f32).to_bits() - 1000;
        let mut last = 1.0;
        for bits in first..first + 1_000_000 {
            let f = dielectric(-f32::from_bits(bits), 1.5).reflectance;
            assert!(f <= last, "F rises from {last} to {f} at bits {bits:#x}");
            last = f;
        }
    }

    /// HARDCASES B09. Oracle: exact values for the f32 inputs; 1e-5 absolute, and nothing at all at eta = 1.
    #[test]
    fn b09_index_match() {
        for cos in [1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5, 1e-30] {
            for side in [1.0, -1.0] {
                let interface = dielectric(side * cos, 1.0);
                assert_eq!((interface.reflectance, interface.cos_t), (0.0, cos), "cos {cos}");
            }
        }
        let cosines = [1.0, 0.1, 0.01, 1e-3, 1e-4, 1e-5];
        let table = [
            (1.000001, [2.27373459e-13, 2.22828953e-9, 2.23063271e-5, 0.0679405179, 0.748728645, 0.971452543]),
            (1.0001, [2.50057966e-9, 2.40288714e-5, 0.0717898037, 0.753817148, 0.972112432, 0.997175592]),
            (1.01, [2.47518156e-5, 0.0697665121, 0.752206998, 0.971905092, 0.997154319, 0.999715067]),
        ];
        for (eta, row) in table {
            for (cos, expected) in cosines.into_iter().zip(row) {
                let got = f64::from(dielectric(cos, eta).reflectance);
                assert!((got - expected).abs() <= 1e-5, "eta {eta} cos {cos}: {got} against {expected}");
            }
        }
    }

    /// HARDCASES B10. Oracle: complex arithmetic in 40 digits; 2e-6 absolute, never above 1; k = 0 is the dielectric.
    #[test]
    fn b10_conductor() {
        let cosines = [1.0, 0.5, 0.1, 0.001];
        let table = [
            (0.2, 3.9, [0.951951952, 0.945882382, 0.96289654, 0.999564974]),
            (1.5, 0.0, [0.04, 0.0891867128, 0.57159252, 0.994205573]),
            (2.0, 4.0, [0.68, 0.65653285, 0.726233007, 0.995735475]),
            (0.05, 100.0, [0.999980002, 0.999975007, 0.999899985, 0.999900985]),
        ];
        for (n, k, row) in table {
            for (cos, expected) in cosines.into_iter().zip(row) {
                let got = conductor(cos, n, k);
                assert!(got <= 1.0 && (f64::from(got) - expected).abs() <= 2e-6, "n {n} k {k} cos {cos}: {got}");
            }
        }
        for i in 0..=1000 {
            let cos = i as f32 / 1000.0;
            assert!((conductor(cos, 1.5, 0.0) - dielectric(cos, 1.5).reflectance).abs() <= 2e-6, "cos {cos}");
        }
        assert_eq!(conductor(0.0, 1.0, 0.0), 0.0);
    }

    /// HARDCASES B11. Oracle: 40-digit integrals, and quadrature of `dielectric` itself; 1e-5 absolute.
    #[test]
    fn b11_hemispherical_averages() {
        let rule = GaussLegendre::new(128);
        for (eta, outside, inside) in
            [(1.33, 0.0659308493, 0.4719491488), (1.5, 0.09177795934, 0.5963457597), (2.4, 0.210181302, 0.8628786983)]
        {
            assert!((dielectric_average(eta) - outside).abs() <= 1e-9);
            assert!((dielectric_average(1.0 / eta) - inside).abs() <= 1e-9);
            let f = |mu: f64| 2.0 * mu * f64::from(dielectric(mu as f32, eta as f32).reflectance);
            assert!((rule.integrate([0.0, 1.0], f) - outside).abs() <= 1e-5, "eta {eta}");
        }
        assert_eq!(dielectric_average(1.0), 0.0);
        let schlick_mean = rule.integrate([0.0, 1.0], |mu| 2.0 * mu * f64::from(schlick_weight(mu as f32)));
        assert!((schlick_mean - f64::from(SCHLICK_AVERAGE)).abs() < 1e-7);
    }
}
