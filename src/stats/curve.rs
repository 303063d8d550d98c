//! How the estimated error falls while a render runs: a point for each pass that somebody looked at.

use std::time::Duration;

use serde::Serialize;

/// Most points that are kept.
const MOST_POINTS: usize = 400;

/// One look at the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CurvePoint {
    /// Seconds of rendering.
    pub seconds: f64,
    /// Samples every pixel has.
    pub spp: u64,
    /// Estimated relative RMSE.
    pub error: f64,
}

/// Looks in the order of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct ErrorCurve {
    points: Vec<CurvePoint>,
}

impl ErrorCurve {
    /// Adds a point, unless the error is not known; it takes the place of one of as many samples. Of too many every
    /// other one is dropped.
    pub fn push(&mut self, elapsed: Duration, spp: u64, error: Option<f64>) {
        let Some(error) = error.filter(|error| error.is_finite()) else { return };
        self.points.pop_if(|last| last.spp == spp);
        self.points.push(CurvePoint { seconds: elapsed.as_secs_f64(), spp, error });
        if self.points.len() > MOST_POINTS {
            let mut number = 0;
            self.points.retain(|_| (number += 1, number % 2 == 1).1);
        }
    }

    /// The points.
    pub fn points(&self) -> &[CurvePoint] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_thinned_and_the_last_one_stays() {
        let mut curve = ErrorCurve::default();
        curve.push(Duration::ZERO, 1, None);
        curve.push(Duration::ZERO, 1, Some(f64::NAN));
        assert!(curve.points().is_empty());
        curve.push(Duration::ZERO, 1, Some(7.0));
        for spp in 1..=MOST_POINTS as u64 + 2 {
            curve.push(Duration::from_secs(spp), spp, Some(1.0 / spp as f64));
        }
        let spp: Vec<u64> = curve.points().iter().map(|point| point.spp).collect();
        assert!(spp.len() <= MOST_POINTS && spp.is_sorted() && spp.last() == Some(&(MOST_POINTS as u64 + 2)));
    }
}
