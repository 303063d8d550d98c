//! A glTF document as bytes and JSON: container, buffers, URIs, and checked look-ups that name a JSON pointer when they
//! fail.
//!
//! Source: glTF 2.0 §2 (URIs), §3.2 (asset), §4.4 (GLB). Objects are converted one by one to the types of the `gltf`
//! crate, so that an error names the member it is about; the crate's own accessors, which trust indices, are not used.
//! Limits: the JSON may nest 128 levels (the parser's limit); buffers and images are read from regular files only, and
//! from the document's folder unless told otherwise: a file may come from anybody, what it names must not.

use std::cell::{Cell, OnceCell, RefCell};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use gltf::json::validation::Checked;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::super::Warning;
use super::json::{brief, culprit, glb_chunks, normalise_root, one_line, without_mark};
#[cfg(feature = "meshopt")]
use super::meshopt;
use super::uri::{self, Resource};
use crate::error::{Error, Result};
use crate::input;
use crate::room::Room;

/// Triangles, instances and sparse elements that a file may make from each of its bytes. One triangle takes at least a
/// byte (a strip of 8-bit indices), an instance a dozen; only sharing makes more, and four-fold sharing of everything
/// is plenty …
const WORK_PER_BYTE: u64 = 4;
/// … but small files may share as much as they like, up to what costs half a gigabyte.
pub(super) const WORK_ALWAYS_ALLOWED: u64 = 1 << 22;
/// Bytes that compressed streams may hold for each byte of the file; real ones stay below 400 …
#[cfg(any(feature = "draco", feature = "meshopt"))]
const UNPACKED_PER_BYTE: u64 = 512;
/// … and what small files may.
#[cfg(any(feature = "draco", feature = "meshopt"))]
const UNPACKED_ALWAYS_ALLOWED: u64 = 1 << 26;

/// The extensions of buffer views that hold streams of meshoptimizer: the vendors' and its successor.
#[cfg(feature = "meshopt")]
pub(super) const MESHOPT_NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// A read file. All look-ups are checked; every error carries the file and a pointer.
pub(super) struct Document {
    pub(super) file: PathBuf,
    /// Whether URIs may lead out of the document's folder.
    allow_outside: bool,
    root: Value,
    /// The whole file, if it is a GLB with a binary chunk, and where that chunk lies.
    binary: Option<(Vec<u8>, Range<usize>)>,
    /// One slot a buffer, filled when it is first used.
    buffers: Vec<OnceCell<Arc<Vec<u8>>>>,
    /// One slot a buffer view, filled when a compressed one is first used.
    #[cfg(feature = "meshopt")]
    unpacked_views: Vec<OnceCell<Vec<u8>>>,
    /// Files read so far, so that a thousand buffers naming one file read it once.
    files: RefCell<HashMap<PathBuf, Arc<Vec<u8>>>>,
    /// Canonical paths of all files that the document names and may read.
    admitted: RefCell<BTreeSet<PathBuf>>,
    warnings: RefCell<Vec<Warning>>,
    /// Bytes read: the document and the buffers opened so far.
    bytes_held: Cell<u64>,
    /// Bytes that compressed streams held besides.
    bytes_unpacked: Cell<u64>,
    /// Elements made from them so far.
    work: Cell<u64>,
}

/// Bytes of a buffer view.
pub(super) struct View<'d> {
    pub(super) bytes: &'d [u8],
    pub(super) stride: Option<usize>,
    pub(super) pointer: String,
}

/// Whether loading may take as many bytes more.
fn fits(bytes: u64) -> Result<()> {
    match Room::left(1) {
        Some(Room { bytes: available, limit }) if bytes > available => Err(Error::Memory {
            what: "loading the scene",
            needed: bytes,
            parts: "what is in its files, and what is made of it".into(),
            available,
            limit,
            advice: "it takes more memory than this process may have".into(),
        }),
        _ => Ok(()),
    }
}

