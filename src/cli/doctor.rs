//! `pathspace doctor`: what this build and this machine have, and what to install. Exit 0 if a render can run.

use std::fs;

use super::output::{EXIT_OK, print};
use super::report;
use crate::backend::{self, BackendInfo, BackendKind, BackendOptions, QueryMode};
use crate::error::{Error, Result};
use crate::film::oidn::Oidn;
use crate::machine::{self, Processor};
use crate::scene::geometry::Geometry;

/// Exit code when no render can run.
const EXIT_UNUSABLE: u8 = 1;

/// Packages that building needs on Debian; those of `scripts/setup.sh`.
const PACKAGES: &str = "gcc libc6-dev make libembree-dev libclang-dev g++ pkg-config libopenimageio-dev";

/// The libraries of each Debian, by `VERSION_ID`.
const LIBRARIES: [(&str, &str); 2] =
    [("12", "Embree 3.13.5, OpenImageIO 2.4"), ("13", "Embree 4.3.3, OpenImageIO 2.5")];

/// Runs the command.
pub fn run() -> Result<u8> {
    let mut lines = vec![format!("pathspace   {}", env!("CARGO_PKG_VERSION"))];
    let release = debian_release();
    lines.push(format!("system      {}", release.name));
    let cpu = Processor::detect();
    lines.push(format!("processor   {}", cpu.name));
    lines.push(format!("features    {}", cpu.features.join(" ")));
    lines.push(format!("threads     {}", machine::threads(0)));

    let mut usable = 0;
    for kind in BackendKind::ALL {
        let built = backend::select::build(kind, &Geometry::default(), &BackendOptions::with_mode(QueryMode::Stream));
        usable += usize::from(built.is_ok());
        lines.push(format!("{:<11} {}", kind.name(), describe(built.as_ref().map(|b| b.info()))));
    }

    lines.push(format!("images      {}", images()));
    lines.push(match Oidn::open(None, 1) {
        Ok(filter) => format!("denoising   {filter} ({})", filter.file().display()),
        Err(Error::Backend { problem, .. }) => format!("denoising   not there: {problem}"),
        Err(error) => format!("denoising   not there: {error}"),
    });

    let missing = cpu.missing();
    if !missing.is_empty() {
        lines.push(format!("missing     this build needs a processor with {}", missing.join(", ")));
    }
    let unused = cpu.unused();
    if !unused.is_empty() {
        lines.push(format!("unused      {}: {}", unused.join(", "), report::TARGET_CPU));
    }
    let verdict = usable > 0 && missing.is_empty();
    lines.push(match LIBRARIES.into_iter().find(|(version, _)| *version == release.version) {
        Some((_, libraries)) => format!("to build    apt-get install {PACKAGES}   ({libraries})"),
        None => "to build    on other systems: a C++ compiler, make, pkg-config, libclang, Embree 3.13 or 4.x, \
            OpenImageIO 2.4 or 2.5"
            .into(),
    });
    lines.push(
        "            without the libraries: a C compiler (gcc libc6-dev) is still needed, because it links;".into(),
    );
    lines.push("            then cargo build --release --no-default-features --features cli".into());
    lines.push(format!("verdict     {}\n", if verdict { "ready to render" } else { "cannot render" }));
    print(&lines.join("\n"))?;
    Ok(if verdict { EXIT_OK } else { EXIT_UNUSABLE })
}

fn describe(built: std::result::Result<&BackendInfo, &Error>) -> String {
    match built {
        // Built with `--rays stream`, so the effective mode tells a native stream from a loop over packets.
        Ok(info) => format!("{} ({}), stream mode runs as {}", info.version, info.isa, info.rays_incoherent),
        Err(Error::Backend { problem, .. }) => format!("not usable: {problem}"),
        Err(error) => format!("not usable: {error}"),
    }
}

/// The library that reads images.
#[cfg(feature = "oiio")]
fn images() -> String {
    match crate::texture::oiio::version() {
        Ok(version) => {
            format!("OpenImageIO {}, loaded when the first image is read ({})", version.number, version.file)
        }
        Err(problem) => format!("OpenImageIO is not usable: {problem}"),
    }
}

/// The library that reads images.
#[cfg(not(feature = "oiio"))]
fn images() -> String {
    "PNG, JPEG, WebP, Radiance and OpenEXR by Rust crates; this build has no OpenImageIO".into()
}

struct Release {
    name: String,
    /// `VERSION_ID` on Debian, else empty.
    version: String,
}

fn debian_release() -> Release {
    let text = fs::read_to_string("/etc/os-release").unwrap_or_default();
    let field = |key: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(key)?.strip_prefix('='));
        line.map(|value| value.trim_matches('"').to_string()).unwrap_or_default()
    };
    let name = field("PRETTY_NAME");
    Release {
        name: if name.is_empty() { "unknown".into() } else { name },
        version: if field("ID") == "debian" { field("VERSION_ID") } else { String::new() },
    }
}

#[cfg(test)]
mod tests {
    use super::PACKAGES;
    use std::collections::BTreeSet;

    /// Oracle: the words of setup.sh's `packages=(…)` and `packages+=(…)`.
    #[test]
    fn the_packages_are_those_of_the_setup_script() {
        let script = include_str!("../../scripts/setup.sh");
        let lists = script.split("packages").filter_map(|rest| {
            let list = rest.strip_prefix("=(").or_else(|| rest.strip_prefix("+=("))?;
            Some(list.split_once(')')?.0)
        });
        let expected: BTreeSet<&str> = lists.flat_map(str::split_whitespace).collect();
        assert_eq!(PACKAGES.split_whitespace().collect::<BTreeSet<_>>(), expected);
    }
}
