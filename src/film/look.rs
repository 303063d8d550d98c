//! How a preview looks: exposure, tone curve, what is behind the scene; and the 8-bit picture that comes of it, PNG or
//! JPEG. The sRGB curve of IEC 61966-2-1, rounding to nearest, no dither. Only the crop window is shown. Looks are
//! applied to means of the film when a preview is written: no look ever touches the film or an EXR.
//!
//! What lies behind is taken off by the layers `background` and `coverage` (`film/layer`), so a backdrop other than
//! [`Backdrop::Seen`] needs a film that has gathered them.

use std::io::Write;
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageResult};

use super::store::Film;
use super::tone::ToneMap;
use crate::error::{Error, Result};
use crate::plan::aov::Aov;
use crate::setters::setters;

/// Quality of JPEG previews, of 100.
const JPEG_QUALITY: u8 = 92;

/// How a preview is made of a film.
///
/// ```
/// # use pathspace::film::Film;
/// # use pathspace::render::Crop;
/// use pathspace::film::look::Look;
/// use pathspace::film::tone::ToneMap;
/// # let folder = tempfile::tempdir().expect("a temporary folder");
/// # let film = Film::new((4, 3), Crop { x: 0, y: 0, width: 4, height: 3 });
/// film.write_preview(folder.path().join("a.jpg"), &Look::default().exposure_ev(1.0).tone_map(ToneMap::Agx))?;
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Look {
    /// Stops: values are multiplied by 2^EV.
    pub exposure_ev: f32,
    /// The tone curve.
    pub tone_map: ToneMap,
    /// What is behind the scene.
    pub backdrop: Backdrop,
    /// R, G, B by pixel of the film that are shown in the place of the beauty, if any.
    pub filtered: Option<Vec<[f32; 3]>>,
}

/// What is behind the scene.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Backdrop {
    /// What camera rays see there: the environment, or black.
    #[default]
    Seen,
    /// Nothing: the preview has an alpha channel, coverage by surfaces. Colours are not premultiplied, as PNG wants.
    Transparent,
    /// This colour of the preview, linear Rec.709 in [0, 1]; neither exposure nor tone curve changes it.
    Color([f64; 3]),
    /// A picture, radiance by pixel of the film: it is exposed and mapped as the scene is.
    Picture(Vec<[f32; 3]>),
}

/// A preview: bytes of sRGB, row-major, with alpha or without.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Preview {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Whether there are four bytes a pixel, not three.
    pub alpha: bool,
    /// The bytes.
    pub bytes: Vec<u8>,
}

/// A format of previews.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Format {
    /// PNG.
    Png,
    /// JPEG; without alpha.
    Jpeg,
}

impl Format {
    /// What a file name's ending asks for: `.png`, `.jpg`, `.jpeg`.
    pub fn of(path: &Path) -> Option<Format> {
        match path.extension()?.to_str()?.to_lowercase().as_str() {
            "png" => Some(Format::Png),
            "jpg" | "jpeg" => Some(Format::Jpeg),
            _ => None,
        }
    }
}

impl Look {
    setters! {
        exposure_ev: = f32,
        tone_map: = ToneMap,
        backdrop: = Backdrop,
        filtered: into Option<Vec<[f32; 3]>>,
    }

