//! Finds OpenImageIO through pkg-config and compiles the shim against it. What the shim needs of OpenImageIO is there from
//! 2.4 on; 3.x has another interface of its tile cache.

use std::process::{Command, exit};

fn main() {
    for file in ["build.rs", "shim.h", "shim.cpp"] {
        println!("cargo::rerun-if-changed={file}");
    }
    println!("cargo::rerun-if-env-changed=PKG_CONFIG_PATH");
    let version = pkg_config(&["--modversion"]).unwrap_or_else(|| fail("pkg-config does not know it"));
    if !["2.4.", "2.5."].iter().any(|series| version.starts_with(series)) {
        fail(&format!("version {} found, 2.4 or 2.5 expected", version.trim()));
    }
    let flags = pkg_config(&["--cflags", "--libs"]).unwrap_or_else(|| fail("pkg-config has no flags for it"));

    let mut shim = cc::Build::new();
    shim.cpp(true).std("c++17").file("shim.cpp").flag("-fvisibility=hidden").opt_level(2);
    for flag in flags.split_whitespace() {
        match flag.split_at_checked(2) {
            // The library's headers are not ours to warn about.
            Some(("-I", dir)) => _ = shim.flag("-isystem").flag(dir),
            Some(("-L", dir)) => println!("cargo::rustc-link-search=native={dir}"),
            _ => {}
        }
    }
    if let Err(problem) = shim.try_compile("pathspace_oiio") {
        fail(&format!("the C++ compiler refuses the shim ({problem})"));
    }
    for flag in flags.split_whitespace() {
        if let Some(library) = flag.strip_prefix("-l") {
            println!("cargo::rustc-link-lib=dylib={library}");
        }
    }
}

fn pkg_config(arguments: &[&str]) -> Option<String> {
    let output = Command::new("pkg-config").args(arguments).arg("OpenImageIO").output().ok()?;
    output.status.success().then(|| String::from_utf8(output.stdout).ok()).flatten()
}

/// One clear message instead of a panic's backtrace.
fn fail(problem: &str) -> ! {
    println!(
        "cargo::error=OpenImageIO: {problem}. On Debian: `apt-get install g++ pkg-config libopenimageio-dev` (or `make setup`); \
         or build without it: --no-default-features --features embree."
    );
    exit(1);
}
