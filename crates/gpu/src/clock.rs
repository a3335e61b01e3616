//! The time that a dispatch has had.
//!
//! A hardware GPU computes while the process waits, so its time is wall time. A software GPU computes in threads of the
//! process itself, and makes no progress while other programs use the processors, so its time is the process's
//! processor time.

use std::time::{Duration, Instant};

/// A software GPU that gets this many times less than all processors is considered stuck nevertheless.
const MAX_CROWDED: u32 = 30;

/// When something began.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    at: Instant,
    /// Processor time of the process until then, where that counts.
    worked: Option<Duration>,
}

impl Moment {
    /// The current moment, for work done by the process itself or by a device.
    pub fn now(in_process: bool) -> Moment {
        Moment { at: Instant::now(), worked: if in_process { processor_time() } else { None } }
    }

    /// The later of two moments.
    pub fn later(self, other: Moment) -> Moment {
        if other.at > self.at { other } else { self }
    }

    /// Wall time since then.
    pub fn elapsed(self) -> Duration {
        self.at.elapsed()
    }

    /// Time spent on work started then: processor time per processor if the process itself computes.
    pub fn spent(self) -> Duration {
        let elapsed = self.at.elapsed();
        let Some((before, now)) = self.worked.zip(processor_time()) else { return elapsed };
        let processors = std::thread::available_parallelism().map_or(1, usize::from) as u32;
        spent(elapsed, now.saturating_sub(before), processors)
    }
}

/// The time that counts if the process had `worked` on so many processors while `elapsed` went by.
fn spent(elapsed: Duration, worked: Duration, processors: u32) -> Duration {
    (worked / processors).max(elapsed / MAX_CROWDED)
}

/// Processor time of all threads of the process so far, where the system reports it.
#[cfg(unix)]
fn processor_time() -> Option<Duration> {
    use rustix::time::{ClockId, clock_gettime};
    clock_gettime(ClockId::ProcessCPUTime).try_into().ok()
}

#[cfg(not(unix))]
fn processor_time() -> Option<Duration> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_on_a_software_gpu_does_time_without_a_processor_count_little() {
        let seconds = Duration::from_secs;
        assert_eq!(spent(seconds(60), seconds(8), 4), seconds(2));
        assert_eq!(spent(seconds(60), seconds(0), 4), seconds(60) / MAX_CROWDED);
        // All processors, and more of them than the system says there are.
        assert_eq!(spent(seconds(60), seconds(240), 4), seconds(60));
        let [hardware, software] = [false, true].map(Moment::now);
        std::thread::sleep(Duration::from_millis(30));
        assert!(hardware.spent() >= Duration::from_millis(30));
        assert!(software.spent() >= Duration::from_millis(30) / MAX_CROWDED);
        assert_eq!(hardware.later(software).at, software.at);
        assert_eq!(software.later(hardware).at, software.at);
    }
}
