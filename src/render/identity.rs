//! What the bits of a picture depend on, as named values: scene, settings, build, instruction set. Saved renders carry
//! theirs, and what differs is refused by its name. The window and the range of samples are not among them: parts of
//! one picture differ in these.
//!
//! The scene is known by the contents of its files, whatever their names and folders; the build by the program's file.
//! Limit: scenes made in code have no files, so they are all the same here.

use std::fmt::Debug;
use std::io::Read;
use std::path::Path;

use glam::Affine3A;

use super::renderer::Renderer;
use crate::error::{Error, Result};
use crate::film::layer;
use crate::input;
use crate::math::hash::mix;
use crate::math::simd::detect;
use crate::plan::options::Backfaces;
use crate::scene::{Environment, Scene};

/// Named values.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Identity {
    /// Name and value, in a fixed order.
    pub values: Vec<(String, String)>,
}

/// Name of the value that says what shades and traces run on.
pub const ISA: &str = "isa";

/// Name of the value that says which program it was.
pub const BUILD: &str = "build";

/// Name of the value that lists the effects that are left out; there where any are.
const WITHOUT: &str = "without";

/// Names whose values may differ where one says so: the picture is then as right, but not the same in every bit.
pub const MAY_DIFFER: [&str; 2] = [ISA, BUILD];

impl Identity {
    /// Values that `other` has not: name, the value here, the value there ("none" where it has no such value).
    pub fn differences(&self, other: &Identity) -> Vec<(String, String, String)> {
        let find = |identity: &Identity, name: &str| {
            let found = identity.values.iter().find(|(known, _)| known == name);
            found.map_or("none".to_string(), |(_, value)| value.clone())
        };
        let mut names: Vec<&String> = self.values.iter().map(|(name, _)| name).collect();
        names.extend(other.values.iter().map(|(name, _)| name).filter(|name| find(self, name) == "none"));
        // What was left out explains what differs besides.
        names.sort_by_key(|name| *name != WITHOUT);
        let pairs = names.into_iter().map(|name| (name.clone(), find(self, name), find(other, name)));
        pairs.filter(|(_, here, there)| here != there).collect()
    }
}

impl Renderer<'_> {
    /// What the bits of this renderer's pictures depend on.
    ///
    /// # Errors
    /// [`Error::Io`] for a file of the scene that cannot be read again.
    pub fn identity(&self) -> Result<Identity> {
        let (scene, plan, backend) = (self.scene(), self.plan(), self.backend_info());
        let digest = digest_of_files(scene)?;
        let texels = |e: &Environment| {
            let bits = e.texels.iter().flat_map(|texel| texel.to_array().map(f32::to_bits));
            bits.fold(mix(e.width as u64, e.height as u64), |digest, bits| mix(digest, bits.into()))
        };
        let environment = scene.environment.as_ref().map(|e| (texels(e), e.rotation_rad, e.intensity));
        let text = |value: &dyn Debug| format!("{value:?}");
        let camera = &scene.cameras[plan.camera];
        let named = plan.aovs.iter().any(|&aov| layer::find(aov).is_of_ids());
        let values = [
            ("scene", format!("{digest:016x}")),
            ("content", format!("{:016x}", content_of(scene))),
            ("environment", text(&environment)),
            ("shutter", text(&scene.motion.shutter)),
            ("size", format!("{}x{}", plan.resolution.0, plan.resolution.1)),
            ("camera", format!("{} {:?}", plan.camera, camera)),
            ("lens", text(&plan.lens)),
            ("fog", text(&plan.fog)),
            ("filter", text(&plan.filter)),
            ("seed", plan.seed.to_string()),
            ("max-depth", plan.max_depth.to_string()),
            ("roulette", format!("{:?} from {}", plan.roulette, plan.roulette_start)),
            ("strategy", plan.strategy.to_string()),
            ("light-paths", plan.light_paths_text()),
            ("sampler", text(&plan.sampler)),
            ("texture-filter", if plan.features.footprints { "trilinear" } else { "exact" }.into()),
            ("fold-normals", plan.features.folded_normals.to_string()),
            ("aov", plan.aovs.iter().map(|aov| aov.name()).collect::<Vec<_>>().join(",")),
            ("backend", format!("{} {}", backend.kind.name(), backend.version)),
            ("robust", plan.robust.to_string()),
            (ISA, format!("{}, {}", detect::name(plan.avx512), backend.isa)),
            (BUILD, build()),
        ];
        let names = named.then(|| ("names", format!("{:016x}", names_of(scene))));
        let left_out: Vec<&str> = scene.left_out.iter().map(|left_out| left_out.name.as_str()).collect();
        let left_out = (!left_out.is_empty()).then(|| (WITHOUT, left_out.join(",")));
        let light_groups = plan.features.light_groups.then(|| {
            let digest = text(&plan.light_groups).bytes().fold(0, |digest, byte| mix(digest, byte.into()));
            ("light-groups", format!("{} {digest:016x}", plan.light_groups.names.join(",")))
        });
        let multiscatter = plan.features.multiscatter.then(|| ("multiscatter", "on".to_string()));
        let backfaces = plan.features.hidden_backs.then(|| {
            let kind = if plan.features.hidden_to_all { Backfaces::HideAll } else { Backfaces::Hide };
            ("backfaces", kind.name().to_string())
        });
        let guide = plan.guide.map(|guide| ("guide", format!("{} cells {:016x}", guide.guiding, guide.digest)));
        let values = left_out.into_iter().chain(values).chain(names).chain(light_groups);
        let values = values.chain(multiscatter).chain(backfaces).chain(guide);
        let values = values.map(|(name, value)| (name.to_string(), value));
        Ok(Identity { values: values.collect() })
    }
}

