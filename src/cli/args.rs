//! The arguments as they are typed: names, types, units, help. Nothing here looks at a scene; [`job`](super::job) does.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, CommandFactory, FromArgMatches, Parser, Subcommand, ValueEnum};

use super::denoising::DenoiseArgs;
use super::exr::ExrArgs;
use super::farm::FarmArgs;
use super::live::args::{DEFAULT_ADDRESS, LiveArgs};
use super::looks::{LookArgs, ViewArgs};
use super::merge::MergeArgs;
use super::production::{ProductionArgs, SequenceArgs};
use super::units::{self, Found};
use crate::backend::{BackendKind, QueryMode};
use crate::error::{Error, Result};
use crate::film::filter::FilterKind;
use crate::film::layer::LAYERS;
use crate::plan::Aov;
use crate::plan::light_groups::LightGroup;
use crate::plan::options::{Backfaces, ROULETTE_START};
use crate::render::{Crop, Fog};
use crate::sampler::SamplerKind;
use crate::scene::Shutter;
use crate::texture::load as loading;

/// Path tracing of glTF 2.0 scenes to OpenEXR on the CPU.
#[derive(Debug, Parser)]
#[command(name = "pathspace", version, propagate_version = true, before_help = FIRST_LOOK, after_help = EXIT_CODES)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The options of `render` that people use: what `-h` shows. `--help` has all.
const COMMON: [&str; 16] = [
    "scene",
    "output",
    "png",
    "tone_map",
    "transparent",
    "background",
    "aov",
    "spp",
    "time",
    "error",
    "size",
    "camera",
    "camera_orbit",
    "env",
    "threads",
    "verbose",
];

impl Cli {
    /// The one definition of every command and flag, from which parsing, help, completions and pages are made.
    pub fn definition() -> clap::Command {
        let hint = "Not all options are shown: pathspace render --help has them.";
        let brief = |arg: clap::Arg| match COMMON.contains(&arg.get_id().as_str()) {
            true => arg,
            false => arg.hide_short_help(true),
        };
        Cli::command().mut_subcommand("render", |render| {
            let whole = render.get_after_help().cloned().unwrap_or_default();
            render.mut_args(brief).after_long_help(whole).after_help(hint)
        })
    }

    /// Whether `words` are a command line.
    ///
    /// # Errors
    /// [`Error::Option`] with the reason in one line.
    pub fn check(words: Vec<String>) -> Result<()> {
        Cli::definition().try_get_matches_from(words).map(drop).map_err(|error| {
            let text = error.to_string();
            let reason = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_string();
            Error::Option { option: "RENDER OPTIONS", problem: reason }
        })
    }

    /// What this process was given besides its command, each option once and by its long name: the argument's name
    /// here, and its words.
    pub fn given() -> Vec<(String, Vec<String>)> {
        let definition = Cli::definition();
        let matches = definition.clone().try_get_matches_from(with_command(std::env::args_os().collect()));
        let Ok(matches) = matches else { return Vec::new() };
        let Some((name, matches)) = matches.subcommand() else { return Vec::new() };
        let arguments = definition.find_subcommand(name).into_iter().flat_map(clap::Command::get_arguments);
        let given =
            arguments.filter(|arg| matches.value_source(arg.get_id().as_str()) == Some(ValueSource::CommandLine));
        given.map(|arg| (arg.get_id().to_string(), words_of(arg, matches))).collect()
    }

    /// Reads the command line as people write it: a scene without a command is rendered for a first look.
    pub fn read(words: Vec<OsString>) -> Cli {
        let matches = Cli::definition().get_matches_from(with_command(words));
        Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit())
    }
}

/// What `arg` looks like on a command line.
fn words_of(arg: &clap::Arg, matches: &ArgMatches) -> Vec<String> {
    let option = format!("--{}", arg.get_long().unwrap_or_default());
    if !arg.get_action().takes_values() {
        return vec![option];
    }
    let occurrences = matches.get_raw_occurrences(arg.get_id().as_str()).into_iter().flatten();
    let mut words = Vec::new();
    for values in occurrences {
        let values = values.map(|value| value.to_string_lossy().into_owned());
        let values: Vec<String> = match arg.get_value_delimiter() {
            Some(delimiter) => vec![values.collect::<Vec<_>>().join(&delimiter.to_string())],
            None => values.collect(),
        };
        match values.first() {
            _ if arg.is_positional() => words.extend(values),
            // What begins like an option is a value here.
            Some(value) if value.starts_with('-') => words.push(format!("{option}={value}")),
            _ => words.extend([option.clone()].into_iter().chain(values)),
        }
    }
    words
}

/// `words` with `render --quick` before a scene that no command stands before, nor a word that may be meant as one.
fn with_command(mut words: Vec<OsString>) -> Vec<OsString> {
    let commands = Cli::command();
    let is_command = |word: &OsString| {
        let mut names = commands.get_subcommands().map(clap::Command::get_name).chain(["help"]);
        names.any(|name| word == name)
    };
    let is_scene = |word: &OsString| {
        let path = Path::new(word);
        let ending =
            path.extension().is_some_and(|e| ["gltf", "glb"].iter().any(|scene| e.eq_ignore_ascii_case(scene)));
        ending || word == "-" || path.is_dir()
    };
    let is_option = |word: &OsString| word.as_encoded_bytes().starts_with(b"-");
    if words.get(1).is_some_and(|word| !is_option(word) && !is_scene(word)) {
        return words;
    }
    let first = words.iter().skip(1).position(|word| is_command(word) || is_scene(word));
    if first.is_some_and(|at| is_scene(&words[at + 1]) && !is_command(&words[at + 1])) {
        words.splice(1..1, ["render".into(), "--quick".into()]);
    }
    words
}

