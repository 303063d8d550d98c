//! What moves while the shutter is open, and how: poses at equal intervals, and between them straight lines in the
//! elements of the matrices, as Embree's time steps have it. Times inside a scene are fractions of the shutter, 0
//! (open) to 1 (close).
//!
//! A turn is cut into so many parts that the straight lines stay close to it ([`MOST_PARTS`] at most); the remaining
//! deviation is measured ([`Motion::off`]) and listed as a bias. A pose that has no inverse somewhere on its way would
//! end the process inside Embree, so [`Track::problem`] refuses it.

use glam::{Affine3A, DAffine3};

use crate::error::{Error, Result};

/// Parts that the shutter interval is cut into at most, for one object; Embree takes up to 128.
pub const MOST_PARTS: usize = 32;

/// When the shutter is open, seconds of the animations' time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shutter {
    open_s: f64,
    close_s: f64,
}

impl Shutter {
    /// From `open_s` to `close_s`, which may be the same.
    ///
    /// # Errors
    /// [`Error::Option`] unless 0 ≤ open ≤ close < ∞.
    pub fn new(open_s: f64, close_s: f64) -> Result<Shutter> {
        // Also false of NaN.
        if 0.0 <= open_s && open_s <= close_s && close_s < f64::INFINITY {
            return Ok(Shutter { open_s, close_s });
        }
        let problem = format!("{open_s},{close_s}; two finite times in seconds are needed, 0 ≤ OPEN ≤ CLOSE");
        Err(Error::Option { option: "--shutter", problem })
    }

    /// When it opens, seconds.
    pub fn open_s(&self) -> f64 {
        self.open_s
    }

    /// When it closes, seconds.
    pub fn close_s(&self) -> f64 {
        self.close_s
    }

    /// Whether it closes as it opens: the scene stands still.
    pub fn is_instant(&self) -> bool {
        self.open_s == self.close_s
    }
}

/// Poses of one instance or camera over the shutter.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Index into `Scene::instances` or `Scene::cameras`.
    pub index: usize,
    /// Object (or camera) to world at equal intervals from open to close, both included. At least two; the first is the
    /// one that the instance or camera itself has.
    pub steps: Vec<Affine3A>,
}

/// An animation and when it runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Span {
    /// Its name, or its number.
    pub name: String,
    /// First and last key, seconds, as the file states them; `None` where it does not.
    pub seconds: Option<(f64, f64)>,
}

/// A motion that the file asks for and that is not shown.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unmoved {
    /// Whose.
    pub what: String,
    /// Why not.
    pub why: String,
}

/// How far straight lines between the poses leave the way of an object.
#[derive(Clone, Debug, PartialEq)]
pub struct Off {
    /// Whose way.
    pub name: String,
    /// Largest distance found, metres.
    pub distance_m: f64,
}

/// All that moves in a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// What was asked for; `None` shows the scene as its nodes say.
    pub shutter: Option<Shutter>,
    /// The file's animations, with or without a shutter.
    pub animations: Vec<Span>,
    /// Instances that move, by ascending index.
    pub instances: Vec<Track>,
    /// Instances that the animation moves or bends at some time, by ascending index; none without a shutter.
    pub animated: Vec<usize>,
    /// Cameras that move, by ascending index.
    pub cameras: Vec<Track>,
    /// The worst of the ways that are not straight, if it is off by more than rounding.
    pub off: Option<Off>,
    /// What the file asks for and is not shown.
    pub unmoved: Vec<Unmoved>,
}

impl Motion {
    /// The track of camera `camera`, if it moves.
    pub fn of_camera(&self, camera: usize) -> Option<&Track> {
        self.cameras.iter().find(|track| track.index == camera)
    }

    /// The track of instance `instance`, if it moves.
    pub fn of_instance(&self, instance: usize) -> Option<&Track> {
        let found = self.instances.binary_search_by_key(&instance, |track| track.index);
        // A track without poses is refused later; until then it moves nothing.
        found.ok().map(|at| &self.instances[at]).filter(|track| !track.steps.is_empty())
    }
}

/// The part of the shutter that a time in [0, 1] falls into, of `parts`, and the fraction of it that has passed.
/// Embree's own arithmetic, so that all backends agree.
#[inline(always)]
pub fn part_of(time: f32, parts: usize) -> (usize, f32) {
    let along = time * parts as f32;
    let part = (along as usize).min(parts - 1);
    (part, along - part as f32)
}

