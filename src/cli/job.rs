//! From arguments to the library's options: outputs are checked before any work, names become values, the scene is
//! loaded. Ranges that the plan checks are left to the plan.

use std::ffi::OsStr;
use std::io::{IsTerminal, Read};
use std::path::{Path, PathBuf};
use std::time::Duration;

use super::args::{
    ContentArgs, EnvironmentArgs, FileArgs, ImageFormatsName, MissingTextureName, ProgressKind, Rays, RenderArgs,
    SettingsArgs, StrategyName, Switch, TextureArgs, TextureFilterName,
};
use super::{frames, quick};
use crate::backend::QueryMode;
use crate::backend::select::{self, Pins};
use crate::error::{Error, Result};
use crate::film::atomic::{check_writable, sweep};
use crate::film::look::Format;
use crate::input;
use crate::plan::effects::without;
use crate::plan::options::ROULETTE_START;
use crate::plan::{Aov, Gate};
use crate::render::{Absent, CameraChoice, Lens, RenderOptions, Roulette, Strategy, TextureFilter, leave_out};
use crate::scene::{Budget, Decoder, Environment, EnvironmentFile, LoadOptions, MissingTexture, Scene, Warning};

/// A name that stands for stdin or stdout.
pub const STREAM: &str = "-";

/// The environment that is built in.
const STUDIO: &str = "studio";

/// Files to be written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outputs {
    /// The EXR.
    pub exr: Option<PathBuf>,
    /// Previews.
    pub previews: Vec<PathBuf>,
    /// Whether a preview goes to stdout, as PNG.
    pub stdout: bool,
    /// Whether the picture is drawn in the terminal.
    pub show: bool,
    /// Statistics; [`STREAM`] is stdout.
    pub stats: Option<PathBuf>,
    /// The page about the render.
    pub report: Option<PathBuf>,
    /// The error against a reference, pass by pass.
    pub error_log: Option<PathBuf>,
    /// The state of the render: how often, and where.
    pub checkpoint: Option<(Duration, PathBuf)>,
    /// The preview of the render while it runs.
    pub preview: Option<PathBuf>,
}

