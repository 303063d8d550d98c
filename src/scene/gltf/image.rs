//! The textures of a file: which image in which colour space with which sampler, decoded once however often it is used.
//!
//! Source: glTF 2.0 §3.8 and §5.29 (samplers). An image read both as colour and as data becomes two textures that
//! share their texels. The sampler's minification filter is not read: a path tracer filters by sampling the pixel, and
//! `--texture-filter` says how else.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::{Image, Texture as JsonTexture, texture::Sampler};

use super::super::{ColorSpace, LoadOptions, MissingTexture, Slot, Texels, Texture, TextureId, Wrap};
use super::document::{Document, View};
use super::ext::ext_texture_webp;
#[cfg(feature = "basisu")]
use super::ext::khr_texture_basisu;
use super::uri::Resource;
use crate::error::Result;
use crate::plain::one_line;
use crate::texture::decode::{Decoder, Encoded, Image as DecodedImage, Problem, decode_any, inspect};
use crate::texture::load::{self as loading, Loaded};
use crate::texture::udim::{self, Udim};

impl Request {
    /// What stands in for an image that is missing: magenta, and in data what changes nothing (a flat normal, a factor
    /// of 1).
    fn stand_in(&self) -> [u8; 4] {
        match self.color_space {
            ColorSpace::Srgb => [255, 0, 255, 255],
            ColorSpace::Linear if self.is_normal_map => [128, 128, 255, 255],
            ColorSpace::Linear => [255; 4],
        }
    }
}

/// Textures asked for so far, not yet decoded.
#[derive(Default)]
pub(super) struct TextureTable {
    requests: Vec<Request>,
    known: HashMap<(usize, bool), Option<TextureId>>,
}

struct Request {
    name: String,
    /// The first material that asks for it.
    material: String,
    /// Read as a normal map.
    is_normal_map: bool,
    image: usize,
    color_space: ColorSpace,
    wrap_u: Wrap,
    wrap_v: Wrap,
    bilinear: bool,
}

impl TextureTable {
    /// Id of `/textures/index` read for a slot. `None`, with a warning, if its image is in a format of an
    /// extension.
    pub(super) fn request(
        &mut self,
        document: &Document,
        index: usize,
        slot: Slot,
        from: &str,
    ) -> Result<Option<TextureId>> {
        let color_space = slot.color_space();
        let key = (index, color_space == ColorSpace::Srgb);
        if let Some(&id) = self.known.get(&key) {
            return Ok(id);
        }
        let texture: JsonTexture = document.element("textures", index, from)?;
        let pointer = format!("/textures/{index}");
        let other = ext_texture_webp::source(document, &pointer)?;
        #[cfg(feature = "basisu")]
        let other = other.map_or_else(|| khr_texture_basisu::source(document, &pointer), |webp| Ok(Some(webp)))?;
        if other.is_none() && document.value(&format!("{pointer}/source")).is_none() {
            document.warn(&pointer, "has no source in a format that is read; the texture is ignored");
            self.known.insert(key, None);
            return Ok(None);
        }
        let (mut wrap_u, mut wrap_v, mut bilinear) = (Wrap::Repeat, Wrap::Repeat, true);
        if let Some(sampler) = texture.sampler {
            let at = |member: &str| format!("/samplers/{}/{member}", sampler.value());
            let sampler: Sampler = document.element("samplers", sampler.value(), &format!("{pointer}/sampler"))?;
            wrap_u = wrap(document.checked(sampler.wrap_s, &at("wrapS"))?);
            wrap_v = wrap(document.checked(sampler.wrap_t, &at("wrapT"))?);
            let filter = sampler.mag_filter.map(|filter| document.checked(filter, &at("magFilter"))).transpose()?;
            bilinear = filter != Some(MagFilter::Nearest);
        }
        let (image, source) = other.unwrap_or_else(|| (texture.source.value(), format!("{pointer}/source")));
        if image >= document.table("images")?.len() {
            return Err(document.out_of_range("images", image, &source));
        }
        // Its URI may hold all of the image.
        let described = |member: &str| document.text(&format!("/images/{image}/{member}"));
        let file = described("uri")?.filter(|uri| !uri.starts_with("data:"));
        let name = described("name")?.or(file).map_or_else(|| format!("image {image}"), str::to_owned);
        let id = TextureId(self.requests.len() as u32);
        let (material, is_normal_map) = (material_of(document, from), slot.is_normal_map());
        self.requests.push(Request { name, material, is_normal_map, image, color_space, wrap_u, wrap_v, bilinear });
        self.known.insert(key, Some(id));
        Ok(Some(id))
    }

