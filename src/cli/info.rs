//! `pathspace info`: what a scene holds and asks for, what will be simulated of it, what not and why. The plan is the one
//! that `render` would run with the same environment and extra channels and no other flags; the backend is built, because the effective query modes are its to say.

use std::fmt;

use serde::Serialize;

use super::args::InfoArgs;
use super::job::EnvironmentRequest;
use super::report::Verbosity;
use super::{EXIT_OK, job, print, to_json};
use crate::backend::BackendInfo;
use crate::error::Result;
use crate::plan::{Bias, Effects, RenderPlan};
use crate::render::{RenderOptions, Renderer};
use crate::scene::{Projection, Scene, Warning};
use crate::stats::SceneStats;

/// The plan as programs read it: in `info --json`, and as `pathspace/plan` in every EXR.
#[derive(Clone, Debug, Serialize)]
pub struct PlanRecord {
    /// What the scene asks for, what runs, what does not and why.
    pub effects: Effects,
    /// Names of the stages that run, in order.
    pub stages: Vec<&'static str>,
    /// Effective query mode of each class of rays.
    pub rays: RayModeRecord,
    /// Paths of one wave.
    pub wave: usize,
    /// Known biases.
    pub bias: Vec<Bias>,
    /// Extra outputs, as the command line names them.
    pub aovs: Vec<&'static str>,
}

/// Effective query modes.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct RayModeRecord {
    /// Camera rays.
    pub camera: &'static str,
    /// Rays after a scattering.
    pub bounce: &'static str,
    /// Shadow rays.
    pub shadow: &'static str,
}

impl PlanRecord {
    /// Copies what is told of a plan and the backend that serves it.
    pub fn of(plan: &RenderPlan, backend: &BackendInfo) -> Self {
        PlanRecord {
            effects: plan.effects.clone(),
            stages: plan.stages.clone(),
            rays: RayModeRecord {
                camera: backend.rays_coherent,
                bounce: backend.rays_incoherent,
                shadow: backend.rays_shadow,
            },
            wave: plan.wave,
            bias: plan.bias.clone(),
            aovs: plan.aovs.iter().map(|aov| aov.name()).collect(),
        }
    }
}

impl fmt::Display for PlanRecord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |names: &[String]| if names.is_empty() { "nothing".to_string() } else { names.join(", ") };
        writeln!(f, "asks for    {}", list(&self.effects.found))?;
        writeln!(f, "simulated   {}", list(&self.effects.simulated))?;
        for ignored in &self.effects.ignored {
            writeln!(f, "ignored     {}: {}", ignored.what, ignored.why)?;
        }
        writeln!(f, "stages      {}", self.stages.join(", "))?;
        let rays = &self.rays;
        writeln!(f, "rays        camera {}, bounce {}, shadow {}", rays.camera, rays.bounce, rays.shadow)?;
        write!(f, "wave        {} paths", self.wave)?;
        if !self.aovs.is_empty() {
            write!(f, "\naov         {}", self.aovs.join(", "))?;
        }
        for bias in &self.bias {
            write!(f, "\nbias        {}", bias.what)?;
            if let Some(most) = bias.radiance_removed_at_most {
                write!(f, ": takes at most {most:.2e} W/(sr m²) from any radiance")?;
            }
        }
        Ok(())
    }
}

/// What `info --json` prints.
#[derive(Serialize)]
struct InfoRecord {
    scene: SceneRecord,
    #[serde(flatten)]
    plan: PlanRecord,
    warnings: Vec<String>,
}

#[derive(Serialize)]
struct SceneRecord {
    #[serde(flatten)]
    counts: SceneStats,
    cameras: Vec<CameraRecord>,
    animations: Vec<AnimationRecord>,
    resolution: [u32; 2],
    degenerate_triangles: usize,
    points_and_lines: usize,
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
    let scene = &job::load(&args.scene, EnvironmentRequest::of(&args.environment), args.textures, args.shutter)?;
    let (width, height) = job::picture_size(None, None, scene, scene.cameras.first());
    let aovs = args.aov.clone();
    let options = RenderOptions { threads: job::default_threads(), aovs, ..RenderOptions::new(width, height) };
    let renderer = Renderer::new(scene, options)?;
    let record = InfoRecord {
        scene: scene_record(scene, [width, height]),
        plan: PlanRecord::of(renderer.plan(), renderer.backend_info()),
        warnings: scene.warnings.iter().map(warning_text).collect(),
    };
    if args.json {
        print(&to_json(&record))?;
    } else {
        Verbosity::Normal.warnings(&scene.warnings);
        print(&text(&record, renderer.backend_info()))?;
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
        resolution,
        degenerate_triangles: scene.dropped.degenerate_triangles,
        points_and_lines: scene.dropped.points_and_lines,
    }
}

fn warning_text(warning: &Warning) -> String {
    format!("{}: {}", warning.place, warning.what)
}

fn text(record: &InfoRecord, backend: &BackendInfo) -> String {
    let scene = &record.scene;
    let counts = &scene.counts;
    let [width, height] = scene.resolution;
    let cameras: Vec<String> = scene.cameras.iter().map(|c| format!("'{}' ({})", c.name, c.kind)).collect();
    let mut lines = vec![
        format!("scene       {}", counts.file),
        format!(
            "holds       {} triangles in {} instances, {} materials, {} lights, {} textures",
            counts.triangles, counts.instances, counts.materials, counts.lights, counts.textures
        ),
        format!("cameras     {}", cameras.join(", ")),
        format!("picture     {width}x{height} pixels unless told otherwise"),
    ];
    if !scene.animations.is_empty() {
        let span = |a: &AnimationRecord| match a.start_s.zip(a.end_s) {
            Some((start, end)) => format!("{} ({start} s to {end} s)", a.name),
            None => a.name.clone(),
        };
        lines.push(format!("animations  {}", scene.animations.iter().map(span).collect::<Vec<_>>().join(", ")));
    }
    let dropped = [(scene.degenerate_triangles, "degenerate triangles"), (scene.points_and_lines, "points and lines")];
    for (n, what) in dropped.into_iter().filter(|(n, _)| *n > 0) {
        lines.push(format!("left out    {n} {what}"));
    }
    lines.push(record.plan.to_string());
    lines.push(format!("backend     {} {} ({})\n", backend.kind.name(), backend.version, backend.isa));
    lines.join("\n")
}
