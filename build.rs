//! Passes what `sys/embree` found to the code: `cfg(embree_major = "3" | "4")`, read by `backend/embree/abi.rs` alone.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(embree_major, values(\"3\", \"4\"))");
    if let Ok(major) = std::env::var("DEP_EMBREE_MAJOR") {
        println!("cargo::rustc-cfg=embree_major=\"{major}\"");
    }
    // An Embree from EMBREE_DIR is not where the loader looks by itself.
    if let Ok(dir) = std::env::var("DEP_EMBREE_LIBDIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}");
    }
}