impl Outputs {
    /// Sorts the output options by kind and makes sure that each file can be written.
    ///
    /// # Errors
    /// [`Error::Option`] for names of a wrong kind, for a file that is named twice or is also read, and for options
    /// without effect; [`Error::Io`] for a folder that is missing or not writable.
    pub fn check(args: &RenderArgs) -> Result<Self> {
        let stats = args.stats.clone().map(|path| if is_stdout(&path) { STREAM.into() } else { path });
        let (error_log, preview) = (args.error_log.clone(), args.live.preview.clone());
        let mut outputs = Outputs { stats, error_log, preview, report: args.report.clone(), ..Outputs::default() };
        match &args.output {
            Some(output) if is_stdout(output) => outputs.stdout = true,
            Some(output) => match extension(output).as_deref() {
                Some("exr") => outputs.exr = Some(output.clone()),
                Some("png" | "jpg" | "jpeg") => outputs.previews.push(output.clone()),
                _ => {
                    return refuse(
                        "--output",
                        format!("{}: the name must end in .exr, .png or .jpg", output.display()),
                    );
                }
            },
            None if args.png.is_some() || args.look.jpg.is_some() => {}
            // A part of a picture need not be one.
            None if args.production.sample_range.is_some() => {}
            // GLB in, PNG out.
            None if args.quick && args.scene.as_os_str() == STREAM => outputs.stdout = true,
            None => {
                let scene = scene_file(&args.scene)?;
                let stem = scene.file_stem().filter(|stem| *stem != STREAM).unwrap_or(OsStr::new("scene"));
                let named = |ending: &str| {
                    let mut name = stem.to_owned();
                    name.push(ending);
                    PathBuf::from(name)
                };
                outputs.exr = Some(named(".exr"));
                if args.quick {
                    outputs.previews.push(named(".png"));
                }
            }
        }
        let named = [("--png", &args.png, &["png"][..], ".png"), ("--jpg", &args.look.jpg, &["jpg", "jpeg"], ".jpg")];
        for (option, path, endings, ending) in named {
            let Some(path) = path else { continue };
            if !extension(path).is_some_and(|found| endings.contains(&found.as_str())) {
                return refuse(option, format!("{}: the name must end in {ending}", path.display()));
            }
            outputs.previews.push(path.clone());
        }
        let picture = outputs.exr.as_deref().or(outputs.previews.first().map(PathBuf::as_path));
        outputs.checkpoint = args.production.checkpoint(picture)?;
        let shows_layers = outputs.exr.is_some() || outputs.checkpoint.is_some() || outputs.report.is_some();
        // Previews show what is denoised.
        let seen = args.denoise.denoise && outputs.has_previews();
        let option = match (args.aov.is_empty(), args.light_group.is_empty()) {
            (false, _) => Some("--aov"),
            (true, false) => Some("--light-group"),
            (true, true) => args.denoise.given().filter(|_| !seen),
        };
        if let Some(option) = option.filter(|_| !shows_layers) {
            return refuse(option, "extra channels need an output that ends in .exr, or a --report".into());
        }
        if outputs.exr.is_none() && args.half {
            return refuse("--half", "it applies to OpenEXR only: the output must end in .exr".into());
        }
        if outputs.exr.is_none() && args.reproducible {
            return refuse("--reproducible", "it applies to OpenEXR only: the output must end in .exr".into());
        }
        if let Some(option) = args.exr.given().filter(|_| outputs.exr.is_none()) {
            return refuse(option, "it applies to OpenEXR only: the output must end in .exr".into());
        }
        if let Some(aov) = args.aov.iter().enumerate().find_map(|(i, aov)| args.aov[..i].contains(aov).then_some(aov)) {
            return refuse("--aov", format!("'{}' is named twice", aov.name()));
        }
        if let Some(preview) = outputs.preview.as_ref().filter(|path| Format::of(path).is_none()) {
            return refuse("--preview", format!("{}: the name must end in .png or .jpg", preview.display()));
        }
        if args.look.transparent
            && let Some(jpg) =
                outputs.previews.iter().chain(&outputs.preview).find(|path| Format::of(path) == Some(Format::Jpeg))
        {
            let problem = format!("{}: JPEG has no transparency; write a PNG, or name a --background", jpg.display());
            return refuse("--transparent", problem);
        }
        if outputs.stdout && std::io::stdout().is_terminal() {
            return refuse("--output", "stdout is a terminal, and a PNG is not for reading; redirect it".into());
        }
        outputs.show = args.show;
        if outputs.show && !std::io::stdout().is_terminal() {
            return refuse("--show", "stdout is no terminal to draw in; --png FILE writes a picture".into());
        }
        let to_stdout = [
            outputs.stdout,
            outputs.show,
            outputs.stats.as_deref() == Some(Path::new(STREAM)),
            matches!(args.progress, ProgressKind::Ndjson | ProgressKind::Openjd),
        ];
        if to_stdout.into_iter().filter(|used| *used).count() > 1 {
            return refuse("--output", "only one of picture, --stats and --progress ndjson fits on stdout".into());
        }
        if let Some(stats) = outputs.stats.as_deref().filter(|path| *path != Path::new(STREAM))
            && extension(stats).as_deref() != Some("json")
        {
            return refuse("--stats", format!("{}: the name must end in .json", stats.display()));
        }
        if let Some(report) = outputs.report.as_ref().filter(|path| extension(path).as_deref() != Some("html")) {
            return refuse("--report", format!("{}: the name must end in .html", report.display()));
        }
        if let Some(log) = &outputs.error_log
            && extension(log).as_deref() != Some("csv")
        {
            return refuse("--error-log", format!("{}: the name must end in .csv", log.display()));
        }
        if args.sequence.is_on() && (outputs.stdout || outputs.stats.as_deref() == Some(Path::new(STREAM))) {
            return refuse("--frames", "pictures and statistics of several frames do not fit on stdout".into());
        }
        outputs.check_files(
            [Some(&args.scene), args.settings.environment.env.as_ref(), args.reference.as_ref()],
            args.production.resume.as_deref(),
            (args.make_path, args.sequence.is_on()),
        )?;
        Ok(outputs)
    }

