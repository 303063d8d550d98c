//! The plan as programs and people read it: in `info`, and as `pathspace/plan` in every EXR.

use std::fmt;

use serde::Serialize;

use super::bias::Bias;
use super::effects::table::Effects;
use super::render_plan::{GuideRecord, RenderPlan};
use crate::backend::BackendInfo;

/// What is reported of a plan. Its JSON keys are a contract: keys may be added, never renamed.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
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
    /// What traces.
    pub backend: BackendRecord,
    /// How light is found.
    pub techniques: TechniquesRecord,
}

/// The techniques that find light.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct TechniquesRecord {
    /// BSDF samples.
    pub bsdf: bool,
    /// Light samples.
    pub light: bool,
    /// Light paths for each pixel and sample; 0 without.
    pub light_paths: f32,
    /// Why so many.
    pub reason: String,
    /// Name of the file of the survey that says so, where one was read or written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub survey: Option<String>,
    /// The guide; `None` without.
    pub guide: Option<GuideRecord>,
    /// Why there is one, or none.
    pub guide_reason: String,
}

/// The choice of a backend.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct BackendRecord {
    /// Which.
    pub name: &'static str,
    /// Why it is that one.
    pub reason: String,
}

/// Effective query modes.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct RayModeRecord {
    /// Camera rays.
    pub camera: &'static str,
    /// Rays after a scattering.
    pub bounce: &'static str,
    /// Shadow rays.
    pub shadow: &'static str,
}

impl PlanRecord {
    /// The record of a plan and its backend.
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
            backend: BackendRecord { name: plan.backend.name(), reason: plan.backend_reason.clone() },
            techniques: TechniquesRecord {
                bsdf: plan.strategy.techniques.bsdf,
                light: plan.strategy.techniques.light,
                light_paths: plan.light_paths,
                reason: plan.light_paths_reason.clone(),
                survey: plan.survey.clone(),
                guide: plan.guide,
                guide_reason: plan.guide_reason.clone(),
            },
        }
    }
}

impl TechniquesRecord {
    /// Which techniques find light, and why.
    pub fn light_line(&self) -> String {
        let with = |on: bool, name| if on { name } else { "" };
        let paths = match self.light_paths > 0.0 {
            true => format!("{} light paths a sample", self.light_paths),
            false => "no light paths".into(),
        };
        let by = self.survey.as_ref().map_or(String::new(), |name| format!(" ({name})"));
        let (bsdf, light) = (with(self.bsdf, "bsdf, "), with(self.light, "light, "));
        format!("light by    {bsdf}{light}{paths}: {}{by}", self.reason)
    }

    /// Where directions are guided, and why.
    pub fn guide_line(&self) -> String {
        match &self.guide {
            Some(guide) => format!("guided      in {} of {} cells: {}", guide.guiding, guide.cells, self.guide_reason),
            None => format!("guided      no: {}", self.guide_reason),
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
        writeln!(f, "traced by   {}: {}", self.backend.name, self.backend.reason)?;
        let rays = &self.rays;
        writeln!(f, "rays        camera {}, bounce {}, shadow {}", rays.camera, rays.bounce, rays.shadow)?;
        writeln!(f, "{}\n{}", self.techniques.light_line(), self.techniques.guide_line())?;
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
