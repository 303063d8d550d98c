//! Leaving effects out, one by one and by name: `--without`. Never by default; what is left out stays listed as asked
//! for and ignored, and is an entry of the ledger of biases.
//!
//! The rows of the table of effects say what can be left out, and how; besides them there are, in `named`, limits of
//! paths, techniques, groups of lamps. The scene remembers its part ([`Scene::left_out`]), so that options that are
//! made anew for it are settled by [`settle`]. Limit: the scene is changed in place; who wants it whole keeps a copy.

use super::asked::Asked;
pub use super::named::depth;
use super::{named, table};
use crate::error::{Error, Result};
use crate::plan::options::RenderOptions;
use crate::scene::geometry::Geometry;
use crate::scene::{LeftOut, Scene};

/// What an effect is that the scene does not call for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Absent {
    /// An error.
    Refused,
    /// Nothing to leave out: a scene at another time may call for it.
    Passed,
}

/// What can be left out of this render, with what calls for it: effects in the order of the table, then techniques and
/// groups of lamps.
pub fn choices(scene: &Scene, options: &RenderOptions) -> Vec<LeftOut> {
    let camera = options.camera.of(scene);
    let index = camera.and_then(|camera| scene.cameras.iter().position(|c| std::ptr::eq(c, camera)));
    // What is found by the flattened geometry is a matter of tracing, and no row that can be left out.
    let geometry = Geometry::default();
    let asked = Asked::new(scene, options, index.unwrap_or(0), &geometry);
    let found = table::removable().filter_map(|(name, reason)| {
        let reason = reason(&asked)?;
        Some(LeftOut { name: name.into(), found: format!("{name} ({reason})") })
    });
    found.chain(named::choices(&asked)).collect()
}

/// Leaves effects out of a scene and of options for it.
///
/// # Errors
/// [`Error::Option`] for a name that is unknown, or not called for, with the names that are.
pub fn leave_out(scene: &mut Scene, options: &mut RenderOptions, names: &[String], absent: Absent) -> Result<()> {
    let choices = choices(scene, options);
    let mut wanted: Vec<LeftOut> = Vec::new();
    for name in names {
        let known = || table::removal(name).is_some() || named::is_known(name);
        match named::unlisted(name, scene, options)
            .or_else(|| choices.iter().find(|choice| choice.name == *name).cloned())
        {
            Some(found) if wanted.contains(&found) => {}
            Some(found) => wanted.push(found),
            None if absent == Absent::Passed && known() => {}
            None => return Err(refused(name, &choices, options)),
        }
    }
    let (mut rest, techniques) = (options.clone(), options.strategy.techniques);
    wanted.iter().for_each(|left_out| named::change_options(&left_out.name, &mut rest));
    if (techniques.bsdf || techniques.light) && rest.strategy.name() == "none" {
        let problem = "technique:bsdf and technique:light: nothing would be left that finds light".into();
        return Err(Error::Option { option: "--without", problem });
    }
    // Twice: glass that becomes opaque has a coat, which may be left out as well.
    for LeftOut { name, .. } in wanted.iter().chain(&wanted) {
        table::removal(name).iter().for_each(|removal| removal.change_scene(scene));
        named::change_scene(name, scene, options);
    }
    scene.part_materials();
    scene.left_out.extend(wanted);
    settle(scene, options);
    Ok(())
}

/// Makes options fit what is left out of a scene.
pub fn settle(scene: &Scene, options: &mut RenderOptions) {
    for LeftOut { name, .. } in &scene.left_out {
        table::removal(name).iter().for_each(|removal| removal.change_options(options));
        named::change_options(name, options);
    }
}