    /// Decodes every image asked for, in parallel and within the budget of memory.
    pub(super) fn decode(self, document: &Document, options: &LoadOptions) -> Result<Vec<Texture>> {
        let mut pages = Vec::new();
        let mut of_request = Vec::new();
        for request in &self.requests {
            of_request.push(pages_of(document, request, options, &mut pages)?);
        }
        let names: Vec<String> = pages.iter().map(|page| page.name(document)).collect();
        let found: Vec<(usize, loading::Request)> = (pages.iter().enumerate())
            .filter_map(|(i, page)| {
                let encoded = match page.source.as_ref().ok()? {
                    Source::File(path) => Encoded::File(path),
                    Source::Borrowed(bytes) => Encoded::Bytes(bytes),
                    Source::Shared(bytes) => Encoded::Bytes(bytes),
                };
                Some((i, loading::Request { encoded, color_spaces: page.color_spaces, name: &names[i] }))
            })
            .collect();
        let (places, requests): (Vec<usize>, Vec<loading::Request>) = found.into_iter().unzip();
        let strict = options.missing_texture == MissingTexture::Error;
        let loaded = loading::load(&requests, options.texture_budget, strict);
        let mut images: Vec<Result<Loaded, String>> =
            pages.iter().map(|page| page.source.as_ref().map(|_| Loaded::default()).map_err(String::clone)).collect();
        for (place, image) in places.into_iter().zip(loaded) {
            images[place] = match image {
                Ok(image) => Ok(image),
                Err(Problem::Image(problem)) => Err(problem),
                Err(Problem::Machine(error)) => return Err(error),
            };
        }
        let textures = self.requests.iter().zip(&of_request);
        textures.map(|(request, pages_of)| texture(document, request, options, (&pages, &images), pages_of)).collect()
    }
}

/// An image to be loaded: one of a UDIM texture, or all of any other.
struct Page<'d> {
    /// Index into `/images`.
    image: usize,
    /// UDIM number, or 0.
    number: u32,
    /// Where it is, or why it cannot be read.
    source: Result<Source<'d>, String>,
    color_spaces: [Option<ColorSpace>; 2],
    /// The first material that asks for it.
    material: String,
}

impl Page<'_> {
    /// Its file and material, for messages.
    fn name(&self, document: &Document) -> String {
        let by = format!("(texture of material \"{}\")", self.material);
        one_line(&match &self.source {
            Ok(Source::File(path)) => format!("{} {by}", path.display()),
            _ => format!("{}#/images/{} {by}", document.file.display(), self.image),
        })
    }
}

enum Source<'d> {
    File(PathBuf),
    Borrowed(&'d [u8]),
    Shared(Arc<Vec<u8>>),
}

/// Where a colour space stands in [`Page::color_spaces`].
fn slot(color_space: ColorSpace) -> usize {
    usize::from(color_space == ColorSpace::Linear)
}

/// The pages that a texture is made of, as indices into `pages`, which is added to.
fn pages_of<'d>(
    document: &'d Document,
    request: &Request,
    options: &LoadOptions,
    pages: &mut Vec<Page<'d>>,
) -> Result<Vec<usize>> {
    let known: Vec<usize> = (0..pages.len()).filter(|&i| pages[i].image == request.image).collect();
    let first = pages.len();
    if known.is_empty() {
        for (number, source) in sources(document, request.image, options)? {
            let material = request.material.clone();
            pages.push(Page { image: request.image, number, source, color_spaces: [None; 2], material });
        }
    }
    let mine: Vec<usize> = if known.is_empty() { (first..pages.len()).collect() } else { known };
    for &i in &mine {
        pages[i].color_spaces[slot(request.color_space)] = Some(request.color_space);
    }
    Ok(mine)
}

/// The files or bytes of an image: several with their numbers for UDIM, else one with number 0. What is wrong with the
/// description itself is an error; a file that is missing is for `--missing-texture` to judge.
fn sources<'d>(
    document: &'d Document,
    index: usize,
    options: &LoadOptions,
) -> Result<Vec<(u32, Result<Source<'d>, String>)>> {
    let pointer = format!("/images/{index}");
    let image: Image = document.element("images", index, &pointer)?;
    let uri = match (image.uri, image.buffer_view) {
        (Some(uri), None) => uri,
        (None, Some(view)) => {
            let View { bytes, .. } = document.view(view.value(), &format!("{pointer}/bufferView"))?;
            return Ok(vec![(0, Ok(Source::Borrowed(bytes)))]);
        }
        (Some(_), Some(_)) => return Err(document.error(pointer, "expected a uri or a bufferView, found both")),
        (None, None) => return Err(document.error(pointer, "expected a uri or a bufferView, found neither")),
    };
    let pointer = format!("{pointer}/uri");
    let path = match document.locate(&uri, &pointer)? {
        Resource::Inline(bytes) => return Ok(vec![(0, Ok(Source::Shared(Arc::new(bytes))))]),
        Resource::File(path) => path,
    };
    let file = |path: &Path| {
        let found = document.admit(path)?;
        let prefers = options.texture_budget.decoder != Decoder::Crates;
        let beside = loading::beside(&found).filter(|_| prefers);
        Ok(Source::File(beside.map_or(Ok(found), |tx| document.admit(&tx))?))
    };
    let name = path.to_string_lossy().into_owned();
    if !name.contains(udim::MARK) {
        return Ok(vec![(0, file(&path))]);
    }
    let numbered = udim::numbers().map(|number| (number, PathBuf::from(name.replace(udim::MARK, &number.to_string()))));
    let pages: Vec<_> =
        numbered.filter(|(_, path)| path.exists()).map(|(number, path)| (number, file(&path))).collect();
    if pages.is_empty() {
        return Ok(vec![(0, Err(format!("cannot read {name}: none of the numbers 1001 to 1100 is there")))]);
    }
    Ok(pages)
}

