//! Animations: what the channels make of a node's translation, rotation, scale and morph weights at a time in seconds.
//!
//! Source: glTF 2.0 §3.11 and Appendix C: STEP, LINEAR (rotations on the great circle, the short way), CUBICSPLINE
//! (Hermite, rotations normalised after). Times outside a sampler's keys take the first or last value. All animations
//! of the file run together unless one is chosen: exporters write one for each object; where two drive the same
//! property of a node the first one does, with a warning. Evaluated in f64. Of targets that
//! KHR_animation_pointer names, those of nodes are animated as others are; the rest are [`Pointed`]. Files are read so
//! only for a shutter.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DQuat, DVec3, DVec4};
use serde_json::Value;

use super::super::motion::Span;
use super::accessor::Accessor;
use super::document::Document;
use super::json::{brief, one_line};
use super::morph;
use crate::error::Result;

/// What a node's local transform is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trs {
    pub(super) translation: DVec3,
    /// Unit length.
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

/// The channels of the animations that run, by node.
#[derive(Default)]
pub(super) struct Animations<'d> {
    nodes: HashMap<usize, Vec<Channel<'d>>>,
    /// Those of morph weights, at most one a node.
    weights: HashMap<usize, Vec<Channel<'d>>>,
    /// The first animation that drives what a later one drives as well.
    shared: Option<usize>,
}

/// Drives one property of a node.
struct Channel<'d> {
    property: Property,
    sampler: Sampler<'d>,
    /// `/animations/N/channels/M`.
    pointer: String,
    animation: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Property {
    Translation,
    Rotation,
    Scale,
    /// Of so many morph targets.
    Weights(usize),
    /// Something else, of up to four numbers.
    Value,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

struct Sampler<'d> {
    /// Seconds, finite, strictly increasing, at least one. Some tools write keys before 0, against glTF 2.0 §3.11.
    keys: Rc<[f32]>,
    /// One element a key (of weights, one a target); three of cubic splines (in-tangent, value, out-tangent).
    values: Accessor<'d>,
    interpolation: Interpolation,
}

