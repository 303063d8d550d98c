//! Memory of a render, by part: what is held, what the hierarchy, film and waves will take. What does not fit is
//! refused before it is allocated, because the alternative is a process that the system ends.
//!
//! What is held already is measured (resident bytes), the rest is counted: the film and its layers, the waves of the
//! workers, an EXR on its way to the disk exactly, the hierarchy by bytes a triangle (`backend/size.rs`); what surveys
//! leave in the heaps is measured after them. The total is the largest sum at one time. Limits: pages of the sums of
//! light paths that no path reaches are counted, though the system never gives them; lists of ids are counted with
//! `COUNTED_IDS` entries a pixel at most, though pixels that meet more names have more (`film/ids.rs`); textures that
//! the tile cache may still read are not in it (`--texture-memory` bounds them); the parts of libraries in address
//! space alone are not either.

use std::fmt;

use glam::Vec3;
use serde::Serialize;

use super::schedule::PASS_SAMPLES;
use crate::backend::size;
use crate::error::{Error, Result};
use crate::film::Pixel;
use crate::film::blocks::Blocks;
use crate::film::layer::bytes_per_pixel;
use crate::film::layer::kind::Shape;
use crate::film::shares::Shares;
use crate::film::splats;
use crate::plan::light_groups::DEFAULT;
use crate::plan::options::RenderOptions;
use crate::plan::{Aov, RenderPlan};
use crate::room::{self, Room};
use crate::scene::geometry::{Geometry, Triangle};
use crate::scene::{Mesh, Scene, Texels};
use crate::transport::parts::Wanted;
use crate::transport::wave::Wave;

/// Pixels of the largest window that is rendered; what `compare` reads.
const MOST_PIXELS: u64 = 1 << 28;

/// Bytes of a pixel outside the film without other layers: its place in a tile, and four channels of f32 while an EXR
/// is written.
const PIXEL_OVERHEAD: u64 = 8 + 4 * 4;

/// Samples per pixel up to which a render that something else ends is counted.
const UNLIMITED_SPP: u64 = 1 << 10;

/// Ids of a pixel up to which they are counted. Pixels with more are rare: all of a picture would have to see so many
/// things at once.
const COUNTED_IDS: u64 = 16;

/// Bytes that the allocator takes for a thread that works.
const PER_THREAD: u64 = 1 << 20;

/// A part of what a render takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Part {
    /// "program", "scene", "textures", "geometry", "hierarchy", "building", "film", "layers", "waves", "writing",
    /// "light paths", "heaps" (what surveys have left in the threads' heaps beyond the waves that will lie there).
    pub what: &'static str,
    /// Bytes.
    pub bytes: u64,
}

/// What a render takes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct Need {
    /// Its parts. "building" is held beside the hierarchy while that is built; film, layers, waves and writing after.
    pub parts: Vec<Part>,
    /// Bytes that were held when it was made.
    pub held_bytes: u64,
    /// Bytes at most at one time.
    pub total_bytes: u64,
    #[serde(skip)]
    threads: usize,
}

/// Name of the part of light paths.
const LIGHT_PATHS: &str = "light paths";

/// Name of the part that surveys leave.
const HEAPS: &str = "heaps";

/// Parts from here on are taken when the hierarchy is built.
const AFTER_BUILDING: usize = 6;

/// What they take of a pixel: while a pass is added, the sums of the render, of the pass and of both; after it, the
/// sums and the picture with them.
fn light_path_pixel(plan: &RenderPlan) -> u64 {
    let sums = splats::bytes(Shares::of(&plan.aovs, plan.light_groups.names.len()).count() as u64);
    (3 * sums).max(sums + size_of::<Pixel>() as u64)
}