    /// Takes away what earlier renders left that were killed on the way to these outputs.
    pub fn sweep<'o>(all: impl IntoIterator<Item = &'o Outputs>) {
        sweep(all.into_iter().flat_map(Outputs::files).map(|(_, path)| path.as_path()));
    }

    /// Takes the statistics of an earlier render away, which are not this one's. Other files of that name stay until
    /// they are written over: the render may be refused because it reads them.
    pub fn forget(&self) {
        let Some(path) = self.stats.as_deref().filter(|path| *path != Path::new(STREAM)) else { return };
        let earlier = input::read(path).ok();
        let earlier = earlier.and_then(|bytes| serde_json::from_slice::<serde_json::Value>(&bytes).ok());
        if earlier.is_some_and(|earlier| earlier.get("schema").is_some()) {
            // One that cannot be removed cannot be written over either, which is said then.
            let _ = std::fs::remove_file(path);
        }
    }

    /// Whether previews are made, in files of their own or in the page.
    pub fn has_previews(&self) -> bool {
        self.stdout || self.show || !self.previews.is_empty() || self.preview.is_some() || self.report.is_some()
    }

    /// The files with the options that name them.
    fn files(&self) -> impl Iterator<Item = (&'static str, &PathBuf)> {
        let pictures = self.exr.iter().chain(&self.previews).map(|path| ("--output", path));
        let stats = self.stats.iter().filter(|path| *path != Path::new(STREAM)).map(|path| ("--stats", path));
        let pictures = pictures.chain(self.preview.iter().map(|path| ("--preview", path)));
        let records = stats.chain(self.report.iter().map(|path| ("--report", path)));
        let records = records.chain(self.error_log.iter().map(|path| ("--error-log", path)));
        pictures.chain(records).chain(self.checkpoint.iter().map(|(_, path)| ("--checkpoint", path)))
    }

    /// Those of one frame, of `several`.
    pub fn of_frame(&self, frame: u32, several: bool) -> Outputs {
        let file = |path: &PathBuf| frames::file(path, frame, several);
        Outputs {
            exr: self.exr.as_ref().map(file),
            previews: self.previews.iter().map(file).collect(),
            stdout: self.stdout,
            show: self.show,
            stats: self.stats.as_ref().map(file),
            report: self.report.as_ref().map(file),
            error_log: self.error_log.as_ref().map(file),
            preview: self.preview.clone(),
            checkpoint: self.checkpoint.as_ref().map(|(every, path)| (*every, file(path))),
        }
    }

    /// Whether the pictures and what is written about them are all there.
    pub fn exist(&self) -> bool {
        self.exr.iter().chain(&self.previews).chain(&self.stats).chain(&self.report).all(|path| path.is_file())
    }

    /// The scene's own files, known once it is loaded, are none of the outputs.
    ///
    /// # Errors
    /// [`Error::Option`] naming the file.
    pub fn spare(&self, inputs: &[PathBuf]) -> Result<()> {
        for (option, path) in self.files() {
            if path.canonicalize().is_ok_and(|file| inputs.contains(&file)) {
                return refuse(option, format!("{} is also read by this render", path.display()));
            }
        }
        Ok(())
    }

    /// Each output can be written and is another file than the others and than the `inputs`; the checkpoint alone may
    /// be the state that is gone on with.
    fn check_files(
        &self,
        inputs: [Option<&PathBuf>; 3],
        resume: Option<&Path>,
        (make_path, frames): (bool, bool),
    ) -> Result<()> {
        let inputs: Vec<PathBuf> = inputs.into_iter().flatten().filter_map(|path| path.canonicalize().ok()).collect();
        let mut places: Vec<PathBuf> = Vec::new();
        for (option, path) in self.files() {
            if frames::is_pattern(path) && !frames {
                let name = path.display();
                return refuse(
                    option,
                    format!("{name} is a pattern of many names, and this is one picture; name it, or give --frames"),
                );
            }
            folder_of(path, make_path)?;
            check_writable(path)?;
            let place = place(path);
            if places.contains(&place) {
                return refuse(option, format!("{} is named as two outputs", path.display()));
            }
            if option != "--checkpoint" && resume.is_some_and(|resume| self::place(resume) == place) {
                return refuse(option, format!("{} is also read by this render", path.display()));
            }
            places.push(place);
        }
        self.spare(&inputs)
    }
}

