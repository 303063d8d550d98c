//! Animations: what the channels make of a node's translation, rotation and scale at a time in seconds.
//!
//! Source: glTF 2.0 §3.11 and Appendix C: STEP, LINEAR (rotations on the great circle, the short way), CUBICSPLINE (Hermite, rotations
//! normalised after). Times outside a sampler's keys take the first or last value. All animations of the file run together: exporters
//! write one for each object; where two drive the same property of a node the first one does, with a warning. Evaluated in f64.
//! Limits: morph weights and targets that extensions define are named, not animated. Files are read so only for a shutter.

use std::collections::HashMap;
use std::rc::Rc;

use glam::{DQuat, DVec3, DVec4};
use serde_json::Value;

use super::super::motion::{Span, Unmoved};
use super::accessor::Accessor;
use super::document::Document;
use super::json::{brief, one_line};
use super::node::index_value;
use crate::error::Result;

/// What a node's local transform is made of.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trs {
    pub(super) translation: DVec3,
    /// Unit length.
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

/// The channels of all animations, by node.
#[derive(Default)]
pub(super) struct Animations<'d> {
    nodes: HashMap<usize, Vec<Channel<'d>>>,
    pub(super) unmoved: Vec<Unmoved>,
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
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Interpolation {
    Step,
    Linear,
    CubicSpline,
}

struct Sampler<'d> {
    /// Seconds, finite, at least 0, strictly increasing, at least one.
    keys: Rc<[f32]>,
    /// One element a key; three of cubic splines (in-tangent, value, out-tangent).
    values: Accessor<'d>,
    interpolation: Interpolation,
}

impl<'d> Animations<'d> {
    /// Reads and checks every channel of the file.
    pub(super) fn read(document: &'d Document) -> Result<Animations<'d>> {
        let listed = document.table("animations")?;
        let mut animations = Animations::default();
        let mut keys = HashMap::new();
        for animation in 0..listed.len() {
            let pointer = format!("/animations/{animation}");
            let name = one_line(&name_of(&listed[animation], animation));
            for place in 0..document.array(&format!("{pointer}/channels"))?.len() {
                let reader = ChannelReader { document, animation: pointer.clone(), place };
                match reader.target()? {
                    Target::Node(node, property) => {
                        let sampler = reader.sampler(property, &mut keys)?;
                        let pointer = reader.at("");
                        animations.add(document, node, Channel { property, sampler, pointer, animation })?;
                    }
                    Target::Weights => animations.leave_out(format!("morph targets of {name}")),
                    Target::Other => document.warn(reader.at("/target"), "is not a property of a node; ignored"),
                }
            }
        }
        Ok(animations)
    }

    /// Channels of one animation follow one another.
    fn leave_out(&mut self, what: String) {
        if self.unmoved.last().is_none_or(|last| last.what != what) {
            self.unmoved.push(Unmoved { what, why: "morph targets are not simulated".into() });
        }
    }

    fn add(&mut self, document: &Document, node: usize, channel: Channel<'d>) -> Result<()> {
        let channels = self.nodes.entry(node).or_default();
        match channels.iter().find(|other| other.property == channel.property) {
            None => channels.push(channel),
            Some(other) if other.animation == channel.animation => {
                let problem = format!("expected a target of its own, found that of {}", other.pointer);
                return Err(document.error(format!("{}/target", channel.pointer), problem));
            }
            Some(other) => document.warn(
                format!("{}/target", channel.pointer),
                format!("is already driven by {}; this channel is ignored", other.pointer),
            ),
        }
        Ok(())
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
            }
        }
        Ok(pose)
    }
}

fn name_of(animation: &Value, index: usize) -> String {
    let name = animation.get("name").and_then(Value::as_str);
    name.map_or_else(|| format!("animation {index}"), |name| format!("animation '{name}'"))
}

/// The animations and their times, by the bounds that accessors of keys must state: nothing of a buffer is read, and nothing refused but
/// what is no list.
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

/// What a channel drives.
enum Target {
    Node(usize, Property),
    Weights,
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
        let index = index_value(document, value?, pointer)?;
        if index < document.array(&format!("/{table}"))?.len() {
            Ok(index)
        } else {
            Err(document.out_of_range(table, index, pointer))
        }
    }

    fn target(&self) -> Result<Target> {
        let at = self.at("/target");
        let path = self.document.value(&format!("{at}/path")).cloned().unwrap_or_default();
        let property = match path.as_str() {
            Some("translation") => Property::Translation,
            Some("rotation") => Property::Rotation,
            Some("scale") => Property::Scale,
            Some("weights") => return Ok(Target::Weights),
            // An extension may define the target instead of a node.
            _ if self.document.value(&format!("{at}/extensions")).is_some() => return Ok(Target::Other),
            _ => {
                let problem = format!("expected translation, rotation, scale or weights, found {}", brief(&path));
                return Err(self.document.error(format!("{at}/path"), problem));
            }
        };
        let node = format!("{at}/node");
        match self.document.value(&node) {
            None => Ok(Target::Other),
            Some(_) => Ok(Target::Node(self.index(&node, "nodes")?, property)),
        }
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
        values.expect_components(document, if property == Property::Rotation { &[4] } else { &[3] })?;
        values.expect_floats(document, property == Property::Rotation)?;
        let wanted = keys.len() as u64 * if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
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
    if let Some(key) = keys.iter().position(|time| !(0.0..f32::INFINITY).contains(time)) {
        let problem = format!("expected finite times of at least 0 s, found {} (key {key})", keys[key]);
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
    /// The value at `time_s`; of rotations a unit quaternion.
    fn at(&self, document: &Document, property: Property, time_s: f64) -> Result<DVec4> {
        let keys = &self.keys;
        let after = keys.partition_point(|&key| f64::from(key) <= time_s);
        let is_rotation = property == Property::Rotation;
        let value = |key: usize| match self.interpolation {
            Interpolation::CubicSpline => self.element(document, 3 * key + 1, is_rotation),
            _ => self.element(document, key, is_rotation),
        };
        // Before the first key, and from the last one on.
        if after == 0 {
            return value(0);
        }
        if after == keys.len() {
            return value(after - 1);
        }
        let before = after - 1;
        let span_s = f64::from(keys[after]) - f64::from(keys[before]);
        let s = (time_s - f64::from(keys[before])) / span_s;
        match self.interpolation {
            Interpolation::Step => value(before),
            Interpolation::Linear if is_rotation => {
                let (a, b) = (DQuat::from_vec4(value(before)?), DQuat::from_vec4(value(after)?));
                Ok(DVec4::from(a.slerp(b, s).normalize()))
            }
            Interpolation::Linear => Ok(value(before)?.lerp(value(after)?, s)),
            Interpolation::CubicSpline => {
                let leaving = self.element(document, 3 * before + 2, false)? * span_s;
                let arriving = self.element(document, 3 * after, false)? * span_s;
                let (s2, s3) = (s * s, s * s * s);
                let sum = self.element(document, 3 * before + 1, false)? * (2.0 * s3 - 3.0 * s2 + 1.0)
                    + leaving * (s3 - 2.0 * s2 + s)
                    + self.element(document, 3 * after + 1, false)? * (3.0 * s2 - 2.0 * s3)
                    + arriving * (s3 - s2);
                if is_rotation { self.unit(document, sum, 3 * before + 1) } else { Ok(sum) }
            }
        }
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
