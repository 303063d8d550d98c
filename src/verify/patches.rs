//! The surfaces of a diffuse scene as patches: every triangle is cut into m² equal parts, m such that patches have
//! about the same area; lamps are cut finer, because shadow edges are as fine as they are. Each patch has two sides,
//! its front (2p) and its back (2p + 1); only fronts emit. Straight from the scene's own meshes and placements, in f64.

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::math::float;
use crate::scene::{Fact, Facts, Instance, Material, Mesh, Scene};

/// Lamps get at least this share of the patches.
const LAMP_SHARE: f64 = 0.1;

/// Finest of the subdivisions: each triangle becomes [`FINEST`]² patches at least.
pub const FINEST: u32 = 3;

/// Number of solutions that a check makes, of fineness 1 to [`FINEST`].
pub const SOLUTIONS: usize = FINEST as usize;

/// Triangles of the largest scene.
const MOST_TRIANGLES: u64 = 1_000;

/// Cosine of the angle to which vertex normals may leave their triangle (1.4 mrad) and still be called flat.
const FLAT: f32 = 1.0 - 1e-6;

/// A part of a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// World, counter-clockwise seen from the front.
    pub corners: [DVec3; 3],
    /// Unit, to the front.
    pub normal: DVec3,
    /// m².
    pub area: f64,
    /// Reflected fraction by channel.
    pub albedo: [f64; 3],
    /// Radiance of the front.
    pub emission: [f64; 3],
    /// How far off the surface a ray must start, metres; of the whole triangle.
    pub error: f32,
}

impl Patch {
    /// Point with these barycentric weights.
    pub fn point(&self, weights: [f64; 3]) -> DVec3 {
        self.corners[0] * weights[0] + self.corners[1] * weights[1] + self.corners[2] * weights[2]
    }
}

/// All patches of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Patches {
    list: Vec<Patch>,
}

/// One triangle of the world.
struct Whole {
    corners: [Vec3; 3],
    normal: DVec3,
    area: f64,
    albedo: [f64; 3],
    emission: [f64; 3],
}

impl Patches {
    /// Cuts `scene` into about `count` patches for a fineness of [`FINEST`], and into patches of `FINEST / fineness`
    /// times the side for less.
    pub fn of(scene: &Scene, count: usize, fineness: u32) -> Result<Self> {
        check(scene)?;
        let wholes: Vec<Whole> = scene.instances.iter().flat_map(|instance| wholes(scene, instance)).collect();
        let is_lamp = |whole: &Whole| whole.emission != [0.0; 3];
        let total: f64 = wholes.iter().map(|whole| whole.area).sum();
        let lamps: f64 = wholes.iter().filter(|whole| is_lamp(whole)).map(|whole| whole.area).sum();
        // Areas of the patches of fineness 1.
        let coarse = (count as f64 / f64::from(FINEST * FINEST)).max(1.0);
        let (area, lamp_area) = (total / coarse, (total / coarse).min(lamps / (LAMP_SHARE * coarse)));
        let mut list = Vec::new();
        for whole in &wholes {
            let target = if is_lamp(whole) { lamp_area } else { area };
            let parts = (whole.area / target).sqrt().round().max(1.0) as u32 * fineness;
            whole.cut(parts, &mut list);
        }
        Ok(Patches { list })
    }

    /// Number of patches; there are twice as many sides.
    pub fn len(&self) -> usize {
        self.list.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// The patches.
    pub fn iter(&self) -> std::slice::Iter<'_, Patch> {
        self.list.iter()
    }
}

