//! What previews look like and where the camera stands: the arguments, and what they are for the library. Looks belong
//! to previews (PNG, JPEG); no EXR is touched by them.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use glam::DVec3;

use super::units;
use crate::error::{Error, Result};
use crate::film::look::{Backdrop, Look};
use crate::film::tone::ToneMap;
use crate::plan::Aov;
use crate::render::{CameraChoice, RenderOptions, Renderer};
use crate::scene::orbit::{Distance, Orbit};
use crate::scene::{Projection, Scene};

/// Width of the blur of `--background blur`: standard deviation, radians.
const BLUR_RAD: f32 = 0.16;

/// What previews look like.
#[derive(Debug, Args)]
pub struct LookArgs {
    /// Also write a JPEG preview
    #[arg(long, alias = "jpeg", value_name = "FILE.jpg", help_heading = "Output")]
    pub jpg: Option<PathBuf>,
    /// Exposure of previews, in stops: values are multiplied by 2^EV
    #[arg(long, value_name = "EV", default_value = "0", value_parser = units::finite, help_heading = "Preview")]
    pub exposure: f32,
    /// Tone curve of previews: none, Khronos PBR Neutral, or AgX [default: clip; neutral with --quick]
    #[arg(
        long, alias = "tonemap", value_name = "CURVE", value_parser = tone_parser(), ignore_case = true,
        help_heading = "Preview"
    )]
    pub tone_map: Option<ToneMap>,
    /// PNG with alpha, coverage by surfaces: environments light and are not seen
    #[arg(long, conflicts_with = "background", help_heading = "Preview")]
    pub transparent: bool,
    /// What previews show behind the scene: a colour (`white`, `#20242c`), or the environment out of focus (`blur`)
    #[arg(long, value_name = "COLOR|blur", value_parser = Background::parse, help_heading = "Preview")]
    pub background: Option<Background>,
}

/// Value of `--background`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Background {
    /// Linear Rec.709.
    Color([f64; 3]),
    /// The environment, blurred.
    Blur,
}

impl Background {
    fn parse(text: &str) -> Result<Self, String> {
        if text.eq_ignore_ascii_case("blur") {
            return Ok(Background::Blur);
        }
        let accepted = "write blur, #RRGGBB, or a name such as white, black, grey";
        units::color(text).map(Background::Color).ok_or_else(|| format!("'{text}' is not a background; {accepted}"))
    }
}

impl LookArgs {
    /// Name of an option that previews alone obey and that was given.
    pub fn given(&self) -> Option<&'static str> {
        let options = [
            ("--exposure", self.exposure != 0.0),
            ("--tone-map", self.tone_map.is_some()),
            ("--transparent", self.transparent),
            ("--background", self.background.is_some()),
        ];
        options.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// Layers that the film has to gather for previews.
    pub fn layers(&self) -> &'static [Aov] {
        match self.transparent || self.background.is_some() {
            true => Look::default().backdrop(Backdrop::Transparent).layers(),
            false => &[],
        }
    }

    /// What previews of `renderer`'s picture look like; `default` is the tone curve where none was asked for.
    pub fn look(&self, renderer: &Renderer, default: ToneMap) -> Look {
        let backdrop = match self.background {
            _ if self.transparent => Backdrop::Transparent,
            Some(Background::Color(color)) => Backdrop::Color(color),
            Some(Background::Blur) => Backdrop::Picture(renderer.blurred_background(BLUR_RAD)),
            None => Backdrop::Seen,
        };
        let tone_map = self.tone_map.unwrap_or(default);
        Look::default().exposure_ev(self.exposure).tone_map(tone_map).backdrop(backdrop)
    }
}

fn tone_parser() -> impl TypedValueParser<Value = ToneMap> {
    PossibleValuesParser::new(ToneMap::ALL.map(ToneMap::name)).try_map(|s| s.parse())
}

/// Size of the picture and where the camera stands, besides what the scene says.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// Columns and rows of the full picture, pixels, in one
    #[arg(
        long, alias = "resolution", value_name = "WxH", value_parser = units::size,
        conflicts_with_all = ["width", "height"], help_heading = "Picture"
    )]
    pub size: Option<(u32, u32)>,
    /// Vertical field of view, degrees; of perspective cameras
    #[arg(long, value_name = "DEG", value_parser = units::field_of_view, help_heading = "Camera")]
    pub fov: Option<f32>,
    /// Point that the camera looks at, metres; it stays where it stands, unless --camera-orbit moves it
    #[arg(long, value_name = "X,Y,Z", value_parser = units::point, allow_hyphen_values = true, help_heading = "Camera")]
    pub look_at: Option<[f64; 3]>,
    /// Put the camera around the scene, or around --look-at: degrees to the right of the front (+Z), degrees above the
    /// horizon, and how far off, in metres, or in percent of where all is seen [default distance: 100%]
    #[arg(
        long, alias = "orbit", value_name = "AZ,EL[,DIST]", value_parser = units::orbit,
        allow_hyphen_values = true, help_heading = "Camera"
    )]
    pub camera_orbit: Option<(f64, f64, Distance)>,
}

impl ViewArgs {
    /// Changes the camera `choice` of the scene as asked, for a picture of `width` and `height` where they are given.
    ///
    /// # Errors
    /// [`Error::Option`] for a field of view of a parallel projection. A camera that is not there is the plan's to
    /// refuse.
    pub fn apply(&self, scene: &mut Scene, choice: &CameraChoice, size: (Option<u32>, Option<u32>)) -> Result<()> {
        let Some(mut camera) = choice.of(scene).cloned() else { return Ok(()) };
        let index = scene.cameras.iter().position(|other| *other == camera);
        if let Some(fov) = self.fov {
            match &mut camera.projection {
                Projection::Perspective { yfov_rad, .. } => *yfov_rad = fov.to_radians(),
                Projection::Orthographic { .. } => {
                    let problem = format!("camera '{}' is orthographic and has no field of view", camera.name);
                    return Err(Error::Option { option: "--fov", problem });
                }
            }
        }
        let target = self.look_at.map(DVec3::from_array);
        if let Some((azimuth, elevation, distance)) = self.camera_orbit {
            let (azimuth_rad, elevation_rad) = (azimuth.to_radians(), elevation.to_radians());
            let options = RenderOptions::default().camera(choice.clone()).sized_for(scene, size.0, size.1);
            let shape = f64::from(options.width) / f64::from(options.height);
            camera = Orbit { azimuth_rad, elevation_rad, distance, target }.camera(scene, &camera, shape);
        } else if let Some(target) = target {
            camera = camera.turned_to(scene, target);
        }
        let Some(index) = index.filter(|&index| scene.cameras[index] != camera) else { return Ok(()) };
        if self.camera_orbit.is_some() || target.is_some() {
            // It stands where it was put.
            scene.motion.cameras.retain(|track| track.index != index);
        }
        scene.cameras[index] = camera;
        Ok(())
    }
}
