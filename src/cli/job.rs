//! From arguments to a job: outputs are checked before any work, the scene is loaded, and what depends on the scene (size,
//! camera, environment) is settled. Ranges that the plan checks are left to the plan.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use glam::Vec3;

use super::args::{
    EnvironmentArgs, MissingTextureName, Rays, RenderArgs, SamplerName, SettingsArgs, StrategyName, Switch,
    TextureArgs, TextureFilterName,
};
use crate::backend::BackendKind;
use crate::error::{Error, Result};
use crate::film::Pixel;
use crate::film::aov::{Aov, FirstHit, channel_count};
use crate::film::atomic::check_writable;
use crate::film::lengths::LENGTHS;
use crate::plan::Gate;
use crate::plan::options::ROULETTE_START;
use crate::render::{CameraChoice, Lens, RenderOptions, Roulette, Strategy, TextureFilter};
use crate::sampler::SamplerKind;
use crate::scene::{Budget, Camera, Environment, LoadOptions, MissingTexture, Projection, Scene, Shutter, Warning};

/// Columns of a picture for which neither the command line nor the scene names a size.
const DEFAULT_WIDTH: u32 = 1280;

/// Pixels of the largest window that is rendered; what `compare` reads.
const MOST_PIXELS: u64 = 1 << 28;

/// Bytes of a pixel outside the film without extra channels: its place in a tile, and four channels of f32 while an EXR
/// is written.
const PIXEL_OVERHEAD: u64 = 8 + 4 * 4;

/// Aspect of a picture for which nothing names one.
const DEFAULT_ASPECT: f64 = 16.0 / 9.0;

/// Files to be written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// The EXR.
    pub exr: Option<PathBuf>,
    /// Previews.
    pub pngs: Vec<PathBuf>,
    /// Statistics.
    pub stats: Option<PathBuf>,
    /// The error against a reference, pass by pass.
    pub error_log: Option<PathBuf>,
}

impl Outputs {
    /// Sorts the output options by kind and makes sure that each file can be written.
    ///
    /// # Errors
    /// [`Error::Option`] for names of a wrong kind, for a file that is named twice or is also read, and for options
    /// without effect; [`Error::Io`] for a folder that is missing or not writable.
    pub fn check(args: &RenderArgs) -> Result<Self> {
        let (stats, error_log) = (args.stats.clone(), args.error_log.clone());
        let mut outputs = Outputs { stats, error_log, ..Outputs::default() };
        let Some(output) = &args.output else { return refuse("--output", "a picture to write is missing".into()) };
        match extension(output).as_deref() {
            Some("exr") => outputs.exr = Some(output.clone()),
            Some("png") => outputs.pngs.push(output.clone()),
            _ => return refuse("--output", format!("{}: the name must end in .exr or .png", output.display())),
        }
        if let Some(png) = &args.png {
            if extension(png).as_deref() != Some("png") {
                return refuse("--png", format!("{}: the name must end in .png", png.display()));
            }
            outputs.pngs.push(png.clone());
        }
        if outputs.exr.is_none() && !args.aov.is_empty() {
            return refuse("--aov", "extra channels need an output that ends in .exr".into());
        }
        if outputs.exr.is_none() && args.half {
            return refuse("--half", "it applies to OpenEXR only: the output must end in .exr".into());
        }
        if let Some(aov) = args.aov.iter().enumerate().find_map(|(i, aov)| args.aov[..i].contains(aov).then_some(aov)) {
            return refuse("--aov", format!("'{}' is named twice", aov.name()));
        }
        if outputs.pngs.is_empty() && args.exposure != 0.0 {
            return refuse("--exposure", "it applies to PNG previews only: add --png FILE.png".into());
        }
        if let Some(stats) = &outputs.stats
            && extension(stats).as_deref() != Some("json")
        {
            return refuse("--stats", format!("{}: the name must end in .json", stats.display()));
        }
        if let Some(log) = &outputs.error_log
            && extension(log).as_deref() != Some("csv")
        {
            return refuse("--error-log", format!("{}: the name must end in .csv", log.display()));
        }
        outputs.check_files([Some(&args.scene), args.settings.environment.env.as_ref(), args.reference.as_ref()])?;
        Ok(outputs)
    }

    /// Each output can be written and is another file than the others and than the `inputs`.
    fn check_files(&self, inputs: [Option<&PathBuf>; 3]) -> Result<()> {
        let inputs: Vec<PathBuf> = inputs.into_iter().flatten().filter_map(|path| path.canonicalize().ok()).collect();
        let mut places: Vec<PathBuf> = Vec::new();
        let pictures = self.exr.iter().chain(&self.pngs).map(|path| ("--output", path));
        let records = self.stats.iter().map(|path| ("--stats", path));
        let records = records.chain(self.error_log.iter().map(|path| ("--error-log", path)));
        for (option, path) in pictures.chain(records) {
            check_writable(path)?;
            if path.canonicalize().is_ok_and(|file| inputs.contains(&file)) {
                return refuse(option, format!("{} is also read by this render", path.display()));
            }
            let place = place(path);
            if places.contains(&place) {
                return refuse(option, format!("{} is named as two outputs", path.display()));
            }
            places.push(place);
        }
        Ok(())
    }
}

