//! Statistical tests for the suite: chi-square of a sampler against its density, moments and their intervals, Welch's
//! test on blocks, Kolmogorov–Smirnov on p-values, and the limits that keep a whole family of tests at one level.
//!
//! Everything is f64 and a pure function of its input. Seeds are the caller's and fixed, so a verdict never flakes; the
//! levels say how likely a redraw of all random numbers is to raise a false alarm (HARDCASES §1.3).

mod chi2;
mod limits;
mod moments;
mod pcg;
mod quadrature;
mod two_sample;

pub use chi2::{Chi2, SphereBins, chi2_test};
pub use limits::{chi2_limit, normal_tail, sidak_level, t_limit, z_limit};
pub use moments::Moments;
pub use pcg::Pcg32;
pub use quadrature::{GaussLegendre, integrate};
pub use two_sample::{Welch, ks_uniform, welch};