impl Need {
    /// What a render of `plan` takes, before its hierarchy is built.
    pub(super) fn of(scene: &Scene, geometry: &Geometry, plan: &RenderPlan) -> Need {
        let hierarchy = size::of(plan.backend, geometry, plan.threads);
        let names = scene.instances.len() as u64;
        let window = (plan.window.width, plan.window.height);
        let pixels = u64::from(window.0) * u64::from(window.1);
        let [scene, textures, geometry] = [scene_bytes(scene), texture_bytes(scene), geometry_bytes(geometry)];
        let held = room::resident().unwrap_or(scene + textures + geometry);
        let films = films(plan.limits.spp);
        let shape = Shape { max_depth: plan.max_depth, groups: &plan.light_groups.names };
        let layers = bytes_per_pixel(&plan.aovs, &shape, films, ids(plan.limits.spp, names));
        let waves = Wave::bytes(plan.wave, &Wanted::by(plan), &plan.features) + PER_THREAD;
        let light_waves = plan.threads as u64 * Wave::bytes(plan.wave, &Wanted::default(), &plan.features);
        let parts = [
            ("program", held.saturating_sub(scene + textures + geometry)),
            ("scene", scene),
            ("textures", textures),
            ("geometry", geometry),
            ("hierarchy", hierarchy.bytes),
            ("building", hierarchy.building),
            ("film", pixels * (films * size_of::<Pixel>() as u64 + 8)),
            ("layers", pixels * layers),
            ("waves", plan.threads as u64 * waves),
            ("writing", pixels * (PIXEL_OVERHEAD - 8)),
            (LIGHT_PATHS, if plan.features.light_paths { pixels * light_path_pixel(plan) + light_waves } else { 0 }),
            (HEAPS, 0),
        ];
        let parts = parts.map(|(what, bytes)| Part { what, bytes }).to_vec();
        let need = Need { parts, held_bytes: held, total_bytes: 0, threads: plan.threads };
        need.with_total()
    }

    /// The same once the hierarchy is built and surveys are made, with or without light paths: what the surveys have
    /// left in the heaps is held as well.
    pub(super) fn surveyed(&self, light_paths: bool) -> Need {
        let mut need = self.clone();
        let hierarchy = need.bytes_of("hierarchy");
        let left = room::resident().unwrap_or(0).saturating_sub(need.held_bytes + hierarchy);
        let heaps = left.saturating_sub(need.bytes_of("waves"));
        for part in &mut need.parts {
            match part.what {
                LIGHT_PATHS if !light_paths => part.bytes = 0,
                HEAPS => part.bytes = heaps,
                _ => {}
            }
        }
        need.with_total()
    }

    /// With the largest sum at one time.
    fn with_total(mut self) -> Need {
        let after: u64 = self.parts[AFTER_BUILDING..].iter().map(|part| part.bytes).sum();
        let total = self.held_bytes + self.bytes_of("hierarchy") + self.bytes_of("building").max(after);
        self.total_bytes = total.max(room::most_resident().unwrap_or(0));
        self
    }

    fn bytes_of(&self, what: &str) -> u64 {
        self.parts.iter().find(|part| part.what == what).map_or(0, |part| part.bytes)
    }

    /// Whether the hierarchy fits, before it is built.
    ///
    /// # Errors
    /// [`Error::Memory`] with the numbers.
    pub(super) fn check_building(&self) -> Result<()> {
        let [_, _, _, _, hierarchy, building, ..] = &self.parts[..] else { unreachable!("made with all its parts") };
        fits("the hierarchy", hierarchy.bytes + building.bytes, self.threads, || {
            (vec![hierarchy.to_string(), building.to_string()], FEWER_THREADS.into())
        })
    }
}

/// What makes hierarchies fit.
const FEWER_THREADS: &str = "fewer threads (-t) or another --backend may take less";

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {} MB", self.what, self.bytes.div_ceil(1 << 20))
    }
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts: Vec<String> = self.parts.iter().filter(|part| part.bytes > 0).map(Part::to_string).collect();
        write!(f, "memory      {} MB at most: {}", self.total_bytes.div_ceil(1 << 20), parts.join(", "))?;
        match Room::left(self.threads) {
            Some(room) => write!(f, "; {} MB more are left by {}", room.bytes >> 20, room.limit),
            None => Ok(()),
        }
    }
}

