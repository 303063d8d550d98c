//! EXT_meshopt_compression and KHR_meshopt_compression: buffer views in streams of meshoptimizer. `document` reads
//! their objects, where it opens views, and `meshopt` decodes them.

use super::super::document::MESHOPT_NAMES;
use super::extension::{Extension, Place};

pub(super) const EXT: Extension = Extension { name: MESHOPT_NAMES[0], place: Place::None };
pub(super) const KHR: Extension = Extension { name: MESHOPT_NAMES[1], place: Place::None };