/// The same for every spelling of a path whose folder exists: the folder without links, `.` and `..`, then the name. A
/// link at the end stays itself: it is what gets replaced.
fn place(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or(OsStr::new(""));
    folder.canonicalize().map_or_else(|_| path.into(), |folder| folder.join(name))
}

/// Refuses what contradicts itself whatever the scene is.
///
/// # Errors
/// [`Error::Option`] naming the option.
pub fn check(args: &SettingsArgs) -> Result<()> {
    let backend = args.backend.unwrap_or(BackendKind::available()[0]);
    if let Some(isa) = args.isa.as_deref().filter(|isa| !backend.pins(isa)) {
        let name = backend.name();
        return refuse(
            "--isa",
            format!("backend '{name}' has no {isa} to pin; 'embree' has all, 'obvhs' and 'flat+obvhs' avx2 and avx512"),
        );
    }
    if args.robust == Switch::Off && backend != BackendKind::Embree {
        let name = backend.name();
        return refuse("--robust", format!("backend '{name}' is always robust; only 'embree' can do without"));
    }
    if args.roulette == Switch::Off && args.roulette_start != ROULETTE_START {
        return refuse("--roulette-start", "it has no effect with --roulette off".into());
    }
    Ok(())
}

/// Refuses a window whose film does not fit: the alternative is a process that the system ends.
///
/// # Errors
/// [`Error::Option`] with the numbers.
pub fn check_memory(options: &RenderOptions) -> Result<()> {
    let (width, height) = options.crop.map_or((options.width, options.height), |crop| (crop.width, crop.height));
    let pixels = u64::from(width) * u64::from(height);
    if pixels > MOST_PIXELS {
        return refuse("--width", format!("{width}x{height} pixels; expected at most {MOST_PIXELS} (use --crop)"));
    }
    let bytes = pixels * (size_of::<Pixel>() as u64 + PIXEL_OVERHEAD + aov_bytes(options));
    if let Some(available) = available_memory().filter(|available| bytes > *available) {
        let (needed, available) = (bytes >> 20, available >> 20);
        let problem = format!("{width}x{height} pixels need {needed} MiB, {available} MiB are available (use --crop)");
        return refuse("--width", problem);
    }
    Ok(())
}

/// Bytes that the extra outputs take for each pixel: what is gathered, and their channels, twice while they are written.
fn aov_bytes(options: &RenderOptions) -> u64 {
    let channels: usize = options.aovs.iter().map(|&aov| channel_count(aov, options.max_depth)).sum();
    let lengths = if options.aovs.contains(&Aov::Bounces) { LENGTHS * size_of::<[f64; 3]>() + 8 } else { 0 };
    let first_hit = if options.aovs.iter().any(|aov| aov.is_of_first_hit()) { size_of::<FirstHit>() } else { 0 };
    (2 * channels * size_of::<f32>() + lengths + first_hit) as u64
}

/// `--env` and what goes with it.
#[derive(Clone, Copy, Debug)]
pub struct EnvironmentRequest<'a> {
    /// The image.
    pub path: &'a Path,
    /// Counter-clockwise seen from above, degrees.
    pub rotation_deg: f32,
    /// Factor on the radiance.
    pub intensity: f32,
}

impl<'a> EnvironmentRequest<'a> {
    /// What the arguments ask for, if anything.
    pub fn of(args: &'a EnvironmentArgs) -> Option<Self> {
        args.env.as_deref().map(|path| EnvironmentRequest {
            path,
            rotation_deg: args.env_rotation,
            intensity: args.env_intensity,
        })
    }
}

/// Loads a scene, posed by the shutter if there is one, and its environment. A scene without any light gets a constant white one, and a warning.
pub fn load(
    path: &Path,
    environment: Option<EnvironmentRequest>,
    textures: TextureArgs,
    shutter: Option<Shutter>,
) -> Result<Scene> {
    let mut scene = Scene::load_with(path, &load_options(textures, shutter))?;
    if let Some(request) = environment {
        scene.load_environment(request.path, request.rotation_deg.to_radians(), request.intensity)?;
    } else if !has_light(&scene) {
        scene.environment = Some(Environment::constant(Vec3::ONE));
        scene.warnings.push(Warning {
            place: path.display().to_string(),
            what: "no light of any kind: lit by a constant white environment of radiance 1".into(),
        });
    }
    Ok(scene)
}

