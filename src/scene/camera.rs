//! Cameras as the file states them.

use glam::{Affine3A, Vec3};

/// A camera placed in the world; it looks along its local −Z with +Y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, or `camera N`.
    pub name: String,
    /// Rigid placement: any scale of the node is removed by the loader. Relative to
    /// [`Scene::origin`](super::Scene::origin).
    pub world_from_camera: Affine3A,
    /// Perspective or orthographic.
    pub projection: Projection,
}

/// How a camera maps directions to the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Pinhole (or thin lens, when the command line asks for an aperture).
    Perspective {
        /// Full vertical field of view, radians, in (0, π).
        yfov_rad: f32,
        /// Authored width over height, if any.
        aspect: Option<f32>,
    },
    /// Parallel rays.
    Orthographic {
        /// Half of the width of the view, metres.
        xmag_m: f32,
        /// Half of the height of the view, metres.
        ymag_m: f32,
    },
}

impl Camera {
    /// Position of the eye in the world.
    pub fn position(&self) -> Vec3 {
        self.world_from_camera.translation.into()
    }
}
