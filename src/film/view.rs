//! The matrices by which OpenEXR files say where their camera was: `worldToCamera` and `worldToNDC`.
//!
//! Conventions of the OpenEXR standard attributes: row vectors (p' = p·M), stored row by row; camera space is
//! left-handed, +x right, +y up, +z into the picture; NDC is (0, 0) at the upper left and (1, 1) at the lower right
//! corner of the display window, after division by w; its z is to be discarded. World is the file's own world: the
//! origin that was subtracted at load is put back, in f64.

use glam::{DAffine3, DMat4, DVec3};

use crate::scene::{Camera, Projection};

/// z of NDC is 1 − NEAR_M/z: it only keeps the matrix invertible.
const NEAR_M: f64 = 1e-2;

/// Camera matrices of a picture, row by row for row vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewMatrices {
    /// World to left-handed camera space.
    pub world_to_camera: [f32; 16],
    /// World to picture coordinates, homogeneous.
    pub world_to_ndc: [f32; 16],
}

/// Half extents of the view: tangents for a perspective, metres for a parallel projection.
#[derive(Clone, Copy, Debug, PartialEq)]
struct HalfExtent {
    x: f64,
    y: f64,
}

impl ViewMatrices {
    /// Matrices of `camera` (placed relative to `origin`) for an image of `resolution` pixels. An image wider than the
    /// camera's aspect keeps the vertical extent, a narrower one the horizontal.
    pub fn new(camera: &Camera, origin: DVec3, resolution: (u32, u32)) -> Self {
        let image_aspect = f64::from(resolution.0) / f64::from(resolution.1);
        let extent = half_extent(&camera.projection, image_aspect);

        // Column-vector matrices in f64; a flip of z makes glTF's right-handed camera space left-handed.
        let linear = camera.world_from_camera.matrix3;
        let mut world_from_camera = DAffine3::from_mat3(linear.as_dmat3());
        world_from_camera.translation = camera.world_from_camera.translation.as_dvec3() + origin;
        let flip = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        let camera_from_world = flip * DMat4::from(world_from_camera.inverse());

        let (sx, sy) = (0.5 / extent.x, -0.5 / extent.y);
        let ndc_from_camera = match camera.projection {
            Projection::Perspective { .. } => DMat4::from_cols_array_2d(&[
                [sx, 0.0, 0.0, 0.0],
                [0.0, sy, 0.0, 0.0],
                [0.5, 0.5, 1.0, 1.0],
                [0.0, 0.0, -NEAR_M, 0.0],
            ]),
            Projection::Orthographic { .. } => DMat4::from_cols_array_2d(&[
                [sx, 0.0, 0.0, 0.0],
                [0.0, sy, 0.0, 0.0],
                [0.0, 0.0, 1.0, 0.0],
                [0.5, 0.5, 0.0, 1.0],
            ]),
        };
        // The columns of a column-vector matrix are the rows of its row-vector transpose.
        ViewMatrices {
            world_to_camera: camera_from_world.as_mat4().to_cols_array(),
            world_to_ndc: (ndc_from_camera * camera_from_world).as_mat4().to_cols_array(),
        }
    }
}

fn half_extent(projection: &Projection, image_aspect: f64) -> HalfExtent {
    let (y, aspect) = match *projection {
        Projection::Perspective { yfov_rad, aspect } => ((0.5 * f64::from(yfov_rad)).tan(), aspect.map(f64::from)),
        Projection::Orthographic { xmag_m, ymag_m } => (f64::from(ymag_m), Some(f64::from(xmag_m) / f64::from(ymag_m))),
    };
    match aspect {
        Some(aspect) if image_aspect < aspect => HalfExtent { x: y * aspect, y: y * aspect / image_aspect },
        _ => HalfExtent { x: y * image_aspect, y },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Affine3A, Vec3};

    /// p·M with division by w.
    fn apply(m: &[f32; 16], p: [f32; 3]) -> [f32; 3] {
        let row = |c: usize| p[0] * m[c] + p[1] * m[4 + c] + p[2] * m[8 + c] + m[12 + c];
        [row(0) / row(3), row(1) / row(3), row(2) / row(3)]
    }

    fn close(a: [f32; 3], b: [f32; 3], lanes: usize) -> bool {
        a.iter().zip(b).take(lanes).all(|(a, b)| (a - b).abs() < 1e-5)
    }

    #[test]
    fn corners_of_the_view_are_corners_of_ndc() {
        // Oracle: by hand. Eye at (1, 2, 3) looking along −Z; tan(yfov/2) = 0.5, image 2:1.
        let camera = Camera {
            name: "camera 0".into(),
            world_from_camera: Affine3A::from_translation(Vec3::new(0.0, 2.0, 3.0)),
            projection: Projection::Perspective { yfov_rad: 2.0 * 0.5f32.atan(), aspect: None },
        };
        let view = ViewMatrices::new(&camera, DVec3::X, (200, 100));
        // Two metres ahead, one metre to the right and half a metre up of the axis.
        assert!(close(apply(&view.world_to_camera, [2.0, 2.5, 1.0]), [1.0, 0.5, 2.0], 3));
        assert!(close(apply(&view.world_to_ndc, [2.0, 2.5, 1.0]), [0.75, 0.25, 0.0], 2));
        assert!(close(apply(&view.world_to_ndc, [-1.0, 3.0, 1.0]), [0.0, 0.0, 0.0], 2));
        assert!(close(apply(&view.world_to_ndc, [3.0, 1.0, 1.0]), [1.0, 1.0, 0.0], 2));
    }

    #[test]
    fn a_narrow_image_keeps_the_authored_width() {
        let extent = |aspect, image| {
            half_extent(&Projection::Perspective { yfov_rad: std::f32::consts::FRAC_PI_2, aspect }, image)
        };
        assert!((extent(Some(2.0), 1.0).x - 2.0).abs() < 1e-6 && (extent(Some(2.0), 1.0).y - 2.0).abs() < 1e-6);
        assert!((extent(Some(2.0), 4.0).x - 4.0).abs() < 1e-6 && (extent(Some(2.0), 4.0).y - 1.0).abs() < 1e-6);
        assert!((extent(None, 0.5).x - 0.5).abs() < 1e-6);
        let camera = Camera {
            name: "camera 0".into(),
            world_from_camera: Affine3A::IDENTITY,
            projection: Projection::Orthographic { xmag_m: 2.0, ymag_m: 1.0 },
        };
        let view = ViewMatrices::new(&camera, DVec3::ZERO, (64, 64));
        assert!(close(apply(&view.world_to_ndc, [2.0, -2.0, -9.0]), [1.0, 1.0, 0.0], 2));
    }
}