fn load_options(args: TextureArgs, shutter: Option<Shutter>) -> LoadOptions {
    LoadOptions {
        shutter,
        texture_budget: Budget { bytes: args.texture_memory << 20, ..Budget::default() },
        missing_texture: match args.missing_texture {
            MissingTextureName::Error => MissingTexture::Error,
            MissingTextureName::Magenta => MissingTexture::Magenta,
        },
    }
}

/// Whether anything in the scene shines: an emissive surface that is placed, a punctual light, an environment.
pub fn has_light(scene: &Scene) -> bool {
    let emits = |instance: &crate::scene::Instance| {
        let mesh = &scene.meshes[instance.mesh.index()];
        scene.materials.get(mesh.material.index()).is_some_and(|material| material.is_emissive())
    };
    scene.environment.is_some()
        || scene.punctual.iter().any(|light| light.intensity.max_element() > 0.0)
        || scene.instances.iter().any(emits)
}

/// Options of the render, settled against the scene.
pub fn options(args: &RenderArgs, scene: &Scene) -> RenderOptions {
    RenderOptions {
        spp: args.spp,
        time: args.time,
        error: args.error,
        min_spp: args.min_spp,
        aovs: args.aov.clone(),
        ..settings(&args.settings, scene)
    }
}

/// What does not limit the render, settled against the scene.
pub fn settings(args: &SettingsArgs, scene: &Scene) -> RenderOptions {
    let camera = camera_choice(args.camera.as_deref(), scene);
    let size = picture_size(args.width, args.height, scene, camera_of(scene, &camera));
    RenderOptions {
        width: size.0,
        height: size.1,
        crop: args.crop,
        camera,
        seed: args.seed,
        threads: args.threads.map_or_else(default_threads, |n| n as usize),
        lens: args.aperture_radius.zip(args.focus_distance).map(|(radius_m, focus_m)| Lens { radius_m, focus_m }),
        filter: args.filter,
        max_depth: args.max_depth,
        roulette: match args.roulette {
            Switch::On => Roulette::On,
            Switch::Off => Roulette::Off,
        },
        roulette_start: args.roulette_start,
        strategy: match args.strategy {
            StrategyName::Mis => Strategy::MisPower,
            StrategyName::MisBalance => Strategy::MisBalance,
            StrategyName::Bsdf => Strategy::BsdfOnly,
            StrategyName::Light => Strategy::LightOnly,
        },
        sampler: match args.sampler {
            SamplerName::Sobol => SamplerKind::Sobol,
            SamplerName::Independent => SamplerKind::Independent,
        },
        texture_filter: match args.texture_filter {
            TextureFilterName::Exact => TextureFilter::Exact,
            TextureFilterName::Trilinear => TextureFilter::Trilinear,
        },
        backend: args.backend,
        rays: match args.rays {
            Rays::Auto => None,
            Rays::Mode(mode) => Some(mode),
        },
        isa: args.isa.clone(),
        forced: if args.no_plan { Gate::ALL.to_vec() } else { Vec::new() },
        robust: args.robust == Switch::On,
        ..RenderOptions::default()
    }
}

/// A camera by name, else by index, else the first. Whether it exists is for the plan to say.
fn camera_choice(text: Option<&str>, scene: &Scene) -> CameraChoice {
    match text {
        None => CameraChoice::First,
        Some(name) if scene.cameras.iter().any(|camera| camera.name == name) => CameraChoice::Name(name.into()),
        Some(text) => text.parse().map_or_else(|_| CameraChoice::Name(text.into()), CameraChoice::Index),
    }
}

/// The camera that a choice means, if the scene has it.
fn camera_of<'a>(scene: &'a Scene, choice: &CameraChoice) -> Option<&'a Camera> {
    match choice {
        CameraChoice::First => scene.cameras.first(),
        CameraChoice::Index(index) => scene.cameras.get(*index),
        CameraChoice::Name(name) => scene.cameras.iter().find(|camera| camera.name == *name),
    }
}

/// Columns and rows: as asked, as the scene suggests, else 1280 columns of the camera's aspect. One side alone takes the
/// other from the aspect of the suggestion or of the camera.
pub fn picture_size(width: Option<u32>, height: Option<u32>, scene: &Scene, camera: Option<&Camera>) -> (u32, u32) {
    let authored = camera.and_then(|camera| match camera.projection {
        Projection::Perspective { aspect, .. } => aspect.map(f64::from),
        Projection::Orthographic { xmag_m, ymag_m } => Some(f64::from(xmag_m) / f64::from(ymag_m)),
    });
    let suggested = scene.suggested_size.map(|(width, height)| f64::from(width) / f64::from(height));
    let aspect = suggested.or(authored).filter(|a| a.is_finite() && *a > 0.0).unwrap_or(DEFAULT_ASPECT);
    let side = |length: f64| length.round().clamp(1.0, f64::from(u32::MAX)) as u32;
    match (width, height, scene.suggested_size) {
        (Some(width), Some(height), _) => (width, height),
        (Some(width), None, _) => (width, side(f64::from(width) / aspect)),
        (None, Some(height), _) => (side(f64::from(height) * aspect), height),
        (None, None, Some(size)) => size,
        (None, None, None) => (DEFAULT_WIDTH, side(f64::from(DEFAULT_WIDTH) / aspect)),
    }
}

