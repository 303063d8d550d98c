//! The raw material of a document: GLB chunks, JSON made safe for the `gltf` crate's types, and short texts about
//! values.

use std::ops::Range;

use serde::de::DeserializeOwned;
use serde_json::{Value, json};

/// Members that the `gltf` crate reads as 32-bit numbers by dropping the upper half.
const NARROW_MEMBERS: &[&str] = &[
    "buffer",
    "bufferView",
    "camera",
    "componentType",
    "index",
    "indices",
    "light",
    "magFilter",
    "material",
    "mesh",
    "minFilter",
    "mode",
    "sampler",
    "source",
    "target",
    "wrapS",
    "wrapT",
];

/// Where the JSON and the binary chunk of a GLB lie (glTF 2.0 §4.4).
pub(super) fn glb_chunks(bytes: &[u8]) -> Result<(Range<usize>, Option<Range<usize>>), String> {
    let word = |at: usize| -> Option<u32> { Some(u32::from_le_bytes(bytes.get(at..at + 4)?.try_into().ok()?)) };
    let version = word(4).ok_or("expected a GLB header of 12 bytes, found the end of the file")?;
    let length = word(8).ok_or("expected a GLB header of 12 bytes, found the end of the file")? as usize;
    if version != 2 {
        return Err(format!("expected GLB version 2, found {version}"));
    }
    if length > bytes.len() {
        return Err(format!("expected {length} bytes of GLB as its header says, found {}", bytes.len()));
    }
    let (mut json, mut binary, mut at) = (None, None, 12);
    while at < length {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err(format!("expected a chunk header at byte {at}, found the end of the file"));
        };
        let start = at + 8;
        let end = start.checked_add(size as usize).filter(|&end| end <= length).ok_or_else(|| {
            format!("expected a chunk of at most {} bytes at byte {at}, found {size}", length.saturating_sub(start))
        })?;
        match &kind.to_le_bytes() {
            b"JSON" if json.is_none() => json = Some(start..end),
            b"BIN\0" if binary.is_none() => binary = Some(start..end),
            _ => {}
        }
        at = end;
    }
    Ok((json.ok_or("expected a JSON chunk in the GLB, found none")?, binary))
}

/// The text of a JSON document without a byte order mark, which readers may ignore (RFC 8259 §8.1).
pub(super) fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Drops `extras` (the crate cannot read them inside extensions; those of scenes and the light groups of nodes are
/// kept), makes integers of integral
/// numbers (4.0 is a count like 4, glTF 2.0 §2.7), and saturates numbers that the crate would wrap: index 2³² must
/// not become index 0.
pub(super) fn normalise_root(root: &mut Value) {
    let Value::Object(tables) = root else { return };
    for (name, table) in tables.iter_mut() {
        match table {
            Value::Array(scenes) if name == "scenes" => {
                for (name, member) in scenes.iter_mut().filter_map(Value::as_object_mut).flatten() {
                    match (name.as_str(), member.pointer_mut("/render")) {
                        ("extras", Some(render)) => normalise(render),
                        ("extras", None) => {}
                        _ => normalise(member),
                    }
                }
            }
            Value::Array(nodes) if name == "nodes" => {
                for node in nodes {
                    let group = node.pointer_mut("/extras/lightgroup").map(Value::take);
                    normalise(node);
                    if let (Some(group), Value::Object(members)) = (group, node) {
                        members.insert("extras".into(), json!({ "lightgroup": group }));
                    }
                }
            }
            other => normalise(other),
        }
    }
}

/// [`normalise_root`] below the root; the parser has bounded the depth.
fn normalise(value: &mut Value) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(normalise),
        Value::Object(members) => {
            members.remove("extras");
            for (name, member) in members.iter_mut() {
                normalise(member);
                if NARROW_MEMBERS.contains(&name.as_str()) {
                    saturate(member);
                } else if let ("attributes", Value::Object(semantics)) = (name.as_str(), &mut *member) {
                    semantics.values_mut().for_each(saturate);
                }
            }
        }
        Value::Number(number) if number.is_f64() => {
            if let Some(integer) = number.as_f64().and_then(integral) {
                *value = integer.into();
            }
        }
        _ => {}
    }
}

/// `number` as an integer, if it is one that f64 holds exactly. −0 stays what it is.
fn integral(number: f64) -> Option<u64> {
    const EXACT: f64 = (1u64 << f64::MANTISSA_DIGITS) as f64;
    let whole = number.is_sign_positive() && number.fract() == 0.0 && number <= EXACT;
    whole.then_some(number as u64)
}

fn saturate(value: &mut Value) {
    if value.as_u64().is_some_and(|number| number > u64::from(u32::MAX)) {
        *value = u32::MAX.into();
    }
}

/// Path below `value` of the member because of which it does not convert to `T`: the one whose removal changes the
/// message.
pub(super) fn culprit<T: DeserializeOwned>(value: &Value, message: &str) -> String {
    /// More members than any glTF object has; the search costs a conversion for each.
    const MEMBERS: usize = 64;
    let mut path = String::new();
    while let Some(Value::Object(members)) = value.pointer(&path) {
        let guilty = members.keys().take(MEMBERS).find(|name| {
            let mut without = value.clone();
            if let Some(Value::Object(members)) = without.pointer_mut(&path) {
                members.remove(*name);
            }
            !matches!(T::deserialize(&without), Err(reason) if reason.to_string() == message)
        });
        match guilty {
            Some(name) => path = format!("{path}/{}", name.replace('~', "~0").replace('/', "~1")),
            None => break,
        }
    }
    path
}

/// A JSON value in a few characters.
pub(super) fn brief(value: &Value) -> String {
    const SHOWN: usize = 40;
    match value {
        Value::Array(items) => format!("an array of {}", items.len()),
        Value::Object(_) => "an object".into(),
        other => {
            let text = other.to_string();
            match text.char_indices().nth(SHOWN) {
                Some((end, _)) => format!("{}…", &text[..end]),
                None => text,
            }
        }
    }
}

/// Errors and warnings are one line each, whatever a file's strings contain.
pub(super) fn one_line(text: &str) -> String {
    const LONGEST: usize = 500;
    text.chars()
        .take(LONGEST)
        .flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] })
        .collect()
}