const FIRST_LOOK: &str = "\
Without a command, `pathspace SCENE` renders a first look in about 10 s: SCENE.png and SCENE.exr in this folder. \
Options of `render` may follow.";

const EXIT_CODES: &str = "\
Exit codes: 0 done and target met; 1 input/output or internal error; 2 usage; 3 stopped by time or samples before the \
error target; 4 scene invalid or a required extension unsupported; 5 non-finite samples; 128+n on signal n (what was \
rendered is written first). `compare` has its own: see its help.";

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to OpenEXR or PNG
    Render(Box<RenderArgs>),
    /// See a scene in a browser as it gets better, and move the camera there
    View(Box<ViewerArgs>),
    /// Show what a scene asks for, what will be simulated of it, and what not and why
    Info(InfoArgs),
    /// Compare two OpenEXR images: error metrics, and a verdict as an exit code
    Compare(CompareArgs),
    /// Check the path tracer against a deterministic solver of diffuse scenes, path length by path length
    Verify(VerifyArgs),
    /// Measure the ray backends on a scene's own rays: rates, build time, memory, agreement, and what a render makes of
    /// them
    Bench(BenchArgs),
    /// Measure what accuracy costs in time: a price list, techniques, and the bias of what trades accuracy for time
    Accuracy(Box<AccuracyArgs>),
    /// Join parts of one picture, rendered apart, to its very bits
    Merge(MergeArgs),
    /// Write a job for Slurm or OpenJD that renders a picture or a sequence on many machines
    Farm(FarmArgs),
    /// Check what native parts this build and this machine have, and say what to install
    Doctor,
    /// Print what completes commands and options in a shell: `pathspace completions bash`
    Completions {
        /// Which shell
        shell: clap_complete::Shell,
    },
    /// Write the manual pages to a folder
    Man {
        /// Folder, made if missing
        folder: PathBuf,
    },
}

/// `render`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Of --spp, --time and --error the first that is met ends the render; with none of them it is 64 samples per pixel.\n\
Example: pathspace render scene.gltf -o scene.exr --error 2% --time 10m --png scene.png\n\
A pixel looks wrong? pathspace render scene.gltf --pixel 31,40 lists its samples; with --sample 7 the path of \
one is told.\n\
Give the options of the picture itself (size, seed, filter, …): then they are the very paths of the picture, \
bit for bit."
)]
pub struct RenderArgs {
    /// Scene, .gltf or .glb; a folder with one of them in it; - for a .glb on stdin
    pub scene: PathBuf,

