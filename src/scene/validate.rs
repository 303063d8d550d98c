//! The contract of [`Scene`] in one place: what every loader and builder promises to those who read it.
//!
//! Checked: ids point into their tables, attribute tables are as long as the vertices, numbers are finite, sizes agree.
//! A scene without triangles is valid here; whether that is an error is for the loader of a file to say.

use glam::{Vec3, Vec4};

use super::motion::MOST_PARTS;
use super::{Camera, Mesh, Projection, Scene, Shape};
use crate::error::{Error, Result};

impl Scene {
    /// Checks everything that the documentation of [`Scene`]'s fields promises.
    pub fn validate(&self) -> Result<()> {
        self.check().map_err(|at| self.invalid(at))
    }

    /// Checks the motion alone. No render does without: a pose that has no inverse would end the process inside Embree.
    pub(crate) fn validate_motion(&self) -> Result<()> {
        self.check_motion().map_err(|at| self.invalid(at))
    }

    fn invalid(&self, (pointer, problem): (String, String)) -> Error {
        Error::InvalidScene { file: self.file.clone(), pointer, problem }
    }

    fn check(&self) -> Result<(), (String, String)> {
        for (index, mesh) in self.meshes.iter().enumerate() {
            let fail = |problem: String| Err((format!("mesh {index} \"{}\"", mesh.name), problem));
            if mesh.material.index() >= self.materials.len() {
                return fail(format!("expected a material below {}, found {}", self.materials.len(), mesh.material.0));
            }
            if let Some(problem) = mesh_problem(mesh) {
                return fail(problem);
            }
        }
        for (index, instance) in self.instances.iter().enumerate() {
            let fail = |problem: String| Err((format!("instance {index}"), problem));
            if instance.mesh.index() >= self.meshes.len() {
                return fail(format!("expected a mesh below {}, found {}", self.meshes.len(), instance.mesh.0));
            }
            if let Some(material) = instance.material {
                let own = &self.materials[self.meshes[instance.mesh.index()].material.index()];
                if !self.materials.get(material.index()).is_some_and(|other| own.may_share(other)) {
                    let problem = format!("expected a plain material like \"{}\", found {}", own.name, material.0);
                    return fail(problem);
                }
            }
            let placement = &instance.world_from_object;
            if !placement.is_finite() || !placement.inverse().is_finite() {
                return fail("expected a finite, invertible placement".into());
            }
        }
        self.check_motion()?;
        for (index, instance) in self.instances.iter().enumerate() {
            let changes = !self.meshes[instance.mesh.index()].later.is_empty();
            if changes && self.motion.of_instance(index).is_none() {
                return Err((format!("instance {index}"), "expected a track, for its mesh changes its shape".into()));
            }
        }
        for material in &self.materials {
            let mut textures = material.textures();
            let fail = |problem: String| Err((format!("material \"{}\"", material.name), problem));
            if let Some((_, slot)) = textures.find(|(_, slot)| slot.texture.index() >= self.textures.len()) {
                return fail(format!("expected a texture below {}, found {}", self.textures.len(), slot.texture.0));
            }
            if !material.is_finite() {
                return fail("expected finite factors".into());
            }
        }
        for texture in &self.textures {
            if let Some(problem) = texture.problem() {
                return Err((format!("texture \"{}\"", texture.name), problem));
            }
        }
        for light in &self.punctual {
            if ![light.position, light.direction, light.intensity].iter().all(|vector| vector.is_finite()) {
                return Err((
                    format!("light \"{}\"", light.name),
                    "expected finite position, direction and intensity".into(),
                ));
            }
        }
        match self.cameras.iter().find_map(|camera| Some((camera, camera_problem(camera)?))) {
            Some((camera, problem)) => Err((format!("camera \"{}\"", camera.name), problem)),
            None => Ok(()),
        }
    }
}

