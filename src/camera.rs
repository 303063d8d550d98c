//! Camera rays: pinhole, thin lens and parallel projection.
//!
//! Film coordinates are continuous pixels of the full image, x to the right, y down; the pixel (i, j) is [i, i+1) ×
//! [j, j+1). The camera looks along its local −Z with +Y up (glTF). Rays carry plain radiance: a pixel is the mean
//! radiance over the pixel filter and the aperture, without the cos⁴ and lens-area weights of an irradiance meter
//! (HARDCASES M03 and M04 therefore do not apply). A lens is a disk around the eye; the plane in focus is perpendicular
//! to the view axis.
//!
//! The image never stretches: when its shape is not the authored one, a wider image keeps the vertical field and a
//! narrower one the horizontal field (glTF 2.0 §5.13, FEATURES §3.5). Everything is resolved in f64 once; a ray is a
//! few multiply-adds.

use std::path::PathBuf;

use glam::{DAffine3, DMat4, DVec3, DVec4, Vec2, Vec3};

use crate::error::{Error, Result};
use crate::math::float::UNIT_ROUNDOFF;
use crate::math::warp::concentric_disk;
use crate::scene::{Camera, Projection};

pub use crate::plan::options::Lens;

/// Roundings between the eye and a surface that it stands on, per coordinate: the eye, and three of the test.
const START_ROUNDING: f32 = 4.0 * UNIT_ROUNDOFF;

/// A camera made ready for one image size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraRays {
    /// Middle of the film, pixels.
    center: Vec2,
    /// Origin of the ray through the middle of the film, and its change per pixel (zero for perspective).
    eye: Vec3,
    eye_dx: Vec3,
    eye_dy: Vec3,
    /// Direction of that ray with unit length along the view axis, and its change per pixel (zero for parallel).
    forward: Vec3,
    forward_dx: Vec3,
    forward_dy: Vec3,
    /// Radius of the lens along the film's axes, in the world; zero without a lens.
    lens_x: Vec3,
    lens_y: Vec3,
    /// Reciprocal distance of the plane in focus; 0 when it is at infinity or there is no lens.
    per_focus: f32,
    has_lens: bool,
    /// See [`CameraRays::near`].
    near: f32,
    world_from_camera: DAffine3,
    /// Half the size of the view at unit distance (perspective) or anywhere (parallel).
    half_size: (f64, f64),
    parallel: bool,
}

/// A point as the camera sees it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sight {
    /// Where on the film, pixels.
    pub film: Vec2,
    /// Start of the ray.
    pub origin: Vec3,
    /// Its unit direction.
    pub dir: Vec3,
    /// Its length up to the point, metres.
    pub distance_m: f32,
    /// Pixels of film for a square metre across the ray at the point.
    pub per_area: f32,
}

impl CameraRays {
    /// Resolves `camera` for an image of `resolution` columns and rows.
    ///
    /// # Errors
    /// [`Error::InvalidScene`] for a field of view outside (0, π), magnifications and aspect ratios that are not
    /// positive and finite, or a placement that is not rigid; [`Error::Option`] for an empty image, a lens without
    /// radius or focus, or a lens on a parallel projection.
    pub fn new(camera: &Camera, resolution: (u32, u32), lens: Option<Lens>) -> Result<Self> {
        check_resolution(resolution)?;
        let shape = f64::from(resolution.0) / f64::from(resolution.1);
        let (half_size, parallel) = half_size(camera, shape)?;
        check_placement(camera)?;
        check_lens(lens, parallel)?;

        // Directions and lengths in the camera's frame, rounded once on their way to the world.
        let world_from_camera = as_daffine(camera);
        let to_world = |v: DVec3| world_from_camera.transform_vector3(v).as_vec3();
        let dx = DVec3::X * (2.0 * half_size.0 / f64::from(resolution.0));
        let dy = DVec3::NEG_Y * (2.0 * half_size.1 / f64::from(resolution.1));
        let (eye_step, forward_step) = if parallel { (1.0, 0.0) } else { (0.0, 1.0) };
        let radius = lens.map_or(0.0, |l| f64::from(l.radius_m));
        // The largest coordinate that an origin may have.
        let across = if parallel { half_size.0.hypot(half_size.1) } else { radius };
        let reach = camera.position().abs().max_element() + across as f32;
        Ok(CameraRays {
            near: (START_ROUNDING * reach).max(f32::MIN_POSITIVE),
            center: Vec2::new(resolution.0 as f32, resolution.1 as f32) * 0.5,
            eye: camera.position(),
            eye_dx: to_world(dx * eye_step),
            eye_dy: to_world(dy * eye_step),
            forward: to_world(DVec3::NEG_Z),
            forward_dx: to_world(dx * forward_step),
            forward_dy: to_world(dy * forward_step),
            lens_x: to_world(DVec3::X * radius),
            lens_y: to_world(DVec3::Y * radius),
            per_focus: lens.map_or(0.0, |l| 1.0 / l.focus_m),
            has_lens: lens.is_some(),
            world_from_camera,
            half_size,
            parallel,
        })
    }