    /// Picture to write, .exr (linear, float), .png or .jpg (8-bit sRGB preview); - for a PNG on stdout [default:
    /// SCENE.exr in the current folder, unless --png or --jpg names a picture]
    #[arg(short, long, value_name = "FILE", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Also write an 8-bit sRGB preview
    #[arg(long, value_name = "FILE.png", help_heading = "Output")]
    pub png: Option<PathBuf>,
    /// What previews look like.
    #[command(flatten)]
    pub look: LookArgs,
    /// Who sees it while it runs.
    #[command(flatten)]
    pub live: LiveArgs,
    /// First look, as `pathspace SCENE` alone: SCENE.png and SCENE.exr of a size and within a time that give a clean
    /// picture in about 10 s on two cores, the studio where the scene has no light, the neutral tone curve. Whatever is
    /// given besides holds
    #[arg(long, help_heading = "Output")]
    pub quick: bool,
    /// Draw the finished picture in the terminal as well, in half blocks of 24-bit colour
    #[arg(long, help_heading = "Output")]
    pub show: bool,
    /// Make the folders of outputs where they are missing
    #[arg(long, alias = "make-output-path", help_heading = "Output")]
    pub make_path: bool,
    /// Layers besides the beauty.
    #[arg(
        long,
        value_name = "LIST",
        value_delimiter = ',',
        value_parser = aov_parser(),
        ignore_case = true,
        help = aov_help(),
        help_heading = "Output"
    )]
    pub aov: Vec<Aov>,
    /// Put the lamps whose names fit PATTERN into light group NAME, and write a layer lightgroup_NAME for each group;
    /// may be repeated, the first that fits counts. `*` is any text, `?` any character; `environment` is a name, too.
    /// Adds to what the nodes of the scene say, and implies --aov lightgroups
    #[arg(long, value_name = "NAME=PATTERN", help_heading = "Output")]
    pub light_group: Vec<LightGroup>,
    /// Write R, G, B and A of the EXR in 16 bits: half the size, rounded to 1 part in 2048, at most 65504
    #[arg(long, help_heading = "Output")]
    pub half: bool,
    /// Leave the clock out of the EXR: equal renders are then equal files, byte for byte, on any number of threads
    #[arg(long, help_heading = "Output")]
    pub reproducible: bool,
    /// What the EXR is like.
    #[command(flatten)]
    pub exr: ExrArgs,
    /// What denoisers want.
    #[command(flatten)]
    pub denoise: DenoiseArgs,
    /// Write statistics as JSON; - for stdout
    #[arg(long, value_name = "FILE.json", help_heading = "Output")]
    pub stats: Option<PathBuf>,
    /// Write a page for a browser, complete in itself: the picture, a map of its noise, the layers of --aov, the plan,
    /// the known biases, the error against time, the statistics, and the command line
    #[arg(long, value_name = "FILE.html", help_heading = "Output")]
    pub report: Option<PathBuf>,
    /// Picture to hold the render against while it runs, OpenEXR of the same size; needs --error-log
    #[arg(long, value_name = "REF.exr", requires = "error_log", help_heading = "Output")]
    pub reference: Option<PathBuf>,
    /// Write a line after every pass: seconds, spp, error against the reference, and the estimated one with its
    /// interval
    #[arg(long, value_name = "RUN.csv", requires = "reference", help_heading = "Output")]
    pub error_log: Option<PathBuf>,

    /// Stop at N samples per pixel [default without any limit: 64]
    #[arg(
        short = 's', long, visible_alias = "samples", value_name = "N",
        value_parser = units::samples, help_heading = "Stopping"
    )]
    pub spp: Option<u64>,
    /// Stop after this wall time of rendering: 90s, 10m, 1h30m
    #[arg(long, value_name = "DURATION", value_parser = units::duration, help_heading = "Stopping")]
    pub time: Option<Duration>,
    /// Stop when the relative RMSE (√relMSE) of the picture is below this with confidence, as estimated: 1% or 0.01
    #[arg(long, value_name = "E", value_parser = units::fraction, help_heading = "Stopping")]
    pub error: Option<f64>,
    /// Samples per pixel before --error may stop the render; it also waits for 65536 samples over the picture
    #[arg(
        long, value_name = "N", default_value_t = 16, requires = "error",
        value_parser = clap::value_parser!(u64).range(2..), help_heading = "Stopping"
    )]
    pub min_spp: u64,

    /// Write no picture: list what each sample of this pixel of the full picture gave (--spp or --time of them), the
    /// largest marked
    #[arg(long, value_name = "X,Y", value_parser = units::pixel, help_heading = "Replay", conflicts_with_all = [
        "preview", "serve", "display_server", "show", "output", "png", "jpg", "quick", "exposure", "tone_map",
        "transparent", "background", "make_path", "aov", "half", "reproducible", "pass_names", "colorspace", "stats",
        "report", "reference", "error_log", "error", "crop", "progress", "denoiser_layers", "denoise",
    ])]
    pub pixel: Option<(u32, u32)>,
    /// Tell the path of this one sample, from 0, vertex by vertex: positions, normals, lobes, densities, weights,
    /// contributions
    #[arg(long, value_name = "N", requires = "pixel", conflicts_with_all = ["spp", "time"], help_heading = "Replay")]
    pub sample: Option<u64>,
    /// Print the replay as JSON
    #[arg(long, requires = "pixel", help_heading = "Replay")]
    pub json: bool,

    /// Its state.
    #[command(flatten)]
    pub production: ProductionArgs,

    /// Its frames.
    #[command(flatten)]
    pub sequence: SequenceArgs,

    /// What is looked at, and how.
    #[command(flatten)]
    pub settings: SettingsArgs,

    /// Progress: a bar on a terminal, else a line each 10 % (auto); JSON objects, one a line, on stdout (ndjson); for
    /// Open Job Description (openjd)
    #[arg(long, value_enum, ignore_case = true, default_value = "auto", help_heading = "Reporting")]
    pub progress: ProgressKind,
    /// Print errors only
    #[arg(short, long, conflicts_with = "verbose", help_heading = "Reporting")]
    pub quiet: bool,
    /// Print the plan, the backend and the times of each step
    #[arg(short, long, help_heading = "Reporting")]
    pub verbose: bool,
}

/// `view`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Drag turns the camera, shift and wheel move it to and fro, the wheel zooms into the picture, a click tells the \
path of a sample. A scene without light stands in the studio."
)]
pub struct ViewerArgs {
    /// Scene, .gltf or .glb, or a folder with one of them in it
    pub scene: PathBuf,
    /// Where the page is served
    #[arg(long, value_name = "HOST:PORT", default_value = DEFAULT_ADDRESS)]
    pub address: String,
    /// Let other machines reach it; the page is then opened by a secret in its address
    #[arg(long)]
    pub serve_anywhere: bool,
    /// Samples per pixel after which a view is complete
    #[arg(
        short = 's', long, visible_alias = "samples", value_name = "N", default_value_t = 4096,
        value_parser = units::samples
    )]
    pub spp: u64,
    /// Print errors only
    #[arg(short, long)]
    pub quiet: bool,
    /// What is looked at, and how.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