impl<'d> Animations<'d> {
    /// Reads and checks every channel of the file, or of one animation.
    pub(super) fn read(document: &'d Document, chosen: Option<usize>) -> Result<Animations<'d>> {
        let mut animations = Animations::default();
        let mut keys = HashMap::new();
        let listed = 0..document.table("animations")?.len();
        for animation in listed.filter(|animation| chosen.is_none_or(|chosen| chosen == *animation)) {
            let pointer = format!("/animations/{animation}");
            for place in 0..document.array(&format!("{pointer}/channels"))?.len() {
                let reader = ChannelReader { document, animation: pointer.clone(), place };
                match reader.target()? {
                    Target::Node(_, Property::Weights(0)) => {
                        document.warn(reader.at("/target"), "drives morph targets of a node without any; ignored");
                    }
                    Target::Node(node, property) => {
                        let sampler = reader.sampler(property, &mut keys)?;
                        let pointer = reader.at("");
                        animations.add(document, node, Channel { property, sampler, pointer, animation })?;
                    }
                    Target::Pointer(_) => {}
                    Target::Other => document.warn(reader.at("/target"), "is not a property of a node; ignored"),
                }
            }
        }
        if let Some(first) = animations.shared {
            let runs = &spans(document)?[first].name;
            let what = format!("several drive the same nodes, of which {runs} runs; --animation NAME runs another");
            document.warn("/animations", what);
        }
        Ok(animations)
    }

    fn add(&mut self, document: &Document, node: usize, channel: Channel<'d>) -> Result<()> {
        let channels = match channel.property {
            Property::Weights(_) => self.weights.entry(node).or_default(),
            _ => self.nodes.entry(node).or_default(),
        };
        match channels.iter().find(|other| other.property == channel.property) {
            None => channels.push(channel),
            Some(other) if other.animation == channel.animation => {
                let problem = format!("expected a target of its own, found that of {}", other.pointer);
                return Err(document.error(format!("{}/target", channel.pointer), problem));
            }
            // The earlier one runs.
            Some(other) => self.shared = Some(self.shared.map_or(other.animation, |first| first.min(other.animation))),
        }
        Ok(())
    }

    /// Whether nothing is driven.
    pub(super) fn is_empty(&self) -> bool {
        self.nodes.is_empty() && self.weights.is_empty()
    }

    /// The pointer of a channel that drives `node`, if one does.
    pub(super) fn driver(&self, node: usize) -> Option<&str> {
        self.nodes.get(&node).map(|channels| channels[0].pointer.as_str())
    }

    /// `rest` with what drives `node` at `time_s`.
    pub(super) fn pose(&self, document: &Document, node: usize, rest: Trs, time_s: f64) -> Result<Trs> {
        let mut pose = rest;
        for channel in self.nodes.get(&node).into_iter().flatten() {
            let value = channel.sampler.at(document, channel.property, time_s)?;
            match channel.property {
                Property::Translation => pose.translation = value.truncate(),
                Property::Rotation => pose.rotation = DQuat::from_vec4(value),
                Property::Scale => pose.scale = value.truncate(),
                Property::Weights(_) | Property::Value => {}
            }
        }
        Ok(pose)
    }

    /// Whether an animation drives the morph weights of `node`.
    pub(super) fn drives_weights(&self, node: usize) -> bool {
        self.weights.contains_key(&node)
    }

    /// The morph weights of `node` at `time_s`, where they are driven.
    pub(super) fn weights(&self, document: &Document, node: usize, time_s: f64) -> Result<Option<Vec<f64>>> {
        let channel = self.weights.get(&node).and_then(|channels| channels.first());
        channel.map(|channel| channel.sampler.weights_at(document, channel.property, time_s)).transpose()
    }
}

fn name_of(animation: &Value, index: usize) -> String {
    let name = animation.get("name").and_then(Value::as_str);
    name.map_or_else(|| format!("animation {index}"), |name| format!("animation '{name}'"))
}

/// The animations and their times, by the bounds that accessors of keys must state: nothing of a buffer is read, and
/// nothing refused but what is no list.
pub(super) fn spans(document: &Document) -> Result<Vec<Span>> {
    let bound = |sampler: &Value, member: &str| {
        let input = sampler.get("input")?.as_u64()?;
        let bound = document.value(&format!("/accessors/{input}/{member}/0"))?.as_f64()?;
        bound.is_finite().then_some(bound)
    };
    let span = |(index, animation): (usize, &Value)| {
        let samplers = animation.get("samplers").and_then(Value::as_array).into_iter().flatten();
        let spans = samplers.filter_map(|sampler| bound(sampler, "min").zip(bound(sampler, "max")));
        let seconds = spans.reduce(|(first, last), (from, to)| (first.min(from), last.max(to)));
        Span { name: one_line(&name_of(animation, index)), seconds }
    };
    Ok(document.table("animations")?.iter().enumerate().map(span).collect())
}

/// The extension by which animations drive anything.
pub(super) const POINTER: &str = "KHR_animation_pointer";

/// A value of the document that an animation drives.
pub(super) struct Pointed {
    /// JSON pointer.
    pub(super) pointer: String,
    /// When the shutter opens: a number, or an array of them.
    pub(super) value: Value,
    /// Whether it changes later.
    pub(super) moves: bool,
}

/// The values besides those of nodes that the animations drive at `times_s`.
pub(super) fn pointed(document: &Document, chosen: Option<usize>, times_s: &[f64]) -> Result<Vec<Pointed>> {
    let (mut all, mut keys) = (Vec::new(), HashMap::new());
    let listed = 0..document.table("animations")?.len();
    for animation in listed.filter(|animation| chosen.is_none_or(|chosen| chosen == *animation)) {
        let pointer = format!("/animations/{animation}");
        for place in 0..document.array(&format!("{pointer}/channels"))?.len() {
            let reader = ChannelReader { document, animation: pointer.clone(), place };
            let Target::Pointer(pointer) = reader.target()? else { continue };
            let sampler = reader.sampler(Property::Value, &mut keys)?;
            let at = |&time_s: &f64| sampler.at(document, Property::Value, time_s);
            let first = at(&times_s[0])?;
            let mut moves = false;
            for time_s in &times_s[1..] {
                moves = moves || at(time_s)? != first;
            }
            let numbers = &first.to_array()[..sampler.values.components.min(4)];
            let value = if let [number] = numbers { (*number).into() } else { numbers.to_vec().into() };
            all.push(Pointed { pointer, value, moves });
        }
    }
    Ok(all)
}

/// What a channel drives.
enum Target {
    Node(usize, Property),
    /// Something that KHR_animation_pointer names.
    Pointer(String),
    /// Something that an extension knows.
    Other,
}

struct ChannelReader<'d> {
    document: &'d Document,
    /// `/animations/N`.
    animation: String,
    place: usize,
}

impl<'d> ChannelReader<'d> {
    /// Pointer below the channel.
    fn at(&self, below: &str) -> String {
        format!("{}/channels/{}{below}", self.animation, self.place)
    }

