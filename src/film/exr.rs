//! OpenEXR: films out, pictures in. One part, scan lines, ZIP, 32-bit float; beauty is the unnamed `R,G,B,A`
//! (scene-linear Rec.709, premultiplied), other layers are dotted [`channels`](Film::channels); other names
//! (`pass_names.rs`) and primaries (`primaries.rs`) on request. The data window is the crop inside the full display
//! window.
//!
//! Means beyond the range of f32 are written as ±[`f32::MAX`], never as infinity.
//! Limit of reading: the first flat part, full resolution, channels R, G, B (A), of Blender's `Combined` as well, or Y
//! without subsampling.

use std::io::Cursor;
use std::path::Path;

use exr::meta::attribute::Chromaticities;
use exr::prelude::{
    AnyChannel, AnyChannels, AttributeValue, Blocks, Compression, Encoding, FlatSamples, Image, IntegerBounds, Layer,
    LayerAttributes, LineOrder, MetaData, ReadChannels, ReadLayers, Text, Vec2, WritableImage, f16,
};

use super::channel::{Channel, stored};
use super::cryptomatte::Matte;
use super::header::SortedHeader;
use super::layer::beauty;
use super::pass_names::PassNames;
use super::primaries::Primaries;
use super::store::Film;
use crate::error::{Error, Result};
use crate::input;
use crate::setters::setters;

/// Camera matrices of the OpenEXR standard attributes, row by row for row vectors; `camera::CameraRays` makes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewMatrices {
    /// World to left-handed camera space, `worldToCamera`.
    pub world_to_camera: [f32; 16],
    /// World to picture coordinates, homogeneous, `worldToNDC`.
    pub world_to_ndc: [f32; 16],
}

/// What a file says besides its pixels. Everything is optional; what is `None` is not written. Attributes are in the
/// order of their names.
///
/// ```
/// # use pathspace::film::{Film, exr::ExrOptions};
/// # use pathspace::render::Crop;
/// # let folder = tempfile::tempdir().expect("a temporary folder");
/// # let path = folder.path().join("picture.exr");
/// # let film = Film::new((4, 4), Crop { x: 0, y: 0, width: 4, height: 4 });
/// film.write_exr(path, &ExrOptions::default().half(true).seed(7))?;
/// # Ok::<(), pathspace::Error>(())
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ExrOptions {
    /// R, G, B and A in 16 bits instead of 32 (rounded to 11 bits of mantissa, at most ±65504); extra outputs stay 32.
    pub half: bool,
    /// Other layers, see [`Film::channels`].
    pub channels: Vec<Channel>,
    /// Whether what depends on the clock is left out (`renderTimeSeconds`), so that equal renders are equal files.
    pub reproducible: bool,
    /// Wall time of the render, `renderTimeSeconds`.
    pub render_seconds: Option<f64>,
    /// Where the camera was.
    pub view: Option<ViewMatrices>,
    /// `pathspace/seed`.
    pub seed: Option<u64>,
    /// Name and version of the ray backend, `pathspace/backend`.
    pub backend: Option<String>,
    /// Instruction set it ran on, `pathspace/isa`.
    pub isa: Option<String>,
    /// The resolved plan, `pathspace/plan`.
    pub plan: Option<String>,
    /// Fingerprint of scene and settings, `pathspace/key`.
    pub key: Option<String>,
    /// Differences of build or instruction set that the render was gone on with in spite of, `pathspace/accepted`.
    pub accepted: Option<String>,
    /// What was filtered into the layer `denoised`, and the measured error of that, `pathspace/denoised`.
    pub denoised: Option<String>,
    /// Names of layers of ids.
    pub mattes: Vec<Matte>,
    /// What channels are called.
    pub pass_names: PassNames,
    /// Primaries of the colours: the beauty and the channels that [are colours](Channel::is_color).
    pub primaries: Primaries,
}

impl ExrOptions {
    setters! {
        half: = bool,
        reproducible: = bool,
        channels: into Vec<Channel>,
        render_seconds: into Option<f64>,
        view: into Option<ViewMatrices>,
        seed: into Option<u64>,
        backend: into Option<String>,
        isa: into Option<String>,
        plan: into Option<String>,
        key: into Option<String>,
        accepted: into Option<String>,
        denoised: into Option<String>,
        mattes: into Vec<Matte>,
        pass_names: = PassNames,
        primaries: = Primaries,
    }
}