/// Picture, camera, environment, transport and machine, as `render`, `accuracy` and `bench` take them.
#[derive(Debug, Args)]
pub struct SettingsArgs {
    /// Columns of the full picture, pixels [default: from the height and the aspect; else what the scene suggests, else
    /// 1280]
    #[arg(long, value_name = "W", value_parser = units::side, help_heading = "Picture")]
    pub width: Option<u32>,
    /// Rows of the full picture, pixels [default: from the width and the aspect of the scene's suggestion or camera]
    #[arg(long, value_name = "H", value_parser = units::side, help_heading = "Picture")]
    pub height: Option<u32>,
    /// What is seen, besides what the scene says.
    #[command(flatten)]
    pub view: ViewArgs,
    /// Render only this window, pixels from the top left corner
    #[arg(long, value_name = "WxH+X+Y", value_parser = units::crop, help_heading = "Picture")]
    pub crop: Option<Crop>,
    /// Pixel filter
    #[arg(
        long, default_value = "blackman-harris", value_parser = filter_parser(), ignore_case = true,
        help_heading = "Picture"
    )]
    pub filter: FilterKind,

    /// Camera by name, or by index from 0 [default: the first]
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Camera")]
    pub camera: Option<String>,
    /// Radius of a thin lens, metres; needs --focus-distance [default: a pinhole]
    #[arg(long, value_name = "M", requires = "focus_distance", value_parser = units::length_m, help_heading = "Camera")]
    pub aperture_radius: Option<f32>,
    /// Distance of the plane in focus along the view axis, metres
    #[arg(
        long, value_name = "M", requires = "aperture_radius", value_parser = units::length_m,
        help_heading = "Camera"
    )]
    pub focus_distance: Option<f32>,

    /// A medium that fills the scene: attenuation per metre, the share of it that scatters (0 to 1), and the mean
    /// cosine of scattering (-1 to 1, 0 is even). It ends at the sphere around the scene's bounds and the camera
    #[arg(
        long, value_name = "SIGMA_T,ALBEDO,G", value_parser = units::fog, allow_hyphen_values = true,
        help_heading = "Environment"
    )]
    pub fog: Option<Fog>,

    /// What of the file is shown.
    #[command(flatten)]
    pub content: ContentArgs,

    /// The environment.
    #[command(flatten)]
    pub environment: EnvironmentArgs,

    /// Files that the scene names.
    #[command(flatten)]
    pub files: FileArgs,

    /// Textures.
    #[command(flatten)]
    pub textures: TextureArgs,

    /// exact: textures as the file's sampler magnifies them, at every distance; trilinear: averaged over the width of
    /// the path (ray cones and pyramids), less noise from fine patterns seen from afar, and a bias that `accuracy`
    /// measures
    #[arg(long, value_enum, ignore_case = true, default_value = "exact", help_heading = "Textures")]
    pub texture_filter: TextureFilterName,
    /// Where normal maps tilt lobes below the surface: on sends that light to its mirror image above and turns facets
    /// that face away to the viewer, so that none is lost; off loses it, as most renderers do
    #[arg(long, value_enum, ignore_case = true, default_value = "on", help_heading = "Textures")]
    pub fold_normals: Switch,

    /// Give back what rough metals and glass lose to light that their facets scatter more than once, up to two thirds
    #[arg(long, value_enum, ignore_case = true, default_value = "off", help_heading = "Light transport")]
    pub multiscatter: Switch,
    /// Who meets the backs of surfaces that are not doubleSided: every ray (show), every ray but the camera's (hide),
    /// or none (hide-all)
    #[arg(long, value_enum, ignore_case = true, default_value = "show", help_heading = "Light transport")]
    pub backfaces: BackfacesName,
    /// Longest path in edges; 1 shows emitters only
    #[arg(
        long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536),
        help_heading = "Light transport"
    )]
    pub max_depth: u32,
    /// End paths at random where they carry little (unbiased either way)
    #[arg(long, value_enum, ignore_case = true, default_value = "on", help_heading = "Light transport")]
    pub roulette: Switch,
    /// First path vertex at which --roulette on may end a path (unbiased at any); 1 is the first surface
    #[arg(
        long, value_name = "N", default_value_t = ROULETTE_START,
        value_parser = clap::value_parser!(u32).range(1..=65536), help_heading = "Light transport"
    )]
    pub roulette_start: u32,
    /// Combine light and BSDF sampling by the power heuristic (mis), the balance heuristic, or use one alone
    #[arg(long, value_enum, ignore_case = true, default_value = "mis", help_heading = "Light transport")]
    pub strategy: StrategyName,
    /// How light is found: auto, or a list of bsdf, light, guide and light-paths; light-paths:0.25 says how many for
    /// each sample
    ///
    /// Light paths start at the lights, are aimed at mirrors, glass and smooth metal, and are connected with the
    /// camera. A guide learns before the first sample from where light comes, and is mixed with bsdf. auto takes both
    /// where they pay. Alone, light-paths leaves to them what they can find, and to the others the
    /// rest.
    #[arg(
        long, value_name = "LIST", default_value = "auto", conflicts_with = "strategy",
        value_parser = units::techniques,
        help_heading = "Light transport"
    )]
    pub techniques: Found,
    /// Random numbers: Owen-scrambled Sobol points, or independent
    #[arg(
        long, ignore_case = true, default_value = "sobol", value_parser = samplers(), help_heading = "Light transport"
    )]
    pub sampler: SamplerKind,
    /// Leave effects out that the scene calls for, by the names that `info` lists: normal-maps, clearcoat, lens, …; or
    /// depth:N for paths of more than N edges, lamp:PATTERN for lamps, technique:NAME for a way of finding light. Each
    /// effect is an entry of the ledger of biases; `accuracy --effects` measures what they cost
    #[arg(long, value_name = "EFFECT", value_delimiter = ',', help_heading = "Light transport")]
    pub without: Vec<String>,
    /// Seed of every random number
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Light transport")]
    pub seed: u64,

    /// Worker threads [default: as many as the process may use: affinity mask, cgroup, SLURM_CPUS_PER_TASK]
    #[arg(
        short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096),
        help_heading = "Machine"
    )]
    pub threads: Option<u32>,
    /// Ray backend [default: the one whose work for the scene's own rays counts least; `info` tells which, and why]
    #[arg(long, value_parser = backend_parser(), ignore_case = true, help_heading = "Machine")]
    pub backend: Option<BackendKind>,
    /// How rays are handed to the backend; auto lets the plan choose for each class of rays. Only embree knows more
    /// than one way
    #[arg(long, default_value = "auto", value_parser = rays_parser(), ignore_case = true, help_heading = "Machine")]
    pub rays: Rays,
    /// Embree's robust traversal; off is faster and loses rays at edges shared by triangles (the other backends have no
    /// such mode)
    #[arg(long, value_enum, ignore_case = true, default_value = "on", help_heading = "Machine")]
    pub robust: Switch,
    /// Pin the instruction set; obvhs, flat and flat+obvhs know avx2 and avx512, brute knows none
    #[arg(long, value_parser = isa_parser(), ignore_case = true, help_heading = "Machine")]
    pub isa: Option<String>,

    /// Run every stage, also those that nothing calls for: the same picture, later
    #[arg(long, hide = true)]
    pub no_plan: bool,
}

