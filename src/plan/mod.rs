//! The plan: every decision of a render, resolved once from scene and options.

pub mod options;

use serde::Serialize;

/// An effect that is not simulated, and why.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Ignored {
    /// Name of the effect, with the object that asks for it.
    pub what: String,
    /// Why it is not simulated.
    pub why: String,
}

/// Effects of a scene, for people and programs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Effects {
    /// What the file and the options ask for.
    pub found: Vec<String>,
    /// What will run.
    pub simulated: Vec<String>,
    /// What will not.
    pub ignored: Vec<Ignored>,
}

/// Something that makes the expected image differ from the true one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Bias {
    /// Name, with its parameter: "max-depth 64".
    pub what: String,
    /// Fraction of the image's energy that it removes at most, or measured; `None` until measured.
    pub energy_removed: Option<f64>,
}

/// Every decision of a render.
#[derive(Clone, Debug)]
pub struct RenderPlan {
    /// For people and programs.
    pub effects: Effects,
    /// Names of the stages that run, in order.
    pub stages: Vec<&'static str>,
    /// Known biases.
    pub bias: Vec<Bias>,
    /// Paths of one wave.
    pub wave: usize,
}