/// Version, and the contents of the program.
fn build() -> String {
    let version = env!("CARGO_PKG_VERSION");
    match std::env::current_exe().ok().and_then(|path| digest_of(&path).ok()) {
        Some(digest) => format!("{version} {digest:016x}"),
        None => version.to_string(),
    }
}

fn text(digest: u64, text: &str) -> u64 {
    text.bytes().fold(mix(digest, text.len() as u64), |digest, byte| mix(digest, byte.into()))
}

/// Digest of what layers of ids call the instances; materials have their part in [`content_of`].
fn names_of(scene: &Scene) -> u64 {
    (0..scene.instances.len())
        .fold(0, |digest, instance| text(text(digest, &scene.object_name(instance)), &scene.asset_name(instance)))
}

/// Digest of what is made of the files: which of their scenes, variants, poses and motions.
fn content_of(scene: &Scene) -> u64 {
    let mut digest = scene.materials.iter().fold(0, |digest, material| text(digest, &format!("{material:?}")));
    digest = scene.punctual.iter().fold(digest, |digest, light| text(digest, &format!("{light:?}")));
    for mesh in &scene.meshes {
        let vertices = mesh.positions.iter().flat_map(|position| position.to_array());
        digest = vertices.fold(text(digest, &mesh.name), |digest, value| mix(digest, value.to_bits().into()));
        let later = mesh.later.iter().flat_map(|shape| &shape.positions).flat_map(|position| position.to_array());
        digest = later.fold(digest, |digest, value| mix(digest, value.to_bits().into()));
        digest = mix(digest, u64::from(mesh.material.0));
    }
    let posed = |digest: u64, pose: &Affine3A| {
        pose.to_cols_array().iter().fold(digest, |digest, value| mix(digest, value.to_bits().into()))
    };
    for instance in &scene.instances {
        digest = mix(mix(digest, instance.mesh.0.into()), scene.material_of(instance).0.into());
        digest = posed(digest, &instance.world_from_object);
    }
    digest = scene.motion.animated.iter().fold(digest, |digest, &instance| mix(digest, instance as u64));
    for tracks in [&scene.motion.instances, &scene.motion.cameras] {
        digest = mix(digest, tracks.len() as u64);
        for track in tracks {
            digest = mix(mix(digest, track.index as u64), track.steps.len() as u64);
            digest = track.steps.iter().fold(digest, posed);
        }
    }
    digest
}

