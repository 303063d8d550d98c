//! The plan: every decision of a render, resolved once from scene and options. Everything below reads the plan, never
//! the options. Pure and printable.

pub mod aov;
pub mod bias;
pub mod effects;
pub mod light_groups;
pub mod options;
pub mod picture;
pub mod record;
mod render_plan;
pub mod view;

pub use aov::Aov;
pub use bias::Bias;
pub use effects::ignored::Ignored;
pub use effects::table::{Effects, Features};
pub use options::Gate;
pub use render_plan::{FogSphere, GuideRecord, Limits, MAX_DEPTH, MAX_SIDE, RayModes, RenderPlan, WAVE};