/// Whether a path means stdout.
fn is_stdout(path: &Path) -> bool {
    [STREAM, "/dev/stdout"].iter().any(|name| path == Path::new(name))
}

/// Makes the folder of an output, or says what would.
fn folder_of(path: &Path, make_path: bool) -> Result<()> {
    let folder = path.parent().filter(|folder| *folder != Path::new("") && !folder.exists());
    let Some(folder) = folder else { return Ok(()) };
    if make_path {
        return std::fs::create_dir_all(folder).map_err(|source| Error::io(folder, "make", source));
    }
    let problem = format!("folder {} does not exist; --make-path makes it", folder.display());
    Err(Error::io(path, "write", std::io::Error::new(std::io::ErrorKind::NotFound, problem)))
}

/// The scene that a path means: itself, or the only one in the folder that it names.
///
/// # Errors
/// [`Error::Option`] for a folder with none or several, [`Error::Io`] for one that cannot be read.
pub fn scene_file(path: &Path) -> Result<PathBuf> {
    if path == Path::new(STREAM) || !path.is_dir() {
        return Ok(path.into());
    }
    let entries = std::fs::read_dir(path).map_err(|source| Error::io(path, "read", source))?;
    let is_scene = |file: &PathBuf| matches!(extension(file).as_deref(), Some("gltf" | "glb")) && file.is_file();
    let mut scenes: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).filter(is_scene).collect();
    scenes.sort();
    let name = |path: &PathBuf| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    match scenes.len() {
        1 => Ok(scenes.remove(0)),
        0 => refuse("SCENE", format!("{} is a folder without .gltf and .glb in it", path.display())),
        n => {
            let first = scenes.iter().take(3).map(name).collect::<Vec<_>>().join(", ");
            let more = if n > 3 { ", …" } else { "" };
            refuse("SCENE", format!("{} is a folder with {n} scenes; name one: {first}{more}", path.display()))
        }
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
    // The plan's rule, early where it takes no scene.
    if let Some(backend) = args.backend {
        select::check(backend, pins(args))?;
    }
    if args.roulette == Switch::Off && args.roulette_start != ROULETTE_START {
        return refuse("--roulette-start", "it has no effect with --roulette off".into());
    }
    Ok(())
}

/// What the backend is held to.
fn pins(args: &SettingsArgs) -> Pins<'_> {
    Pins { rays: query_mode(args.rays), isa: args.isa.as_deref(), robust: args.robust == Switch::On }
}

fn query_mode(rays: Rays) -> Option<QueryMode> {
    match rays {
        Rays::Auto => None,
        Rays::Mode(mode) => Some(mode),
    }
}

/// Loads a scene as `settings` say, and puts its camera where they say.
///
/// # Errors
/// As [`Scene::load_with`], and [`ViewArgs::apply`](super::looks::ViewArgs::apply).
pub fn load(path: &Path, settings: &SettingsArgs, fallback: Fallback) -> Result<Scene> {
    let mut scene =
        load_from(path, &settings.content, &settings.environment, settings.files, settings.textures, fallback)?;
    prepare(settings, &mut scene, Absent::Refused)?;
    Ok(scene)
}

/// Puts the camera of a loaded scene where `settings` say, and leaves out what they say.
///
/// # Errors
/// As [`ViewArgs::apply`](super::looks::ViewArgs::apply) and [`leave_out`].
pub fn prepare(args: &SettingsArgs, scene: &mut Scene, absent: Absent) -> Result<()> {
    let choice = camera(args, scene);
    args.view.apply(scene, &choice, sides(args))?;
    if !args.without.is_empty() {
        // What it changes of the options, `settings` changes again.
        leave_out(scene, &mut settings(args, scene), &args.without, absent)?;
    }
    Ok(())
}

/// Columns and rows that were asked for.
fn sides(settings: &SettingsArgs) -> (Option<u32>, Option<u32>) {
    let size = settings.view.size;
    (size.map(|size| size.0).or(settings.width), size.map(|size| size.1).or(settings.height))
}