/// Decodes all of an image that is read for `what`, whatever its size and whether missing textures are errors.
pub(super) fn decode_whole(
    document: &Document,
    index: usize,
    options: &LoadOptions,
    what: &str,
) -> Result<DecodedImage> {
    let pointer = format!("/images/{index}");
    let fails = |problem: String| document.error(&pointer, format!("{problem} ({what})"));
    let (_, source) = sources(document, index, options)?.swap_remove(0);
    let source = source.map_err(fails)?;
    let encoded = match &source {
        Source::File(path) => Encoded::File(path),
        Source::Borrowed(bytes) => Encoded::Bytes(bytes),
        Source::Shared(bytes) => Encoded::Bytes(bytes),
    };
    let found = |problem| match problem {
        Problem::Image(problem) => fails(problem),
        Problem::Machine(error) => error,
    };
    let budget = options.texture_budget;
    let size = inspect(encoded, budget.decoder).map_err(found)?;
    if size.bytes > budget.bytes {
        let (bytes, most) = (size.bytes >> 20, budget.bytes >> 20);
        return Err(fails(format!("expected an image that fits into --texture-memory ({most} MB), found {bytes} MB")));
    }
    decode_any(encoded, budget.decoder).map_err(found)
}

/// A texture from its pages.
fn texture(
    document: &Document,
    request: &Request,
    options: &LoadOptions,
    (pages, images): (&[Page], &[Result<Loaded, String>]),
    pages_of: &[usize],
) -> Result<Texture> {
    let mut parts = Vec::new();
    for &i in pages_of {
        let image = match &images[i] {
            Ok(image) => image[slot(request.color_space)].clone().expect("asked for in this colour space"),
            Err(problem) if options.missing_texture == MissingTexture::Magenta => {
                let (place, problem) = named(document, request, problem);
                document.warn(place, format!("{problem}; shown in magenta"));
                DecodedImage::constant(request.stand_in())
            }
            Err(problem) => {
                let (place, problem) = named(document, request, problem);
                return Err(document.error(place, problem));
            }
        };
        let is_page = pages[i].number != 0;
        let wrap = |wrap| if is_page { Wrap::ClampToEdge } else { wrap };
        let part = Texture {
            name: request.name.clone(),
            width: image.width,
            height: image.height,
            texels: image.texels,
            color_space: request.color_space,
            wrap_u: wrap(request.wrap_u),
            wrap_v: wrap(request.wrap_v),
            bilinear: request.bilinear,
        };
        if !is_page {
            return Ok(part);
        }
        parts.push((pages[i].number, part));
    }
    let (width, height) = parts.first().map_or((1, 1), |(_, page)| (page.width, page.height));
    Ok(Texture {
        name: request.name.clone(),
        width,
        height,
        texels: Texels::Udim(Arc::new(Udim::new(parts))),
        color_space: request.color_space,
        wrap_u: request.wrap_u,
        wrap_v: request.wrap_v,
        bilinear: request.bilinear,
    })
}

/// Pointer and problem of an image that cannot be used: its file, if that is another one, and the material that asks
/// for it.
fn named(document: &Document, request: &Request, problem: &str) -> (String, String) {
    let pointer = format!("/images/{}", request.image);
    let uri = document.value(&format!("{pointer}/uri")).and_then(|uri| uri.as_str());
    let by = format!("(texture of material \"{}\")", request.material);
    match uri.filter(|uri| !uri.starts_with("data:")) {
        Some(uri) => (format!("{pointer}/uri"), format!("{uri}: {problem} {by}")),
        None => (pointer, format!("{problem} {by}")),
    }
}

/// Name of the material that the pointer `from` leads into.
fn material_of(document: &Document, from: &str) -> String {
    let index = from.strip_prefix("/materials/").and_then(|rest| rest.split('/').next()).unwrap_or("?");
    let name = document.value(&format!("/materials/{index}/name")).and_then(|name| name.as_str());
    name.map_or_else(|| format!("material {index}"), String::from)
}

fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
        WrappingMode::ClampToEdge => Wrap::ClampToEdge,
    }
}
