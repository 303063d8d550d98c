//! `pathspace info`: what a scene holds and asks for, what will be simulated of it, what not and why; what a picture
//! takes, by a pilot of a second at most. The plan is the one that `render` would run with the same options; the
//! backend is built, because the effective query modes are its to say.

use std::time::Duration;

use serde::Serialize;

use super::args::{InfoArgs, layers_of};
use super::job::{self, Fallback};
use super::output::{EXIT_OK, print, to_json};
use super::report::{Verbosity, duration};
use super::waiting::Waiting;
use crate::backend::BackendInfo;
use crate::error::Result;
use crate::plain::one_line;
use crate::plan::record::PlanRecord;
use crate::render::{Need, RenderOptions, Renderer};
use crate::scene::{Projection, Scene, Warning};
use crate::stats::SceneStats;

/// What `info --json` prints.
#[derive(Serialize)]
struct InfoRecord {
    scene: SceneRecord,
    #[serde(flatten)]
    plan: PlanRecord,
    warnings: Vec<String>,
    memory: Need,
}

#[derive(Serialize)]
struct SceneRecord {
    #[serde(flatten)]
    counts: SceneStats,
    cameras: Vec<CameraRecord>,
    animations: Vec<AnimationRecord>,
    scenes: Vec<String>,
    variants: Vec<String>,
    resolution: [u32; 2],
    degenerate_triangles: usize,
    points_and_lines: usize,
    /// Width, height and depth of what is placed, metres.
    size_m: [f64; 3],
}

#[derive(Serialize)]
struct AnimationRecord {
    name: String,
    start_s: Option<f64>,
    end_s: Option<f64>,
}

#[derive(Serialize)]
struct CameraRecord {
    name: String,
    kind: &'static str,
    aspect: Option<f32>,
}

/// Runs the command.
pub fn run(args: &InfoArgs) -> Result<u8> {
    let waiting = Waiting::begin(Verbosity::Normal, "loading and building");
    job::check(&args.settings)?;
    let scene = &job::load(&args.scene, &args.settings, Fallback::White)?;
    let layers = layers_of(&args.aov, &args.light_group);
    let options = job::settings(&args.settings, scene).aovs(layers).light_groups(args.light_group.clone());
    let resolution = [options.width, options.height];
    let mut renderer = Renderer::new(scene, options.clone())?;
    drop(waiting);
    let record = InfoRecord {
        scene: scene_record(scene, resolution),
        plan: renderer.record(),
        warnings: scene.warnings.iter().map(warning_text).collect(),
        memory: renderer.need().clone(),
    };
    if args.json {
        print(&to_json(&record))?;
    } else {
        Verbosity::Normal.warnings(&scene.warnings);
        let time = time_for(&mut renderer, options)?;
        print(&text(&record, renderer.backend_info(), &time, args.verbose))?;
    }
    Ok(EXIT_OK)
}

fn scene_record(scene: &Scene, resolution: [u32; 2]) -> SceneRecord {
    let cameras = scene.cameras.iter().map(|camera| {
        let (kind, aspect) = match camera.projection {
            Projection::Perspective { aspect, .. } => ("perspective", aspect),
            Projection::Orthographic { xmag_m, ymag_m } => ("orthographic", Some(xmag_m / ymag_m)),
        };
        CameraRecord { name: camera.name.clone(), kind, aspect }
    });
    SceneRecord {
        counts: SceneStats::of(scene),
        cameras: cameras.collect(),
        animations: (scene.motion.animations.iter())
            .map(|animation| AnimationRecord {
                name: animation.name.clone(),
                start_s: animation.seconds.map(|(start, _)| start),
                end_s: animation.seconds.map(|(_, end)| end),
            })
            .collect(),
        scenes: scene.scenes.clone(),
        variants: scene.variants.clone(),
        resolution,
        degenerate_triangles: scene.dropped.degenerate_triangles,
        points_and_lines: scene.dropped.points_and_lines,
        size_m: scene.bounds().map_or([0.0; 3], |(least, most)| (most - least).to_array()),
    }
}

fn warning_text(warning: &Warning) -> String {
    format!("{}: {}", warning.place, warning.what)
}

/// Noise that the time is stated for.
const NOISE: f64 = 0.05;

/// Pixels and time of the pilot.
const PILOT_PIXELS: f64 = 4096.0;
const PILOT_TIME: Duration = Duration::from_secs(1);

