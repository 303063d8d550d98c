//! Finds Embree (`EMBREE_DIR`, then pkg-config, then the usual include directories; 4 before 3), generates the
//! declarations from the installed header and compiles the layout table that the tests compare them with.
//!
//! Tells the dependent crate `DEP_EMBREE_MAJOR` ("3" or "4") and `DEP_EMBREE_LIBDIR` (only for an `EMBREE_DIR`); here
//! `cfg(embree_major)` chooses the rows of the layout test.

use std::env;
use std::panic;
use std::path::{Path, PathBuf};
use std::process::{Command, exit};

/// Where an Embree was found.
struct Found {
    /// 3 or 4.
    major: u32,
    /// Directory that holds `embree4/rtcore.h` or `embree3/rtcore.h`.
    include: PathBuf,
    /// Directories for the linker; empty where its defaults do.
    lib_dirs: Vec<PathBuf>,
    /// Whether `lib_dirs` go into the run path, because the loader would not look there.
    run_path: bool,
}

fn main() {
    println!("cargo::rerun-if-env-changed=EMBREE_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed=layout.c");

    let found = find().unwrap_or_else(|problem| fail(&problem));
    let header = format!("embree{}/rtcore.h", found.major);
    println!("cargo::rerun-if-changed={}", found.include.join(&header).display());
    check_version(&found).unwrap_or_else(|problem| fail(&problem));

    println!("cargo::metadata=MAJOR={}", found.major);
    println!("cargo::rustc-check-cfg=cfg(embree_major, values(\"3\", \"4\"))");
    println!("cargo::rustc-cfg=embree_major=\"{}\"", found.major);
    println!("cargo::rustc-link-lib=dylib=embree{}", found.major);
    for dir in &found.lib_dirs {
        println!("cargo::rustc-link-search=native={}", dir.display());
        if found.run_path {
            println!("cargo::rustc-link-arg=-Wl,-rpath,{}", dir.display());
            println!("cargo::metadata=LIBDIR={}", dir.display());
        }
    }

    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    generate(&found, &header, &out.join("bindings.rs")).unwrap_or_else(|problem| fail(&problem));
    cc::Build::new()
        .file("layout.c")
        .include(&found.include)
        .define("PATHSPACE_EMBREE_HEADER", Some(format!("<{header}>").as_str()))
        .warnings(false)
        .compile("pathspace_embree_layout");
}

/// The discovery order of the page above.
fn find() -> Result<Found, String> {
    if let Some(prefix) = env::var_os("EMBREE_DIR").map(PathBuf::from) {
        let include = prefix.join("include");
        let major = major_in(&include).ok_or_else(|| {
            format!("EMBREE_DIR={}: no include/embree4/rtcore.h or include/embree3/rtcore.h in it", prefix.display())
        })?;
        let lib_dirs: Vec<PathBuf> =
            ["lib", "lib64"].iter().map(|lib| prefix.join(lib)).filter(|d| d.is_dir()).collect();
        return Ok(Found { major, include, lib_dirs, run_path: true });
    }
    if let Some(found) = ["embree4", "embree3", "embree"].into_iter().find_map(pkg_config) {
        return Ok(found);
    }
    // A 4 anywhere is preferred to a 3 nearer by.
    let usual = [Path::new("/usr/include"), Path::new("/usr/local/include")];
    for major in [4, 3] {
        if let Some(include) = usual.iter().find(|dir| dir.join(format!("embree{major}/rtcore.h")).is_file()) {
            return Ok(Found { major, include: include.to_path_buf(), lib_dirs: Vec::new(), run_path: false });
        }
    }
    Err("no embree4/rtcore.h or embree3/rtcore.h in /usr/include or /usr/local/include".into())
}

/// Which major version's header stands in `include`; 4 if both do.
fn major_in(include: &Path) -> Option<u32> {
    [4, 3].into_iter().find(|major| include.join(format!("embree{major}/rtcore.h")).is_file())
}