    /// This camera on its way to `other`, which differs in its placement alone: what rays are made of goes along
    /// straight lines, as the elements of the placement do. The matrices of the picture stay this one's.
    #[inline(always)]
    pub fn towards(&self, other: &CameraRays, fraction: f32) -> CameraRays {
        let mix = |a: Vec3, b: Vec3| a + (b - a) * fraction;
        CameraRays {
            eye: mix(self.eye, other.eye),
            eye_dx: mix(self.eye_dx, other.eye_dx),
            eye_dy: mix(self.eye_dy, other.eye_dy),
            forward: mix(self.forward, other.forward),
            forward_dx: mix(self.forward_dx, other.forward_dx),
            forward_dy: mix(self.forward_dy, other.forward_dy),
            lens_x: mix(self.lens_x, other.lens_x),
            lens_y: mix(self.lens_y, other.lens_y),
            ..*self
        }
    }

    /// Where camera rays begin, metres along them: closer than this an f32 origin cannot tell one side of a surface
    /// from the other. A camera that stands exactly on a surface does not see that surface.
    #[inline(always)]
    pub fn near(&self) -> f32 {
        self.near
    }

    /// Where it stands; the middle of the lens, and of the film of parallel rays.
    pub fn position(&self) -> Vec3 {
        self.eye
    }

    /// Where it looks.
    pub fn forward(&self) -> Vec3 {
        self.forward
    }

    /// The cone of rays through a pixel: its width at the camera (metres) and its widening per metre.
    pub fn pixel_cone(&self) -> (f32, f32) {
        (self.eye_dx.length(), self.forward_dx.length())
    }

    /// Whether rays need the lens' random numbers.
    #[inline(always)]
    pub fn has_lens(&self) -> bool {
        self.has_lens
    }

    /// Origin and unit direction of the ray through a film point and a point of the lens (a unit square). A pinhole is
    /// a lens of radius 0, bit for bit; only parallel rays know no lens.
    #[inline(always)]
    pub fn ray(&self, film_x: f32, film_y: f32, lens_uv: [f32; 2]) -> (Vec3, Vec3) {
        if self.parallel { self.pinhole_ray(film_x, film_y) } else { self.lens_ray(film_x, film_y, lens_uv) }
    }

    /// As [`ray`](Self::ray) for a camera without a lens.
    #[inline(always)]
    pub fn pinhole_ray(&self, film_x: f32, film_y: f32) -> (Vec3, Vec3) {
        let (x, y) = (film_x - self.center.x, film_y - self.center.y);
        let origin = self.eye + (self.eye_dx * x + self.eye_dy * y);
        let dir = self.forward + (self.forward_dx * x + self.forward_dy * y);
        (origin, dir.normalize())
    }

    /// As [`ray`](Self::ray) for a camera with a lens.
    #[inline(always)]
    pub fn lens_ray(&self, film_x: f32, film_y: f32, lens_uv: [f32; 2]) -> (Vec3, Vec3) {
        let (x, y) = (film_x - self.center.x, film_y - self.center.y);
        let disk = concentric_disk(lens_uv);
        let offset = self.lens_x * disk.x + self.lens_y * disk.y;
        // Both this ray and the pinhole's meet at focus_m · dir, where dir has unit length along the axis.
        let dir = self.forward + (self.forward_dx * x + self.forward_dy * y) - offset * self.per_focus;
        (self.eye + offset, dir.normalize())
    }