/// Digest of a scene's files, whatever their names.
///
/// # Errors
/// [`Error::Io`] for a file that cannot be read again.
pub fn digest_of_files(scene: &Scene) -> Result<u64> {
    let mut files = scene.inputs.iter().map(|path| digest_of(path)).collect::<Result<Vec<u64>>>()?;
    files.sort_unstable();
    Ok(files.iter().fold(0, |digest, file| mix(digest, *file)))
}

/// Digest of a file's contents; not cryptographic.
///
/// # Errors
/// [`Error::Io`] for a file that cannot be read.
pub fn digest_of(path: &Path) -> Result<u64> {
    let digest = || {
        let (mut file, length) = input::open(path)?;
        let (mut digest, mut buffer) = (mix(0, length), vec![0; 1 << 20]);
        loop {
            let mut filled = 0;
            while filled < buffer.len() {
                match file.read(&mut buffer[filled..])? {
                    0 => break,
                    more => filled += more,
                }
            }
            buffer[filled..].fill(0);
            let words = buffer[..filled.next_multiple_of(8)].chunks_exact(8);
            digest = words.fold(digest, |digest, word| mix(digest, u64::from_le_bytes(word.try_into().expect("8"))));
            if filled < buffer.len() {
                return Ok(digest);
            }
        }
    };
    digest().map_err(|source| Error::io(path, "read", source))
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::scene::builder::SceneBuilder;
    use crate::scene::motion::Track;

    /// Oracle: written by hand.
    #[test]
    fn differences_are_named_from_both_sides() {
        let identity = |values: &[(&str, &str)]| Identity {
            values: values.iter().map(|(name, value)| (name.to_string(), value.to_string())).collect(),
        };
        let (a, b) = (identity(&[("seed", "1"), ("size", "8x8")]), identity(&[("seed", "2"), ("isa", "avx2")]));
        let triple = |a: &str, b: &str, c: &str| (a.to_string(), b.to_string(), c.to_string());
        let expected = [triple("seed", "1", "2"), triple("size", "8x8", "none"), triple("isa", "none", "avx2")];
        assert_eq!(a.differences(&b), expected);
        assert!(a.differences(&a).is_empty());
    }

    /// One change of what is shown or of how it moves changes the digest. Oracle: the definition.
    #[test]
    fn contents_tell_motions_and_materials_apart() {
        let mut b = SceneBuilder::new();
        let (white, grey) = (b.lambert(Vec3::ONE), b.lambert(Vec3::splat(0.5)));
        b.cuboid(Vec3::splat(-1.0), Vec3::splat(1.0), true, white);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let still = b.build();
        let changed = |change: &dyn Fn(&mut Scene)| {
            let mut scene = still.clone();
            change(&mut scene);
            content_of(&scene)
        };
        let track = |x: f32| Track {
            index: 0,
            steps: vec![Affine3A::IDENTITY, Affine3A::from_translation(Vec3::new(x, 0.0, 0.0))],
        };
        let digests = [
            content_of(&still),
            changed(&|scene| scene.instances[0].material = Some(grey)),
            changed(&|scene| scene.motion.instances = vec![track(1.0)]),
            changed(&|scene| scene.motion.instances = vec![track(2.0)]),
            changed(&|scene| scene.motion.cameras = vec![track(1.0)]),
        ];
        for (i, digest) in digests.iter().enumerate() {
            assert!(!digests[..i].contains(digest), "{i}");
        }
        assert_eq!(changed(&|_| {}), digests[0]);
    }

    /// Any changed byte, and a longer or shorter file, change the digest.
    #[test]
    fn digests_tell_contents_apart() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let of = |bytes: &[u8]| {
            let path = folder.path().join("a");
            std::fs::write(&path, bytes).expect("a writable folder");
            digest_of(&path).expect("just written")
        };
        let all = [&b""[..], b"\0", b"a", b"ab", b"abcdefgh", b"abcdefg\0", b"abcdefghi", &[0; 1 << 20]].map(of);
        for (i, a) in all.iter().enumerate() {
            assert!(!all[..i].contains(a), "{i}");
        }
        assert_eq!(of(b"ab"), of(b"ab"));
    }
}