impl SettingsArgs {
    /// Whether the picture's size or window was given.
    pub fn is_sized(&self) -> bool {
        self.width.or(self.height).is_some() || self.view.size.is_some() || self.crop.is_some()
    }
}

/// What of a file is shown, and when, as `render` and `info` take it.
#[derive(Clone, Debug, Args)]
pub struct ContentArgs {
    /// Scene of the file by name, or by index from 0 [default: the one that the file says]
    #[arg(long = "scene", value_name = "NAME|INDEX", help_heading = "Content")]
    pub scene_of_file: Option<String>,
    /// Variant of the materials by name, or by index from 0 (KHR_materials_variants); `info` lists them
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Content")]
    pub variant: Option<String>,
    /// Animation that runs, by name or by index from 0; needs --at or --shutter [default: all run]
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Content")]
    pub animation: Option<String>,
    /// Show the scene as its animations have it at this time; nothing is blurred [default: as its nodes say, without
    /// animation]
    #[arg(
        long, value_name = "SECONDS", value_parser = units::moment, conflicts_with = "shutter", help_heading = "Content"
    )]
    pub at: Option<Shutter>,
    /// When the shutter is open, seconds of the animations' time. What moves meanwhile is blurred; OPEN = CLOSE is
    /// --at OPEN. Motion goes along straight lines between up to 33 poses
    #[arg(long, value_name = "OPEN,CLOSE", value_parser = units::shutter, help_heading = "Content")]
    pub shutter: Option<Shutter>,
}

/// The environment, as `render` and `info` take it.
#[derive(Debug, Args)]
pub struct EnvironmentArgs {
    /// Equirectangular environment, .exr or .hdr (linear Rec.709)
    #[arg(long, value_name = "FILE", help_heading = "Environment")]
    pub env: Option<PathBuf>,
    /// Turn the environment counter-clockwise seen from above, degrees
    #[arg(
        long, value_name = "DEG", default_value = "0", requires = "env", value_parser = units::finite,
        help_heading = "Environment"
    )]
    pub env_rotation: f32,
    /// Multiply the environment's radiance
    #[arg(
        long, value_name = "X", default_value = "1", requires = "env", value_parser = units::not_negative,
        help_heading = "Environment"
    )]
    pub env_intensity: f32,
}

/// Files that a scene names, as every command that loads one takes it.
#[derive(Clone, Copy, Debug, Args)]
pub struct FileArgs {
    /// Read buffers and images that lie outside of the scene's folder as well (absolute paths, `..`, links)
    #[arg(long, help_heading = "Files")]
    pub allow_outside: bool,
    /// Load files that require extensions of materials which are not supported, with a warning for each
    #[arg(long, help_heading = "Files")]
    pub allow_missing_extensions: bool,
}

/// How images become textures, as `render` and `info` take it.
#[derive(Clone, Copy, Debug, Args)]
pub struct TextureArgs {
    /// Memory of decoded textures: 512M, 4G, or MB (2^20 bytes). If they need more, the largest stay in their files
    /// behind a cache of tiles: the same picture, later. Files in tiles (.tx by maketx, tiled EXR) are looked up where
    /// they are, others are copied to TMPDIR first
    #[arg(
        long, value_name = "MB", default_value_t = loading::DEFAULT_BYTES >> 20,
        value_parser = texture_memory,
        help_heading = "Textures"
    )]
    pub texture_memory: u64,
    /// What an image does that is missing, broken or not finite: end the load with an error, or a warning and magenta
    /// in its place
    #[arg(long, value_enum, ignore_case = true, default_value = "error", help_heading = "Textures")]
    pub missing_texture: MissingTextureName,
    /// Image files that are read: `known` are PNG, JPEG, WebP, KTX2, OpenEXR, Radiance, TIFF, TGA and DPX, told by
    /// their bytes; `all` adds what else OpenImageIO reads, told by the end of the name. Hostile files of those can
    /// crash or hang the process, or lead to other files
    #[arg(long, value_enum, default_value = "known", help_heading = "Textures")]
    pub image_formats: ImageFormatsName,
}

/// Values of `--image-formats`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ImageFormatsName {
    /// Those of the list
    Known,
    /// Any that OpenImageIO reads, at your own risk
    All,
}

/// Values of `--missing-texture`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MissingTextureName {
    /// The load fails
    Error,
    /// A warning; colours are magenta, other data change nothing
    Magenta,
}

