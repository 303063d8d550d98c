//! The node tree, flattened to one level: world transforms in f64, and what hangs on each node.
//!
//! Source: glTF 2.0 §3.5.3. Transforms are read from the JSON text as f64, not through the crate's f32, so that scenes
//! far from the origin keep their precision. The walk keeps its own stack: depth is bounded by the number of nodes
//! only. A node reached twice (a cycle, or two parents) is an error. Nodes that an animation drives, and those below
//! them, are posed at every time of the timeline; all others once.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};
use serde_json::Value;

use super::super::Node;
use super::super::light::{LONGEST_GROUP_NAME, is_group_name};
use super::animation::{Animations, Trs};
use super::document::Document;
use super::ext::{ext_mesh_gpu_instancing, khr_node_visibility};
use super::json::brief;
use super::morph;
use crate::error::Result;

/// Morph weights at each time of a timeline.
pub(super) type Morphs = Rc<[Vec<f64>]>;

/// A node that carries something.
#[derive(Debug)]
pub(super) struct Placed {
    /// `/nodes/N`.
    pub(super) pointer: String,
    pub(super) name: Option<String>,
    /// What it and its asset are called, named in the file or not.
    pub(super) called: Rc<Node>,
    pub(super) world_from_node: DAffine3,
    /// The same at each time of the timeline, if an animation drives the node or one above it and there is more than
    /// one time.
    pub(super) poses: Option<Rc<[DAffine3]>>,
    pub(super) mesh: Option<usize>,
    /// Of the mesh, whose node's transform then does not count.
    pub(super) skin: Option<usize>,
    pub(super) camera: Option<usize>,
    pub(super) light: Option<usize>,
    /// Of EXT_lights_ies.
    pub(super) lamp: Option<usize>,
    /// Morph weights when the shutter opens, in the place of the mesh's.
    pub(super) weights: Option<Rc<[f64]>>,
    /// Those at each time of the timeline, if they change while it is open.
    pub(super) morphs: Option<Morphs>,
    /// Whether an animation moves or bends its mesh, at these times or others.
    pub(super) animated: bool,
}

/// Morph weights of a node.
struct Weights {
    /// When the shutter opens.
    first: Option<Rc<[f64]>>,
    /// At each time, where they change.
    morphs: Option<Morphs>,
}

/// What drives nodes, and when they are sampled.
pub(super) struct Timeline<'a> {
    pub(super) animations: &'a Animations<'a>,
    /// Seconds; at least one. Where nodes stand by default is where they are at the first.
    pub(super) times_s: Vec<f64>,
}

/// Where a node's children hang.
struct Parent {
    world_from_node: DAffine3,
    poses: Option<Rc<[DAffine3]>>,
    driven: bool,
    is_visible: bool,
    /// Name of the root node; `None` above it.
    asset: Option<Rc<str>>,
}

/// The chosen scene's nodes.
pub(super) struct Nodes {
    /// Those that carry something, parents before children, in file order.
    pub(super) placed: Vec<Placed>,
    /// Node to world of all, by index, for files with skins; empty for others.
    pub(super) worlds: HashMap<usize, DAffine3>,
    /// The same at each time of the timeline, of nodes that an animation drives and where there is more than one time.
    pub(super) moving: HashMap<usize, Rc<[DAffine3]>>,
}