/// Refuses what does not fit; `told` are the parts and what helps.
fn fits(what: &'static str, needed: u64, threads: usize, told: impl FnOnce() -> (Vec<String>, String)) -> Result<()> {
    let Some(room) = Room::left(threads).filter(|room| needed > room.bytes) else { return Ok(()) };
    let (parts, advice) = told();
    Err(Error::Memory { what, needed, parts: parts.join(", "), available: room.bytes, limit: room.limit, advice })
}

/// Bytes that the triangles of `scene` take at least when they are flattened.
fn flattened_bytes(scene: &Scene) -> u64 {
    let triangles: u64 = scene.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum();
    let vertices: u64 = scene.meshes.iter().map(|mesh| mesh.positions.len() as u64).sum();
    triangles * size_of::<(Triangle, [u32; 3])>() as u64 + vertices * size_of::<Vec3>() as u64
}

/// Whether the flattened geometry of `scene` fits.
pub(super) fn check_geometry(scene: &Scene) -> Result<()> {
    fits("flattening the scene", flattened_bytes(scene), 1, || {
        (
            vec![format!("{} triangles", scene.triangle_count())],
            "the scene takes more than this process may have".into(),
        )
    })
}

fn scene_bytes(scene: &Scene) -> u64 {
    let of = |mesh: &Mesh| {
        let uvs = mesh.uvs.iter().chain(&mesh.more_uvs).map(|uvs| size_of_val(uvs.as_slice())).sum::<usize>();
        let wide = mesh.colors.iter().chain(&mesh.tangents).map(|values| size_of_val(values.as_slice())).sum::<usize>();
        let normals = mesh.normals.as_ref().map_or(0, |normals| size_of_val(normals.as_slice()));
        size_of_val(mesh.positions.as_slice()) + size_of_val(mesh.triangles.as_slice()) + uvs + wide + normals
    };
    let meshes: usize = scene.meshes.iter().map(of).sum();
    let environment = scene.environment.as_ref().map_or(0, |environment| size_of_val(&environment.texels[..]));
    (meshes + size_of_val(scene.instances.as_slice()) + environment) as u64
}

fn texture_bytes(scene: &Scene) -> u64 {
    let mut seen: Vec<&Texels> = Vec::new();
    for texture in &scene.textures {
        if !seen.iter().any(|texels| texels.shares(&texture.texels)) {
            seen.push(&texture.texels);
        }
    }
    seen.iter().map(|texels| texels.bytes()).sum()
}

fn geometry_bytes(geometry: &Geometry) -> u64 {
    let meshes = geometry.meshes.iter();
    let meshes: usize = meshes
        .map(|mesh| {
            (1 + mesh.later.len()) * size_of_val(mesh.vertices.as_slice()) + size_of_val(mesh.indices.as_slice())
        })
        .sum();
    let more: usize = geometry.more_uvs.iter().map(|uvs| size_of_val(uvs.as_slice())).sum();
    let attributes = size_of_val(geometry.normals.as_slice())
        + size_of_val(geometry.uvs.as_slice())
        + size_of_val(geometry.colors.as_slice())
        + size_of_val(geometry.tangents.as_slice());
    let records = size_of_val(geometry.triangles.as_slice())
        + size_of_val(geometry.later.as_slice())
        + size_of_val(geometry.instances.as_slice());
    (meshes + more + attributes + records) as u64
}

