//! Finds OpenImageIO through pkg-config and compiles the shim against it. What the shim needs of OpenImageIO is there
//! from 2.4 on; 3.x has another interface of its tile cache.

use std::env;
use std::path::PathBuf;
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

    // A separate shared library, which the crate carries and opens when the first image is read: OpenImageIO brings
    // some 250 libraries along, a quarter of a second that a render without textures need not wait.
    let shim = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("shim.so");
    let mut compiler = cc::Build::new();
    compiler.cpp(true).std("c++17").opt_level(2).pic(true);
    let mut command = compiler.get_compiler().to_command();
    command.args(["-shared", "-Wl,-z,defs", "shim.cpp", "-o"]).arg(&shim);
    for flag in flags.split_whitespace() {
        match flag.strip_prefix("-I") {
            // The library's headers are not ours to warn about.
            Some(dir) => command.args(["-isystem", dir]),
            None => command.arg(flag),
        };
    }
    match command.status() {
        Ok(status) if status.success() => {}
        Ok(status) => fail(&format!("the C++ compiler refuses the shim ({status})")),
        Err(problem) => fail(&format!("the C++ compiler does not run ({problem})")),
    }
}

fn pkg_config(arguments: &[&str]) -> Option<String> {
    let output = Command::new("pkg-config").args(arguments).arg("OpenImageIO").output().ok()?;
    output.status.success().then(|| String::from_utf8(output.stdout).ok()).flatten()
}

/// One clear message instead of a panic's backtrace.
fn fail(problem: &str) -> ! {
    println!(
        "cargo::error=OpenImageIO: {problem}. On Debian: `apt-get install g++ pkg-config libopenimageio-dev` (or \
         `make setup`); or build without it: --no-default-features --features cli,embree."
    );
    exit(1);
}
