//! The meshes that the chosen scene shows: one for each primitive, read once however often it is placed, and in however
//! many materials that are alike ([`Material::may_share`](crate::scene::Material::may_share)).

use std::collections::{HashMap, HashSet};

use serde_json::Value;

use super::super::motion::Off;
use super::super::{Dropped, MaterialId, Mesh, MeshId};
use super::changing::Poses;
use super::document::Document;
use super::ext::khr_materials_variants;
use super::json::one_line;
use super::material::MaterialTable;
use super::mesh;
use super::morph;
use super::node::{Nodes, Placed};
use super::skin::Skin;
use crate::error::Result;

/// The meshes in use: one for each primitive, grouped by the glTF mesh that holds them.
pub(super) struct Meshes {
    pub(super) list: Vec<Mesh>,
    of_form: HashMap<Form, Vec<Shown>>,
    /// The form in which each node shows its mesh.
    forms: Vec<Option<Form>>,
    /// The mesh whose vertices are furthest from the straight lines between its shapes.
    pub(super) off: Option<Off>,
}

/// A mesh and what it is made of, if that is not its own material.
#[derive(Clone, Copy)]
pub(super) struct Shown {
    pub(super) mesh: MeshId,
    pub(super) material: Option<MaterialId>,
}

/// What a primitive's triangles and vertices follow from: its JSON without the material, and the form of its mesh.
type Shape = (String, Option<usize>, Vec<u64>);

/// Meshes read before, by their shape, with the material that each was read for.
#[derive(Default)]
struct Shapes(HashMap<Shape, Vec<(MeshId, Option<MaterialId>)>>);

impl Shapes {
    fn of(document: &Document, primitive: &str, form: &Form) -> Shape {
        let mut value = document.value(primitive).cloned().unwrap_or_default();
        if let Some(members) = value.as_object_mut() {
            members.remove("material");
            if let Some(extensions) = members.get_mut("extensions").and_then(Value::as_object_mut) {
                extensions.remove(khr_materials_variants::NAME);
            }
            members.retain(|_, member| member.as_object().is_none_or(|object| !object.is_empty()));
        }
        (value.to_string(), form.skin, form.weights.clone())
    }

    /// A mesh of that shape that may be shown in another material.
    fn find(&self, shape: &Shape, material: MaterialId, list: &[Mesh], materials: &MaterialTable) -> Option<Shown> {
        let known = self.0.get(shape)?;
        let fits = |&&(mesh, read_for): &&(MeshId, Option<MaterialId>)| {
            let own = list[mesh.index()].material;
            // One that needed another material than the file's is shown in that alone.
            read_for == Some(own) && (own == material || materials.may_share(own, material))
        };
        known.iter().find(fits).map(|&(mesh, _)| {
            let own = list[mesh.index()].material;
            Shown { mesh, material: (own != material).then_some(material) }
        })
    }
}

/// One shape of a mesh.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Form {
    /// Index into `/meshes`.
    mesh: usize,
    /// Index into `/skins`.
    skin: Option<usize>,
    /// Bits of the morph weights, none where nothing is displaced; of those that change, at each time as well.
    weights: Vec<u64>,
}

impl Meshes {
    /// Those of the node at `place` of the placed nodes.
    pub(super) fn of(&self, place: usize) -> &[Shown] {
        let form = self.forms.get(place).and_then(Option::as_ref);
        form.and_then(|form| self.of_form.get(form)).map_or(&[], Vec::as_slice)
    }
}

/// Numbers of the materials that the meshes of `nodes` are made of.
pub(super) fn materials_in_use(document: &Document, nodes: &[Placed]) -> HashSet<usize> {
    let shown: HashSet<usize> = nodes.iter().filter_map(|node| node.mesh).collect();
    let primitives = shown.iter().filter_map(|mesh| document.value(&format!("/meshes/{mesh}/primitives"))?.as_array());
    let materials = primitives.flatten().filter_map(|primitive| primitive.get("material").and_then(Value::as_u64));
    materials.filter_map(|material| usize::try_from(material).ok()).collect()
}

/// Reads every mesh that a node shows, in the order of the nodes.
pub(super) fn read(
    document: &Document,
    nodes: &Nodes,
    materials: &mut MaterialTable,
    dropped: &mut Dropped,
) -> Result<Meshes> {
    let mut meshes = Meshes { list: Vec::new(), of_form: HashMap::new(), forms: Vec::new(), off: None };
    let mut shapes = Shapes::default();
    for node in &nodes.placed {
        let Some(index) = node.mesh else {
            meshes.forms.push(None);
            continue;
        };
        let weights = morph::weights(document, node.weights.as_deref(), index)?;
        let later = node.morphs.iter().flat_map(|morphs| morphs.iter().flatten());
        let bits = weights.iter().chain(later).map(|weight| weight.to_bits()).collect();
        let form = Form { mesh: index, skin: node.skin, weights: bits };
        meshes.forms.push(Some(form.clone()));
        if meshes.of_form.contains_key(&form) {
            continue;
        }
        let source: gltf::json::Mesh = document.element("meshes", index, &format!("{}/mesh", node.pointer))?;
        let name = source.name.clone().unwrap_or_else(|| format!("mesh {index}"));
        let world = |joint: usize| nodes.worlds.get(&joint).copied();
        let skin = node.skin.map(|skin| Skin::read(document, skin, &world)).transpose()?;
        let poses = Poses::of(document, node, nodes, &weights);
        let mut shown = Vec::with_capacity(source.primitives.len());
        for (place, primitive) in source.primitives.iter().enumerate() {
            let pointer = format!("/meshes/{index}/primitives/{place}");
            let shape = Shapes::of(document, &pointer, &form);
            let material = primitive.material.map(|material| MaterialId(material.value() as u32));
            if let Some(known) = material.and_then(|id| shapes.find(&shape, id, &meshes.list, materials)) {
                document.charge(1, &pointer)?;
                shown.push(known);
                continue;
            }
            let name = format!("{name}/primitive {place}");
            let (skin, poses) = (skin.as_ref(), poses.as_ref());
            let place = mesh::Place { pointer: &pointer, name, skin, weights: &weights, poses };
            if let Some((mesh, distance_m)) = mesh::read(document, primitive, place, materials, dropped)? {
                if distance_m > meshes.off.as_ref().map_or(0.0, |worst| worst.distance_m) {
                    meshes.off = Some(Off { name: one_line(&mesh.name), distance_m });
                }
                let id = MeshId(meshes.list.len() as u32);
                shapes.0.entry(shape).or_default().push((id, material));
                shown.push(Shown { mesh: id, material: None });
                meshes.list.push(mesh);
            }
        }
        meshes.of_form.insert(form, shown);
    }
    if meshes.list.is_empty() {
        let problem = match dropped.degenerate_triangles {
            0 => "expected triangles in the scene, found none: there is nothing to render".into(),
            n => format!("expected at least one triangle with an area in the scene, found {n} without"),
        };
        return Err(document.error("/meshes", problem));
    }
    Ok(meshes)
}