fn camera(settings: &SettingsArgs, scene: &Scene) -> CameraChoice {
    settings.camera.as_deref().map_or(CameraChoice::First, |text| CameraChoice::named(text, scene))
}

/// What lights a scene that states no light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fallback {
    /// White from everywhere, with a warning.
    White,
    /// The studio.
    Studio,
}

impl Fallback {
    /// That of `render`.
    pub fn of(args: &RenderArgs) -> Self {
        if args.quick { Fallback::Studio } else { Fallback::White }
    }
}

/// Loads a scene as the parts of settings say that loading reads.
///
/// # Errors
/// As [`Scene::load_with`].
pub fn load_from(
    path: &Path,
    content: &ContentArgs,
    environment: &EnvironmentArgs,
    files: FileArgs,
    textures: TextureArgs,
    fallback: Fallback,
) -> Result<Scene> {
    let shutter = content.at.or(content.shutter);
    if content.animation.is_some() && shutter.is_none() {
        return refuse("--animation", "it runs at a time: add --at SECONDS or --shutter OPEN,CLOSE".into());
    }
    let options = load_options(content, environment, files, textures, fallback)?.shutter(shutter);
    let path = scene_file(path)?;
    let mut scene = match path.as_os_str() == STREAM {
        true => Scene::from_bytes(stdin()?, &path, &options)?,
        false => Scene::load_with(path, &options)?,
    };
    light(&mut scene, environment, fallback);
    Ok(scene)
}

/// Lights a loaded scene by the studio, where that is asked for or falls back on.
pub fn light(scene: &mut Scene, environment: &EnvironmentArgs, fallback: Fallback) {
    let wanted = wants_studio(scene, environment, fallback);
    light_as(scene, environment, wanted);
}

/// Whether the studio is asked for or fallen back on.
pub fn wants_studio(scene: &Scene, environment: &EnvironmentArgs, fallback: Fallback) -> bool {
    let asked = environment.env.as_deref() == Some(Path::new(STUDIO));
    asked || (fallback == Fallback::Studio && !scene.has_light())
}

/// Lights a loaded scene by the studio, if it is `wanted`; it is said where nobody asked for it.
pub fn light_as(scene: &mut Scene, environment: &EnvironmentArgs, wanted: bool) {
    if wanted {
        if environment.env.is_none() {
            let what = "no light of any kind: lit by the studio that is built in (--env FILE: by another environment)";
            scene.warnings.push(Warning { place: scene.file.display().to_string(), what: what.into() });
        }
        let (rotation_rad, intensity) = (environment.env_rotation.to_radians(), environment.env_intensity);
        scene.environment = Some(Environment { rotation_rad, intensity, ..Environment::studio() });
    }
}

/// The file of the environment, unless it is built in.
pub fn environment_file(environment: &EnvironmentArgs) -> Option<PathBuf> {
    environment.env.clone().filter(|env| env != Path::new(STUDIO))
}

/// How a scene is loaded under these settings, but for the shutter.
///
/// # Errors
/// [`Error::Option`] for an environment that is a scene.
pub fn load_options(
    content: &ContentArgs,
    environment: &EnvironmentArgs,
    files: FileArgs,
    textures: TextureArgs,
    fallback: Fallback,
) -> Result<LoadOptions> {
    let rotation_rad = environment.env_rotation.to_radians();
    let intensity = environment.env_intensity;
    let studio = environment.env.as_deref() == Some(Path::new(STUDIO));
    if let Some(env) = &environment.env
        && matches!(extension(env).as_deref(), Some("gltf" | "glb"))
    {
        let problem = format!("{} is a scene; an environment is an image, .exr or .hdr, or studio", env.display());
        return refuse("--env", problem);
    }
    let file = environment_file(environment);
    let missing_texture = match textures.missing_texture {
        MissingTextureName::Error => MissingTexture::Error,
        MissingTextureName::Magenta => MissingTexture::Magenta,
    };
    let decoder = match textures.image_formats {
        ImageFormatsName::Known => Decoder::Default,
        ImageFormatsName::All => Decoder::Any,
    };
    Ok(LoadOptions::default()
        .environment(file.map(|path| EnvironmentFile { path, rotation_rad, intensity }))
        .fallback_light(!studio && fallback == Fallback::White)
        .allow_outside(files.allow_outside)
        .allow_missing_extensions(files.allow_missing_extensions)
        .scene(content.scene_of_file.clone())
        .variant(content.variant.clone())
        .animation(content.animation.clone())
        .texture_budget(Budget { bytes: textures.texture_memory << 20, decoder })
        .missing_texture(missing_texture))
}

