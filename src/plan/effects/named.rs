//! What can be left out besides the rows of the table, by names with a colon: `depth:N`, paths of more than N edges;
//! `technique:NAME`, one way of finding light; `light-group:NAME`, the lamps of a group; `lamp:PATTERN`, those whose
//! names look so.
//!
//! A technique is no effect: those that stay find the same light, but for what is stated (punctual lights are found by
//! light samples alone), so that leaving it out costs efficiency and is no bias. Groups are those that the file or the
//! options name ([`light_groups`]); where there are none, a few lamps are listed by their names. Lamps that are left
//! out stay as black surfaces. Limit: without BSDF or light sampling, techniques that surveys decide on are left out as
//! well, unless they are asked for.

use std::collections::BTreeSet;

use glam::Vec3;

use super::asked::Asked;
use super::{guide, light_paths};
use crate::plan::light_groups::{self, LightGroup, LightGroups};
use crate::plan::options::{Guiding, LightPaths, RenderOptions};
use crate::scene::{LeftOut, Material, MaterialId, Scene};

/// Name of the limit of paths, before the colon.
const DEPTH: &str = "depth";

/// Of a way of finding light.
const TECHNIQUE: &str = LeftOut::TECHNIQUE;

/// Of a group of lamps.
const GROUP: &str = "light-group";

/// Of lamps by their names.
const LAMP: &str = "lamp";

/// Most lamps that are listed by their names.
const MOST_LAMPS: usize = 8;

/// What follows `kind` and a colon in `name`.
fn of_kind<'n>(name: &'n str, kind: &str) -> Option<&'n str> {
    name.strip_prefix(kind)?.strip_prefix(':')
}