/// Threads that the process may use: the affinity mask and cgroup quota, and no more than Slurm grants the task.
pub fn default_threads() -> usize {
    let available = std::thread::available_parallelism().map_or(1, |n| n.get());
    let granted = std::env::var("SLURM_CPUS_PER_TASK").ok().and_then(|n| n.parse::<usize>().ok());
    granted.map_or(available, |granted| available.min(granted.max(1)))
}

/// Bytes that the process may still take: what Linux calls available, within the limit of the control group; `None`
/// where the system does not say. An allocation that succeeds says nothing, because Linux promises more than it has.
fn available_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: u64 = line.split_whitespace().next()?.parse().ok()?;
    let limit = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|max| max.trim().parse().ok());
    Some(kib.saturating_mul(1024).min(limit.unwrap_or(u64::MAX)))
}

fn extension(path: &Path) -> Option<String> {
    path.extension().map(|extension| extension.to_string_lossy().to_lowercase())
}

fn refuse<T>(option: &'static str, problem: String) -> Result<T> {
    Err(Error::Option { option, problem })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    fn camera(name: &str, aspect: Option<f32>) -> Camera {
        Camera {
            name: name.into(),
            world_from_camera: Affine3A::IDENTITY,
            projection: Projection::Perspective { yfov_rad: 1.0, aspect },
        }
    }

    #[test]
    fn sizes_follow_request_then_suggestion_then_aspect() {
        let wide = camera("wide", Some(2.0));
        let mut scene = Scene::default();
        assert_eq!(picture_size(None, None, &scene, Some(&wide)), (1280, 640));
        assert_eq!(picture_size(Some(100), None, &scene, Some(&wide)), (100, 50));
        assert_eq!(picture_size(None, Some(100), &scene, Some(&wide)), (200, 100));
        assert_eq!(picture_size(Some(7), Some(9), &scene, Some(&wide)), (7, 9));
        assert_eq!(picture_size(None, None, &scene, Some(&camera("any", None))), (1280, 720));
        assert_eq!(picture_size(Some(1), None, &scene, Some(&camera("tall", Some(1e9)))), (1, 1));
        scene.suggested_size = Some((512, 256));
        assert_eq!(picture_size(None, None, &scene, None), (512, 256));
        assert_eq!(picture_size(Some(64), None, &scene, Some(&camera("square", Some(1.0)))), (64, 32));
    }

    #[test]
    fn cameras_are_found_by_name_before_index() {
        let scene = Scene { cameras: vec![camera("left", None), camera("0", None)], ..Scene::default() };
        let find = |text| camera_of(&scene, &camera_choice(Some(text), &scene)).map(|c| c.name.as_str());
        assert_eq!(find("left"), Some("left"));
        assert_eq!(find("0"), Some("0"));
        assert_eq!(find("1"), Some("0"));
        assert_eq!(find("2"), None);
        assert_eq!(find("right"), None);
        assert_eq!(camera_choice(None, &scene), CameraChoice::First);
    }

    #[test]
    fn spellings_of_one_path_are_one_place() {
        let root = env!("CARGO_MANIFEST_DIR");
        let spellings = ["a.exr", "./a.exr", "src/../a.exr"].map(|name| place(&Path::new(root).join(name)));
        assert!(spellings.iter().all(|spelling| *spelling == spellings[0]), "{spellings:?}");
        // Tests run in the package's folder.
        assert_eq!(place(Path::new("a.exr")), spellings[0]);
        assert_ne!(place(Path::new("src/a.exr")), spellings[0]);
    }

    #[test]
    fn windows_beyond_memory_are_refused() {
        let with = |width, height, crop| check_memory(&RenderOptions { crop, ..RenderOptions::new(width, height) });
        let crop = crate::render::Crop { x: 9, y: 9, width: 8, height: 8 };
        assert!(with(64, 64, None).is_ok());
        assert!(with(65536, 65536, None).is_err());
        assert!(with(65536, 65536, Some(crop)).is_ok());
    }

    #[test]
    fn a_scene_without_lights_is_recognised() {
        let mut scene = Scene::default();
        assert!(!has_light(&scene));
        scene.environment = Some(Environment::constant(Vec3::ONE));
        assert!(has_light(&scene));
    }
}
