//! The machine: processor, instruction sets, threads, processor time (memory: `room.rs`). Read from `/proc` and the
//! processor itself; where the system does not say, the answer is "unknown" or `None`, never a guess.

use std::fs;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};
use rustix::time::{ClockId, clock_gettime};

/// A processor.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Processor {
    /// Name as the system gives it: "AMD EPYC".
    pub name: String,
    /// Instruction sets that matter here, of those that it has.
    pub features: Vec<&'static str>,
}

/// What x86-64-v3 has over the baseline that matters here, and whether this binary was compiled to use it.
const COMPILED: [(&str, bool); 3] = [
    ("avx2", cfg!(target_feature = "avx2")),
    ("fma", cfg!(target_feature = "fma")),
    ("bmi2", cfg!(target_feature = "bmi2")),
];

impl Processor {
    /// The one that runs this process.
    pub fn detect() -> Self {
        Processor { name: name(), features: features() }
    }

    /// Features that this binary was compiled to use and this processor lacks.
    pub fn missing(&self) -> Vec<&'static str> {
        COMPILED.iter().filter(|(name, used)| *used && !self.features.contains(name)).map(|(name, _)| *name).collect()
    }

    /// Instruction sets of x86-64-v3 that this processor has and this binary was not compiled for: shading and the
    /// backends in Rust then run slower than they could. Only AVX-512 is found at run time.
    ///
    /// ```
    /// use pathspace::machine::Processor;
    /// let unused = Processor::detect().unused();
    /// if !unused.is_empty() {
    ///     eprintln!("{} unused: compile with RUSTFLAGS='-C target-cpu=x86-64-v3'", unused.join(", "));
    /// }
    /// ```
    pub fn unused(&self) -> Vec<&'static str> {
        COMPILED.iter().filter(|(name, used)| !used && self.features.contains(name)).map(|(name, _)| *name).collect()
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

/// Bytes of a thread's stack, asked for so that no variable of the environment decides.
const STACK: usize = 2 << 20;

/// Bytes that the threads of a C library may ask for: the default of oneTBB.
const FOREIGN_STACK: usize = 4 << 20;

/// Threads for each processor that are worth starting, and how many are allowed everywhere.
const MOST_THREADS: (usize, usize) = (4, 64);

/// Worker threads for `asked`, at most four a processor (at least 64 are allowed): more make nothing faster, and
/// thousands take minutes to come and go. For 0 all that this process may use: the affinity mask and cgroup quota, and
/// no more than Slurm grants the task.
pub fn threads(asked: usize) -> usize {
    if asked > 0 {
        let processors = thread::available_parallelism().map_or(1, |n| n.get());
        return asked.min((MOST_THREADS.0 * processors).max(MOST_THREADS.1));
    }
    let available = thread::available_parallelism().map_or(1, |n| n.get());
    let granted = std::env::var("SLURM_CPUS_PER_TASK").ok().and_then(|n| n.parse::<usize>().ok());
    granted.map_or(available, |granted| available.min(granted.max(1)))
}

/// A pool of exactly `threads` threads (1 if 0) that are named after `what`.
///
/// # Errors
/// When the system refuses to start them.
pub fn pool(threads: usize, what: &'static str) -> Result<ThreadPool, ThreadPoolBuildError> {
    builder(threads, what).build()
}

/// Starts the pool that work outside of any pool runs on, with the threads for `asked`; for programs, once.
///
/// # Errors
/// When the system refuses to start them, or there is one already.
pub fn start_pool(asked: usize) -> Result<(), ThreadPoolBuildError> {
    builder(threads(asked), "shared").build_global()
}

fn builder(threads: usize, what: &'static str) -> ThreadPoolBuilder {
    let builder = ThreadPoolBuilder::new().num_threads(threads.max(1)).stack_size(STACK);
    builder.thread_name(move |i| format!("{what}-{i}"))
}

/// Whether `count` threads more can be started, tried by starting them: C libraries end the process where they cannot.
///
/// # Errors
/// The system's reason.
pub fn can_start(count: usize) -> std::io::Result<()> {
    let seen = AtomicBool::new(false);
    thread::scope(|scope| {
        let mut waiting = Vec::new();
        let start = || {
            let builder = thread::Builder::new().stack_size(FOREIGN_STACK);
            builder.spawn_scoped(scope, || {
                while !seen.load(Ordering::Acquire) {
                    thread::park()
                }
            })
        };
        let outcome = (0..count).try_for_each(|_| start().map(|thread| waiting.push(thread)));
        seen.store(true, Ordering::Release);
        waiting.iter().for_each(|thread| thread.thread().unpark());
        outcome
    })
}

/// A clock that counts from some moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The time that passes.
    Wall,
    /// The processor time of the calling thread, which other processes do not stretch.
    Thread,
}

impl Clock {
    /// What it shows (POSIX `CLOCK_MONOTONIC`, `CLOCK_THREAD_CPUTIME_ID`).
    pub fn now(self) -> Duration {
        let time = clock_gettime(match self {
            Clock::Wall => ClockId::Monotonic,
            Clock::Thread => ClockId::ThreadCPUTime,
        });
        Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
    }
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

    /// Oracle: the definitions. Deterministic.
    #[test]
    fn absurd_numbers_of_threads_are_not_started() {
        assert_eq!([1, 3, 64].map(threads), [1, 3, 64]);
        assert!(threads(1 << 20) <= MOST_THREADS.1.max(MOST_THREADS.0 * threads(0).max(1 << 10)));
        can_start(3).expect("three threads more");
        assert_eq!(pool(2, "two").expect("two threads").current_num_threads(), 2);
    }

    #[test]
    fn the_widest_instruction_set_is_named_as_on_the_command_line() {
        let with = |features: &[&'static str]| Processor { name: String::new(), features: features.to_vec() }.isa();
        assert_eq!(with(&["sse4.2", "avx", "avx2", "fma", "bmi2", "avx512f", "avx512dq", "avx512vl"]), "avx512");
        assert_eq!(with(&["sse4.2", "avx", "avx2", "fma", "avx512f"]), "avx2");
        assert_eq!(with(&["sse4.2"]), "sse4.2");
        assert_eq!(with(&[]), std::env::consts::ARCH);
    }

    /// Of this thread alone: the process's sum falls when a thread of another test ends. A running thread's time is
    /// accounted at ticks, and on a busy machine it may not run for a while.
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
