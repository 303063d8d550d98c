//! Clocks around a piece of work: wall time, and the processor time of all threads of the process, which other
//! processes on the machine do not stretch (POSIX `CLOCK_PROCESS_CPUTIME_ID`, in nanoseconds; `/proc` counts in ticks
//! of 10 ms).

use std::time::{Duration, Instant};

use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

/// What a piece of work took, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Of the clock on the wall.
    pub wall_s: f64,
    /// Of all threads together.
    pub cpu_s: f64,
}

/// Started when made.
#[derive(Clone, Copy, Debug)]
pub struct Stopwatch {
    wall: Instant,
    cpu: Duration,
}

impl Stopwatch {
    /// Starts.
    pub fn start() -> Self {
        Stopwatch { wall: Instant::now(), cpu: cpu_time() }
    }

    /// What has passed since.
    pub fn cost(&self) -> Cost {
        let cpu = cpu_time().saturating_sub(self.cpu);
        Cost { wall_s: self.wall.elapsed().as_secs_f64(), cpu_s: cpu.as_secs_f64() }
    }
}

/// Processor time of the process so far.
fn cpu_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    Duration::new(time.tv_sec.unsigned_abs(), time.tv_nsec.unsigned_abs() as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_takes_processor_time_and_waiting_does_not() {
        // Other tests of this process use the processor meanwhile, so only lower bounds are sure.
        let watch = Stopwatch::start();
        let mut x = 1u64;
        while watch.cost().cpu_s < 0.02 {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        let cost = watch.cost();
        assert!(cost.cpu_s >= 0.02 && cost.wall_s > 0.0, "{cost:?}");
    }
}