/// What a file is that people take for a scene, by its first bytes.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    let kinds: [(&[u8], &str); 19] = [
        (b"\x89PNG", "a PNG picture"),
        (b"\xff\xd8\xff", "a JPEG picture"),
        (b"\x76\x2f\x31\x01", "an OpenEXR picture"),
        (b"#?RADIANCE", "a Radiance picture (an environment? --env takes it)"),
        (b"#?RGBE", "a Radiance picture (an environment? --env takes it)"),
        (b"GIF8", "a GIF picture"),
        (b"II*\0", "a TIFF picture"),
        (b"MM\0*", "a TIFF picture"),
        (b"\xabKTX", "a KTX texture"),
        (b"PK\x03\x04", "a ZIP archive (.zip, .usdz, .3mf); unpack or convert it first"),
        (b"Kaydara FBX", "an FBX file; FBX2glTF or Blender converts it"),
        (b"; FBX", "an FBX file; FBX2glTF or Blender converts it"),
        (b"BLENDER", "a Blender file; export it as glTF 2.0"),
        (b"(\xb5/\xfd", "a compressed file (zstd), as Blender writes; export the scene as glTF 2.0"),
        (b"PXR-USDC", "a USD file; usd2gltf or Blender converts it"),
        (b"#usda", "a USD file; usd2gltf or Blender converts it"),
        (b"ply\n", "a PLY mesh; Blender converts it"),
        (b"solid ", "an STL mesh; Blender converts it"),
        (b"\x1f\x8b", "a file compressed by gzip; unpack it first"),
    ];
    kinds.iter().find(|(start, _)| bytes.starts_with(start)).map(|(_, kind)| *kind)
}

/// A warning's text without its numbers and names.
fn kind(what: &str) -> String {
    let outside = what.split('"').step_by(2);
    outside.flat_map(|part| part.chars().filter(|c| !c.is_ascii_digit())).collect()
}

impl Document {
    /// Reads a `.gltf` or `.glb`; its first bytes say which.
    pub(super) fn read(file: &Path, allow_outside: bool) -> Result<Document> {
        // Its text, and the values that are made of it.
        let length = std::fs::metadata(file).map_or(0, |data| data.len());
        fits(length.saturating_mul(4))?;
        let bytes = input::read(file).map_err(|source| Error::io(file, "read", source))?;
        Document::of_bytes(file, bytes, allow_outside)
    }