    /// Layers that a film has to gather for this look.
    pub fn layers(&self) -> &'static [Aov] {
        match self.backdrop {
            Backdrop::Seen => &[],
            _ => &[Aov::BACKGROUND, Aov::COVERAGE],
        }
    }

    /// What the film looks like so.
    ///
    /// # Errors
    /// [`Error::Option`] where the film lacks a layer, or a picture behind it or in its place has another size.
    pub fn preview(&self, film: &Film) -> Result<Preview> {
        let gain = f64::from(self.exposure_ev).exp2();
        let shown = |rgb: [f64; 3]| self.tone_map.apply(rgb.map(|value| value * gain));
        let (width, height, alpha) = (film.window.width, film.window.height, self.backdrop == Backdrop::Transparent);
        let mut bytes = Vec::with_capacity(film.pixels.len() * if alpha { 4 } else { 3 });
        let behind = match self.backdrop {
            Backdrop::Seen => None,
            _ => Some((layer(film, Aov::BACKGROUND)?, layer(film, Aov::COVERAGE)?)),
        };
        if let Backdrop::Picture(picture) = &self.backdrop
            && picture.len() != film.pixels.len()
        {
            return Err(refused("the picture behind the scene has another size"));
        }
        if self.filtered.as_ref().is_some_and(|filtered| filtered.len() != film.pixels.len()) {
            return Err(refused("the filtered picture has another size"));
        }
        for (p, pixel) in film.pixels.iter().enumerate() {
            let [r, g, b, _] = pixel.mean();
            let rgb = self.filtered.as_ref().map_or([r, g, b], |filtered| filtered[p].map(f64::from));
            let Some((background, coverage)) = &behind else {
                bytes.extend(shown(rgb).map(srgb_byte));
                continue;
            };
            // What is in front, premultiplied by how much of the pixel it covers.
            let cover = coverage[p][0].clamp(0.0, 1.0);
            let front: [f64; 3] = std::array::from_fn(|c| (rgb[c] - background[p][c]).max(0.0));
            // Where next to nothing is covered, the colour of next to nothing does not matter, and 0/0 is none.
            let straight = front.map(|value| if cover > 1e-6 { value / cover } else { 0.0 });
            match &self.backdrop {
                Backdrop::Seen => unreachable!("left above"),
                Backdrop::Transparent => {
                    bytes.extend(shown(straight).map(srgb_byte));
                    bytes.push((255.0 * cover).round() as u8);
                }
                Backdrop::Color(color) => {
                    let front = shown(straight);
                    bytes.extend((0..3).map(|c| srgb_byte(front[c] * cover + color[c] * (1.0 - cover))));
                }
                Backdrop::Picture(picture) => {
                    let mixed = |c: usize| front[c] + f64::from(picture[p][c]) * (1.0 - cover);
                    bytes.extend(shown(std::array::from_fn(mixed)).map(srgb_byte));
                }
            }
        }
        Ok(Preview { width, height, alpha, bytes })
    }
}

impl Preview {
    /// Writes the preview in a format.
    ///
    /// # Errors
    /// Those of the writer; JPEG has no alpha.
    pub fn encode(&self, format: Format, writer: impl Write) -> ImageResult<()> {
        let color = if self.alpha { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
        match format {
            Format::Png => PngEncoder::new(writer).write_image(&self.bytes, self.width, self.height, color),
            Format::Jpeg => JpegEncoder::new_with_quality(writer, JPEG_QUALITY).write_image(
                &self.bytes,
                self.width,
                self.height,
                color,
            ),
        }
    }

    /// A PNG file in memory.
    pub fn png(&self) -> Vec<u8> {
        let mut file = Vec::new();
        self.encode(Format::Png, &mut file).expect("a vector takes every byte, and their number fits the size");
        file
    }
}

impl Film {
    /// Writes a preview, PNG or JPEG by the name's ending, all or nothing.
    ///
    /// # Errors
    /// [`Error::Option`] for another ending, a layer that the film has not gathered, or a transparent JPEG;
    /// [`Error::Io`] naming `path`.
    pub fn write_preview(&self, path: impl AsRef<Path>, look: &Look) -> Result<()> {
        let path = path.as_ref();
        let problem = || format!("{}: the name must end in .png or .jpg", path.display());
        let format = Format::of(path).ok_or_else(|| Error::Option { option: "--output", problem: problem() })?;
        if format == Format::Jpeg && look.backdrop == Backdrop::Transparent {
            let problem = format!("{}: JPEG has no transparency; write a PNG, or name a --background", path.display());
            return Err(Error::Option { option: "--transparent", problem });
        }
        let preview = look.preview(self)?;
        super::atomic::write_atomically(path, |writer| {
            preview.encode(format, writer).map_err(|error| match error {
                image::ImageError::IoError(source) => source,
                other => std::io::Error::other(other),
            })
        })
    }
}

fn layer(film: &Film, aov: Aov) -> Result<Vec<[f64; 3]>> {
    film.layer(aov).ok_or_else(|| refused(&format!("the film has not gathered the layer {aov}")))
}

fn refused(problem: &str) -> Error {
    Error::Option { option: "--background", problem: problem.into() }
}

/// Linear value to the 8-bit code of sRGB.
pub fn srgb_byte(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.0031308 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (255.0 * encoded).round() as u8
}

/// 8-bit code of sRGB to the linear value.
pub fn srgb_value(code: u8) -> f64 {
    let encoded = f64::from(code) / 255.0;
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}
