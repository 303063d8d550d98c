//! KHR_mesh_quantization: vertex attributes of 8 and 16 bits. `accessor` reads every type anyway.

use super::extension::{Extension, Place};

pub(super) const EXTENSION: Extension = Extension { name: "KHR_mesh_quantization", place: Place::None };