/// Walks the chosen scene.
pub(super) fn flatten(document: &Document, timeline: &Timeline) -> Result<Nodes> {
    let nodes = document.table("nodes")?;
    let mut reached = vec![false; nodes.len()];
    let (mut placed, mut worlds, mut moving) = (Vec::new(), HashMap::new(), HashMap::new());
    let skinned = !document.table("skins")?.is_empty();
    // Pending nodes with their parent and the pointer that refers to them; the last is visited next.
    let mut pending: Vec<(usize, Rc<Parent>, String)> = Vec::new();
    let world =
        Parent { world_from_node: DAffine3::IDENTITY, poses: None, driven: false, is_visible: true, asset: None };
    let world = Rc::new(world);
    for (root, from) in roots(document)?.into_iter().rev() {
        pending.push((root, world.clone(), from));
    }
    while let Some((index, parent, from)) = pending.pop() {
        let node = nodes.get(index).ok_or_else(|| document.out_of_range("nodes", index, &from))?;
        if std::mem::replace(&mut reached[index], true) {
            let problem =
                format!("node {index} is reached a second time: the nodes form a cycle, or it has two parents");
            return Err(document.error(from, problem));
        }
        let pointer = format!("/nodes/{index}");
        let reader = Reader { document, node, pointer: &pointer };
        let local = reader.local()?;
        let world_from_node = parent.world_from_node * timeline.at(document, index, &local, timeline.times_s[0])?;
        let driven = parent.driven || timeline.animations.driver(index).is_some();
        let poses = (driven && timeline.times_s.len() > 1).then(|| {
            document.charge(timeline.times_s.len(), &pointer)?;
            let at = |(i, &time_s): (usize, &f64)| {
                let world_from_parent = parent.poses.as_ref().map_or(parent.world_from_node, |poses| poses[i]);
                Ok(world_from_parent * timeline.at(document, index, &local, time_s)?)
            };
            timeline.times_s.iter().enumerate().map(at).collect::<Result<Rc<[DAffine3]>>>()
        });
        let poses = poses.transpose()?;
        if !world_from_node.is_finite() || poses.iter().flat_map(|poses| poses.iter()).any(|pose| !pose.is_finite()) {
            return Err(document.error(pointer, "expected a finite world transform, found one that overflows"));
        }
        let is_visible = parent.is_visible && khr_node_visibility::is_visible(document, &pointer)?;
        let name = node.get("name").and_then(Value::as_str).map(str::to_owned);
        let called = name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("node {index}"));
        let asset = parent.asset.clone().unwrap_or_else(|| called.as_str().into());
        let node_itself =
            Rc::new(Parent { world_from_node, poses: poses.clone(), driven, is_visible, asset: Some(asset.clone()) });
        for (place, child) in reader.array("children")?.iter().enumerate().rev() {
            let from = format!("{pointer}/children/{place}");
            pending.push((document.index(child, &from)?, node_itself.clone(), from));
        }
        if skinned {
            worlds.insert(index, world_from_node);
            if let Some(poses) = &poses {
                moving.insert(index, poses.clone());
            }
        }
        let mesh = reader.index("/mesh")?.filter(|_| is_visible);
        let skin = if mesh.is_some() { reader.index("/skin")? } else { None };
        let camera = reader.index("/camera")?;
        let light = reader.index("/extensions/KHR_lights_punctual/light")?.filter(|_| is_visible);
        let lamp = reader.index("/extensions/EXT_lights_ies/light")?.filter(|_| is_visible);
        if mesh.is_some() || camera.is_some() || light.is_some() || lamp.is_some() {
            let Weights { first: weights, morphs } = timeline.weights(document, index)?;
            let called = Rc::new(Node { name: called, asset: asset.to_string(), light_group: reader.light_group() });
            let node = Placed {
                pointer,
                name,
                called,
                world_from_node,
                poses,
                mesh,
                skin,
                camera,
                light,
                lamp,
                weights,
                morphs,
                // (Joints are somewhere else in the tree.)
                animated: driven || timeline.animations.drives_weights(index) || (skin.is_some() && timeline.drives()),
            };
            // A skinned mesh stands where its joints are, however often it is placed.
            let instances = if mesh.is_some() && skin.is_none() {
                ext_mesh_gpu_instancing::placements(document, &node.pointer)?
            } else {
                None
            };
            match instances {
                None => placed.push(node),
                Some(instances) => {
                    placed.extend(instances.iter().map(|instance| node.instance(instance)));
                    placed.push(Placed { mesh: None, ..node });
                }
            }
        }
    }
    Ok(Nodes { placed, worlds, moving })
}

/// A node's transform as the file states it.
enum Local {
    Matrix(DAffine3),
    Parts(Trs),
}

