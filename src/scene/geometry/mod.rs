//! Geometry flattened for tracing and shading: what the backends are built from and what a hit is looked up in.
//!
//! Meshes that are placed once, and small repeated ones, are baked into one world mesh in f64 (index 0); the rest, and
//! what moves, stays instanced at one level (`bake`, `placement`).

mod attributes;
mod bake;
mod between;
mod bodies;
mod coincident;
mod contacts;
mod deforming;
mod frames;
mod lamps;
mod overlaps;
mod owners;
mod parts;
mod placement;
mod records;
mod solids;

pub(crate) use bake::copied_lamps;
pub use bake::{BAKE_MESH_TRIANGLES, BAKE_TRIANGLE_BUDGET};
pub use between::Between;
pub use coincident::{Coincident, Partners};
pub use deforming::Deforming;
pub use frames::Frames;
pub(crate) use overlaps::corners;
pub use owners::Owners;
pub use placement::{Moving, NO_MATERIAL, Placement};
pub use records::{Geometry, NO_ATTRIBUTES, Triangle, TriangleMesh};
pub(crate) use records::{LARGEST_COORDINATE_M, is_degenerate};
pub use solids::{NO_SOLID, Solid, Solids};