    /// The index at `pointer`, below `count`, the length of the table of that name.
    fn index(&self, pointer: &str, table: &str) -> Result<usize> {
        let document = self.document;
        let value = document.value(pointer).ok_or_else(|| document.error(pointer, "expected an index, found nothing"));
        let index = document.index(value?, pointer)?;
        if index < document.array(&format!("/{table}"))?.len() {
            Ok(index)
        } else {
            Err(document.out_of_range(table, index, pointer))
        }
    }

    fn target(&self) -> Result<Target> {
        let at = self.at("/target");
        if let Some(pointer) = self.document.text(&format!("{at}/extensions/{POINTER}/pointer"))? {
            return self.pointed(pointer);
        }
        let path = self.document.value(&format!("{at}/path")).cloned().unwrap_or_default();
        let property = match path.as_str() {
            Some("translation") => Property::Translation,
            Some("rotation") => Property::Rotation,
            Some("scale") => Property::Scale,
            Some("weights") => Property::Weights(0),
            // An extension may define the target instead of a node.
            _ if self.document.value(&format!("{at}/extensions")).is_some() => return Ok(Target::Other),
            _ => {
                let problem = format!("expected translation, rotation, scale or weights, found {}", brief(&path));
                return Err(self.document.error(format!("{at}/path"), problem));
            }
        };
        let node = format!("{at}/node");
        if self.document.value(&node).is_none() {
            return Ok(Target::Other);
        }
        self.node(self.index(&node, "nodes")?, property)
    }

    /// What a pointer leads to.
    fn pointed(&self, pointer: &str) -> Result<Target> {
        let parts: Vec<&str> = pointer.split('/').collect();
        let ["", "nodes", node, property] = parts[..] else { return Ok(Target::Pointer(pointer.to_owned())) };
        let property = match property {
            "translation" => Property::Translation,
            "rotation" => Property::Rotation,
            "scale" => Property::Scale,
            "weights" => Property::Weights(0),
            _ => return Ok(Target::Pointer(pointer.to_owned())),
        };
        let count = self.document.table("nodes")?.len();
        match node.parse().ok().filter(|&node: &usize| node < count) {
            Some(node) => self.node(node, property),
            None => {
                let problem = format!("expected a node below {count}, found {}", one_line(pointer));
                Err(self.document.error(self.at("/target"), problem))
            }
        }
    }

    fn node(&self, index: usize, property: Property) -> Result<Target> {
        if property != Property::Weights(0) {
            return Ok(Target::Node(index, property));
        }
        let mesh = self.document.value(&format!("/nodes/{index}/mesh")).and_then(Value::as_u64);
        let mesh = mesh.and_then(|mesh| usize::try_from(mesh).ok());
        let targets = mesh.map(|mesh| morph::count(self.document, mesh)).transpose()?.unwrap_or(0);
        Ok(Target::Node(index, Property::Weights(targets)))
    }

    /// The channel's sampler; `keys` are those read before, by accessor.
    fn sampler(&self, property: Property, keys: &mut HashMap<usize, Rc<[f32]>>) -> Result<Sampler<'d>> {
        let document = self.document;
        let index = self.index(&self.at("/sampler"), &format!("{}/samplers", &self.animation[1..]))?;
        let at = |member: &str| format!("{}/samplers/{index}/{member}", self.animation);
        let interpolation = match document.value(&at("interpolation")).map(|name| (name, name.as_str())) {
            None | Some((_, Some("LINEAR"))) => Interpolation::Linear,
            Some((_, Some("STEP"))) => Interpolation::Step,
            Some((_, Some("CUBICSPLINE"))) => Interpolation::CubicSpline,
            Some((other, _)) => {
                let problem = format!("expected LINEAR, STEP or CUBICSPLINE, found {}", brief(other));
                return Err(document.error(at("interpolation"), problem));
            }
        };
        let input = self.index(&at("input"), "accessors")?;
        let keys = match keys.get(&input) {
            Some(known) => known.clone(),
            None => keys.entry(input).or_insert(read_keys(document, input, &at("input"))?).clone(),
        };
        let values = Accessor::open(document, self.index(&at("output"), "accessors")?, &at("output"))?;
        let (components, each): (&[usize], u64) = match property {
            Property::Weights(targets) => (&[1], targets as u64),
            Property::Rotation => (&[4], 1),
            Property::Translation | Property::Scale => (&[3], 1),
            Property::Value => (&[1, 2, 3, 4], 1),
        };
        values.expect_components(document, components)?;
        // Switches are integers.
        if property != Property::Value {
            values.expect_floats(document, !matches!(property, Property::Translation | Property::Scale))?;
        }
        let groups = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let wanted = (keys.len() as u64 * groups).saturating_mul(each);
        if values.count as u64 != wanted {
            let problem = format!("expected {wanted} values for {} keys, found {}", keys.len(), values.count);
            return Err(document.error(format!("{}/count", values.pointer), problem));
        }
        Ok(Sampler { keys, values, interpolation })
    }
}

