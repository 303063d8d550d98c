//! Energy of the processor's packages over a piece of work, joules, as the running average power limit counts it (RAPL;
//! Linux: `/sys/class/powercap/intel-rapl:N/energy_uj`, AMD's too). Whatever else the machine does meanwhile is in it;
//! memory, disks and fans are not. Limit: most systems let root alone read it, virtual machines have none, and counters
//! that wrap more than once (minutes at full power) are not noticed: [`MOST_S`].

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::input;

/// A counter of 32 bits in 2⁻¹⁴ J holds 262 kJ: at 1 kW it wraps after 262 s.
const MOST_S: f64 = 240.0;

/// Started when made.
#[derive(Debug)]
pub struct Meter {
    packages: Vec<Package>,
    started: Instant,
}

#[derive(Debug)]
struct Package {
    counter: PathBuf,
    start_uj: u64,
    /// Where it wraps.
    range_uj: u64,
}

impl Meter {
    /// Starts, where every package can be read.
    pub fn start() -> Option<Self> {
        Meter::of(Path::new("/sys/class/powercap"))
    }

    fn of(folder: &Path) -> Option<Self> {
        let zones = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
        // Parts of a package have another colon and a number.
        let is_package = |zone: &PathBuf| {
            let name =
                zone.file_name().and_then(|name| name.to_str()).and_then(|name| name.strip_prefix("intel-rapl:"));
            name.is_some_and(|number| number.bytes().all(|byte| byte.is_ascii_digit()))
        };
        let package = |zone: PathBuf| {
            let (counter, range_uj) = (zone.join("energy_uj"), number(&zone.join("max_energy_range_uj"))?);
            Some(Package { start_uj: number(&counter)?, counter, range_uj })
        };
        let packages: Vec<Package> = zones.filter(is_package).map(package).collect::<Option<_>>()?;
        (!packages.is_empty()).then(|| Meter { packages, started: Instant::now() })
    }

    /// What was taken since.
    pub fn joules(&self) -> Option<f64> {
        let taken = |package: &Package| {
            let now_uj = number(&package.counter)?;
            let wrapped = if now_uj < package.start_uj { package.range_uj } else { 0 };
            Some((now_uj + wrapped).saturating_sub(package.start_uj))
        };
        let taken = self.packages.iter().map(taken).sum::<Option<u64>>();
        taken.filter(|_| self.started.elapsed().as_secs_f64() < MOST_S).map(|taken| 1e-6 * taken as f64)
    }
}

fn number(file: &Path) -> Option<u64> {
    let text = input::read_at_most(file, 32).ok()?;
    std::str::from_utf8(&text).ok()?.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Oracle: counters written by hand; one wraps.
    #[test]
    fn packages_are_added_and_counters_wrap() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let write = |zone: &str, file: &str, value: u64| {
            let zone = folder.path().join(zone);
            std::fs::create_dir_all(&zone).expect("a writable folder");
            std::fs::write(zone.join(file), format!("{value}\n")).expect("a writable folder");
        };
        assert!(Meter::of(folder.path()).is_none());
        for (zone, start) in [("intel-rapl:0", 5_000_000), ("intel-rapl:1", 9_000_000), ("intel-rapl:0:0", 1)] {
            write(zone, "energy_uj", start);
            write(zone, "max_energy_range_uj", 10_000_000);
        }
        let meter = Meter::of(folder.path()).expect("two packages");
        write("intel-rapl:0", "energy_uj", 7_000_000);
        write("intel-rapl:1", "energy_uj", 500_000);
        assert_eq!(meter.joules(), Some(3.5));
        std::fs::remove_file(folder.path().join("intel-rapl:1/energy_uj")).expect("written");
        assert!(meter.joules().is_none() && Meter::of(folder.path()).is_none());
    }
}
