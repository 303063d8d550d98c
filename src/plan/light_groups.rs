//! Light groups: which lamp belongs to which. A lamp is whatever radiance begins at: a placed mesh that emits or is
//! unlit, a punctual light, the environment. The first pattern of the options that its name fits claims it; else the
//! group that its node names in the file does; the rest is in [`DEFAULT`]. Names are those of the nodes (`node 12`
//! where one has none), in scenes made in code without nodes those of meshes and lights; the environment is called
//! `environment`.
//!
//! Every group that an option or a node that shows something names has its layer, whether or not a lamp is in it.

use std::collections::BTreeSet;
use std::str::FromStr;

use crate::error::{Error, Result};
use crate::scene::light::{LONGEST_GROUP_NAME, is_group_name};
use crate::scene::{Instance, NodeId, Scene};

/// The group of what no other claims.
pub const DEFAULT: &str = "default";

/// What the environment is called.
pub const ENVIRONMENT: &str = "environment";

/// Most groups of a render: each takes 24 bytes a pixel.
pub const MOST_GROUPS: usize = 256;

/// A group and the lamps that it claims, `NAME=PATTERN` on the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LightGroup {
    /// Name of the group: its layer is `lightgroup_NAME`.
    pub name: String,
    /// What the names of its lamps look like: `*` stands for any text, `?` for any character.
    pub pattern: String,
}

impl LightGroup {
    /// The lamps whose names fit `pattern`.
    pub fn new(name: impl Into<String>, pattern: impl Into<String>) -> Self {
        LightGroup { name: name.into(), pattern: pattern.into() }
    }
}

impl FromStr for LightGroup {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('=').filter(|(name, pattern)| !name.is_empty() && !pattern.is_empty());
        let (name, pattern) = parts.ok_or_else(|| {
            format!("'{text}' is no light group; write NAME=PATTERN, as in key='Key*', or sky=environment")
        })?;
        Ok(LightGroup::new(name, pattern))
    }
}

/// The groups of a render; none where the layer is not asked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LightGroups {
    /// Their names, [`DEFAULT`] first, the others in alphabetical order.
    pub names: Vec<String>,
    /// Number of the group of each placement of the scene.
    instances: Vec<u16>,
    /// Of each punctual light.
    punctual: Vec<u16>,
    environment: u16,
}

impl LightGroups {
    /// Who belongs where.
    ///
    /// # Errors
    /// [`Error::Option`] for names that no layer can have, and for too many groups.
    pub(super) fn resolve(scene: &Scene, asked: &[LightGroup]) -> Result<Self> {
        check(asked)?;
        let of_nodes = scene.nodes.iter().filter_map(|node| node.light_group.as_ref());
        let named: BTreeSet<&String> = asked.iter().map(|group| &group.name).chain(of_nodes).collect();
        let others = named.into_iter().filter(|name| *name != DEFAULT);
        let names: Vec<String> = std::iter::once(DEFAULT.to_string()).chain(others.cloned()).collect();
        if names.len() > MOST_GROUPS {
            return refuse(format!("{} groups of options and scene; accepted are {MOST_GROUPS}", names.len()));
        }
        let number = |name: &String| names.iter().position(|known| known == name).unwrap_or(0) as u16;
        let asked_numbers: Vec<u16> = asked.iter().map(|group| number(&group.name)).collect();
        let node_numbers: Vec<u16> =
            scene.nodes.iter().map(|node| node.light_group.as_ref().map_or(0, number)).collect();
        let of = |name: &str, node: Option<NodeId>| {
            let claimed = asked.iter().position(|group| fits(&group.pattern, name));
            let own = || node.and_then(|node| node_numbers.get(node.index()).copied());
            claimed.map(|first| asked_numbers[first]).or_else(own).unwrap_or(0)
        };
        let instances = scene.instances.iter().map(|instance| of(name_of(scene, instance), instance.node)).collect();
        let punctual = (0..scene.punctual.len()).map(|i| of(name_of_light(scene, i), node_of_light(scene, i)));
        let punctual = punctual.collect();
        Ok(LightGroups { instances, punctual, environment: of(ENVIRONMENT, None), names })
    }

    /// The number of the group of this name.
    pub(super) fn number(&self, name: &str) -> Option<u16> {
        self.names.iter().position(|known| known == name).map(|number| number as u16)
    }

    /// Group of what placement `owner` of the scene emits.
    #[inline]
    pub fn of_instance(&self, owner: usize) -> u16 {
        self.instances.get(owner).copied().unwrap_or(0)
    }

    /// Group of punctual light `index`.
    #[inline]
    pub fn of_punctual(&self, index: usize) -> u16 {
        self.punctual.get(index).copied().unwrap_or(0)
    }

    /// Group of the environment.
    #[inline]
    pub fn of_environment(&self) -> u16 {
        self.environment
    }
}

/// Whether the names of `asked` can be those of layers.
pub(super) fn check(asked: &[LightGroup]) -> Result<()> {
    match asked.iter().find(|group| !is_group_name(&group.name)) {
        Some(LightGroup { name, .. }) => {
            refuse(format!("'{name}'; a name has 1 to {LONGEST_GROUP_NAME} bytes, no dots, and no spaces at its ends"))
        }
        None => Ok(()),
    }
}