/// `info`.
#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct InfoArgs {
    /// Scene, .gltf or .glb
    pub scene: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Also what the machine is going to do: stages, rays, backend, biases, memory by part
    #[arg(short, long)]
    pub verbose: bool,
    /// The options of `render`, so that the plan is that of the render.
    #[command(flatten)]
    pub settings: SettingsArgs,
    /// Extra channels as `render` takes them, to see what they add to the plan
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = aov_parser())]
    pub aov: Vec<Aov>,
    /// Light groups as `render` takes them
    #[arg(long, value_name = "NAME=PATTERN")]
    pub light_group: Vec<LightGroup>,
}

/// The layers of `--aov`, and those that light groups imply.
pub fn layers_of(aov: &[Aov], groups: &[LightGroup]) -> Vec<Aov> {
    let implied = Some(Aov::LIGHT_GROUPS).filter(|layer| !groups.is_empty() && !aov.contains(layer));
    aov.iter().copied().chain(implied).collect()
}

impl RenderArgs {
    /// The layers that the picture has.
    pub fn layers(&self) -> Vec<Aov> {
        let mut layers = layers_of(&self.aov, &self.light_group);
        layers.extend(self.denoise.layers(&self.aov));
        layers
    }
}

/// `compare`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Exit codes, as those of idiff: 0 ok, 1 warning, 2 failure, 3 the images differ in size, 4 a file cannot be read \
or written.\n\
A pixel fails (or warns) when one of its channels differs by more than the threshold. Pixels that are not \
finite fail.\n\
relMSE = mean of (A − B)²/(B² + ε) with ε = 0.01·mean(B)²; trimmed: without the worst 0.1 % of pixels. \
FLIP is HDR-FLIP at 67 pixels per degree."
)]
pub struct CompareArgs {
    /// Image to judge, OpenEXR
    pub image: PathBuf,
    /// Reference, OpenEXR
    pub reference: PathBuf,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Also draw the difference of each pixel, relative to the reference: from black (none) through red to pale yellow,
    /// with the scale printed below
    #[arg(short, long, value_name = "DIFF.png")]
    pub output: Option<PathBuf>,
    /// Also write a page for a browser, complete in itself: both images in one place to be switched by a click or a
    /// key, their difference, FLIP, and the metrics
    #[arg(long, value_name = "FILE.html")]
    pub html: Option<PathBuf>,
    /// Fail where a channel differs by more than this
    #[arg(long, value_name = "X", default_value = "1e-6", value_parser = units::not_negative)]
    pub fail: f32,
    /// Percentage of pixels that may fail without failing the comparison
    #[arg(long, value_name = "PERCENT", default_value = "0", value_parser = units::not_negative)]
    pub failpercent: f32,
    /// Fail if one channel of one pixel differs by more than this [default: no such limit]
    #[arg(long, value_name = "X", value_parser = units::not_negative)]
    pub hardfail: Option<f32>,
    /// Warn where a channel differs by more than this
    #[arg(long, value_name = "X", default_value = "1e-6", value_parser = units::not_negative)]
    pub warn: f32,
    /// Percentage of pixels that may be above --warn without a warning
    #[arg(long, value_name = "PERCENT", default_value = "0", value_parser = units::not_negative)]
    pub warnpercent: f32,
    /// Warn if one channel of one pixel differs by more than this [default: no such limit]
    #[arg(long, value_name = "X", value_parser = units::not_negative)]
    pub hardwarn: Option<f32>,
}

/// `verify`.
#[derive(Debug, Args)]
#[command(after_help = "\
The solver divides the surfaces into patches, computes form factors with visibility, and iterates L ← KG·L. \
Both sides are \
the mean radiance along the rays through the pixels' centres, by number of scatterings, over the picture and \
its quarters. \
A term agrees within 4.9 standard errors of the path tracer plus the solver's discretisation error, which comes from \
solutions on patches of 1, 3/2 and 3 times the side. Terms that few paths make up are shown and not judged.\n\
Exit codes: 0 every term agrees; 3 one does not; 4 the scene is not diffuse (untextured, flat Lambert surfaces, \
emissive \
ones as the only light), the message names the material.")]
pub struct VerifyArgs {
    /// Scene, .gltf or .glb; its first camera looks
    pub scene: PathBuf,
    /// Patches of the finest solution, about; time and memory grow with the square (4000: about 1 GB)
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(16..=4000))]
    pub patches: u32,
    /// Samples of the path tracer for each pixel
    #[arg(long, value_name = "N", default_value_t = 256, value_parser = clap::value_parser!(u64).range(2..=1 << 24))]
    pub spp: u64,
    /// Wall time for everything: the path tracer takes as many samples as fit, up to --spp
    #[arg(long, value_name = "DURATION", value_parser = units::duration)]
    pub time: Option<Duration>,
    /// Columns of the picture that both look at, pixels; rows follow from the aspect
    #[arg(long, value_name = "W", default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=1024))]
    pub width: u32,
    /// Longest path of the path tracer, edges
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub max_depth: u32,
    /// Seed of the path tracer
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Worker threads [default: as many as the process may use]
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=4096))]
    pub threads: Option<u32>,
    /// Ray backend of both [default: embree, or obvhs in builds without it]
    #[arg(long, value_parser = backend_parser(), ignore_case = true)]
    pub backend: Option<BackendKind>,
    /// Files that the scene names.
    #[command(flatten)]
    pub files: FileArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `bench`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