    /// How a point is seen from a point of the lens (a unit square): what [`ray`](Self::ray) would have to be told, and
    /// what it would answer. `None` behind the camera. The place on the film may lie outside of the picture.
    pub fn sight(&self, p: Vec3, lens_uv: [f32; 2]) -> Option<Sight> {
        if self.parallel {
            let to = p - self.eye;
            let (dx2, dy2) = (self.eye_dx.length_squared(), self.eye_dy.length_squared());
            let film = self.center + Vec2::new(to.dot(self.eye_dx) / dx2, to.dot(self.eye_dy) / dy2);
            let (origin, dir) = self.pinhole_ray(film.x, film.y);
            let distance_m = (p - origin).dot(dir);
            let sight = Sight { film, origin, dir, distance_m, per_area: self.per_area(dir, distance_m) };
            return (distance_m > self.near).then_some(sight);
        }
        let disk = concentric_disk(lens_uv);
        let offset = self.lens_x * disk.x + self.lens_y * disk.y;
        let origin = self.eye + offset;
        let to = p - origin;
        let depth = to.dot(self.forward);
        if !(depth > 0.0) {
            return None;
        }
        // Undoes `lens_ray`.
        let film = self.film_of(to / depth + offset * self.per_focus);
        let distance_m = to.length();
        let dir = to / distance_m;
        let sight = Sight { film, origin, dir, distance_m, per_area: self.per_area(dir, distance_m) };
        (distance_m > self.near).then_some(sight)
    }

    /// Where on the film a ray of this direction goes through that has unit length along the view axis.
    #[inline(always)]
    fn film_of(&self, dir: Vec3) -> Vec2 {
        let across = dir - self.forward;
        let (dx2, dy2) = (self.forward_dx.length_squared(), self.forward_dy.length_squared());
        self.center + Vec2::new(across.dot(self.forward_dx) / dx2, across.dot(self.forward_dy) / dy2)
    }

    /// Where on the film what is infinitely far off in direction `dir` is seen, pixels. `None` behind the camera, and
    /// for parallel rays, all of which have one direction.
    pub fn vanishing_point(&self, dir: Vec3) -> Option<Vec2> {
        let depth = dir.dot(self.forward);
        (!self.parallel && depth > 0.0).then(|| self.film_of(dir / depth))
    }

    /// Pixels of film for a square metre across a camera ray `distance_m` from its start.
    #[inline]
    pub fn per_area(&self, dir: Vec3, distance_m: f32) -> f32 {
        if self.parallel {
            return 1.0 / (self.eye_dx.length() * self.eye_dy.length());
        }
        // A pixel is |dx|·|dy|·cos³ of solid angle.
        let cos = dir.dot(self.forward);
        1.0 / (self.forward_dx.length() * self.forward_dy.length() * cos * cos * cos * distance_m * distance_m)
    }

    /// Distance of a world point along the view axis, metres: the `Z` channel.
    #[inline(always)]
    pub fn depth(&self, p: Vec3) -> f32 {
        (p - self.eye).dot(self.forward)
    }

    /// World to camera as the EXR attribute `worldToCamera` wants it: RenderMan's left-handed space (x right, y up, z
    /// along the view), row-major for row vectors. `origin` is [`Scene::origin`](crate::scene::Scene::origin).
    pub fn world_to_camera(&self, origin: DVec3) -> [f32; 16] {
        row_vectors(self.camera_from_world(origin))
    }

    /// World to the EXR attribute `worldToNDC`: (0,0) is the upper left and (1,1) the lower right corner of the image.
    /// Row-major for row vectors. The z it gives, which readers discard, is 1 − 1/distance (perspective) or the
    /// distance.
    pub fn world_to_ndc(&self, origin: DVec3) -> [f32; 16] {
        let (x, y) = (0.5 / self.half_size.0, -0.5 / self.half_size.1);
        let ndc_from_camera = if self.parallel {
            DMat4::from_cols(
                DVec4::new(x, 0.0, 0.0, 0.0),
                DVec4::new(0.0, y, 0.0, 0.0),
                DVec4::Z,
                DVec4::new(0.5, 0.5, 0.0, 1.0),
            )
        } else {
            DMat4::from_cols(
                DVec4::new(x, 0.0, 0.0, 0.0),
                DVec4::new(0.0, y, 0.0, 0.0),
                DVec4::new(0.5, 0.5, 1.0, 1.0),
                DVec4::new(0.0, 0.0, -1.0, 0.0),
            )
        };
        row_vectors(ndc_from_camera * self.camera_from_world(origin))
    }