/// The pose between two.
#[inline(always)]
pub fn between(from: &Affine3A, to: &Affine3A, fraction: f32) -> Affine3A {
    let (a, b) = (&from.matrix3, &to.matrix3);
    let mix = |a: glam::Vec3A, b: glam::Vec3A| a + (b - a) * fraction;
    Affine3A {
        matrix3: glam::Mat3A::from_cols(mix(a.x_axis, b.x_axis), mix(a.y_axis, b.y_axis), mix(a.z_axis, b.z_axis)),
        translation: mix(from.translation, to.translation),
    }
}

impl Track {
    /// Points of a part, less one, at which its volume (determinant) is evaluated. A polynomial of third degree on [0,
    /// 1] bends by at most 96 times its largest value (Markov), so between two of them it strays by 96/(8·16²) = 3/64
    /// of that at most, and that is no more than 64/61 of the largest that is seen. The samples are 61/(64·15) of it
    /// or more, so all of it is above a 64th.
    const LOOKS: usize = 16;
    /// Share of the largest volume seen on a part below which none seen may fall.
    const LEAST_VOLUME: f64 = 1.0 / 15.0;

    /// Why rays cannot be taken along this way: a pose that is not finite, or one without an inverse on the way.
    pub fn problem(&self) -> Option<&'static str> {
        if self.steps.len() < 2 || self.steps.len() > MOST_PARTS + 1 {
            return Some("it has less than two poses, or too many");
        }
        if !self.steps.iter().all(|step| step.is_finite() && step.inverse().is_finite()) {
            return Some("it is scaled to nothing, or has a pose that is not finite");
        }
        let volume = |a: &DAffine3, b: &DAffine3, i: usize| {
            let s = i as f64 / Self::LOOKS as f64;
            (a.matrix3 * (1.0 - s) + b.matrix3 * s).determinant()
        };
        for pair in self.steps.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|m| DAffine3::from_cols_array(&m.to_cols_array().map(f64::from)));
            let volumes: Vec<f64> = (0..=Self::LOOKS).map(|i| volume(&a, &b, i)).collect();
            let largest = volumes.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
            let sound = |v: &f64| v.signum() == volumes[0].signum() && v.abs() >= Self::LEAST_VOLUME * largest;
            if !(largest.is_finite() && volumes.iter().all(sound)) {
                return Some("it turns or changes its size too fast: it would collapse on its way");
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Quat, Vec3};

    #[test]
    fn times_fall_into_parts() {
        assert_eq!(part_of(0.0, 4), (0, 0.0));
        assert_eq!(part_of(0.625, 4), (2, 0.5));
        assert_eq!(part_of(0.999_999_94, 4).0, 3);
        // The end itself belongs to the last part.
        assert_eq!(part_of(1.0, 4), (3, 1.0));
    }

    /// Oracle: by hand. A half turn in one part passes through a flat pose; in quarters it does not.
    #[test]
    fn ways_through_flat_poses_are_refused() {
        let turned = |angle: f32| Affine3A::from_quat(Quat::from_rotation_z(angle));
        let track = |steps: Vec<Affine3A>| Track { index: 0, steps };
        let half = std::f32::consts::PI;
        assert!(track(vec![turned(0.0), turned(half)]).problem().is_some());
        assert!(track((0..=4).map(|i| turned(half * i as f32 / 4.0)).collect()).problem().is_none());
        let scaled = |s: f32| Affine3A::from_scale(Vec3::splat(s));
        assert!(track(vec![scaled(1.0), scaled(0.0)]).problem().is_some());
        assert!(track(vec![scaled(1.0), scaled(-1.0)]).problem().is_some());
        assert!(track(vec![scaled(1.0), scaled(0.1)]).problem().is_some());
        assert!(track(vec![scaled(1.0), scaled(0.5)]).problem().is_none());
        assert!(track(vec![scaled(1.0), scaled(f32::NAN)]).problem().is_some());
        assert!(track(vec![scaled(1.0)]).problem().is_some());
    }

    #[test]
    fn shutters_are_intervals() {
        assert!(Shutter::new(0.5, 0.5).is_ok_and(|shutter| shutter.is_instant()));
        assert!(Shutter::new(0.0, 1.0).is_ok_and(|shutter| !shutter.is_instant()));
        for (open, close) in [(1.0, 0.5), (-1.0, 0.5), (f64::NAN, 1.0), (0.0, f64::NAN), (0.0, f64::INFINITY)] {
            assert!(Shutter::new(open, close).is_err(), "{open},{close}");
        }
    }
}
