//! The time that a dispatch has had.
//!
//! A hardware GPU computes while the process waits, so its time is that of the wall. A software one computes in threads of
//! the process itself, and gets no further while other programs have the processors: its time is what the process was given
//! of them.

use std::time::{Duration, Instant};

/// A software GPU that gets this many times less than all processors is taken for stuck all the same.
const MAX_CROWDED: u32 = 30;

/// When something began.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moment {
    at: Instant,
    /// Processor time of the process until then, where that is what counts.
    worked: Option<Duration>,
}

impl Moment {
    /// This moment, for work that the process itself does or for that of a device.
    pub fn now(in_process: bool) -> Moment {
        Moment { at: Instant::now(), worked: if in_process { processor_time() } else { None } }
    }

    /// The later one of two.
    pub fn later(self, other: Moment) -> Moment {
        if other.at > self.at { other } else { self }
    }

    /// Time on the wall since then.
    pub fn elapsed(self) -> Duration {
        self.at.elapsed()
    }

    /// The time that work begun then has had: in processor time, per processor, where it is the process that computes.
    pub fn spent(self) -> Duration {
        let elapsed = self.at.elapsed();
        let Some((before, now)) = self.worked.zip(processor_time()) else { return elapsed };
        let processors = std::thread::available_parallelism().map_or(1, usize::from) as u32;
        (now.saturating_sub(before) / processors).max(elapsed / MAX_CROWDED)
    }
}

/// What all threads of the process have computed so far, together, where the system tells.
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
        let [hardware, software] = [false, true].map(Moment::now);
        // Other tests of this process compute meanwhile: at most on all processors, but no clock is that exact.
        std::thread::sleep(Duration::from_millis(300));
        assert!(hardware.spent() >= Duration::from_millis(300));
        let (spent, elapsed) = (software.spent(), software.elapsed());
        assert!(spent >= Duration::from_millis(300) / MAX_CROWDED && spent <= elapsed + Duration::from_millis(50));
        if let (Some(before), Some(now)) = (software.worked, processor_time()) {
            let processors = std::thread::available_parallelism().map_or(1, usize::from) as u32;
            assert!(now >= before && spent <= ((now - before) / processors).max(software.elapsed() / MAX_CROWDED));
        }
        assert_eq!(hardware.later(software).at, software.at);
        assert_eq!(software.later(hardware).at, software.at);
    }
}