impl RenderOptions {
    /// Whether a render of `scene` with these options fits into memory: the film with its layers and the flattened
    /// scene with the smallest hierarchy. A renderer asks again when it knows which hierarchy it builds.
    ///
    /// # Errors
    /// As [`check_memory`](Self::check_memory), and [`Error::Memory`] with the numbers.
    pub fn check_memory_for(&self, scene: &Scene) -> Result<()> {
        self.check_memory()?;
        let window = self.crop.map_or((self.width, self.height), |crop| (crop.width, crop.height));
        let ids = ids(self.spp, scene.instances.len() as u64);
        let groups = self.group_names();
        let shape = Shape { max_depth: self.max_depth, groups: &groups };
        let pixel = bytes_of_pixel(&self.aovs, &shape, films(self.spp), ids);
        let film = u64::from(window.0) * u64::from(window.1) * pixel;
        let flattened = flattened_bytes(scene);
        fits("the render", film + 2 * flattened, 1, || {
            let part = |what, bytes| Part { what, bytes }.to_string();
            let parts = vec![part("film and layers", film), part("geometry and hierarchy", 2 * flattened)];
            (parts, "fewer pixels (--crop, --width) or fewer layers (--aov) take less".into())
        })
    }

    /// Whether the film of a render with these options fits into memory. Every render asks so before it begins; asked
    /// here, it is known before the scene is made ready.
    ///
    /// # Errors
    /// [`Error::Option`] with the numbers.
    pub fn check_memory(&self) -> Result<()> {
        let window = self.crop.map_or((self.width, self.height), |crop| (crop.width, crop.height));
        let shape = Shape { max_depth: self.max_depth, groups: &self.group_names() };
        check(window, &self.aovs, &shape, (films(self.spp), ids(self.spp, COUNTED_IDS)))
    }

    /// Names of the light groups that are known without the scene, perhaps twice.
    fn group_names(&self) -> Vec<String> {
        std::iter::once(DEFAULT.to_string()).chain(self.light_groups.iter().map(|group| group.name.clone())).collect()
    }
}

fn bytes_of_pixel(aovs: &[Aov], shape: &Shape, films: u64, ids: u64) -> u64 {
    films * size_of::<Pixel>() as u64 + PIXEL_OVERHEAD + bytes_per_pixel(aovs, shape, films, ids)
}

/// Ids that are counted for a pixel of a scene of so many names.
pub(super) fn ids(spp: Option<u64>, names: u64) -> u64 {
    spp.unwrap_or(UNLIMITED_SPP).min(names + 1).min(COUNTED_IDS)
}

/// Films that a render to `spp` samples per pixel holds at once.
pub(super) fn films(spp: Option<u64>) -> u64 {
    Blocks::most(spp.unwrap_or(UNLIMITED_SPP), PASS_SAMPLES)
}

/// Whether so many films of this window (columns, rows) with these layers fit, where lists have so many ids.
pub(super) fn check((width, height): (u32, u32), aovs: &[Aov], shape: &Shape, (films, ids): (u64, u64)) -> Result<()> {
    let refuse = |problem: String| Err(Error::Option { option: "--width", problem });
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MOST_PIXELS {
        return refuse(format!("{width}x{height} pixels; expected at most {MOST_PIXELS} (use --crop)"));
    }
    let bytes = pixels * bytes_of_pixel(aovs, shape, films, ids);
    if let Some(room) = Room::left(1).filter(|room| bytes > room.bytes) {
        let (needed, available) = (bytes >> 20, room.bytes >> 20);
        return refuse(format!(
            "{width}x{height} pixels need {needed} MiB, {available} MiB are left by {} (use --crop)",
            room.limit
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::options::Crop;

    #[test]
    fn windows_beyond_memory_are_refused() {
        let with = |width, height, crop| RenderOptions { crop, ..RenderOptions::new(width, height) }.check_memory();
        let crop = Crop { x: 9, y: 9, width: 8, height: 8 };
        assert!(with(64, 64, None).is_ok());
        assert!(with(65536, 65536, None).is_err());
        assert!(with(65536, 65536, Some(crop)).is_ok());
    }
}
