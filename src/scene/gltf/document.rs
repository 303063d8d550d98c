//! A glTF document as bytes and JSON: container, buffers, URIs, and checked look-ups that name a JSON pointer when they fail.
//!
//! Source: glTF 2.0 §2 (URIs), §3.2 (asset), §4.4 (GLB). Objects are converted one by one to the types of the `gltf` crate, so
//! that an error names the member it is about; the crate's own accessors, which trust indices, are not used.
//! Limits: the JSON may nest 128 levels (the parser's limit); buffers and images are read from regular files only.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::HashMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gltf::json::validation::Checked;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::super::Warning;
use super::json::{brief, culprit, glb_chunks, normalise_root, one_line};
use super::uri::{self, Resource};
use crate::error::{Error, Result};

/// Extensions that a file may require.
const SUPPORTED: &[&str] = &[
    "EXT_texture_webp",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_volume",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Triangles, instances and sparse elements that a file may make from each of its bytes. One triangle takes at least a byte (a
/// strip of 8-bit indices), an instance a dozen; only sharing makes more, and four-fold sharing of everything is plenty …
const WORK_PER_BYTE: u64 = 4;
/// … but small files may share as much as they like, up to what costs half a gigabyte.
const WORK_ALWAYS_ALLOWED: u64 = 1 << 22;

/// A read file. All look-ups are checked; every error carries the file and a pointer.
pub(super) struct Document {
    pub(super) file: PathBuf,
    root: Value,
    /// The whole file, if it is a GLB with a binary chunk, and where that chunk lies.
    binary: Option<(Vec<u8>, Range<usize>)>,
    /// One slot a buffer, filled when it is first used.
    buffers: Vec<OnceCell<Arc<Vec<u8>>>>,
    /// Files read so far, so that a thousand buffers naming one file read it once.
    files: RefCell<HashMap<PathBuf, Arc<Vec<u8>>>>,
    warnings: RefCell<Vec<Warning>>,
    /// Bytes read: the document and the buffers opened so far.
    bytes_held: Cell<u64>,
    /// Elements made from them so far.
    work: Cell<u64>,
}

/// Bytes of a buffer view.
pub(super) struct View<'d> {
    pub(super) bytes: &'d [u8],
    pub(super) stride: Option<usize>,
    pub(super) pointer: String,
}

impl Document {
    /// Reads a `.gltf` or `.glb`; which one is told by its first bytes.
    pub(super) fn read(file: &Path) -> Result<Document> {
        let bytes = std::fs::read(file).map_err(|source| Error::io(file, "read", source))?;
        Document::parse(file, bytes)
    }