/// Every lamp of `scene`: the number of its group, and its name.
pub(super) fn lamps<'a>(scene: &'a Scene, groups: &LightGroups) -> Vec<(u16, &'a str)> {
    let shines = |instance: &Instance| {
        let material = &scene.materials[scene.material_of(instance).index()];
        material.is_emissive() || material.unlit && material.base_color.max_element() > 0.0
    };
    let meshes = scene.instances.iter().enumerate().filter(|(_, instance)| shines(instance));
    let meshes = meshes.map(|(index, instance)| (groups.of_instance(index), name_of(scene, instance)));
    let lights = scene.punctual.iter().enumerate().filter(|(_, light)| light.intensity.max_element() > 0.0);
    let lights = lights.map(|(index, _)| (groups.of_punctual(index), name_of_light(scene, index)));
    let around = scene.environment.as_ref().map(|_| (groups.of_environment(), ENVIRONMENT));
    meshes.chain(lights).chain(around).collect()
}

/// The patterns that no lamp of `scene` fits.
pub(super) fn unmatched<'a>(scene: &'a Scene, asked: &'a [LightGroup]) -> impl Iterator<Item = &'a LightGroup> {
    let lamp = |material: usize| scene.materials[material].is_emissive() || scene.materials[material].unlit;
    let meshes = scene.instances.iter().filter(move |instance| lamp(scene.material_of(instance).index()));
    let names: Vec<&str> = (meshes.map(|instance| name_of(scene, instance)))
        .chain((0..scene.punctual.len()).map(|index| name_of_light(scene, index)))
        .chain(scene.environment.as_ref().map(|_| ENVIRONMENT))
        .collect();
    asked.iter().filter(move |group| !names.iter().any(|name| fits(&group.pattern, name)))
}

/// What a placed mesh is called.
fn name_of<'s>(scene: &'s Scene, instance: &Instance) -> &'s str {
    let node = instance.node.and_then(|node| scene.nodes.get(node.index()));
    node.map_or(&scene.meshes[instance.mesh.index()].name, |node| &node.name)
}

/// What punctual light `index` is called.
fn name_of_light(scene: &Scene, index: usize) -> &str {
    let node = node_of_light(scene, index).and_then(|node| scene.nodes.get(node.index()));
    node.map_or(&scene.punctual[index].name, |node| &node.name)
}

fn node_of_light(scene: &Scene, index: usize) -> Option<NodeId> {
    scene.light_nodes.get(index).copied().flatten()
}

fn refuse<T>(problem: String) -> Result<T> {
    Err(Error::Option { option: "--light-group", problem })
}

/// Whether `name` looks like `pattern`. What follows the last `*` that was met is tried at every later place, so the
/// time is at most the product of both lengths.
fn fits(pattern: &str, name: &str) -> bool {
    let (pattern, name): (Vec<char>, Vec<char>) = (pattern.chars().collect(), name.chars().collect());
    let (mut p, mut n, mut retry) = (0, 0, None);
    while n < name.len() {
        match pattern.get(p) {
            Some('*') => {
                p += 1;
                retry = Some((p, n));
            }
            Some(&c) if c == '?' || c == name[n] => (p, n) = (p + 1, n + 1),
            _ => {
                let Some((after, from)) = retry else { return false };
                (p, n) = (after, from + 1);
                retry = Some((after, from + 1));
            }
        }
    }
    pattern[p..].iter().all(|&c| c == '*')
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::Environment;
    use crate::scene::builder::SceneBuilder;

    /// Oracle: written by hand.
    #[test]
    fn patterns_are_globs() {
        let yes = [("*", ""), ("Key*", "Key.001"), ("*key", "monkey key"), ("a*b?d", "a--b-bcd"), ("?", "ß"), ("", "")];
        let no = [("Key", "Key.001"), ("key*", "Key"), ("?", ""), ("a*b?d", "abd"), ("", "a"), ("*.1", "a.12")];
        assert!(yes.iter().all(|(pattern, name)| fits(pattern, name)));
        assert!(!no.iter().any(|(pattern, name)| fits(pattern, name)));
    }

    /// Oracle: the page above. Patterns come before what the file says, the first before the second; lamps without
    /// either are in the default, and a group without lamps has a number.
    #[test]
    fn the_first_claim_counts() {
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::ONE, Vec3::ONE);
        for (name, group) in [("Key", Some("file")), ("Kicker", Some("file")), ("Rim", Some("file")), ("Fill", None)] {
            b.node(name, group).quad([Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y], lamp);
        }
        b.node("light", None).point_light(Vec3::ZERO, Vec3::ONE);
        b.environment(Environment::constant(Vec3::ONE));
        let scene = b.build();
        let asked = ["z=Ki*", "k=K*", "sky=env*", "none=nothing", "z=ligh?"].map(|text| text.parse().expect(text));
        let groups = LightGroups::resolve(&scene, &asked).expect("valid names");
        assert_eq!(groups.names, [DEFAULT, "file", "k", "none", "sky", "z"]);
        assert_eq!(groups.instances, [2, 5, 1, 0]);
        assert_eq!((&groups.punctual[..], groups.environment), (&[5][..], 4));
        assert_eq!(unmatched(&scene, &asked).map(|group| &group.name[..]).collect::<Vec<_>>(), ["none"]);
        for bad in ["a.b=*", " a=*", "a\n=*"] {
            assert!(LightGroups::resolve(&scene, &[bad.parse().expect(bad)]).is_err(), "{bad}");
        }
        assert!(["a", "=*", "a="].iter().all(|text| text.parse::<LightGroup>().is_err()));
    }
}
