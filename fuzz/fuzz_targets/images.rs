//! Bytes as an image: whatever they are, decoding ends with texels or an error, without a panic and within the memory
//! that the header was believed. Through the crates and through OpenImageIO, whole and in tiles.

#![no_main]

use std::fs::OpenOptions;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use libfuzzer_sys::fuzz_target;
use pathspace::texture::ColorSpace;
use pathspace::texture::decode::{Decoder, Encoded, Problem, decode, inspect};
use pathspace::texture::load::{Budget, LEAST_BYTES, Request, load};

/// Bytes of texels that are worth decoding: the rest of the time is better spent on other bytes.
const MOST_BYTES: u64 = 32 << 20;

/// Budget that a machine would have for them; memory that grows by more than twice this is a finding.
const BUDGET_BYTES: u64 = 2 * MOST_BYTES;

fuzz_target!(|bytes: &[u8]| {
    let before = Resident::begin();
    for decoder in [Decoder::Crates, Decoder::Default] {
        let encoded = Encoded::Bytes(bytes);
        match inspect(encoded, decoder) {
            Ok(header) if header.bytes <= MOST_BYTES => match decode(encoded, decoder) {
                Ok(image) => {
                    assert!(image.width > 0 && image.height > 0);
                    assert!(image.texels.bytes() <= header.bytes, "{} of {} bytes", image.texels.bytes(), header.bytes);
                }
                Err(problem) => one_line(problem),
            },
            Ok(_) => {}
            Err(problem) => one_line(problem),
        }
    }
    // As a file: in a budget that it may not fit into, tiles are read where they are.
    let file = file();
    overwrite(file, bytes).expect("the folder of temporary files can be written");
    let encoded = Encoded::File(file);
    let size = inspect(encoded, Decoder::Default).map_or(0, |header| header.bytes);
    if size <= MOST_BYTES {
        let color_spaces = [Some(ColorSpace::Srgb), Some(ColorSpace::Linear)];
        // Several of one: together they do not fit.
        let copies = (LEAST_BYTES / size.max(1) + 1).min(4) as usize;
        let requests = vec![Request { encoded, color_spaces, name: "an image" }; copies];
        for loaded in load(&requests, Budget { bytes: LEAST_BYTES, ..Budget::default() }, true) {
            loaded.map_or_else(one_line, |_| ());
        }
    }
    if let Some(grown) = before.and_then(Resident::grown) {
        assert!(grown <= 2 * BUDGET_BYTES, "{} MB for an image of {} bytes", grown >> 20, bytes.len());
    }
});

/// Memory of the process, in bytes; `None` where the kernel does not tell.
struct Resident(u64);

impl Resident {
    /// What it is now. The peak is counted anew from here.
    fn begin() -> Option<Self> {
        std::fs::write("/proc/self/clear_refs", "5").ok()?;
        Self::line("VmRSS:").map(Resident)
    }

    /// How far it has risen above that since, at its peak.
    fn grown(self) -> Option<u64> {
        Some(Self::line("VmHWM:")?.saturating_sub(self.0))
    }

    fn line(name: &str) -> Option<u64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let kilobytes = status.lines().find_map(|line| line.strip_prefix(name))?.trim().strip_suffix(" kB")?;
        Some(kilobytes.parse::<u64>().ok()? << 10)
    }
}

/// An error is one line, and no fault of the machine.
fn one_line(problem: Problem) {
    let Problem::Image(line) = problem else { panic!("{problem:?}") };
    assert!(!line.contains('\n'), "{line}");
}

/// Writes the file anew. It is cut to its length last: a file that is emptied first is flushed to disk by ext4 as it is
/// closed, which makes a tenth of the rate.
fn overwrite(file: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut open = OpenOptions::new().write(true).create(true).truncate(false).open(file)?;
    open.write_all(bytes)?;
    open.set_len(bytes.len() as u64)
}

/// A file of this process alone, in the folder of temporary files.
fn file() -> &'static Path {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| std::env::temp_dir().join(format!("pathspace-fuzz-{}", std::process::id())))
}
