//! Which camera looks and how large the picture is, where that is left to the scene.

use super::options::{CameraChoice, RenderOptions};
use crate::scene::{Camera, Projection, Scene};

/// Columns of a picture for which neither the caller nor the scene names a size.
const DEFAULT_WIDTH: u32 = 1280;

/// Aspect of a picture for which nothing names one.
const DEFAULT_ASPECT: f64 = 16.0 / 9.0;

impl CameraChoice {
    /// A camera by name, else by index. Whether the scene has it is for the plan to say.
    pub fn named(text: &str, scene: &Scene) -> Self {
        if scene.cameras.iter().any(|camera| camera.name == text) {
            return CameraChoice::Name(text.into());
        }
        text.parse().map_or_else(|_| CameraChoice::Name(text.into()), CameraChoice::Index)
    }

    /// The camera that is meant, if the scene has it.
    pub fn of<'s>(&self, scene: &'s Scene) -> Option<&'s Camera> {
        match self {
            CameraChoice::First => scene.cameras.first(),
            CameraChoice::Index(index) => scene.cameras.get(*index),
            CameraChoice::Name(name) => scene.cameras.iter().find(|camera| camera.name == *name),
        }
    }
}

impl RenderOptions {
    /// Defaults for a picture of the size that the scene and its first camera suggest; what the command line does
    /// without flags.
    pub fn for_scene(scene: &Scene) -> Self {
        RenderOptions::default().sized_for(scene, None, None)
    }

    /// Sets columns and rows: as given, as the scene suggests, else 1280 columns of the camera's aspect. One side alone
    /// takes the other from the aspect of the suggestion or of the camera. Set the camera first.
    pub fn sized_for(self, scene: &Scene, width: Option<u32>, height: Option<u32>) -> Self {
        let (width, height) = picture_size(width, height, scene, self.camera.of(scene));
        self.size(width, height)
    }
}

/// Columns and rows, see [`RenderOptions::sized_for`].
fn picture_size(width: Option<u32>, height: Option<u32>, scene: &Scene, camera: Option<&Camera>) -> (u32, u32) {
    let authored = camera.and_then(|camera| match camera.projection {
        Projection::Perspective { aspect, .. } => aspect.map(f64::from),
        Projection::Orthographic { xmag_m, ymag_m } => Some(f64::from(xmag_m) / f64::from(ymag_m)),
    });
    let suggested = scene.suggested_size.map(|(width, height)| f64::from(width) / f64::from(height));
    let aspect = suggested.or(authored).filter(|a| a.is_finite() && *a > 0.0).unwrap_or(DEFAULT_ASPECT);
    let side = |length: f64| length.round().clamp(1.0, f64::from(u32::MAX)) as u32;
    match (width, height, scene.suggested_size) {
        (Some(width), Some(height), _) => (width, height),
        (Some(width), None, _) => (width, side(f64::from(width) / aspect)),
        (None, Some(height), _) => (side(f64::from(height) * aspect), height),
        (None, None, Some(size)) => size,
        (None, None, None) => (DEFAULT_WIDTH, side(f64::from(DEFAULT_WIDTH) / aspect)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    fn camera(name: &str, aspect: Option<f32>) -> Camera {
        Camera {
            name: name.into(),
            world_from_camera: Affine3A::IDENTITY,
            projection: Projection::Perspective { yfov_rad: 1.0, aspect },
        }
    }

    #[test]
    fn sizes_follow_request_then_suggestion_then_aspect() {
        let wide = camera("wide", Some(2.0));
        let mut scene = Scene::default();
        assert_eq!(picture_size(None, None, &scene, Some(&wide)), (1280, 640));
        assert_eq!(picture_size(Some(100), None, &scene, Some(&wide)), (100, 50));
        assert_eq!(picture_size(None, Some(100), &scene, Some(&wide)), (200, 100));
        assert_eq!(picture_size(Some(7), Some(9), &scene, Some(&wide)), (7, 9));
        assert_eq!(picture_size(None, None, &scene, Some(&camera("any", None))), (1280, 720));
        assert_eq!(picture_size(Some(1), None, &scene, Some(&camera("tall", Some(1e9)))), (1, 1));
        scene.suggested_size = Some((512, 256));
        assert_eq!(picture_size(None, None, &scene, None), (512, 256));
        assert_eq!(picture_size(Some(64), None, &scene, Some(&camera("square", Some(1.0)))), (64, 32));
        let options = RenderOptions::for_scene(&scene);
        assert_eq!((options.width, options.height), (512, 256));
    }

    #[test]
    fn cameras_are_found_by_name_before_index() {
        let scene = Scene { cameras: vec![camera("left", None), camera("0", None)], ..Scene::default() };
        let find = |text| CameraChoice::named(text, &scene).of(&scene).map(|c| c.name.as_str());
        assert_eq!(find("left"), Some("left"));
        assert_eq!(find("0"), Some("0"));
        assert_eq!(find("1"), Some("0"));
        assert_eq!(find("2"), None);
        assert_eq!(find("right"), None);
    }
}