impl ExrOptions {
    /// The values of channel `number` in the primaries that are asked for.
    fn values(&self, number: usize) -> Vec<f32> {
        let channel = &self.channels[number];
        if self.primaries == Primaries::Rec709 || !channel.is_color {
            return channel.values.clone();
        }
        // The three of a colour follow each other.
        let component =
            self.channels[..number].iter().rev().take_while(|before| before.layer() == channel.layer()).count();
        let color = &self.channels[number - component % 3..][..3];
        let at = |p: usize| self.primaries.of_rec709([0, 1, 2].map(|c| f64::from(color[c].values[p])))[component % 3];
        (0..channel.values.len()).map(|p| stored(at(p))).collect()
    }
}

impl Film {
    /// Writes the film as OpenEXR, all or nothing.
    ///
    /// # Errors
    /// [`Error::Io`] naming `path`.
    pub fn write_exr(&self, path: impl AsRef<Path>, options: &ExrOptions) -> Result<()> {
        let window = self.window;
        let encoding =
            Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let size = Vec2(window.width as usize, window.height as usize);
        let channels = AnyChannels::sort(self.exr_channels(options).into_iter().collect());
        let mut image = Image::from_layer(Layer::new(size, self.layer_attributes(options), encoding, channels));
        let resolution = Vec2(self.resolution.0 as usize, self.resolution.1 as usize);
        image.attributes.display_window = IntegerBounds::from_dimensions(resolution);
        image.attributes.chromaticities = Some(chromaticities(options.primaries));
        super::atomic::write_atomically(path.as_ref(), |writer| {
            image.write().to_buffered(SortedHeader::new(writer)).map_err(|error| match error {
                exr::error::Error::Io(source) => source,
                other => std::io::Error::other(other.to_string()),
            })
        })
    }

    fn exr_channels(&self, options: &ExrOptions) -> Vec<AnyChannel<FlatSamples>> {
        let own = beauty::CHANNELS.into_iter().chain(options.channels.iter().map(|channel| channel.name.as_str()));
        let names = options.pass_names.channels(own);
        let beauty = (0..beauty::CHANNELS.len()).map(|c| {
            let values = self.pixels.iter().map(|pixel| {
                let [r, g, b, a] = pixel.mean();
                let [r, g, b] = options.primaries.of_rec709([r, g, b]);
                [r, g, b, a][c]
            });
            if options.half {
                FlatSamples::F16(values.map(stored_half).collect())
            } else {
                FlatSamples::F32(values.map(stored).collect())
            }
        });
        let extra = (0..options.channels.len()).map(|number| FlatSamples::F32(options.values(number)));
        let named = names.iter().zip(beauty.chain(extra));
        named.map(|(name, samples)| AnyChannel::new(name.as_str(), samples)).collect()
    }

    fn layer_attributes(&self, options: &ExrOptions) -> LayerAttributes {
        // Strings in OpenEXR files are UTF-8; `Text` from a `str` would make them Latin-1.
        let text = |value: &str| AttributeValue::Text(Text::from_slice_unchecked(value.as_bytes()));
        let mut attributes = LayerAttributes {
            layer_position: Vec2(self.window.x as i32, self.window.y as i32),
            software_name: Text::new_or_none(SOFTWARE),
            world_to_camera: options.view.map(|view| view.world_to_camera),
            world_to_normalized_device: options.view.map(|view| view.world_to_ndc),
            ..LayerAttributes::default()
        };
        let mut set = |name: &str, value: AttributeValue| attributes.other.insert(Text::from(name), value);
        set("samplesPerPixel", AttributeValue::I32(self.spp().mean.round().min(f64::from(i32::MAX)) as i32));
        set("colorInteropID", text(options.primaries.interop_id()));
        set("pathspace/version", text(env!("CARGO_PKG_VERSION")));
        if let Some(seconds) = options.render_seconds.filter(|_| !options.reproducible) {
            set("renderTimeSeconds", AttributeValue::F32(seconds as f32));
        }
        let spp = self.spp();
        // First sample and one past the last that every pixel has; where some have more (a render that was stopped
        // within a pass), also the range of the pixel with the most.
        let range = |samples: u64| format!("{}..{}", self.first_sample, self.first_sample + samples);
        let range_max = (spp.max > spp.min).then(|| range(spp.max));
        let texts = [
            ("pathspace/seed", options.seed.map(|seed| seed.to_string())),
            ("pathspace/sampleRange", Some(range(spp.min))),
            ("pathspace/sampleRangeMax", range_max),
            ("pathspace/backend", options.backend.clone()),
            ("pathspace/isa", options.isa.clone()),
            ("pathspace/plan", options.plan.clone()),
            ("pathspace/key", options.key.clone()),
            ("pathspace/accepted", options.accepted.clone()),
            ("pathspace/denoised", options.denoised.clone()),
        ];
        for (name, value) in texts {
            if let Some(value) = value {
                set(name, text(&value));
            }
        }
        for matte in &options.mattes {
            for (name, value) in matte.attributes(&options.pass_names.layer(&matte.layer)) {
                set(&name, text(value));
            }
        }
        attributes
    }
}