/// What the picture of `options` takes to [`NOISE`], by a small one: noise at a number of samples hardly depends on the
/// size.
fn time_for(renderer: &mut Renderer, options: RenderOptions) -> Result<String> {
    let pixels = renderer.plan().window;
    let pixels = f64::from(pixels.width) * f64::from(pixels.height);
    let scale = (PILOT_PIXELS / (f64::from(options.width) * f64::from(options.height))).sqrt().min(1.0);
    let side = |length: u32| (f64::from(length) * scale).ceil() as u32;
    let small = options.clone().size(side(options.width), side(options.height));
    renderer.retarget(&RenderOptions { crop: None, aovs: Vec::new(), ..small }.spp(16).time(PILOT_TIME))?;
    let render = renderer.render()?;
    render.check_fault()?;
    renderer.scene().check_textures()?;
    let error = render.film.error_estimate().filter(|error| error.relmse.is_finite() && error.relmse > 0.0);
    let samples = render.film.spp().mean;
    let Some(error) = error.filter(|_| samples >= 2.0) else { return Ok("not known: the pilot saw no noise".into()) };
    let spp = (samples * error.relmse / (NOISE * NOISE)).ceil().max(1.0);
    let paths = samples * render.film.pixels.len() as f64;
    let seconds = spp * pixels * render.render_time.as_secs_f64() / paths;
    let threads = renderer.plan().threads;
    let noise = 100.0 * NOISE;
    Ok(format!("about {} to {noise:.0} % of noise, {spp:.0} spp, on {threads} threads", duration(seconds)))
}

fn text(record: &InfoRecord, backend: &BackendInfo, time: &str, verbose: bool) -> String {
    let scene = &record.scene;
    let counts = &scene.counts;
    let [width, height] = scene.resolution;
    let cameras: Vec<String> = scene.cameras.iter().map(|c| format!("'{}' ({})", one_line(&c.name), c.kind)).collect();
    let mut lines = vec![
        format!("scene       {}", counts.file),
        format!("size        {}", size(scene.size_m)),
        format!("cameras     {}", cameras.join(", ")),
        format!("picture     {width}x{height} pixels unless told otherwise"),
    ];
    if !scene.animations.is_empty() {
        let span = |a: &AnimationRecord| match a.start_s.zip(a.end_s) {
            Some((start, end)) => format!("{} ({start} s to {end} s)", one_line(&a.name)),
            None => one_line(&a.name),
        };
        lines.push(format!("animations  {}", scene.animations.iter().map(span).collect::<Vec<_>>().join(", ")));
    }
    let named = |names: &[String]| {
        let name = |(index, name): (usize, &String)| format!("{index} '{}'", one_line(name));
        names.iter().enumerate().map(name).collect::<Vec<_>>().join(", ")
    };
    if scene.scenes.len() > 1 {
        lines.push(format!("scenes      {}", named(&scene.scenes)));
    }
    if !scene.variants.is_empty() {
        lines.push(format!("variants    {}", named(&scene.variants)));
    }
    let dropped = [(scene.degenerate_triangles, "degenerate triangles"), (scene.points_and_lines, "points and lines")];
    for (n, what) in dropped.into_iter().filter(|(n, _)| *n > 0) {
        lines.push(format!("left out    {n} {what}"));
    }
    lines.push(format!(
        "holds       {} triangles in {} instances, {} materials, {} lights, {} textures",
        counts.triangles, counts.instances, counts.materials, counts.lights, counts.textures
    ));
    lines.push(format!("time        {time}"));
    if verbose {
        lines.push(record.memory.to_string());
        lines.push(record.plan.to_string());
        lines.push(format!("backend     {} {} ({})", backend.kind.name(), backend.version, backend.isa));
    } else {
        lines.push(format!("memory      {} MB at most", record.memory.total_bytes.div_ceil(1 << 20)));
        let effects = &record.plan.effects;
        lines.push(format!("simulated   {}", effects.simulated.join(", ")));
        lines.extend(effects.ignored.iter().map(|ignored| format!("ignored     {}: {}", ignored.what, ignored.why)));
        let techniques = &record.plan.techniques;
        lines.push(techniques.light_line());
        lines.extend(techniques.guide.is_some().then(|| techniques.guide_line()));
    }
    lines.join("\n") + "\n"
}

/// Width, height and depth: "1.20 × 0.50 × 3.00 m".
fn size([x, y, z]: [f64; 3]) -> String {
    let most = x.max(y).max(z);
    let (scale, unit) = match most {
        m if m < 0.01 => (1e3, "mm"),
        m if m < 1.0 => (1e2, "cm"),
        m if m < 10_000.0 => (1.0, "m"),
        _ => (1e-3, "km"),
    };
    let [x, y, z] = [x, y, z].map(|side| format!("{:.2}", side * scale));
    format!("{x} × {y} × {z} {unit} (width, height, depth)")
}