A frame is rendered once and its rays are kept; every backend and query mode then traces those rays: first against the \
others (a mode that disagrees is an error), then against the clock, with one thread and with all.\n\
Tracing efficiency = (time of the frame's rays traced bare, each class in its best mode) / (time of the \
render). Render \
and replay alternate; the figure is the median over the pairs.\n\
With --suite, scenes made in code and the given files instead: each backend that is fit for one traces the rays of a \
small frame, in turn with the others; the table has processor times over the fastest, and what a render takes.\n\
Examples: pathspace bench scene.gltf -o rates.svg; pathspace bench --suite -t 2 -o heat.svg"
)]
pub struct BenchArgs {
    /// Scene, .gltf or .glb; with --suite any number
    #[arg(value_name = "SCENE", required_unless_present = "suite")]
    pub scenes: Vec<PathBuf>,
    /// Compare the backends on a suite of scenes
    #[arg(long, help_heading = "Suite")]
    pub suite: bool,
    /// Scenes of the suite up to so many triangles; 10000000 for all, 0 for the given files alone
    #[arg(long, value_name = "N", default_value_t = 2_000_000, requires = "suite", help_heading = "Suite")]
    pub suite_triangles: u64,
    /// Print JSON
    #[arg(long, help_heading = "Output")]
    pub json: bool,
    /// Also draw a chart
    #[arg(short, long, value_name = "CHART.svg", help_heading = "Output")]
    pub output: Option<PathBuf>,
    /// Print errors only, besides the result
    #[arg(short, long, help_heading = "Output")]
    pub quiet: bool,

    /// Samples per pixel of the frame [default: 64; of the suite's, 2]
    #[arg(
        long, visible_alias = "samples", value_name = "N", value_parser = clap::value_parser!(u64).range(1..=65536),
        help_heading = "Frame"
    )]
    pub spp: Option<u64>,
    /// Pairs of render and replay behind the tracing efficiency
    #[arg(
        long, value_name = "N", default_value_t = 5,
        value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=1000),
        help_heading = "Frame"
    )]
    pub pairs: usize,
    /// Wall time for everything, about: the frame gets fewer samples and pairs, and backends are left out, as it needs
    #[arg(long, value_name = "DURATION", value_parser = units::duration, help_heading = "Frame")]
    pub time: Option<Duration>,

    /// The same as of a render.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

/// `accuracy`.
#[derive(Debug, Args)]
#[command(
    allow_negative_numbers = true,
    after_help = "\
Prints on stdout: the price list (errors of 10, 5, 2, 1 and 0.5 %: predicted samples and seconds with \
intervals, and what runs \
of that many samples took, as far as the budget goes); techniques (error, slope of error against samples, time \
a sample, \
efficiency against the default); knobs (bias and time saved); what each path length carries. All options of the \
picture and of \
light transport are those of `render` and make the default setting.\n\
The picture is small unless --width says otherwise (about 4900 pixels), so that a minute says something: \
samples for an error \
hardly depend on the size, seconds grow with the pixels.\n\
Example: pathspace accuracy scene.gltf --budget 2m -o report"
)]
pub struct AccuracyArgs {
    /// Scene, .gltf or .glb
    pub scene: PathBuf,
    /// Wall time for everything: 60s, 10m
    #[arg(long, value_name = "DURATION", default_value = "60s", value_parser = units::duration)]
    pub budget: Duration,
    /// Picture that stands for the truth, OpenEXR, of the same size or (with --filter box) a whole multiple [default:
    /// long runs with other seeds]
    #[arg(long, value_name = "REF.exr")]
    pub reference: Option<PathBuf>,
    /// Folder for report.html, report.json and report.csv; made if missing [default: no files]
    #[arg(short, long, value_name = "DIR")]
    pub output: Option<PathBuf>,
    /// Price of a core for an hour, in any money: the report says what pictures cost
    #[arg(long, value_name = "PRICE", value_parser = units::price)]
    pub price_per_core_hour: Option<f64>,
    /// Every combination of strategy, sampler, roulette and backend instead of one change at a time
    #[arg(long)]
    pub full: bool,
    /// Also say where the noise comes from, by class of path (direct, caustic, seen through glass, …) and by length:
    /// replays this many paths, on top of the budget [default where no number is given: 262144]
    #[arg(
        long, value_name = "PATHS", num_args = 0..=1, require_equals = true, default_missing_value = "262144",
        value_parser = clap::value_parser!(u64).range(1024..=1 << 24)
    )]
    pub classes: Option<u64>,
    /// The price of every effect that the scene calls for, of techniques, lamps and lengths of paths, in the place of
    /// the other tables: the share of the time to equal error that it takes, and the error of the picture without it
    #[arg(long, conflicts_with_all = ["full", "reference"])]
    pub effects: bool,
    /// Print no progress and no warnings
    #[arg(short, long)]
    pub quiet: bool,
    /// What is looked at, and how.
    #[command(flatten)]
    pub settings: SettingsArgs,
}

/// `on` or `off`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Switch {
    /// On.
    #[value(aliases = ["true", "yes", "1"])]
    On,
    /// Off.
    #[value(aliases = ["false", "no", "0"])]
    Off,
}

/// Values of `--strategy`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum StrategyName {
    /// Both samplings, power heuristic
    Mis,
    /// Both samplings, balance heuristic
    MisBalance,
    /// BSDF sampling alone
    Bsdf,
    /// Light sampling alone
    Light,
}