impl Placed {
    /// One instance of its mesh.
    fn instance(&self, node_from_instance: &DAffine3) -> Placed {
        let at = |world_from_node: &DAffine3| *world_from_node * *node_from_instance;
        Placed {
            pointer: self.pointer.clone(),
            name: self.name.clone(),
            called: self.called.clone(),
            world_from_node: at(&self.world_from_node),
            poses: self.poses.as_ref().map(|poses| poses.iter().map(at).collect()),
            mesh: self.mesh,
            skin: None,
            camera: None,
            light: None,
            lamp: None,
            weights: self.weights.clone(),
            morphs: self.morphs.clone(),
            animated: self.animated,
        }
    }

    /// Where its mesh stands.
    pub(super) fn world_from_mesh(&self) -> DAffine3 {
        if self.skin.is_some() { DAffine3::IDENTITY } else { self.world_from_node }
    }
}

impl Timeline<'_> {
    /// Whether there is an animation.
    fn drives(&self) -> bool {
        !self.animations.is_empty()
    }

    /// Node to parent at a time.
    fn at(&self, document: &Document, node: usize, local: &Local, time_s: f64) -> Result<DAffine3> {
        let parts = match (local, self.animations.driver(node)) {
            (Local::Matrix(matrix), None) => return Ok(*matrix),
            (Local::Matrix(_), Some(channel)) => {
                let problem = format!("expected an animated node without a matrix, found node {node} with one");
                return Err(document.error(format!("{channel}/target/node"), problem));
            }
            (Local::Parts(parts), None) => *parts,
            (Local::Parts(parts), Some(_)) => self.animations.pose(document, node, *parts, time_s)?,
        };
        Ok(DAffine3::from_scale_rotation_translation(parts.scale, parts.rotation, parts.translation))
    }

    /// The morph weights of a node at the first time, and at each if they change later.
    fn weights(&self, document: &Document, node: usize) -> Result<Weights> {
        let at = |&time_s: &f64| self.animations.weights(document, node, time_s);
        if !self.animations.drives_weights(node) {
            let own = morph::numbers(document, &format!("/nodes/{node}/weights"))?;
            return Ok(Weights { first: own.map(Rc::from), morphs: None });
        }
        let first = at(&self.times_s[0])?;
        let targets = first.as_ref().map_or(0, Vec::len);
        document.charge(targets.saturating_mul(self.times_s.len()) / 8, &format!("/nodes/{node}"))?;
        let all = self.times_s.iter().map(|time_s| Ok(at(time_s)?.unwrap_or_default()));
        let all: Vec<Vec<f64>> = all.collect::<Result<_>>()?;
        let morphs = all.iter().any(|weights| *weights != all[0]);
        Ok(Weights { first: first.map(Rc::from), morphs: morphs.then(|| all.into()) })
    }
}

/// Pointer of the chosen scene (glTF 2.0 §3.5.1: the default one, else the first), if the file has scenes.
pub(super) fn chosen_scene(document: &Document) -> Result<Option<String>> {
    let scenes = document.table("scenes")?.len();
    let chosen = match document.value("/scene") {
        Some(value) => document.index(value, "/scene")?,
        None if scenes == 0 => return Ok(None),
        None => 0,
    };
    if chosen >= scenes {
        return Err(document.out_of_range("scenes", chosen, "/scene"));
    }
    Ok(Some(format!("/scenes/{chosen}")))
}

/// Root nodes of the chosen scene and the pointers that name them; every parentless node if the file has no scenes.
fn roots(document: &Document) -> Result<Vec<(usize, String)>> {
    if let Some(scene) = chosen_scene(document)? {
        let pointer = format!("{scene}/nodes");
        let listed = document.array(&pointer)?.iter().enumerate();
        return listed
            .map(|(place, root)| {
                let from = format!("{pointer}/{place}");
                Ok((document.index(root, &from)?, from))
            })
            .collect();
    }
    let nodes = document.table("nodes")?;
    let mut is_child = vec![false; nodes.len()];
    for child in nodes.iter().filter_map(|node| node.get("children")?.as_array()).flatten().filter_map(Value::as_u64) {
        if let Some(mark) = usize::try_from(child).ok().and_then(|child| is_child.get_mut(child)) {
            *mark = true;
        }
    }
    if !nodes.is_empty() && is_child.iter().all(|&child| child) {
        return Err(document.error("/nodes", "expected a node without a parent, found none: the nodes form a cycle"));
    }
    Ok((0..nodes.len()).filter(|&node| !is_child[node]).map(|node| (node, format!("/nodes/{node}"))).collect())
}

