//! What the page's clients share with the render: the last frame, the state as JSON, and requests to the render. Each
//! lock is held for a moment; no client ever holds one while it is written to.

use std::sync::mpsc::SyncSender;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::plan::Aov;

/// Most requests that wait for the render; more are turned away.
const MOST_REQUESTS: usize = 64;

/// What several clients may be sent.
pub type Bytes = Arc<Vec<u8>>;

/// What a client wants of the render.
pub enum Request {
    /// Another view.
    Look(ViewChange),
    /// The path of a sample in words.
    Replay {
        /// Pixel of the full image.
        pixel: (u32, u32),
        /// Its sample.
        sample: u64,
        /// Gets the text.
        reply: SyncSender<Bytes>,
    },
    /// A layer.
    Layer {
        /// Which of those that the state lists.
        number: usize,
        /// Gets its file.
        reply: SyncSender<Bytes>,
    },
    /// The picture as OpenEXR.
    Exr {
        /// Gets the file.
        reply: SyncSender<Bytes>,
    },
}

/// A camera about a point, as the page says it and is told; with it what else of the picture the page can change.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewChange {
    /// Degrees to the right of +Z.
    pub azimuth: f64,
    /// Degrees above the horizon.
    pub elevation: f64,
    /// Metres from the target.
    pub distance: f64,
    /// The point that is looked at, in the file's world.
    pub target: [f64; 3],
    /// Vertical field of view, degrees; of perspective cameras.
    pub fov: Option<f64>,
    /// Radius of the lens, metres; 0 is a pinhole. It is focused at the target.
    pub aperture: f64,
    /// By how much the environment is turned, degrees as of `--env-rotation`; `None` where there is none.
    #[serde(default)]
    pub rotation: Option<f64>,
    /// Layers that are gathered, by their names.
    #[serde(default)]
    pub layers: Vec<String>,
}

impl ViewChange {
    /// Whether the camera stands as that of `other`; numbers may have lost their last digit on their way.
    pub fn stands_as(&self, other: &ViewChange) -> bool {
        let of = |view: &ViewChange| {
            let [x, y, z] = view.target;
            [view.azimuth, view.elevation, view.distance, x, y, z, view.fov.unwrap_or(0.0)]
        };
        of(self).into_iter().zip(of(other)).all(|(a, b)| near(a, b))
    }

    /// Whether its lens is that of `other`.
    pub fn sees_as(&self, other: &ViewChange) -> bool {
        near(self.aperture, other.aperture) && near(self.distance, other.distance)
    }

    /// Whether the environment is turned as that of `other`.
    pub fn is_lit_as(&self, other: &ViewChange) -> bool {
        near(self.rotation.unwrap_or(0.0), other.rotation.unwrap_or(0.0))
    }

    /// Whether a camera can stand so.
    pub fn is_sane(&self) -> bool {
        let finite = [self.azimuth, self.elevation, self.target[0], self.target[1], self.target[2]];
        finite.iter().all(|value| value.is_finite())
            && self.elevation.abs() <= 90.0
            && self.distance > 0.0
            && self.distance.is_finite()
            && self.fov.is_none_or(|fov| fov > 0.0 && fov < 180.0)
            && self.aperture >= 0.0
            && self.aperture.is_finite()
            && self.rotation.is_none_or(|degrees| (degrees as f32).is_finite())
            && self.layers.iter().all(|name| name.parse::<Aov>().is_ok())
    }
}

/// The shared part.
#[derive(Default)]
pub struct Shared {
    frame: Mutex<Option<Bytes>>,
    state: Mutex<Arc<str>>,
    requests: Mutex<Vec<Request>>,
    arrived: Condvar,
}

impl Shared {
    /// The last frame's file.
    pub fn frame(&self) -> Option<Bytes> {
        held(&self.frame).clone()
    }

    /// Shows another frame, by its file.
    pub fn show(&self, frame: Vec<u8>) {
        *held(&self.frame) = Some(Arc::new(frame));
    }

    /// The state, JSON.
    pub fn state(&self) -> Arc<str> {
        held(&self.state).clone()
    }

    /// Tells another state.
    pub fn tell(&self, state: String) {
        *held(&self.state) = state.into();
    }

    /// Hands a request over to the render; `false` when too many wait. A later view replaces an earlier one.
    pub fn ask(&self, request: Request) -> bool {
        let mut requests = held(&self.requests);
        if matches!(request, Request::Look(_)) {
            requests.retain(|request| !matches!(request, Request::Look(_)));
        }
        let room = requests.len() < MOST_REQUESTS;
        if room {
            requests.push(request);
            self.arrived.notify_all();
        }
        room
    }

    /// Takes the requests that `wanted` picks.
    pub fn take(&self, wanted: impl Fn(&Request) -> bool) -> Vec<Request> {
        let mut requests = held(&self.requests);
        // Most of the time there is none, and this is asked some times a second.
        if requests.is_empty() {
            return Vec::new();
        }
        let (taken, left) = requests.drain(..).partition(|request| wanted(request));
        *requests = left;
        taken
    }

    /// Whether another view is asked for.
    pub fn has_view(&self) -> bool {
        held(&self.requests).iter().any(|request| matches!(request, Request::Look(_)))
    }

    /// Waits for a request, at most so long.
    pub fn wait(&self, most: Duration) {
        let requests = held(&self.requests);
        if requests.is_empty() {
            drop(self.arrived.wait_timeout(requests, most));
        }
    }
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-12 * a.abs().max(b.abs())
}

fn held<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
