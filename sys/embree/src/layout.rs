//! Compares every size, alignment and offset that bindgen arrived at with the C compiler's table in `layout.c`.
//! Oracle: the C compiler on the same header. False alarms: none, the comparison is exact.

use std::collections::BTreeMap;
use std::ffi::{CStr, c_char};
use std::mem::{align_of, offset_of, size_of};

use crate::*;

/// One line of the C table.
#[repr(C)]
struct Entry {
    name: *const c_char,
    value: usize,
}

unsafe extern "C" {
    static pathspace_embree_layout: [Entry; 0];
    static pathspace_embree_layout_count: usize;
}

/// Rust's side, under the names of the C table.
struct Table(BTreeMap<String, usize>);

macro_rules! structure {
    ($table:expr, $type:ident: $($field:ident)*) => {
        $table.0.insert(concat!("sizeof ", stringify!($type)).to_string(), size_of::<$type>());
        $table.0.insert(concat!("alignof ", stringify!($type)).to_string(), align_of::<$type>());
        $($table.0.insert(concat!(stringify!($type), ".", stringify!($field)).to_string(), offset_of!($type, $field));)*
    };
}

macro_rules! rays {
    ($table:expr, $($type:ident)*) => {$(
        structure!($table, $type: org_x org_y org_z tnear dir_x dir_y dir_z time tfar mask id flags);
    )*};
}

macro_rules! hits {
    ($table:expr, $($type:ident)*) => {$( structure!($table, $type: Ng_x Ng_y Ng_z u v primID geomID instID); )*};
}

macro_rules! rayhits {
    ($table:expr, $($type:ident)*) => {$( structure!($table, $type: ray hit); )*};
}

#[test]
fn the_c_compiler_sees_the_same_layout() {
    let mut rust = Table(BTreeMap::new());
    rays!(rust, RTCRay RTCRay4 RTCRay8 RTCRay16);
    hits!(rust, RTCHit RTCHit4 RTCHit8 RTCHit16);
    rayhits!(rust, RTCRayHit RTCRayHit4 RTCRayHit8 RTCRayHit16);
    structure!(rust, RTCBounds: lower_x upper_x align1);
    #[cfg(embree_major = "4")]
    {
        structure!(rust, RTCIntersectArguments: flags feature_mask context filter intersect);
        structure!(rust, RTCOccludedArguments: flags feature_mask context filter occluded);
    }
    #[cfg(embree_major = "3")]
    structure!(rust, RTCIntersectContext: flags filter instID);

    // SAFETY: the C file defines the count and as many entries, all of them constants.
    let entries = unsafe {
        std::slice::from_raw_parts((&raw const pathspace_embree_layout).cast::<Entry>(), pathspace_embree_layout_count)
    };
    let c: BTreeMap<String, usize> = entries
        .iter()
        // SAFETY: every name is a string literal.
        .map(|entry| (unsafe { CStr::from_ptr(entry.name) }.to_string_lossy().into_owned(), entry.value))
        .collect();
    assert_eq!(c, rust.0);
    assert!(c.len() > 100, "the C table holds only {} entries", c.len());
}
