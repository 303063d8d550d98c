//! The textures of a file: which image in which colour space with which sampler, decoded once however often it is used.
//!
//! Source: glTF 2.0 §3.8 and §5.29 (samplers). An image read both as colour and as data becomes two textures that share
//! their texels. Limit: minification filters are not used (a path tracer filters by sampling the pixel).

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::{Image, Texture as JsonTexture, texture::Sampler};
use rayon::prelude::*;

use super::super::image::{Rgba8, decode_rgba8, texel_count};
use super::super::{ColorSpace, Texture, TextureId, Wrap};
use super::document::{Document, View};
use crate::error::{Error, Result};

/// Texels of all images together: 16 GB decoded.
const MOST_TEXELS_IN_ALL: u64 = 1 << 32;

/// Textures asked for so far, not yet decoded.
#[derive(Default)]
pub(super) struct TextureTable {
    requests: Vec<Request>,
    known: HashMap<(usize, bool), Option<TextureId>>,
}

struct Request {
    name: String,
    image: usize,
    color_space: ColorSpace,
    wrap_u: Wrap,
    wrap_v: Wrap,
    bilinear: bool,
}

impl TextureTable {
    /// Id of `/textures/index` read in a colour space. `None`, with a warning, if its image is in a format of an extension.
    pub(super) fn request(
        &mut self,
        document: &Document,
        index: usize,
        color_space: ColorSpace,
        from: &str,
    ) -> Result<Option<TextureId>> {
        let key = (index, color_space == ColorSpace::Srgb);
        if let Some(&id) = self.known.get(&key) {
            return Ok(id);
        }
        let texture: JsonTexture = document.element("textures", index, from)?;
        let pointer = format!("/textures/{index}");
        // The extension's image is the better one; `source` is for readers without WebP.
        let webp = format!("{pointer}/extensions/EXT_texture_webp/source");
        let webp = document.value(&webp).map(|value| (value, webp));
        if webp.is_none() && document.value(&format!("{pointer}/source")).is_none() {
            document.warn(&pointer, "has no PNG, JPEG or WebP source; the texture is ignored");
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
        let (image, source) = match webp {
            None => (texture.source.value(), format!("{pointer}/source")),
            Some((value, source)) => {
                let image = value.as_u64().and_then(|image| usize::try_from(image).ok());
                let problem = || document.error(&source, format!("expected the number of an image, found {value}"));
                (image.ok_or_else(problem)?, source)
            }
        };
        let described: Image = document.element("images", image, &source)?;
        let file = described.uri.filter(|uri| !uri.starts_with("data:"));
        let name = described.name.or(file).unwrap_or_else(|| format!("image {image}"));
        let id = TextureId(self.requests.len() as u32);
        self.requests.push(Request { name, image, color_space, wrap_u, wrap_v, bilinear });
        self.known.insert(key, Some(id));
        Ok(Some(id))
    }

    /// Decodes every image asked for, in parallel.
    pub(super) fn decode(self, document: &Document) -> Result<Vec<Texture>> {
        let mut sources: BTreeMap<usize, Bytes<'_>> = BTreeMap::new();
        for request in &self.requests {
            if let Entry::Vacant(place) = sources.entry(request.image) {
                place.insert(image_bytes(document, request.image)?);
            }
        }
        let mut texels = 0u64;
        for (&image, bytes) in &sources {
            texels += texel_count(bytes.as_slice()).map_err(|problem| broken(document, image, &problem))?;
            if texels > MOST_TEXELS_IN_ALL {
                let problem = format!("expected at most {MOST_TEXELS_IN_ALL} texels in all images, found more");
                return Err(broken(document, image, &problem));
            }
        }
        let decoded: Vec<(usize, Result<Rgba8, String>)> =
            sources.into_par_iter().map(|(image, bytes)| (image, decode_rgba8(bytes.as_slice()))).collect();
        let mut images: HashMap<usize, Rgba8> = HashMap::new();
        for (image, result) in decoded {
            images.insert(image, result.map_err(|problem| broken(document, image, &problem))?);
        }
        let texture = |request: Request| {
            let image = &images[&request.image];
            Texture {
                name: request.name,
                width: image.width,
                height: image.height,
                texels: image.texels.clone(),
                color_space: request.color_space,
                wrap_u: request.wrap_u,
                wrap_v: request.wrap_v,
                bilinear: request.bilinear,
            }
        };
        Ok(self.requests.into_iter().map(texture).collect())
    }
}

/// Bytes of an encoded image.
enum Bytes<'d> {
    Borrowed(&'d [u8]),
    Shared(Arc<Vec<u8>>),
}

impl Bytes<'_> {
    fn as_slice(&self) -> &[u8] {
        match self {
            Bytes::Borrowed(bytes) => bytes,
            Bytes::Shared(bytes) => bytes,
        }
    }
}

fn image_bytes(document: &Document, index: usize) -> Result<Bytes<'_>> {
    let pointer = format!("/images/{index}");
    let image: Image = document.element("images", index, &pointer)?;
    match (image.uri, image.buffer_view) {
        (Some(uri), None) => Ok(Bytes::Shared(document.resource(&uri, &format!("{pointer}/uri"))?)),
        (None, Some(view)) => {
            let View { bytes, .. } = document.view(view.value(), &format!("{pointer}/bufferView"))?;
            Ok(Bytes::Borrowed(bytes))
        }
        (Some(_), Some(_)) => Err(document.error(pointer, "expected a uri or a bufferView, found both")),
        (None, None) => Err(document.error(pointer, "expected a uri or a bufferView, found neither")),
    }
}

/// The error for an image that cannot be decoded; it names the image's file, if that is another one.
fn broken(document: &Document, index: usize, problem: &str) -> Error {
    let pointer = format!("/images/{index}");
    let uri = document.value(&format!("{pointer}/uri")).and_then(|uri| uri.as_str());
    match uri.filter(|uri| !uri.starts_with("data:")) {
        Some(uri) => document.error(format!("{pointer}/uri"), format!("{uri}: {problem}")),
        None => document.error(pointer, problem),
    }
}

fn wrap(mode: WrappingMode) -> Wrap {
    match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::MirroredRepeat,
        WrappingMode::ClampToEdge => Wrap::ClampToEdge,
    }
}