    /// The document that `bytes` are, under the name `file`.
    pub(super) fn of_bytes(file: &Path, bytes: Vec<u8>, allow_outside: bool) -> Result<Document> {
        fits((bytes.len() as u64).saturating_mul(3))?;
        Ok(Document { allow_outside, ..Document::parse(file, bytes)? })
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
        if let Some(kind) = foreign(&bytes) {
            return Err(invalid("/", format!("expected a glTF file (.gltf or .glb), found {kind}")));
        }
        if bytes.is_empty() {
            return Err(invalid("/", "expected a glTF file (.gltf or .glb), found an empty file".into()));
        }
        if named_glb && !is_glb {
            let found = &bytes[..bytes.len().min(4)];
            return Err(invalid("/", format!("expected the GLB magic `glTF`, found `{}`", found.escape_ascii())));
        }
        let chunks =
            if is_glb { glb_chunks(&bytes).map_err(|problem| invalid("/", problem))? } else { (0..bytes.len(), None) };
        let mut root: Value = serde_json::from_slice(without_mark(&bytes[chunks.0.clone()]))
            .map_err(|reason| invalid("/", format!("expected JSON, found {reason}")))?;
        if !root.is_object() {
            return Err(invalid("/", format!("expected a JSON object, found {}", brief(&root))));
        }
        normalise_root(&mut root);
        let mut document = Document {
            file: file.into(),
            allow_outside: false,
            root,
            binary: chunks.1.map(|range| (bytes, range)),
            buffers: Vec::new(),
            #[cfg(feature = "meshopt")]
            unpacked_views: Vec::new(),
            files: RefCell::default(),
            admitted: RefCell::default(),
            warnings: RefCell::default(),
            bytes_held: Cell::new(length),
            bytes_unpacked: Cell::default(),
            work: Cell::default(),
        };
        document.buffers.resize_with(document.table("buffers")?.len(), OnceCell::new);
        #[cfg(feature = "meshopt")]
        document.unpacked_views.resize_with(document.table("bufferViews")?.len(), OnceCell::new);
        document.check_asset()?;
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

    /// Accounts for `amount` triangles, instances or sparse elements about to be made. A small file whose parts refer
    /// to each other many times over would otherwise multiply into more than memory holds.
    pub(super) fn charge(&self, amount: usize, pointer: &str) -> Result<()> {
        let work = self.work.get().saturating_add(amount as u64);
        let held = self.bytes_held.get().saturating_add(self.bytes_unpacked.get());
        let allowed = WORK_ALWAYS_ALLOWED.max(WORK_PER_BYTE.saturating_mul(held));
        if work > allowed {
            let problem = format!(
                "expected at most {allowed} triangles, instances and sparse elements from {held} bytes of file, \
                 found {work}"
            );
            return Err(self.error(pointer, problem));
        }
        self.work.set(work);
        Ok(())
    }

    /// Accounts for bytes that a compressed stream holds: few may hold many, and be referred to many times.
    #[cfg(any(feature = "draco", feature = "meshopt"))]
    pub(super) fn unpack(&self, bytes: u64, pointer: &str) -> Result<()> {
        let (unpacked, held) = (self.bytes_unpacked.get().saturating_add(bytes), self.bytes_held.get());
        let allowed = UNPACKED_ALWAYS_ALLOWED.max(UNPACKED_PER_BYTE.saturating_mul(held));
        if unpacked > allowed {
            let problem =
                format!("expected at most {allowed} bytes in streams of {held} bytes of file, found {unpacked}");
            return Err(self.error(pointer, problem));
        }
        fits(bytes)?;
        self.bytes_unpacked.set(unpacked);
        Ok(())
    }

    /// Notes something that does not stop the work.
    pub(super) fn warn(&self, place: impl AsRef<str>, what: impl AsRef<str>) {
        self.warnings.borrow_mut().push(Warning { place: one_line(place.as_ref()), what: one_line(what.as_ref()) });
    }

    /// The warnings noted so far, taken out: of those that differ in numbers and names alone the first one, which says
    /// how many there are.
    pub(super) fn take_warnings(&self) -> Vec<Warning> {
        let mut kinds: HashMap<String, usize> = HashMap::new();
        let mut told: Vec<(Warning, usize)> = Vec::new();
        for warning in self.warnings.take() {
            let place = *kinds.entry(kind(&warning.what)).or_insert(told.len());
            match told.get_mut(place) {
                Some((_, more)) => *more += 1,
                None => told.push((warning, 0)),
            }
        }
        let counted = |(warning, more): (Warning, usize)| match more {
            0 => warning,
            more => Warning { what: format!("{} (and {more} more like it)", warning.what), ..warning },
        };
        told.into_iter().map(counted).collect()
    }

    /// The JSON value at `pointer`, if there is one.
    pub(super) fn value(&self, pointer: &str) -> Option<&Value> {
        self.root.pointer(pointer)
    }

    /// Sets the member of an object, or the element of an array, at `pointer`; nothing where that is in none.
    pub(super) fn set(&mut self, pointer: &str, value: Value) {
        let Some((parent, name)) = pointer.rsplit_once('/') else { return };
        match self.root.pointer_mut(parent) {
            Some(Value::Object(members)) => drop(members.insert(name.to_owned(), value)),
            Some(Value::Array(items)) => {
                if let Some(item) = name.parse().ok().and_then(|place: usize| items.get_mut(place)) {
                    *item = value;
                }
            }
            _ => {}
        }
    }

    /// Sets a member below objects that are there or made on the way, but for textures: those are not made. Whether it
    /// could.
    pub(super) fn set_below(&mut self, pointer: &str, value: Value) -> bool {
        let mut names = pointer.split('/').skip(1).peekable();
        let mut place = &mut self.root;
        while let Some(name) = names.next() {
            let is_last = names.peek().is_none();
            let next = match place {
                Value::Object(members) if is_last || members.contains_key(name) || !name.ends_with("Texture") => {
                    Some(members.entry(name).or_insert_with(|| Value::Object(serde_json::Map::new())))
                }
                Value::Array(items) => name.parse().ok().and_then(|index: usize| items.get_mut(index)),
                _ => None,
            };
            let Some(next) = next else { return false };
            place = next;
        }
        *place = value;
        true
    }

    /// The string at `pointer`, if there is one.
    pub(super) fn text(&self, pointer: &str) -> Result<Option<&str>> {
        match self.root.pointer(pointer) {
            None => Ok(None),
            Some(Value::String(text)) => Ok(Some(text)),
            Some(other) => Err(self.error(pointer, format!("expected a string, found {}", brief(other)))),
        }
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

    /// `value`, found at `pointer`, as an index of some table.
    pub(super) fn index(&self, value: &Value, pointer: &str) -> Result<usize> {
        let index = value.as_u64().and_then(|index| usize::try_from(index).ok());
        index.ok_or_else(|| self.error(pointer, format!("expected an index, found {}", brief(value))))
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
        let stride = view.byte_stride.map(|stride| stride.0);
        if let Some(stride) = stride.filter(|stride| !(4..=252).contains(stride)) {
            return Err(self.error(format!("{pointer}/byteStride"), format!("expected 4 to 252, found {stride}")));
        }
        #[cfg(feature = "meshopt")]
        if let Some(bytes) = self.unpacked(index, &pointer, view.byte_length.0)? {
            return Ok(View { bytes, stride, pointer });
        }
        let offset = view.byte_offset.unwrap_or_default().0;
        let bytes = self.part(view.buffer.value(), offset, view.byte_length.0, &pointer)?;
        Ok(View { bytes, stride, pointer })
    }

    /// `length` bytes from byte `offset` of a buffer, as the object at `pointer` asks.
    fn part(&self, buffer: usize, offset: u64, length: u64, pointer: &str) -> Result<&[u8]> {
        let buffer = self.buffer(buffer, &format!("{pointer}/buffer"))?;
        let end = offset.checked_add(length).filter(|&end| end <= buffer.len() as u64).ok_or_else(|| {
            let problem =
                format!("expected at most {} bytes, the length of its buffer, found {offset} + {length}", buffer.len());
            self.error(pointer, problem)
        })?;
        Ok(&buffer[offset as usize..end as usize])
    }

    /// What the stream of a compressed view holds, which is `length` bytes; `None` of a view without one.
    #[cfg(feature = "meshopt")]
    fn unpacked(&self, index: usize, view: &str, length: u64) -> Result<Option<&[u8]>> {
        let mut pointers = MESHOPT_NAMES.into_iter().map(|name| format!("{view}/extensions/{name}"));
        let Some(pointer) = pointers.find(|pointer| self.value(pointer).is_some()) else { return Ok(None) };
        let slot = &self.unpacked_views[index];
        if let Some(bytes) = slot.get() {
            return Ok(Some(bytes));
        }
        let number = |member: &str| {
            let at = format!("{pointer}/{member}");
            let value = self.value(&at).ok_or_else(|| self.error(&pointer, format!("missing field `{member}`")))?;
            self.index(value, &at)
        };
        let text = |member: &str| self.text(&format!("{pointer}/{member}"));
        let offset = self.value(&format!("{pointer}/byteOffset")).map_or(Ok(0), |_| number("byteOffset"))?;
        let bytes = self.part(number("buffer")?, offset as u64, number("byteLength")? as u64, &pointer)?;
        let (mode, filter) = (text("mode")?.unwrap_or("none"), text("filter")?.unwrap_or("NONE"));
        let stream = meshopt::Stream { bytes, mode, filter, count: number("count")?, stride: number("byteStride")? };
        let held = stream.length().map_err(|problem| self.error(&pointer, problem))?;
        if held as u64 != length {
            let problem = format!("expected {held} bytes, as its stream holds, found {length}");
            return Err(self.error(format!("{view}/byteLength"), problem));
        }
        self.unpack(length, &pointer)?;
        let bytes = stream.decode().map_err(|problem| self.error(&pointer, problem))?;
        Ok(Some(slot.get_or_init(|| bytes)))
    }

    fn buffer(&self, index: usize, from: &str) -> Result<&[u8]> {
        let slot = self.buffers.get(index).ok_or_else(|| self.out_of_range("buffers", index, from))?;
        let pointer = format!("/buffers/{index}");
        // Member by member: a buffer that holds its bytes in its URI is large, and asked for often.
        let wanted = match self.value(&format!("{pointer}/byteLength")) {
            Some(value) => self.index(value, &format!("{pointer}/byteLength"))?,
            None => return Err(self.error(pointer, "missing field `byteLength`")),
        };
        let bytes = match (self.text(&format!("{pointer}/uri"))?, &self.binary) {
            (None, Some((file, range))) if index == 0 => &file[range.clone()],
            (None, _) => {
                return Err(self.error(pointer, "expected a uri (only buffer 0 of a GLB may do without), found none"));
            }
            (Some(uri), _) => match slot.get() {
                Some(bytes) => bytes.as_slice(),
                None => {
                    let bytes = self.resource(uri, &format!("{pointer}/uri"), wanted as u64)?;
                    slot.get_or_init(|| bytes).as_slice()
                }
            },
        };
        let available = bytes.len();
        bytes.get(..wanted).ok_or_else(|| {
            self.error(
                format!("{pointer}/byteLength"),
                format!("expected at most the {available} bytes that there are, found {wanted}"),
            )
        })
    }

    /// What a URI refers to: bytes in itself, or a path relative to the document.
    pub(super) fn locate(&self, uri: &str, pointer: &str) -> Result<Resource> {
        uri::resolve(uri, self.file.parent().unwrap_or(Path::new(""))).map_err(|problem| self.error(pointer, problem))
    }

    /// The canonical path of a regular file that the document may read, or why there is none.
    pub(super) fn admit(&self, path: &Path) -> Result<PathBuf, String> {
        let unreadable = |reason: &dyn std::fmt::Display| format!("cannot read {}: {reason}", path.display());
        let canonical = path.canonicalize().map_err(|reason| unreadable(&reason))?;
        if !canonical.is_file() {
            return Err(unreadable(&"not a regular file"));
        }
        let folder = match self.file.parent() {
            Some(folder) if folder != Path::new("") => folder,
            _ => Path::new("."),
        };
        let folder = folder.canonicalize().map_err(|reason| unreadable(&reason))?;
        if !self.allow_outside && !canonical.starts_with(&folder) {
            return Err(unreadable(&"it lies outside of the scene's folder; --allow-outside reads it all the same"));
        }
        self.admitted.borrow_mut().insert(canonical.clone());
        Ok(canonical)
    }

    /// The document's own canonical path, and those of what it names.
    pub(super) fn inputs(&self) -> Vec<PathBuf> {
        self.file.canonicalize().into_iter().chain(self.admitted.borrow().iter().cloned()).collect()
    }

    /// The bytes behind a URI: a data URI, or the first `most` of a regular file relative to the document.
    fn resource(&self, uri: &str, pointer: &str, most: u64) -> Result<Arc<Vec<u8>>> {
        let path = match self.locate(uri, pointer)? {
            Resource::Inline(bytes) => {
                self.hold(bytes.len());
                return Ok(Arc::new(bytes));
            }
            Resource::File(path) => path,
        };
        let canonical = self.admit(&path).map_err(|problem| self.error(pointer, problem))?;
        // Of a file that several buffers name, the longest part that one of them wants.
        if let Some(bytes) = self.files.borrow().get(&canonical).filter(|bytes| bytes.len() as u64 >= most) {
            return Ok(bytes.clone());
        }
        // The bytes, and the arrays that are made of them.
        let length = std::fs::metadata(&canonical).map_or(0, |data| data.len()).min(most);
        fits(length.saturating_mul(3))?;
        let bytes = input::read_at_most(&canonical, most);
        let bytes =
            Arc::new(bytes.map_err(|reason| self.error(pointer, format!("cannot read {}: {reason}", path.display())))?);
        // Of a file that is read again and further, what is more: the bound on work grows with what files hold, not
        // with how often they are named.
        let before = self.files.borrow_mut().insert(canonical, bytes.clone());
        self.hold(bytes.len().saturating_sub(before.map_or(0, |before| before.len())));
        Ok(bytes)
    }

    /// Accounts for bytes read.
    fn hold(&self, bytes: usize) {
        self.bytes_held.set(self.bytes_held.get().saturating_add(bytes as u64));
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
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// A thousand buffers that name one file, each a byte more of it than the one before, and one that holds its bytes
    /// itself. Oracle: the bytes on disk that were read, the text, and the three bytes. Deterministic.
    #[test]
    fn a_file_counts_once_however_often_it_is_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        std::fs::write(folder.path().join("a.bin"), [0; 6000]).expect("a writable folder");
        let mut buffers: Vec<Value> = (0..1000).map(|i| json!({"uri": "a.bin", "byteLength": 4001 + i})).collect();
        buffers.push(json!({"uri": "data:application/octet-stream;base64,AAAA", "byteLength": 3}));
        let text = json!({"asset": {"version": "2.0"}, "buffers": buffers}).to_string();
        let file = folder.path().join("scene.gltf");
        let document = Document::of_bytes(&file, text.clone().into_bytes(), false).unwrap_or_else(|e| panic!("{e}"));
        for buffer in (0..1001).chain(0..1001) {
            document.buffer(buffer, "/").unwrap_or_else(|e| panic!("{e}"));
        }
        assert_eq!(document.bytes_held.get(), text.len() as u64 + 5000 + 3);
    }
}
