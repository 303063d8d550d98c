//! Passes what `sys/embree` found to the code: `cfg(embree_major = "3" | "4")`, read by `backend/embree/abi.rs` alone.
//! Warns of a build without AVX2, which nobody means and which is slow.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(embree_major, values(\"3\", \"4\"))");
    if let Ok(major) = std::env::var("DEP_EMBREE_MAJOR") {
        println!("cargo::rustc-cfg=embree_major=\"{major}\"");
    }
    // `.cargo/config.toml` speaks for builds inside the checkout only, not for `cargo install` from elsewhere or for
    // programs that depend on the library.
    let features = std::env::var("CARGO_CFG_TARGET_FEATURE").unwrap_or_default();
    if std::env::var("CARGO_CFG_TARGET_ARCH").is_ok_and(|arch| arch == "x86_64")
        && !features.split(',').any(|feature| feature == "avx2")
    {
        println!(
            "cargo::warning=pathspace is compiled without AVX2 and will render slower; \
             set RUSTFLAGS=\"-C target-cpu=x86-64-v3\" (or native)"
        );
    }
    // An Embree from EMBREE_DIR is not where the loader looks by itself.
    if let Ok(dir) = std::env::var("DEP_EMBREE_LIBDIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{dir}");
    }
}
