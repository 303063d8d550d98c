//! Cameras that look at the scene from a direction: on a sphere about a point, as far away as it takes to see all of
//! the scene, or at a distance.
//!
//! Azimuth 0 looks at the front of a glTF asset, from +Z; it grows counter-clockwise seen from above (towards +X).
//! Elevation grows upwards; ±90° look straight down and up.

use glam::{Affine3A, DMat3, DVec3, Mat3A, Vec3, Vec3A};

use super::{Camera, Projection, Scene};

/// Share of the picture's half that the scene fills at the fitting distance.
const FILL: f64 = 0.92;

/// Vertical field of view of the automatic camera: that of a 50 mm lens over 24 mm of film height, 2·atan(12/50).
const AUTOMATIC_YFOV_RAD: f64 = 0.471_089_96;

/// Where it stands: to the right of the front, and raised.
const AUTOMATIC_AZIMUTH_RAD: f64 = 35.0 * std::f64::consts::PI / 180.0;
const AUTOMATIC_ELEVATION_RAD: f64 = 22.0 * std::f64::consts::PI / 180.0;

/// Where a camera stands about a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Radians counter-clockwise from +Z.
    pub azimuth_rad: f64,
    /// Radians above the horizon, in [−π/2, π/2].
    pub elevation_rad: f64,
    /// How far from the point.
    pub distance: Distance,
    /// The point that is looked at, in the file's world; `None` is the middle of the scene.
    pub target: Option<DVec3>,
}

/// How far a camera stands from what it looks at.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Distance {
    /// So many times the least distance from which all of the scene is seen.
    Fitting(f64),
    /// Metres.
    Metres(f64),
}

impl Scene {
    /// Least and greatest corner of what is placed, relative to [`Scene::origin`]; `None` without anything.
    pub fn bounds(&self) -> Option<(DVec3, DVec3)> {
        let mut bounds: Option<(DVec3, DVec3)> = None;
        self.for_each_vertex(|p| {
            let (least, most) = bounds.unwrap_or((p, p));
            bounds = Some((least.min(p), most.max(p)));
        });
        bounds
    }

    /// The camera of a scene that has none: a raised three-quarter view that sees all of it, all the time.
    pub fn automatic_camera(&self) -> Camera {
        let projection = Projection::Perspective { yfov_rad: AUTOMATIC_YFOV_RAD as f32, aspect: Some(1.0) };
        let camera = Camera { name: "automatic".into(), world_from_camera: Affine3A::IDENTITY, projection };
        let orbit = Orbit {
            azimuth_rad: AUTOMATIC_AZIMUTH_RAD,
            elevation_rad: AUTOMATIC_ELEVATION_RAD,
            distance: Distance::Fitting(1.0),
            target: None,
        };
        orbit.camera(self, &camera, 1.0)
    }

    /// Every corner, of what moves at every pose.
    fn for_each_vertex(&self, mut visit: impl FnMut(DVec3)) {
        for (i, instance) in self.instances.iter().enumerate() {
            let still = std::slice::from_ref(&instance.world_from_object);
            for pose in self.motion.of_instance(i).map_or(still, |track| &track.steps) {
                for &p in &self.meshes[instance.mesh.index()].positions {
                    visit(pose.transform_point3(p).as_dvec3());
                }
            }
        }
    }
}