/// All of stdin.
fn stdin() -> Result<Vec<u8>> {
    let mut input = std::io::stdin().lock();
    if input.is_terminal() {
        return refuse(
            "SCENE",
            "- reads a .glb from stdin, which is a terminal: pathspace render - < scene.glb".into(),
        );
    }
    let mut bytes = Vec::new();
    input.read_to_end(&mut bytes).map_err(|source| Error::io("stdin", "read", source))?;
    Ok(bytes)
}

/// Options of the render, settled against the scene.
pub fn options(args: &RenderArgs, scene: &Scene) -> RenderOptions {
    let options = RenderOptions {
        spp: args.spp,
        time: args.time,
        error: args.error,
        min_spp: args.min_spp,
        aovs: layers(args),
        light_groups: args.light_group.clone(),
        survey: args.production.survey.clone(),
        ..settings(&args.settings, scene)
    };
    if args.quick { quick::options(args, options) } else { options }
}

/// Layers that the film gathers: those asked for, and what previews need.
fn layers(args: &RenderArgs) -> Vec<Aov> {
    let layers = args.layers();
    let more = args.look.layers().iter().filter(|aov| !layers.contains(aov));
    layers.iter().chain(more).copied().collect()
}

/// What does not limit the render, settled against the scene.
pub fn settings(args: &SettingsArgs, scene: &Scene) -> RenderOptions {
    let (camera, (width, height)) = (camera(args, scene), sides(args));
    let mut options = RenderOptions {
        crop: args.crop,
        seed: args.seed,
        threads: args.threads.map_or(0, |n| n as usize),
        fog: args.fog,
        lens: args.aperture_radius.zip(args.focus_distance).map(|(radius_m, focus_m)| Lens { radius_m, focus_m }),
        filter: args.filter,
        max_depth: args.max_depth,
        roulette: match args.roulette {
            Switch::On => Roulette::On,
            Switch::Off => Roulette::Off,
        },
        roulette_start: args.roulette_start,
        strategy: match args.strategy {
            StrategyName::Mis => Strategy::MIS,
            StrategyName::MisBalance => Strategy::MIS_BALANCE,
            StrategyName::Bsdf => Strategy::BSDF,
            StrategyName::Light => Strategy::LIGHT,
        }
        .with(args.techniques.samples),
        light_paths: args.techniques.light_paths,
        guiding: args.techniques.guiding,
        sampler: args.sampler,
        texture_filter: match args.texture_filter {
            TextureFilterName::Exact => TextureFilter::Exact,
            TextureFilterName::Trilinear => TextureFilter::Trilinear,
        },
        fold_normals: args.fold_normals == Switch::On,
        multiscatter: args.multiscatter == Switch::On,
        backfaces: args.backfaces.into(),
        backend: args.backend,
        rays: query_mode(args.rays),
        isa: args.isa.clone(),
        forced: if args.no_plan { Gate::ALL.to_vec() } else { Vec::new() },
        robust: args.robust == Switch::On,
        ..RenderOptions::default().camera(camera).sized_for(scene, width, height)
    };
    without::settle(scene, &mut options);
    options
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

    #[test]
    fn spellings_of_one_path_are_one_place() {
        let root = env!("CARGO_MANIFEST_DIR");
        let spellings = ["a.exr", "./a.exr", "src/../a.exr"].map(|name| place(&Path::new(root).join(name)));
        assert!(spellings.iter().all(|spelling| *spelling == spellings[0]), "{spellings:?}");
        // Tests run in the package's folder.
        assert_eq!(place(Path::new("a.exr")), spellings[0]);
        assert_ne!(place(Path::new("src/a.exr")), spellings[0]);
    }
}