impl Scene {
    fn check_motion(&self) -> Result<(), (String, String)> {
        let motion = &self.motion;
        if motion.instances.is_empty() && motion.cameras.is_empty() {
            return Ok(());
        }
        let [instances, cameras] = [
            self.instances.iter().map(|i| i.world_from_object).collect::<Vec<_>>(),
            self.cameras.iter().map(|c| c.world_from_camera).collect(),
        ];
        for (kind, tracks, at_rest) in
            [("instance", &motion.instances, instances), ("camera", &motion.cameras, cameras)]
        {
            for track in tracks {
                let fail = |problem: &str| Err((format!("motion of {kind} {}", track.index), problem.to_owned()));
                if at_rest.get(track.index).is_none_or(|first| track.steps.first() != Some(first)) {
                    return fail("expected a track that begins where the shutter opens");
                }
                if let Some(problem) = track.problem() {
                    return fail(problem);
                }
            }
            if tracks.windows(2).any(|pair| pair[0].index >= pair[1].index) {
                return Err((format!("motion of {kind}s"), "expected tracks by ascending index".into()));
            }
        }
        Ok(())
    }
}

fn mesh_problem(mesh: &Mesh) -> Option<String> {
    let count = mesh.positions.len();
    let lengths = [
        ("normals", mesh.normals.as_ref().map(Vec::len)),
        ("uvs", mesh.uvs.as_ref().map(Vec::len)),
        ("tangents", mesh.tangents.as_ref().map(Vec::len)),
        ("colors", mesh.colors.as_ref().map(Vec::len)),
        ("more_uvs", mesh.more_uvs.iter().map(Vec::len).find(|&found| found != count)),
    ];
    if let Some((name, found)) =
        lengths.iter().find_map(|&(name, found)| Some((name, found.filter(|&found| found != count)?)))
    {
        return Some(format!("expected {count} {name}, found {found}"));
    }
    if let Some(position) = mesh.positions.iter().find(|position| !position.is_finite()) {
        return Some(format!("expected finite positions, found {position}"));
    }
    if let Some(corner) = mesh.triangles.as_flattened().iter().find(|&&corner| corner as usize >= count) {
        return Some(format!("expected corners below {count}, found {corner}"));
    }
    if let Some(problem) = mesh.later.iter().find_map(|shape| shape_problem(mesh, shape)) {
        return Some(problem);
    }
    let finite = mesh.normals.iter().flatten().all(|normal: &Vec3| normal.is_finite())
        && mesh.uvs.iter().chain(&mesh.more_uvs).flatten().all(|uv| uv.is_finite())
        && mesh.colors.iter().flatten().all(|color: &Vec4| color.is_finite())
        && mesh.tangents.iter().flatten().all(|tangent: &Vec4| tangent.is_finite());
    (!finite).then(|| "expected finite vertex attributes".into())
}

/// What is wrong with a later shape of a mesh.
fn shape_problem(mesh: &Mesh, shape: &Shape) -> Option<String> {
    let lengths = |positions: usize, normals: Option<usize>, tangents: Option<usize>| (positions, normals, tangents);
    let of_mesh =
        lengths(mesh.positions.len(), mesh.normals.as_ref().map(Vec::len), mesh.tangents.as_ref().map(Vec::len));
    let of_shape =
        lengths(shape.positions.len(), shape.normals.as_ref().map(Vec::len), shape.tangents.as_ref().map(Vec::len));
    if of_mesh != of_shape || mesh.later.len() > MOST_PARTS {
        return Some(format!("expected at most {MOST_PARTS} later shapes with the tables of the first"));
    }
    let finite = shape.positions.iter().chain(shape.normals.iter().flatten()).all(|v| v.is_finite())
        && shape.tangents.iter().flatten().all(|tangent| tangent.is_finite());
    (!finite).then(|| "expected finite vertices in every shape".into())
}

fn camera_problem(camera: &Camera) -> Option<String> {
    let sound = match camera.projection {
        Projection::Perspective { yfov_rad, aspect } => {
            yfov_rad > 0.0
                && yfov_rad < std::f32::consts::PI
                && aspect.is_none_or(|aspect| aspect > 0.0 && aspect.is_finite())
        }
        Projection::Orthographic { xmag_m, ymag_m } => {
            xmag_m > 0.0 && ymag_m > 0.0 && xmag_m.is_finite() && ymag_m.is_finite()
        }
    };
    if !sound {
        return Some(format!("expected a field of view in (0, π), found {:?}", camera.projection));
    }
    (!camera.world_from_camera.is_finite()).then(|| "expected a finite placement".into())
}