fn refused(name: &str, choices: &[LeftOut], options: &RenderOptions) -> Error {
    let listed = choices.iter().map(|choice| choice.name.as_str());
    let limit = named::limits(options);
    let names: Vec<&str> = listed.chain(limit.as_deref()).collect();
    let what = match table::removal(name).is_some() || named::is_known(name) {
        true => "is not called for",
        false => "is no effect that can be left out",
    };
    let problem = format!("'{name}' {what}; this scene calls for {}", names.join(", "));
    Error::Option { option: "--without", problem }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use crate::plan::options::{Fog, Lens};
    use crate::scene::builder::SceneBuilder;
    use crate::scene::material::parameters::TextureSlot;
    use crate::scene::{AlphaMode, Environment, Material, Shutter, TextureId};

    /// A scene that calls for everything that can be left out, and options that do the rest.
    fn everything() -> (Scene, RenderOptions) {
        let mut b = SceneBuilder::new();
        let texture = Some(TextureSlot { texture: TextureId(0), uv_set: 0 });
        let opaque = b.material(Material {
            metallic: 0.5,
            base_color_texture: texture,
            metallic_roughness_texture: texture,
            glossiness_texture: texture,
            normal_texture: texture,
            emissive: Vec3::ONE,
            emissive_texture: texture,
            specular_texture: texture,
            vertex_colors: true,
            clearcoat: 1.0,
            clearcoat_texture: texture,
            clearcoat_normal_texture: texture,
            anisotropy: 0.5,
            anisotropy_texture: texture,
            iridescence: 1.0,
            iridescence_texture: texture,
            diffuse_transmission: 0.5,
            diffuse_transmission_texture: texture,
            sheen_color: Vec3::ONE,
            sheen_roughness: 0.5,
            sheen_color_texture: texture,
            alpha_mode: AlphaMode::Mask { cutoff: 0.5 },
            ..Material::default()
        });
        let clear = Material { metallic: 0.0, transmission: 1.0, ..Material::default() };
        let solid = b.material(Material {
            thickness: 1.0,
            dispersion: 1.0,
            attenuation_color: Vec3::splat(0.5),
            attenuation_distance_m: 1.0,
            multiscatter_color: Vec3::splat(0.5),
            ..clear.clone()
        });
        let thin = b.material(Material { transmission_texture: texture, ..clear });
        let blended = b.material(Material { alpha_mode: AlphaMode::Blend, base_alpha: 0.5, ..Material::default() });
        for (i, material) in [opaque, solid, thin, blended].into_iter().enumerate() {
            b.cuboid(Vec3::splat(3.0 * i as f32), Vec3::splat(3.0 * i as f32 + 1.0), false, material);
        }
        b.point_light(Vec3::Y, Vec3::ONE);
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let mut scene = b.build();
        for mesh in &mut scene.meshes {
            mesh.uvs = Some(vec![glam::Vec2::ZERO; mesh.positions.len()]);
            mesh.colors = Some(vec![glam::Vec4::ONE; mesh.positions.len()]);
            mesh.normals = Some(vec![Vec3::Y; mesh.positions.len()]);
        }
        let moved = glam::Affine3A::from_translation(Vec3::X);
        let steps = vec![scene.instances[0].world_from_object, moved * scene.instances[0].world_from_object];
        scene.motion.instances = vec![crate::scene::motion::Track { index: 0, steps }];
        scene.motion.shutter = Shutter::new(0.0, 1.0).ok();
        scene.environment = Some(Environment::constant(Vec3::ONE));
        let options = RenderOptions::new(4, 4)
            .lens(Lens { radius_m: 0.1, focus_m: 1.0 })
            .fog(Fog { sigma_t: 1.0, albedo: 0.5, g: 0.0 })
            .texture_filter(crate::plan::options::TextureFilter::Trilinear)
            .multiscatter(true)
            .backfaces(crate::plan::options::Backfaces::Hide);
        (scene, options)
    }

    /// Every row that can be left out is no more called for once it is, and nothing is called for that was not before.
    /// Oracle: the predicates of the table.
    #[test]
    fn what_is_left_out_is_not_called_for() {
        let (scene, options) = everything();
        let before = choices(&scene, &options);
        let missing: Vec<&str> =
            table::removable().map(|(name, _)| name).filter(|name| before.iter().all(|c| c.name != *name)).collect();
        assert!(missing.is_empty(), "the test's scene does not call for {missing:?}");
        for LeftOut { name, .. } in &before {
            let (mut scene, mut options) = (scene.clone(), options.clone());
            leave_out(&mut scene, &mut options, std::slice::from_ref(name), Absent::Refused).expect("called for");
            let after = choices(&scene, &options);
            assert!(after.iter().all(|choice| choice.name != *name), "{name} is still called for");
            let new: Vec<_> = after.iter().filter(|a| before.iter().all(|b| a.name != b.name)).collect();
            assert!(new.is_empty(), "{name}: {new:?}");
            assert_eq!(scene.left_out.len(), 1);
            // Again, as a frame at another time would.
            leave_out(&mut scene, &mut options, std::slice::from_ref(name), Absent::Passed).expect("known");
            assert!(leave_out(&mut scene, &mut options, std::slice::from_ref(name), Absent::Refused).is_err());
        }
        let all: Vec<String> = before.iter().map(|choice| choice.name.clone()).collect();
        let (mut none, mut none_options) = (scene.clone(), options.clone());
        let error = leave_out(&mut none, &mut none_options, &all, Absent::Refused).expect_err("no technique is left");
        assert!(error.to_string().contains("nothing would be left that finds light"), "{error}");
        let all: Vec<String> = all.into_iter().filter(|name| name != "technique:light").collect();
        let (mut none, mut options) = (scene, options);
        leave_out(&mut none, &mut options, &all, Absent::Refused).expect("all are called for");
        assert!(choices(&none, &options).is_empty());
    }

    /// A group that is left out is dark, and other placements of its material are lit. Oracle: the page of `named`.
    #[test]
    fn lamps_of_a_group_go_out_alone() {
        let mut b = SceneBuilder::new();
        let lamp = b.emitter(Vec3::ONE, Vec3::ONE);
        let corners = [Vec3::ZERO, Vec3::X, Vec3::ONE, Vec3::Y];
        b.node("key", Some("key")).quad(corners, lamp);
        b.node("fill", None).quad(corners.map(|corner| corner + Vec3::Z), lamp);
        b.node("spot", Some("key")).point_light(Vec3::ONE, Vec3::ONE);
        b.environment(Environment::constant(Vec3::ONE));
        b.camera(Vec3::ZERO, Vec3::Z, Vec3::Y, 1.0);
        let (scene, options) = (b.build(), RenderOptions::new(4, 4));
        let found: Vec<String> = choices(&scene, &options).into_iter().map(|choice| choice.found).collect();
        assert!(found.contains(&"light-group:key ('key' and 1 more)".to_string()), "{found:?}");
        assert!(found.contains(&"light-group:default ('fill' and 1 more)".to_string()), "{found:?}");
        let shines = |scene: &Scene| {
            let lit = |i: &crate::scene::Instance| scene.materials[scene.material_of(i).index()].is_emissive();
            let meshes: Vec<bool> = scene.instances.iter().map(lit).collect();
            (meshes, scene.punctual[0].intensity != Vec3::ZERO, scene.environment.is_some())
        };
        for (group, rest) in [("key", (vec![false, true], false, true)), ("default", (vec![true, false], true, false))]
        {
            let (mut scene, mut options) = (scene.clone(), options.clone());
            let name = format!("light-group:{group}");
            leave_out(&mut scene, &mut options, std::slice::from_ref(&name), Absent::Refused).expect("called for");
            assert_eq!(shines(&scene), rest, "{name}");
            assert!(choices(&scene, &options).iter().all(|choice| choice.name != name));
        }
        let (mut scene, mut options) = (scene, options);
        leave_out(&mut scene, &mut options, &["lamp:?????*".into()], Absent::Refused).expect("the environment");
        assert_eq!(shines(&scene), (vec![true, true], true, false));
        assert!(leave_out(&mut scene, &mut options, &["lamp:moon".into()], Absent::Refused).is_err());
    }

    #[test]
    fn names_that_say_nothing_are_refused() {
        let (scene, options) = everything();
        for name in ["bloom", "depth:0", "depth:64", "depth:x", "depth", "lambert", "technique:luck", ""] {
            let (mut scene, mut options) = (scene.clone(), options.clone());
            let error = leave_out(&mut scene, &mut options, &[name.into()], Absent::Passed);
            let text = error.expect_err(name).to_string();
            assert!(text.contains("--without") && text.contains("normal-maps") && text.contains("depth:N"), "{text}");
        }
        let (mut scene, mut short) = (scene, options.clone());
        leave_out(&mut scene, &mut short, &["depth:4".into()], Absent::Refused).expect("a limit");
        assert_eq!(short.max_depth, 4);
        let mut anew = options;
        settle(&scene, &mut anew);
        assert_eq!(anew.max_depth, 4);
    }
}