/// Values of `--texture-filter`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TextureFilterName {
    /// As the sampler says
    Exact,
    /// Averaged over footprints
    Trilinear,
}

/// Values of `--backfaces`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BackfacesName {
    /// They are there
    Show,
    /// Camera rays pass them
    Hide,
    /// All rays pass them
    HideAll,
}

impl From<BackfacesName> for Backfaces {
    fn from(name: BackfacesName) -> Self {
        match name {
            BackfacesName::Show => Backfaces::Show,
            BackfacesName::Hide => Backfaces::Hide,
            BackfacesName::HideAll => Backfaces::HideAll,
        }
    }
}

/// Values of `--sampler`.
fn samplers() -> impl TypedValueParser<Value = SamplerKind> {
    let value = |kind: SamplerKind| PossibleValue::new(kind.name()).help(kind.about());
    PossibleValuesParser::new(SamplerKind::ALL.map(value))
        .map(|name| name.to_lowercase().parse().expect("one of the values"))
}

/// Values of `--progress`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum ProgressKind {
    /// A bar on a terminal, plain lines elsewhere
    Auto,
    /// A bar, terminal or not
    Tty,
    /// A line each 10 %
    Plain,
    /// A JSON object per line on stdout
    Ndjson,
    /// Lines for Open Job Description on stdout
    Openjd,
    /// Nothing
    None,
}

/// Value of `--rays`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rays {
    /// The plan chooses.
    Auto,
    /// One mode for every class.
    Mode(QueryMode),
}

fn filter_parser() -> impl TypedValueParser<Value = FilterKind> {
    PossibleValuesParser::new(FilterKind::ALL.map(FilterKind::name)).try_map(|s| s.to_lowercase().parse())
}

/// Other names of layers: what they are called elsewhere.
const LAYER_ALIASES: [(&str, Aov); 9] = [
    ("depth", Aov::DEPTH),
    ("normal", Aov::NORMAL),
    ("normals", Aov::NORMAL),
    ("position", Aov::POSITION),
    ("samples", Aov::SPP),
    ("uvs", Aov::UV),
    ("alpha", Aov::COVERAGE),
    ("basecolor", Aov::ALBEDO),
    ("vector", Aov::MOTION),
];

fn aov_parser() -> impl TypedValueParser<Value = Aov> {
    let aliases = |aov: Aov| LAYER_ALIASES.into_iter().filter(move |(_, of)| *of == aov).map(|(alias, _)| alias);
    let value = move |aov: Aov| PossibleValue::new(aov.name()).aliases(aliases(aov));
    PossibleValuesParser::new(Aov::all().map(value)).try_map(|text| {
        let named = Aov::all().find(|aov| aov.name().eq_ignore_ascii_case(&text));
        let alias = || LAYER_ALIASES.into_iter().find(|(alias, _)| alias.eq_ignore_ascii_case(&text));
        named.or_else(|| alias().map(|(_, aov)| aov)).ok_or_else(|| format!("'{text}' is no layer"))
    })
}

fn isa_parser() -> impl TypedValueParser<Value = String> {
    PossibleValuesParser::new(["sse2", "sse4.2", "avx", "avx2", "avx512"]).map(|s| s.to_lowercase())
}

fn texture_memory(text: &str) -> Result<u64, String> {
    let (least, most) = (loading::LEAST_BYTES >> 20, 1 << 24);
    let fits = |mb: &u64| (least..=most).contains(mb);
    let problem = || format!("'{text}' is out of range; accepted are {least}M to {}T", most >> 20);
    units::megabytes(text).and_then(|mb| Some(mb).filter(fits).ok_or_else(problem))
}

fn aov_help() -> String {
    let about: Vec<_> = LAYERS.iter().map(|layer| format!("{}: {}", layer.aov, layer.about)).collect();
    format!("Extra channels in the EXR, separated by commas. {}", about.join("; "))
}

fn backend_parser() -> impl TypedValueParser<Value = BackendKind> {
    PossibleValuesParser::new(BackendKind::ALL.map(BackendKind::name)).try_map(|s| s.to_lowercase().parse())
}

fn rays_parser() -> impl TypedValueParser<Value = Rays> {
    let names = std::iter::once("auto").chain(QueryMode::ALL.map(QueryMode::name));
    PossibleValuesParser::new(names).try_map(|s| match s.to_lowercase().as_str() {
        "auto" => Ok(Rays::Auto),
        mode => mode.parse().map(Rays::Mode),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        let command = Cli::definition();
        command.clone().debug_assert();
        let render = command.find_subcommand("render").expect("a command");
        assert!(COMMON.iter().all(|id| render.get_arguments().any(|arg| arg.get_id() == *id)));
    }

    #[test]
    fn a_scene_alone_is_rendered() {
        let of = |line: &str| with_command(line.split(' ').map(OsString::from).collect()).join(" ".as_ref());
        assert_eq!(of("pathspace a.glb"), "pathspace render --quick a.glb");
        assert_eq!(of("pathspace --width 9 A.GLTF"), "pathspace render --quick --width 9 A.GLTF");
        assert_eq!(of("pathspace -"), "pathspace render --quick -");
        for line in
            ["pathspace", "pathspace info a.glb", "pathspace --help", "pathspace paint", "pathspace -q render -"]
        {
            assert_eq!(of(line), line);
        }
        // A command with a slip is told what was meant.
        assert_eq!(of("pathspace rendr a.glb"), "pathspace rendr a.glb");
    }
}