impl Orbit {
    /// The camera on this orbit, of `camera`'s name and projection, for a picture of width over height `shape`. A
    /// parallel projection keeps its magnification.
    pub fn camera(&self, scene: &Scene, camera: &Camera, shape: f64) -> Camera {
        let (least, most) = scene.bounds().unwrap_or((DVec3::NEG_ONE, DVec3::ONE));
        let target = self.target.map_or(0.5 * (least + most), |target| target - scene.origin);
        let (sin_az, cos_az) = self.azimuth_rad.sin_cos();
        let (sin_el, cos_el) = self.elevation_rad.sin_cos();
        let back = DVec3::new(sin_az * cos_el, sin_el, cos_az * cos_el);
        let right = DVec3::new(cos_az, 0.0, -sin_az);
        let frame = DMat3::from_cols(right, back.cross(right), back);
        let radius = (0.5 * (most - least).length()).max(f64::MIN_POSITIVE);
        let distance = match (self.distance, camera.projection) {
            (Distance::Metres(metres), _) => metres,
            (Distance::Fitting(factor), Projection::Orthographic { .. }) => 2.0 * factor * radius,
            (Distance::Fitting(factor), Projection::Perspective { yfov_rad, aspect }) => {
                let half = (0.5 * f64::from(yfov_rad)).tan();
                // What `CameraRays` makes of a picture of another shape.
                let half_height = match aspect.map(f64::from) {
                    Some(aspect) if shape < aspect => half * aspect / shape,
                    _ => half,
                };
                let slopes = DVec3::new(1.0 / (FILL * half_height * shape), 1.0 / (FILL * half_height), 0.0);
                let mut distance = 0.0f64;
                scene.for_each_vertex(|p| {
                    let p = frame.transpose() * (p - target);
                    distance = distance.max(p.z + (p.x.abs() * slopes.x).max(p.y.abs() * slopes.y));
                });
                factor * distance.max(1e-3 * radius)
            }
        };
        placed(camera, frame, target + back * distance)
    }
}

impl Camera {
    /// This camera, further along.
    pub(crate) fn moved(&self, by: Vec3) -> Camera {
        let mut camera = self.clone();
        camera.world_from_camera.translation += Vec3A::from(by);
        camera
    }

    /// This camera turned where it stands towards a point of the file's world, upright.
    pub fn turned_to(&self, scene: &Scene, target: DVec3) -> Camera {
        let eye = self.position().as_dvec3();
        let back = (eye - (target - scene.origin)).normalize_or(DVec3::Z);
        let right = DVec3::Y.cross(back).normalize_or(DVec3::X);
        placed(self, DMat3::from_cols(right, back.cross(right), back), eye)
    }
}

fn placed(camera: &Camera, frame: DMat3, eye: DVec3) -> Camera {
    let world_from_camera = Affine3A { matrix3: Mat3A::from(frame.as_mat3()), translation: eye.as_vec3().into() };
    Camera { world_from_camera, ..camera.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::builder::SceneBuilder;

    /// Oracle: projection by hand. Every vertex lies in the picture, and one of them at its share of the edge.
    #[test]
    fn all_of_the_scene_is_seen_and_fills_the_picture() {
        let mut builder = SceneBuilder::new();
        let grey = builder.emitter(Vec3::ONE, Vec3::ONE);
        let corners = [(2.0, 1.0), (6.0, 1.0), (6.0, 9.0), (2.0, 9.0)];
        builder.quad(corners.map(|(x, y)| Vec3::new(x, y, 3.0)), grey);
        builder.camera(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.8);
        let scene = builder.build();
        for (azimuth, elevation, shape) in [(0.0, 0.0, 1.0), (0.7, 0.4, 2.0), (-2.0, std::f64::consts::FRAC_PI_2, 0.5)]
        {
            let orbit = Orbit {
                azimuth_rad: azimuth,
                elevation_rad: elevation,
                distance: Distance::Fitting(1.0),
                target: None,
            };
            let camera = orbit.camera(&scene, &scene.cameras[0], shape);
            let Projection::Perspective { yfov_rad, .. } = camera.projection else { panic!("as it was") };
            let half = (0.5 * f64::from(yfov_rad)).tan();
            let view = camera.world_from_camera.inverse();
            let mut most = 0.0f64;
            scene.for_each_vertex(|p| {
                let p = view.transform_point3(p.as_vec3()).as_dvec3();
                assert!(p.z < 0.0);
                most = most.max((p.x / -p.z / half / shape).abs()).max((p.y / -p.z / half).abs());
            });
            assert!((most - FILL).abs() < 1e-4, "{azimuth} {elevation} {shape}: {most}");
            let eye = camera.position().as_dvec3();
            let back = (eye - (DVec3::new(4.0, 5.0, 3.0) - scene.origin)).normalize();
            assert!((back.y - elevation.sin()).abs() < 1e-5, "{back}");
        }
        let turned = scene.cameras[0].turned_to(&scene, DVec3::new(5.0, 0.0, 2.0));
        let forward = turned.world_from_camera.transform_vector3(Vec3::NEG_Z);
        assert!(forward.abs_diff_eq(Vec3::X, 1e-6), "{forward}");
    }
}