impl Whole {
    /// Adds `parts`² equal parts.
    fn cut(&self, parts: u32, list: &mut Vec<Patch>) {
        let [a, b, c] = self.corners.map(|p| p.as_dvec3());
        let (e1, e2) = ((b - a) / f64::from(parts), (c - a) / f64::from(parts));
        let at = |i: u32, j: u32| a + e1 * f64::from(i) + e2 * f64::from(j);
        let [v0, v1, v2] = self.corners;
        let error = self.corners.iter().map(|&p| float::hit_error(v0, v1 - v0, v2 - v0, p)).fold(0.0, f32::max);
        let mut push = |corners| {
            list.push(Patch {
                corners,
                normal: self.normal,
                area: self.area / f64::from(parts * parts),
                albedo: self.albedo,
                emission: self.emission,
                error,
            });
        };
        for j in 0..parts {
            for i in 0..parts - j {
                push([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < parts {
                    push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
                }
            }
        }
    }
}

/// The triangles of one placement; a mirroring one turns the winding, so that the front stays the authored one.
fn wholes(scene: &Scene, instance: &Instance) -> Vec<Whole> {
    let mesh = &scene.meshes[instance.mesh.index()];
    let material = &scene.materials[scene.material_of(instance).index()];
    let m = &instance.world_from_object;
    let mirrored = m.matrix3.determinant() < 0.0;
    let whole = |&[a, b, c]: &[u32; 3]| {
        let order = if mirrored { [a, c, b] } else { [a, b, c] };
        let corners = order.map(|i| m.transform_point3(mesh.positions[i as usize]));
        let [v0, v1, v2] = corners.map(|p| p.as_dvec3());
        let cross = (v1 - v0).cross(v2 - v0);
        let twice_area = cross.length();
        (twice_area > 0.0).then(|| Whole {
            corners,
            normal: cross / twice_area,
            area: 0.5 * twice_area,
            albedo: material.base_color.to_array().map(f64::from),
            emission: material.emissive.to_array().map(f64::from),
        })
    };
    mesh.triangles.iter().filter_map(whole).collect()
}

/// Largest emission of all that is placed, by channel.
pub fn brightest(scene: &Scene) -> [f64; 3] {
    let material = |instance: &Instance| &scene.materials[scene.material_of(instance).index()];
    let largest = scene.instances.iter().map(|instance| material(instance).emissive).fold(Vec3::ZERO, Vec3::max);
    largest.to_array().map(f64::from)
}

/// The error that names what the solver does not know.
pub(super) fn refusal(scene: &Scene, pointer: &str, problem: String) -> Error {
    Error::InvalidScene { file: scene.file.clone(), pointer: pointer.into(), problem }
}

/// Refuses what the solver does not know.
///
/// # Errors
/// [`Error::InvalidScene`] naming the material, mesh or light.
pub fn check(scene: &Scene) -> Result<()> {
    let refuse = |pointer: String, problem: String| Err(refusal(scene, &pointer, problem));
    if scene.environment.is_some() || scene.punctual.iter().any(|light| light.intensity.max_element() > 0.0) {
        return refuse("/".into(), "verify knows emissive surfaces as the only light; here are others".into());
    }
    let mut emits = false;
    for instance in &scene.instances {
        let mesh = &scene.meshes[instance.mesh.index()];
        let index = scene.material_of(instance).index();
        let material = &scene.materials[index];
        if let Some(why) = not_diffuse(material) {
            let problem = format!("material '{}' {why}; verify solves untextured Lambert surfaces only", material.name);
            return refuse(format!("/materials/{index}"), problem);
        }
        if let Some(triangle) = bent_triangle(mesh) {
            let problem =
                format!("triangle {triangle} of '{}' is shaded smooth; verify knows flat ones only", mesh.name);
            return refuse(format!("/meshes ('{}')", mesh.name), problem);
        }
        emits |= material.is_emissive();
    }
    if !emits {
        return refuse("/materials".into(), "nothing that is placed emits; verify needs an emissive surface".into());
    }
    let triangles = scene.triangle_count();
    if triangles > MOST_TRIANGLES {
        return refuse("/meshes".into(), format!("{triangles} triangles; verify solves up to {MOST_TRIANGLES}"));
    }
    Ok(())
}

/// What hits on a diffuse surface may turn out to be.
const DIFFUSE: [Fact; 2] = [Fact::Black, Fact::Lambert];

/// What keeps a material from being an untextured Lambert surface.
fn not_diffuse(material: &Material) -> Option<&'static str> {
    let facts = Facts::of(material);
    [
        (facts.has(Fact::Unlit), "is unlit"),
        (facts.transmits(), "transmits light"),
        (facts.has(Fact::Metal), "is a metal"),
        (facts.has(Fact::Coat), "has a specular coat (specularFactor above 0)"),
        (facts.has(Fact::Textures), "has textures"),
        (facts.has(Fact::VertexColors), "has vertex colours"),
        (facts.has(Fact::Uncovered), "is not opaque"),
        (Fact::MODELS.into_iter().any(|model| facts.has(model) && !DIFFUSE.contains(&model)), "is not diffuse"),
    ]
    .into_iter()
    .find_map(|(is, why)| is.then_some(why))
}

/// The first triangle whose vertex normals are not its own.
fn bent_triangle(mesh: &Mesh) -> Option<usize> {
    let normals = mesh.normals.as_ref()?;
    mesh.triangles.iter().position(|corners| {
        let [a, b, c] = corners.map(|i| mesh.positions[i as usize]);
        let n = (b - a).cross(c - a).normalize_or_zero();
        n != Vec3::ZERO && corners.iter().any(|&i| normals[i as usize].normalize_or_zero().dot(n) < FLAT)
    })
}