fn chromaticities(primaries: Primaries) -> Chromaticities {
    let [red, green, blue, white] = primaries.chromaticities().map(|[x, y]| Vec2(x, y));
    Chromaticities { red, green, blue, white }
}

const SOFTWARE: &str = concat!("pathspace ", env!("CARGO_PKG_VERSION"));

/// Pixels of the largest picture that is read.
const MOST_PIXELS: u64 = 1 << 28;

/// Deflate, the strongest of the lossless codecs, expands a byte to at most 1032, and a pixel has at least one.
const MOST_PIXELS_PER_BYTE: u64 = 1032;

/// A mean as it is stored in 16 bits: rounded once, and saturated.
fn stored_half(value: f64) -> f16 {
    f16::from_f64(value.clamp(f16::MIN.to_f64(), f16::MAX.to_f64()))
}

/// What a reader finds where `value` was written in 16 bits.
pub fn through_half(value: f64) -> f64 {
    stored_half(value).to_f64()
}

/// Pixels of a data window and where it lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Columns and rows of the display window.
    pub display: (usize, usize),
    /// Left column and top row of the data window, relative to the display window.
    pub position: (i64, i64),
    /// Columns of the data window.
    pub width: usize,
    /// Rows of the data window.
    pub height: usize,
    /// R, G, B of the data window, row-major.
    pub rgb: Vec<[f32; 3]>,
    /// Alpha, if the file has one.
    pub alpha: Option<Vec<f32>>,
}

/// The text of an attribute of an OpenEXR file; `None` where there is no such file or attribute.
pub fn text_attribute(path: &Path, name: &str) -> Option<String> {
    let (file, _) = input::open(path).ok()?;
    let meta = MetaData::read_from_buffered(std::io::BufReader::new(file), false).ok()?;
    match meta.headers.first()?.own_attributes.other.get(&Text::from(name))? {
        AttributeValue::Text(text) => Some(String::from_utf8_lossy(text.as_slice()).into_owned()),
        _ => None,
    }
}

/// Reads the first flat part of an OpenEXR file.
///
/// # Errors
/// [`Error::Io`] when the file cannot be opened or read, [`Error::Image`] when it is broken or has no colour channels.
pub fn read_exr(path: &Path) -> Result<Picture> {
    let broken = |problem: String| Error::Image { path: path.into(), problem };
    let unreadable = |error: exr::error::Error| broken(format!("not a readable OpenEXR file: {error}"));
    let bytes = input::read(path).map_err(|source| Error::io(path, "read", source))?;
    // Sizes in headers are believed only as far as the file's length can expand to.
    let meta = MetaData::read_from_buffered(Cursor::new(&bytes), false).map_err(unreadable)?;
    let most = (bytes.len() as u64).saturating_mul(MOST_PIXELS_PER_BYTE).min(MOST_PIXELS);
    if let Some(size) =
        meta.headers.iter().map(|h| h.layer_size).find(|s| (s.0 as u64).saturating_mul(s.1 as u64) > most)
    {
        return Err(broken(format!("expected at most {most} pixels in this file, found {} × {}", size.0, size.1)));
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(&bytes))
        .map_err(unreadable)?;
    let layer = image.layer_data;
    let (width, height) = (layer.size.0, layer.size.1);
    let values = |name: &str| -> Option<Vec<f32>> {
        let called = |wanted: &str| layer.channel_data.list.iter().find(|channel| channel.name.eq(wanted));
        let channel = called(name).or_else(|| called(&PassNames::Blender.channels([name])[0]))?;
        (channel.sampling == Vec2(1, 1)).then(|| channel.sample_data.values_as_f32().collect())
    };
    let rgb: Vec<[f32; 3]> = match (values("R"), values("G"), values("B"), values("Y")) {
        (Some(r), Some(g), Some(b), _) => r.iter().zip(&g).zip(&b).map(|((&r, &g), &b)| [r, g, b]).collect(),
        (_, _, _, Some(y)) => y.iter().map(|&y| [y; 3]).collect(),
        _ => {
            let found: Vec<String> = layer.channel_data.list.iter().map(|c| c.name.to_string()).collect();
            return Err(broken(format!("expected channels R, G, B (or Y), found {}", found.join(", "))));
        }
    };
    let display = image.attributes.display_window;
    let position = layer.attributes.layer_position - display.position;
    Ok(Picture {
        display: (display.size.0, display.size.1),
        position: (i64::from(position.0), i64::from(position.1)),
        width,
        height,
        rgb,
        alpha: values("A"),
    })
}