struct Reader<'d> {
    document: &'d Document,
    node: &'d Value,
    pointer: &'d str,
}

impl Reader<'_> {
    /// The node's local transform: `matrix`, or translation, rotation and scale.
    fn local(&self) -> Result<Local> {
        if let Some(matrix) = self.numbers::<16>("matrix")? {
            let matrix = DMat4::from_cols_array(&matrix);
            if matrix.row(3) != DVec4::W {
                self.document.warn(self.at("matrix"), "has a last row other than 0 0 0 1, which is ignored");
            }
            let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(DVec4::truncate);
            let linear = DMat3::from_cols(columns[0], columns[1], columns[2]);
            return Ok(Local::Matrix(DAffine3 { matrix3: linear, translation: matrix.w_axis.truncate() }));
        }
        let translation = self.numbers::<3>("translation")?.map_or(DVec3::ZERO, DVec3::from);
        let scale = self.numbers::<3>("scale")?.map_or(DVec3::ONE, DVec3::from);
        let rotation = match self.numbers::<4>("rotation")? {
            None => DQuat::IDENTITY,
            Some(rotation) => {
                let length = DVec4::from(rotation).length();
                if length == 0.0 || !length.is_finite() {
                    return Err(self
                        .document
                        .error(self.at("rotation"), "expected a unit quaternion, found one without direction"));
                }
                DQuat::from_vec4(DVec4::from(rotation) / length)
            }
        };
        Ok(Local::Parts(Trs { translation, rotation, scale }))
    }

    fn numbers<const N: usize>(&self, member: &str) -> Result<Option<[f64; N]>> {
        let Some(value) = self.node.get(member) else { return Ok(None) };
        let items = value.as_array().filter(|items| items.len() == N);
        let items = items.ok_or_else(|| {
            self.document.error(self.at(member), format!("expected {N} numbers, found {}", brief(value)))
        })?;
        let mut numbers = [0.0; N];
        for (place, (number, item)) in numbers.iter_mut().zip(items).enumerate() {
            let problem = || {
                self.document
                    .error(format!("{}/{place}", self.at(member)), format!("expected a number, found {}", brief(item)))
            };
            *number = item.as_f64().filter(|number| number.is_finite()).ok_or_else(problem)?;
        }
        Ok(Some(numbers))
    }

    /// The light group that the node's `extras` name; a name that no layer can have is warned of and left out.
    fn light_group(&self) -> Option<String> {
        let group = self.node.pointer("/extras/lightgroup")?;
        let named = group.as_str().map(str::to_owned).filter(|name| is_group_name(name));
        if named.is_none() {
            let problem = format!("expected a name of up to {LONGEST_GROUP_NAME} bytes without dots, found ");
            self.document.warn(self.at("extras/lightgroup"), problem + &brief(group));
        }
        named
    }

    fn index(&self, member: &str) -> Result<Option<usize>> {
        let Some(value) = self.node.pointer(member) else { return Ok(None) };
        self.document.index(value, &format!("{}{member}", self.pointer)).map(Some)
    }

    fn array(&self, member: &str) -> Result<&[Value]> {
        match self.node.get(member) {
            None => Ok(&[]),
            Some(Value::Array(items)) => Ok(items),
            Some(other) => {
                Err(self.document.error(self.at(member), format!("expected an array, found {}", brief(other))))
            }
        }
    }

    fn at(&self, member: &str) -> String {
        format!("{}/{member}", self.pointer)
    }
}