    fn parse(file: &Path, bytes: Vec<u8>) -> Result<Document> {
        let invalid = |pointer: &str, problem: String| Error::InvalidScene {
            file: file.into(),
            pointer: pointer.into(),
            problem: one_line(&problem),
        };
        let named_glb = file.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("glb"));
        let length = bytes.len() as u64;
        let is_glb = bytes.starts_with(b"glTF");
        if named_glb && !is_glb {
            let found = &bytes[..bytes.len().min(4)];
            return Err(invalid("/", format!("expected the GLB magic `glTF`, found `{}`", found.escape_ascii())));
        }
        let chunks =
            if is_glb { glb_chunks(&bytes).map_err(|problem| invalid("/", problem))? } else { (0..bytes.len(), None) };
        let mut root: Value = serde_json::from_slice(&bytes[chunks.0.clone()])
            .map_err(|reason| invalid("/", format!("expected JSON, found {reason}")))?;
        if !root.is_object() {
            return Err(invalid("/", format!("expected a JSON object, found {}", brief(&root))));
        }
        normalise_root(&mut root);
        let mut document = Document {
            file: file.into(),
            root,
            binary: chunks.1.map(|range| (bytes, range)),
            buffers: Vec::new(),
            files: RefCell::default(),
            warnings: RefCell::default(),
            bytes_held: Cell::new(length),
            work: Cell::default(),
        };
        document.buffers.resize_with(document.table("buffers")?.len(), OnceCell::new);
        document.check_asset()?;
        document.check_extensions()?;
        Ok(document)
    }

    /// The error for `pointer`, on one line whatever the file wrote into its strings.
    pub(super) fn error(&self, pointer: impl AsRef<str>, problem: impl AsRef<str>) -> Error {
        Error::InvalidScene {
            file: self.file.clone(),
            pointer: one_line(pointer.as_ref()),
            problem: one_line(problem.as_ref()),
        }
    }

    /// Accounts for `amount` triangles, instances or sparse elements about to be made. A small file whose parts refer to each
    /// other many times over would otherwise multiply into more than memory holds.
    pub(super) fn charge(&self, amount: usize, pointer: &str) -> Result<()> {
        let work = self.work.get().saturating_add(amount as u64);
        let allowed = WORK_ALWAYS_ALLOWED.max(WORK_PER_BYTE.saturating_mul(self.bytes_held.get()));
        if work > allowed {
            let held = self.bytes_held.get();
            let problem = format!(
                "expected at most {allowed} triangles, instances and sparse elements from {held} bytes of file, found {work}"
            );
            return Err(self.error(pointer, problem));
        }
        self.work.set(work);
        Ok(())
    }

    /// Notes something that does not stop the work.
    pub(super) fn warn(&self, place: impl AsRef<str>, what: impl AsRef<str>) {
        self.warnings.borrow_mut().push(Warning { place: one_line(place.as_ref()), what: one_line(what.as_ref()) });
    }

    /// The warnings noted so far, taken out.
    pub(super) fn take_warnings(&self) -> Vec<Warning> {
        self.warnings.take()
    }

    /// The JSON value at `pointer`, if there is one.
    pub(super) fn value(&self, pointer: &str) -> Option<&Value> {
        self.root.pointer(pointer)
    }

    /// The array at `/name`; empty if the file has none.
    pub(super) fn table(&self, name: &str) -> Result<&[Value]> {
        self.array(&format!("/{name}"))
    }

    /// The array at `pointer`; empty if the file has none.
    pub(super) fn array(&self, pointer: &str) -> Result<&[Value]> {
        match self.root.pointer(pointer) {
            None => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(other) => Err(self.error(pointer, format!("expected an array, found {}", brief(other)))),
        }
    }

    /// `table[index]` as a type of the `gltf` crate. `from` is the pointer that made the reference.
    pub(super) fn element<T: DeserializeOwned>(&self, table: &str, index: usize, from: &str) -> Result<T> {
        let items = self.table(table)?;
        let value = items.get(index).ok_or_else(|| self.out_of_range(table, index, from))?;
        self.typed(value, &format!("/{table}/{index}"))
    }

    /// The error for a reference past the end of a table.
    pub(super) fn out_of_range(&self, table: &str, index: usize, from: &str) -> Error {
        let count = self.table(table).map_or(0, <[Value]>::len);
        self.error(from, format!("expected an index below {count}, the length of /{table}, found {index}"))
    }

    /// `value`, found at `pointer`, converted; a failure is reported at the member that caused it.
    pub(super) fn typed<T: DeserializeOwned>(&self, value: &Value, pointer: &str) -> Result<T> {
        T::deserialize(value).map_err(|reason| {
            let reason = reason.to_string();
            self.error(format!("{pointer}{}", culprit::<T>(value, &reason)), reason)
        })
    }

    /// Unwraps an enumeration that the `gltf` crate marks invalid.
    pub(super) fn checked<T>(&self, value: Checked<T>, pointer: &str) -> Result<T> {
        match value {
            Checked::Valid(value) => Ok(value),
            Checked::Invalid => {
                let found = self.value(pointer).map_or("something else".into(), brief);
                Err(self.error(pointer, format!("expected a value that glTF 2.0 lists, found {found}")))
            }
        }
    }

    /// A number that must be finite: 1e39 is valid JSON and infinite as `f32`.
    pub(super) fn finite(&self, value: f32, pointer: &str) -> Result<f32> {
        if value.is_finite() {
            Ok(value)
        } else {
            Err(self.error(pointer, format!("expected a finite number, found {value}")))
        }
    }

    /// The bytes of a buffer view, inside its buffer.
    pub(super) fn view(&self, index: usize, from: &str) -> Result<View<'_>> {
        let view: gltf::json::buffer::View = self.element("bufferViews", index, from)?;
        let pointer = format!("/bufferViews/{index}");
        let buffer = self.buffer(view.buffer.value(), &format!("{pointer}/buffer"))?;
        let offset = view.byte_offset.unwrap_or_default().0;
        let length = view.byte_length.0;
        let end = offset.checked_add(length).filter(|&end| end <= buffer.len() as u64).ok_or_else(|| {
            let problem =
                format!("expected at most {} bytes, the length of its buffer, found {offset} + {length}", buffer.len());
            self.error(&pointer, problem)
        })?;
        let stride = view.byte_stride.map(|stride| stride.0);
        if let Some(stride) = stride.filter(|stride| !(4..=252).contains(stride)) {
            return Err(self.error(format!("{pointer}/byteStride"), format!("expected 4 to 252, found {stride}")));
        }
        Ok(View { bytes: &buffer[offset as usize..end as usize], stride, pointer })
    }

    fn buffer(&self, index: usize, from: &str) -> Result<&[u8]> {
        let slot = self.buffers.get(index).ok_or_else(|| self.out_of_range("buffers", index, from))?;
        let buffer: gltf::json::Buffer = self.element("buffers", index, from)?;
        let pointer = format!("/buffers/{index}");
        let bytes = match (&buffer.uri, &self.binary) {
            (None, Some((file, range))) if index == 0 => &file[range.clone()],
            (None, _) => {
                return Err(self.error(pointer, "expected a uri (only buffer 0 of a GLB may do without), found none"));
            }
            (Some(uri), _) => match slot.get() {
                Some(bytes) => bytes.as_slice(),
                None => {
                    let bytes = self.resource(uri, &format!("{pointer}/uri"))?;
                    self.bytes_held.set(self.bytes_held.get() + bytes.len() as u64);
                    slot.get_or_init(|| bytes).as_slice()
                }
            },
        };
        let wanted = buffer.byte_length.0;
        let available = bytes.len();
        usize::try_from(wanted).ok().and_then(|wanted| bytes.get(..wanted)).ok_or_else(|| {
            self.error(
                format!("{pointer}/byteLength"),
                format!("expected at most the {available} bytes that there are, found {wanted}"),
            )
        })
    }

    /// What a URI stands for: bytes in itself, or a path relative to the document.
    pub(super) fn locate(&self, uri: &str, pointer: &str) -> Result<Resource> {
        uri::resolve(uri, self.file.parent().unwrap_or(Path::new(""))).map_err(|problem| self.error(pointer, problem))
    }

    /// The bytes behind a URI: a data URI, or a regular file relative to the document.
    pub(super) fn resource(&self, uri: &str, pointer: &str) -> Result<Arc<Vec<u8>>> {
        let path = match self.locate(uri, pointer)? {
            Resource::Inline(bytes) => return Ok(Arc::new(bytes)),
            Resource::File(path) => path,
        };
        let missing =
            |reason: &dyn std::fmt::Display| self.error(pointer, format!("cannot read {}: {reason}", path.display()));
        // A pipe or a device would never end; a directory gives an unclear message.
        let canonical = path.canonicalize().map_err(|reason| missing(&reason))?;
        if !canonical.is_file() {
            return Err(missing(&"not a regular file"));
        }
        if let Some(bytes) = self.files.borrow().get(&canonical) {
            return Ok(bytes.clone());
        }
        let bytes = Arc::new(std::fs::read(&canonical).map_err(|reason| missing(&reason))?);
        self.files.borrow_mut().insert(canonical, bytes.clone());
        Ok(bytes)
    }

    fn check_asset(&self) -> Result<()> {
        let version = |pointer: &str| match self.value(pointer) {
            None => Ok(None),
            Some(Value::String(text)) => match text.split_once('.') {
                Some((major, minor)) if major == "2" && minor.parse::<u32>().is_ok() => Ok(Some(minor.parse::<u32>())),
                _ => Err(self.error(pointer, format!("expected version 2.0, found {text:?}"))),
            },
            Some(other) => Err(self.error(pointer, format!("expected a version string, found {}", brief(other)))),
        };
        if version("/asset/version")?.is_none() {
            return Err(self.error("/asset/version", "expected \"2.0\", found nothing"));
        }
        match version("/asset/minVersion")? {
            None | Some(Ok(0)) => Ok(()),
            Some(_) => Err(self.error("/asset/minVersion", "expected at most \"2.0\"")),
        }
    }

    fn check_extensions(&self) -> Result<()> {
        for name in self.table("extensionsRequired")? {
            let name =
                name.as_str().ok_or_else(|| self.error("/extensionsRequired", "expected names of extensions"))?;
            if !SUPPORTED.contains(&name) {
                return Err(Error::UnsupportedExtension { file: self.file.clone(), extension: one_line(name) });
            }
        }
        // Extensions of materials are named with their material, later.
        for name in self.table("extensionsUsed")?.iter().filter_map(Value::as_str) {
            if !SUPPORTED.contains(&name) && !name.starts_with("KHR_materials_") && !name.starts_with("KHR_texture_") {
                self.warn("/extensionsUsed", format!("{name} is not supported and ignored"));
            }
        }
        Ok(())
    }
}
