//! References between the tables of a document, all looked at once at the beginning: an index past the end of its table
//! is an error wherever it stands, also in what the scene does not show. What is no index at all is for its reader to
//! refuse.

use serde_json::Value;

use super::document::Document;
use crate::error::Result;

/// Where an index stands (`*` is every member or element), and the table that it counts in. What hangs on nodes is
/// checked where nodes are walked, too.
const REFERENCES: &[(&str, &str)] = &[
    ("accessors/*/bufferView", "bufferViews"),
    ("accessors/*/sparse/indices/bufferView", "bufferViews"),
    ("accessors/*/sparse/values/bufferView", "bufferViews"),
    ("animations/*/channels/*/target/node", "nodes"),
    ("animations/*/samplers/*/input", "accessors"),
    ("animations/*/samplers/*/output", "accessors"),
    ("bufferViews/*/buffer", "buffers"),
    ("bufferViews/*/extensions/EXT_meshopt_compression/buffer", "buffers"),
    ("bufferViews/*/extensions/KHR_meshopt_compression/buffer", "buffers"),
    ("images/*/bufferView", "bufferViews"),
    ("meshes/*/primitives/*/attributes/*", "accessors"),
    ("meshes/*/primitives/*/extensions/KHR_draco_mesh_compression/bufferView", "bufferViews"),
    ("meshes/*/primitives/*/extensions/KHR_materials_variants/mappings/*/material", "materials"),
    ("meshes/*/primitives/*/indices", "accessors"),
    ("meshes/*/primitives/*/material", "materials"),
    ("meshes/*/primitives/*/targets/*/*", "accessors"),
    ("nodes/*/camera", "cameras"),
    ("nodes/*/children/*", "nodes"),
    ("nodes/*/extensions/EXT_mesh_gpu_instancing/attributes/*", "accessors"),
    ("nodes/*/extensions/EXT_lights_ies/light", "extensions/EXT_lights_ies/lights"),
    ("nodes/*/extensions/KHR_lights_punctual/light", "extensions/KHR_lights_punctual/lights"),
    ("nodes/*/mesh", "meshes"),
    ("nodes/*/skin", "skins"),
    ("scenes/*/nodes/*", "nodes"),
    ("skins/*/inverseBindMatrices", "accessors"),
    ("skins/*/joints/*", "nodes"),
    ("skins/*/skeleton", "nodes"),
    ("textures/*/extensions/EXT_texture_webp/source", "images"),
    ("textures/*/extensions/KHR_texture_basisu/source", "images"),
    ("textures/*/sampler", "samplers"),
    ("textures/*/source", "images"),
];

/// Fails at the first reference past the end of its table.
pub(super) fn check(document: &Document) -> Result<()> {
    let root = document.value("").expect("a document has a root");
    for (path, table) in REFERENCES {
        let check = Check { document, table, count: document.table(table)?.len() };
        check.follow(root, path, &mut String::new())?;
    }
    // Channels count in the samplers of their own animation.
    for animation in 0..document.table("animations")?.len() {
        let table = format!("animations/{animation}/samplers");
        let check = Check { document, table: &table, count: document.table(&table)?.len() };
        let channels = format!("/animations/{animation}/channels");
        if let Some(value) = document.value(&channels) {
            check.follow(value, "*/sampler", &mut channels.clone())?;
        }
    }
    let textures = Check { document, table: "textures", count: document.table("textures")?.len() };
    match document.value("/materials") {
        Some(materials) => textures.of_textures(materials, &mut "/materials".to_owned()),
        None => Ok(()),
    }
}

struct Check<'d> {
    document: &'d Document,
    table: &'d str,
    count: usize,
}

impl Check<'_> {
    /// Follows `path` from `value`, which stands at `pointer`.
    fn follow(&self, value: &Value, path: &str, pointer: &mut String) -> Result<()> {
        let (name, rest) = path.split_once('/').unwrap_or((path, ""));
        if path.is_empty() {
            return self.index(value, pointer);
        }
        let length = pointer.len();
        let mut step = |name: &str, member: &Value| {
            pointer.push('/');
            pointer.push_str(name);
            let checked = self.follow(member, rest, pointer);
            pointer.truncate(length);
            checked
        };
        match value {
            Value::Object(members) if name == "*" => members.iter().try_for_each(|(name, member)| step(name, member)),
            Value::Array(items) if name == "*" => {
                items.iter().enumerate().try_for_each(|(place, item)| step(&place.to_string(), item))
            }
            Value::Object(members) => members.get(name).map_or(Ok(()), |member| step(name, member)),
            _ => Ok(()),
        }
    }

    /// Looks at the `index` of every texture information below `value`: a member whose name ends in `Texture`.
    fn of_textures(&self, value: &Value, pointer: &mut String) -> Result<()> {
        let length = pointer.len();
        let mut step = |name: &str, member: &Value| {
            pointer.push('/');
            pointer.push_str(name);
            let is_information = name.ends_with("Texture");
            let checked = if is_information { self.follow(member, "index", pointer) } else { Ok(()) };
            let checked = checked.and_then(|()| self.of_textures(member, pointer));
            pointer.truncate(length);
            checked
        };
        match value {
            Value::Object(members) => members.iter().try_for_each(|(name, member)| step(name, member)),
            Value::Array(items) => {
                items.iter().enumerate().try_for_each(|(place, item)| step(&place.to_string(), item))
            }
            _ => Ok(()),
        }
    }

    fn index(&self, value: &Value, pointer: &str) -> Result<()> {
        let past = |index: u64| usize::try_from(index).map_or(true, |index| index >= self.count);
        match value.as_u64().filter(|&index| past(index)) {
            Some(index) => {
                Err(self.document.out_of_range(self.table, usize::try_from(index).unwrap_or(usize::MAX), pointer))
            }
            None => Ok(()),
        }
    }
}