/// A technique: its name, whether a render calls for it, and what takes it out.
type Technique = (&'static str, fn(&Asked) -> bool, fn(&mut RenderOptions));

const TECHNIQUES: [Technique; 4] = [
    ("bsdf", mixes, |options| options.strategy.techniques.bsdf = false),
    ("light", mixes, |options| options.strategy.techniques.light = false),
    (
        "light-paths",
        |asked| light_paths::wanted(asked) && light_paths::refusal(asked).is_none(),
        |options| {
            options.light_paths = LightPaths::Off;
        },
    ),
    ("guide", guide::wanted, |options| options.guiding = Guiding::Off),
];

/// Whether there is light, and two techniques find it: the last is never left out.
fn mixes(asked: &Asked) -> bool {
    let techniques = asked.options.strategy.techniques;
    techniques.bsdf && techniques.light && guide::is_lit(asked)
}

/// The techniques and groups that can be left out of a render.
pub fn choices(asked: &Asked) -> Vec<LeftOut> {
    let called = TECHNIQUES.iter().filter(|(_, called, _)| called(asked));
    let techniques = called.map(|(name, ..)| LeftOut {
        name: format!("{TECHNIQUE}:{name}"),
        found: format!("{TECHNIQUE}:{name} (finds light)"),
    });
    techniques.chain(groups(asked.scene, asked.options)).collect()
}

/// Groups that have a lamp, where any was named; else lamps by name, if they are few and not one alone.
fn groups(scene: &Scene, options: &RenderOptions) -> Vec<LeftOut> {
    let Ok(groups) = LightGroups::resolve(scene, &options.light_groups) else { return Vec::new() };
    let lamps = light_groups::lamps(scene, &groups);
    if groups.names.len() > 1 {
        let of = |number| move |lamp: &&(u16, &str)| usize::from(lamp.0) == number;
        let named = groups.names.iter().enumerate();
        return named.filter_map(|(number, name)| group(GROUP, name, lamps.iter().filter(of(number)))).collect();
    }
    let names: BTreeSet<&str> = lamps.iter().map(|lamp| lamp.1).collect();
    if !(2..=MOST_LAMPS).contains(&names.len()) {
        return Vec::new();
    }
    let plain = names.iter().filter(|name| !name.contains(['*', '?', ',']) && !name.is_empty());
    plain.filter_map(|name| group(LAMP, name, lamps.iter().filter(|lamp| lamp.1 == *name))).collect()
}

/// These lamps, as something to be left out.
fn group<'l>(kind: &str, name: &str, lamps: impl Iterator<Item = &'l (u16, &'l str)>) -> Option<LeftOut> {
    let names: Vec<&str> = lamps.map(|lamp| lamp.1).collect();
    let first = names.first()?;
    let found = match names.len() {
        1 => format!("{kind}:{name} ('{first}')"),
        count => format!("{kind}:{name} ('{first}' and {} more)", count - 1),
    };
    Some(LeftOut { name: format!("{kind}:{name}"), found })
}

/// A limit of the length of paths, if `options` have a higher one.
pub fn depth(options: &RenderOptions, edges: u32) -> Option<LeftOut> {
    let found = format!("paths of more than {edges} edges (up to {})", options.max_depth);
    (1..options.max_depth).contains(&edges).then(|| LeftOut { name: format!("{DEPTH}:{edges}"), found })
}

/// What has this name and is in no list: limits of paths, lamps by a pattern.
pub fn unlisted(name: &str, scene: &Scene, options: &RenderOptions) -> Option<LeftOut> {
    if let Some(pattern) = of_kind(name, LAMP) {
        let (groups, number) = fitting(scene, pattern)?;
        let lamps = light_groups::lamps(scene, &groups);
        return group(LAMP, pattern, lamps.iter().filter(|lamp| lamp.0 == number));
    }
    depth(options, of_kind(name, DEPTH)?.parse().ok()?)
}

/// The lamps whose names look like `pattern` as a group, and its number.
fn fitting(scene: &Scene, pattern: &str) -> Option<(LightGroups, u16)> {
    // No group of a file is called so by chance.
    const FITTING: &str = "--without";
    let groups = LightGroups::resolve(scene, &[LightGroup::new(FITTING, pattern)]).ok()?;
    let number = groups.number(FITTING)?;
    Some((groups, number))
}

/// How the limits of `options` are written; nothing where there is none.
pub fn limits(options: &RenderOptions) -> Option<String> {
    (options.max_depth > 1).then(|| format!("{DEPTH}:N (N from 1 to {})", options.max_depth - 1))
}

/// Whether a scene at another time, or other options, may call for what has this name.
pub fn is_known(name: &str) -> bool {
    let technique = of_kind(name, TECHNIQUE).is_some_and(|own| TECHNIQUES.iter().any(|(known, ..)| *known == own));
    technique || of_kind(name, GROUP).or(of_kind(name, LAMP)).is_some()
}

/// Takes what has this name out of a scene.
pub fn change_scene(name: &str, scene: &mut Scene, options: &RenderOptions) {
    let group = of_kind(name, GROUP).and_then(|group| {
        let groups = LightGroups::resolve(scene, &options.light_groups).ok()?;
        let number = groups.number(group)?;
        Some((groups, number))
    });
    if let Some((groups, number)) = group.or_else(|| fitting(scene, of_kind(name, LAMP)?)) {
        put_out(scene, &groups, number);
    }
}

/// Takes what has this name out of options.
pub fn change_options(name: &str, options: &mut RenderOptions) {
    if let Some(edges) = of_kind(name, DEPTH).and_then(|edges| edges.parse().ok()) {
        options.max_depth = options.max_depth.min(edges);
    }
    let technique = of_kind(name, TECHNIQUE).and_then(|own| TECHNIQUES.iter().find(|(known, ..)| *known == own));
    if let Some((.., change)) = technique {
        change(options);
    }
}

/// The lamps of a group go out; other placements keep the materials that they share with them.
fn put_out(scene: &mut Scene, groups: &LightGroups, number: u16) {
    let mut dark: Vec<(MaterialId, MaterialId)> = Vec::new();
    for index in 0..scene.instances.len() {
        let lit = scene.material_of(&scene.instances[index]);
        let material = &scene.materials[lit.index()];
        if groups.of_instance(index) != number || !(material.is_emissive() || material.unlit) {
            continue;
        }
        let own = match dark.iter().find(|(known, _)| *known == lit) {
            Some((_, own)) => *own,
            None => {
                let own = MaterialId(scene.materials.len() as u32);
                scene.materials.push(unlit(material));
                dark.push((lit, own));
                own
            }
        };
        scene.instances[index].material = Some(own);
    }
    for (index, light) in scene.punctual.iter_mut().enumerate() {
        if groups.of_punctual(index) == number {
            light.intensity = Vec3::ZERO;
        }
    }
    if groups.of_environment() == number {
        scene.environment = None;
    }
}

/// The material of a lamp that is off.
fn unlit(material: &Material) -> Material {
    let mut off = Material { emissive: Vec3::ZERO, emissive_texture: None, ..material.clone() };
    if off.unlit {
        (off.base_color, off.base_color_texture, off.vertex_colors) = (Vec3::ZERO, None, false);
    }
    off
}