/// What pkg-config knows of `name`. Debian ships no .pc file; other distributions and own builds may.
fn pkg_config(name: &str) -> Option<Found> {
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    let output = Command::new("pkg-config").args(["--cflags-only-I", "--libs-only-L", name]).output().ok()?;
    let text = output.status.success().then(|| String::from_utf8(output.stdout).ok()).flatten()?;
    let dirs =
        |flag: &str| text.split_whitespace().filter_map(|word| word.strip_prefix(flag)).map(PathBuf::from).collect();
    let mut includes: Vec<PathBuf> = dirs("-I");
    // pkg-config leaves out what the compiler searches anyway.
    includes.push("/usr/include".into());
    let (include, major) = includes.into_iter().find_map(|dir| major_in(&dir).map(|major| (dir, major)))?;
    Some(Found { major, include, lib_dirs: dirs("-L"), run_path: false })
}

/// Refuses what the code above was not written for: anything but 3.13 and 4.
fn check_version(found: &Found) -> Result<(), String> {
    let path = found.include.join(format!("embree{}/rtcore_config.h", found.major));
    let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let number = |name: &str| -> Option<u32> {
        text.lines().find_map(|line| line.strip_prefix("#define ")?.strip_prefix(name)?.trim().parse().ok())
    };
    match (number("RTC_VERSION_MAJOR "), number("RTC_VERSION_MINOR ")) {
        (Some(4), Some(_)) => Ok(()),
        (Some(3), Some(minor)) if minor >= 13 => Ok(()),
        (major, minor) => Err(format!(
            "{}: found version {}.{}, need 3.13 or 4.x",
            path.display(),
            major.map_or("?".into(), |n| n.to_string()),
            minor.map_or("?".into(), |n| n.to_string())
        )),
    }
}

/// Writes the declarations that `src/backend/embree` uses. The inline helpers of the header have no symbol and are
/// left out by bindgen itself.
fn generate(found: &Found, header: &str, target: &Path) -> Result<(), String> {
    let builder = bindgen::Builder::default()
        .header_contents("wrapper.h", &format!("#include <{header}>\n"))
        .clang_arg(format!("-I{}", found.include.display()))
        .allowlist_function("rtc(New|Release)(Device|Geometry|Scene)")
        .allowlist_function("rtcGetDevice(Property|Error)")
        .allowlist_function("rtcSetDevice(Error|MemoryMonitor)Function")
        .allowlist_function("rtcSet(NewGeometryBuffer|Geometry(Mask|InstancedScene|TimeStepCount|Transform))")
        .allowlist_function(
            "rtc(Commit(Geometry|Scene)|AttachGeometryByID|DetachGeometry|SetScene(Flags|BuildQuality))",
        )
        .allowlist_function("rtc(Intersect|Occluded)(1|4|8|16)|rtcIntersectNM|rtcOccluded1M")
        .allowlist_type("RTC(Ray|Hit|RayHit)(4|8|16)?|RTCBounds|RTCFilterFunctionNArguments")
        .allowlist_type("RTC(IntersectContext|IntersectArguments|OccludedArguments|FeatureFlags|RayQueryFlags)")
        .allowlist_type("RTC(Format|BufferType|GeometryType|BuildQuality|SceneFlags|DeviceProperty|Error)")
        .allowlist_var("RTC_(VERSION_MAJOR|VERSION_MINOR|VERSION_PATCH|MAX_INSTANCE_LEVEL_COUNT)")
        .default_enum_style(bindgen::EnumVariation::NewType { is_bitfield: false, is_global: false })
        .derive_default(true)
        .layout_tests(false)
        .generate_comments(false)
        .formatter(bindgen::Formatter::None);

    // bindgen panics when libclang is missing; the panic becomes our one line.
    panic::set_hook(Box::new(|_| ()));
    let generated = panic::catch_unwind(panic::AssertUnwindSafe(|| builder.generate()));
    let _ = panic::take_hook();
    let bindings = generated
        .map_err(|_| "bindgen could not load libclang".to_string())?
        .map_err(|error| format!("bindgen could not read {header}: {error}"))?;
    bindings.write_to_file(target).map_err(|error| format!("{}: {error}", target.display()))
}

/// One clear message instead of a panic's backtrace.
fn fail(problem: &str) -> ! {
    println!(
        "cargo::error=Embree: {problem}. On Debian: `apt-get install libembree-dev libclang-dev` (or `make setup`); \
         elsewhere set EMBREE_DIR to a prefix with include/ and lib/; or build without Embree: \
         --no-default-features --features cli."
    );
    exit(1);
}
