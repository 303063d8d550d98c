//! The machine that a measurement ran on: processor, instruction sets, processor time. Read from `/proc` and the
//! processor itself; where the system does not say, the answer is "unknown" or `None`, never a guess.

use std::fs;

/// A processor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Processor {
    /// Name as the system gives it: "AMD EPYC".
    pub name: String,
    /// Instruction sets that matter here, of those that it has.
    pub features: Vec<&'static str>,
}

impl Processor {
    /// The one that runs this process.
    pub fn detect() -> Self {
        Processor { name: name(), features: features() }
    }

    /// Features that this binary was compiled to use and this processor lacks.
    pub fn missing(&self) -> Vec<&'static str> {
        let compiled = [
            ("avx2", cfg!(target_feature = "avx2")),
            ("fma", cfg!(target_feature = "fma")),
            ("bmi2", cfg!(target_feature = "bmi2")),
        ];
        compiled.iter().filter(|(name, used)| *used && !self.features.contains(name)).map(|(name, _)| *name).collect()
    }

    /// The widest vector instructions, in the spelling of `--isa`.
    pub fn isa(&self) -> &'static str {
        let has = |names: &[&str]| names.iter().all(|name| self.features.contains(name));
        if has(&["avx512f", "avx512dq", "avx512vl"]) {
            "avx512"
        } else {
            ["avx2", "avx", "sse4.2"].into_iter().find(|&name| has(&[name])).unwrap_or(std::env::consts::ARCH)
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn features() -> Vec<&'static str> {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx", is_x86_feature_detected!("avx")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("bmi2", is_x86_feature_detected!("bmi2")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
        ("avx512dq", is_x86_feature_detected!("avx512dq")),
        ("avx512vl", is_x86_feature_detected!("avx512vl")),
    ];
    found.iter().filter(|(_, has)| *has).map(|(name, _)| *name).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn features() -> Vec<&'static str> {
    vec![]
}

fn name() -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':'));
    name.map_or_else(|| std::env::consts::ARCH.to_string(), |(_, name)| name.trim().to_string())
}

/// Processor time of all living threads of this process, seconds, without the time they waited for a processor; `None`
/// where the system does not say. Exact to a nanosecond for threads that sleep, to a tick (4 ms) for those that run.
/// Source: the first field of `/proc/PID/task/TID/schedstat` (Linux, Documentation/scheduler/sched-stats).
pub fn processor_seconds() -> Option<f64> {
    let mut total = 0u64;
    for task in fs::read_dir("/proc/self/task").ok()? {
        // A thread may have ended since the folder was read.
        let Ok(text) = fs::read_to_string(task.ok()?.path().join("schedstat")) else { continue };
        total += nanoseconds(&text)?;
    }
    Some(total as f64 * 1e-9)
}

/// Processor time in a thread's `schedstat`.
fn nanoseconds(schedstat: &str) -> Option<u64> {
    schedstat.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_widest_instruction_set_is_named_as_on_the_command_line() {
        let with = |features: &[&'static str]| Processor { name: String::new(), features: features.to_vec() }.isa();
        assert_eq!(with(&["sse4.2", "avx", "avx2", "fma", "bmi2", "avx512f", "avx512dq", "avx512vl"]), "avx512");
        assert_eq!(with(&["sse4.2", "avx", "avx2", "fma", "avx512f"]), "avx2");
        assert_eq!(with(&["sse4.2"]), "sse4.2");
        assert_eq!(with(&[]), std::env::consts::ARCH);
    }

    /// Of this thread alone: the process's sum falls when a thread of another test ends. A running thread's time is accounted
    /// at ticks, and on a busy machine it may not run for a while.
    #[test]
    fn processor_time_grows_with_work() {
        let now = || nanoseconds(&fs::read_to_string("/proc/thread-self/schedstat").ok()?);
        let Some(before) = now() else { return };
        let start = std::time::Instant::now();
        while now() <= Some(before) {
            assert!(start.elapsed().as_secs() < 60, "no processor time in a minute");
        }
        assert!(processor_seconds().is_some_and(|all| all > 0.0));
    }
}