    fn camera_from_world(&self, origin: DVec3) -> DMat4 {
        let left_handed = DMat4::from_scale(DVec3::new(1.0, 1.0, -1.0));
        left_handed * DMat4::from(self.world_from_camera.inverse()) * DMat4::from_translation(-origin)
    }
}

/// A column-vector matrix written by columns is the row-vector matrix written by rows.
fn row_vectors(m: DMat4) -> [f32; 16] {
    m.to_cols_array().map(|x| x as f32)
}

fn as_daffine(camera: &Camera) -> DAffine3 {
    DAffine3 {
        matrix3: camera.world_from_camera.matrix3.as_dmat3(),
        translation: camera.world_from_camera.translation.as_dvec3(),
    }
}

/// Half width and half height of the view, and whether rays are parallel. `shape` is the image's width over height.
fn half_size(camera: &Camera, shape: f64) -> Result<((f64, f64), bool)> {
    let positive = |name: &str, value: f32| {
        if value > 0.0 && value < f32::INFINITY {
            Ok(f64::from(value))
        } else {
            Err(invalid(camera, format!("{name} is {value}; it must be positive and finite")))
        }
    };
    // Half height and authored shape.
    let (half_height, authored, parallel) = match camera.projection {
        Projection::Perspective { yfov_rad, aspect } => {
            // f32's π lies above π, so the comparison is made in f64.
            if !(yfov_rad > 0.0 && f64::from(yfov_rad) < std::f64::consts::PI) {
                return Err(invalid(camera, format!("yfov is {yfov_rad}; it must lie between 0 and π radians")));
            }
            let half_height = (0.5 * f64::from(yfov_rad)).tan();
            (half_height, aspect.map(|a| positive("aspectRatio", a)).transpose()?, false)
        }
        Projection::Orthographic { xmag_m, ymag_m } => {
            let (xmag, ymag) = (positive("xmag", xmag_m)?, positive("ymag", ymag_m)?);
            (ymag, Some(xmag / ymag), true)
        }
    };
    let size = match authored {
        Some(authored) if shape < authored => (half_height * authored, half_height * authored / shape),
        _ => (half_height * shape, half_height),
    };
    Ok((size, parallel))
}

/// Refuses placements that would stretch or skew the view. The bound is what rounding a rotation to f32 can do, times
/// 100.
fn check_placement(camera: &Camera) -> Result<()> {
    let m = as_daffine(camera);
    let gram = m.matrix3.transpose() * m.matrix3;
    let deviation = (gram - glam::DMat3::IDENTITY).to_cols_array().into_iter().fold(0.0, |a: f64, x| a.max(x.abs()));
    // `max` drops NaN; the translation and the determinant keep it.
    let finite = m.translation.is_finite() && gram.is_finite();
    if finite && deviation <= 1e-4 && m.matrix3.determinant() > 0.0 {
        Ok(())
    } else {
        Err(invalid(camera, "its placement is not a rotation and a finite translation".into()))
    }
}

fn check_resolution((width, height): (u32, u32)) -> Result<()> {
    for (option, size) in [("--width", width), ("--height", height)] {
        if size == 0 {
            return Err(Error::Option { option, problem: "0 was given; an image has at least one pixel".into() });
        }
    }
    Ok(())
}

fn check_lens(lens: Option<Lens>, parallel: bool) -> Result<()> {
    let Some(lens) = lens else { return Ok(()) };
    if !(lens.radius_m > 0.0 && lens.radius_m < f32::INFINITY) {
        let problem = format!("{} was given; it must be positive and finite", lens.radius_m);
        return Err(Error::Option { option: "--aperture-radius", problem });
    }
    if lens.focus_m.is_nan() || lens.focus_m < f32::MIN_POSITIVE {
        let problem = format!("{} was given; it must be positive (inf is allowed)", lens.focus_m);
        return Err(Error::Option { option: "--focus-distance", problem });
    }
    if parallel {
        let problem = "the camera is orthographic; a lens needs a perspective camera".into();
        return Err(Error::Option { option: "--aperture-radius", problem });
    }
    Ok(())
}

/// The loader names file and pointer of a broken camera before this is reached; a scene made in code has neither.
fn invalid(camera: &Camera, problem: String) -> Error {
    Error::InvalidScene { file: PathBuf::new(), pointer: format!("camera '{}'", camera.name), problem }
}
