//! Declarations of the installed Embree, 3.13 or 4.x, as bindgen reads them from its header. No policy, no wrapper:
//! the safe layer is `pathspace::backend::embree`.
//!
//! C enums are newtypes over their integer, because new values appear between releases. The layout of every structure
//! that crosses the border is compared with the C compiler's by the test below.

#![allow(non_camel_case_types, non_snake_case, non_upper_case_globals, missing_docs)]
#![allow(clippy::all)]

include!(concat!(env!("OUT_DIR"), "/bindings.rs"));

#[cfg(test)]
mod layout;
