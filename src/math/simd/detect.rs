//! What the processor can do beyond the build's baseline.

/// Whether this processor has the AVX-512 extensions that kernels are compiled for a second time.
#[cfg(target_arch = "x86_64")]
pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512cd")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512vbmi")
        && is_x86_feature_detected!("gfni")
}

/// Other processors have one path.
#[cfg(not(target_arch = "x86_64"))]
pub fn has_avx512() -> bool {
    false
}

/// Whether kernels run as compiled for AVX-512: where the processor has it and no other instruction set is pinned.
pub fn is_wide(isa: Option<&str>) -> bool {
    isa.is_none_or(|isa| isa == AVX512) && has_avx512()
}

/// As on the command line (`--isa`).
const AVX512: &str = "avx512";

/// Name of what [`widest`](super::dispatch::widest) runs, as Embree spells it.
pub fn name(wide: bool) -> &'static str {
    match (wide, cfg!(target_feature = "avx2"), cfg!(target_arch = "x86_64")) {
        (true, _, _) => AVX512,
        (false, true, _) => "avx2",
        // Built without `-C target-cpu=x86-64-v3`: build.rs warns of it.
        (false, false, true) => "sse2",
        (false, false, false) => std::env::consts::ARCH,
    }
}