/// Times of keys, checked.
fn read_keys(document: &Document, index: usize, from: &str) -> Result<Rc<[f32]>> {
    let input = Accessor::open(document, index, from)?;
    input.expect_components(document, &[1])?;
    input.expect_floats(document, false)?;
    document.charge(input.count, &input.pointer)?;
    let keys: Rc<[f32]> = (0..input.count).map(|key| input.vector::<1>(key)[0]).collect();
    if let Some(key) = keys.iter().position(|time| !time.is_finite()) {
        let problem = format!("expected finite times, found {} (key {key})", keys[key]);
        return Err(document.error(&input.pointer, problem));
    }
    if let Some(key) = keys.windows(2).position(|pair| pair[0] >= pair[1]) {
        let problem =
            format!("expected times that increase, found {} s after {} s (key {})", keys[key + 1], keys[key], key + 1);
        return Err(document.error(&input.pointer, problem));
    }
    Ok(keys)
}

impl Sampler<'_> {
    /// The value at `time_s` as a sum: groups of elements (one a key, three of cubic splines) and their coefficients.
    fn terms(&self, time_s: f64) -> Vec<(usize, f64)> {
        let keys = &self.keys;
        let cubic = self.interpolation == Interpolation::CubicSpline;
        let held = |key: usize| vec![(if cubic { 3 * key + 1 } else { key }, 1.0)];
        let after = keys.partition_point(|&key| f64::from(key) <= time_s);
        // Before the first key, and from the last one on.
        if after == 0 {
            return held(0);
        }
        let before = after - 1;
        if after == keys.len() {
            return held(before);
        }
        let span_s = f64::from(keys[after]) - f64::from(keys[before]);
        let s = (time_s - f64::from(keys[before])) / span_s;
        match self.interpolation {
            Interpolation::Step => held(before),
            Interpolation::Linear => vec![(before, 1.0 - s), (after, s)],
            Interpolation::CubicSpline => {
                let (s2, s3) = (s * s, s * s * s);
                vec![
                    (3 * before + 1, 2.0 * s3 - 3.0 * s2 + 1.0),
                    (3 * before + 2, span_s * (s3 - 2.0 * s2 + s)),
                    (3 * after + 1, 3.0 * s2 - 2.0 * s3),
                    (3 * after, span_s * (s3 - s2)),
                ]
            }
        }
    }

    /// The value at `time_s`; of rotations a unit quaternion.
    fn at(&self, document: &Document, property: Property, time_s: f64) -> Result<DVec4> {
        let is_rotation = property == Property::Rotation;
        let terms = self.terms(time_s);
        if let (true, Interpolation::Linear, &[(from, _), (to, s)]) = (is_rotation, self.interpolation, &terms[..]) {
            let end = |key| self.element(document, key, true).map(DQuat::from_vec4);
            return Ok(DVec4::from(end(from)?.slerp(end(to)?, s).normalize()));
        }
        let mut sum = DVec4::ZERO;
        for &(element, coefficient) in &terms {
            sum += self.element(document, element, false)? * coefficient;
        }
        if is_rotation { self.unit(document, sum, terms[0].0) } else { Ok(sum) }
    }

    /// The weights at `time_s`, one a target.
    fn weights_at(&self, document: &Document, property: Property, time_s: f64) -> Result<Vec<f64>> {
        let Property::Weights(targets) = property else { return Ok(Vec::new()) };
        let mut weights = vec![0.0; targets];
        for (group, coefficient) in self.terms(time_s) {
            for (target, weight) in weights.iter_mut().enumerate() {
                *weight += self.element(document, group * targets + target, false)?.x * coefficient;
            }
        }
        Ok(weights)
    }

    /// One element of the values, at unit length where asked for.
    fn element(&self, document: &Document, element: usize, unit: bool) -> Result<DVec4> {
        let value = DVec4::from_array(self.values.vector::<4>(element).map(f64::from));
        if !value.is_finite() {
            let problem = format!("expected finite values, found {value} (element {element})");
            return Err(document.error(&self.values.pointer, problem));
        }
        if unit { self.unit(document, value, element) } else { Ok(value) }
    }

    fn unit(&self, document: &Document, value: DVec4, element: usize) -> Result<DVec4> {
        value.try_normalize().ok_or_else(|| {
            let problem = format!("expected a unit quaternion, found one without direction (element {element})");
            document.error(&self.values.pointer, problem)
        })
    }
}
