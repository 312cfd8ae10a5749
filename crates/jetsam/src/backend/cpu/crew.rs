//! The threads of a step, which stay awake for it.
//!
//! Rayon's threads go to sleep after some ten microseconds without work, and to be woken up takes longer than many a loop does, of which a step
//! has a hundred. So they look for work for a while instead, as those of OpenMP do (docs/performance.md, Threads).
//!
//! Loops over chunks that take long are cut into single ones (`with_max_len(1)`): by itself rayon cuts a loop into quarters for two threads,
//! and one waits for the other to end its last.

use rayon::Yield;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// So long a thread looks for work in vain before it goes to sleep.
const PATIENCE: Duration = Duration::from_micros(500);
/// Looks between two looks at the clock, after which others may have the processor.
const LOOKS: u32 = 64;

/// Does `work` in the pool, with at most `most` of its threads awake.
pub(super) fn together<R: Send>(most: usize, work: impl FnOnce() -> R + Send) -> R {
    // as one job: a thread of the pool hands out work to the others without waiting to be woken up
    rayon::scope(|_| {
        let done = Arc::new(AtomicBool::new(false));
        let leader = rayon::current_thread_index();
        for _ in 1..rayon::current_num_threads().min(most) {
            let done = Arc::clone(&done);
            rayon::spawn(move || {
                if rayon::current_thread_index() != leader {
                    wait(&done);
                }
            });
        }
        let _last = Ends(&done);
        work()
    })
}

/// Lets the others go, even if the work panics.
struct Ends<'a>(&'a AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, Relaxed);
    }
}

/// Does what there is to do until `done`, or until there has been nothing for a while.
fn wait(done: &AtomicBool) {
    let (mut looks, mut idle_since) = (0_u32, Instant::now());
    while !done.load(Relaxed) {
        if rayon::yield_now() == Some(Yield::Executed) {
            (looks, idle_since) = (0, Instant::now());
            continue;
        }
        looks += 1;
        if looks % LOOKS == 0 {
            if idle_since.elapsed() > PATIENCE {
                break;
            }
            std::thread::yield_now();
        } else {
            std::hint::spin_loop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};

    fn sum(of: usize) -> usize {
        (0..of).into_par_iter().with_max_len(1).sum()
    }

    /// Loops inside, and steps inside loops of others, come to their end, with any number of threads, awake or not.
    #[test]
    fn work_is_done_together() {
        for threads in [1, 2, 5] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            for most in [0, 1, 3, 100] {
                let step = || together(most, || (0..20).map(|_| sum(50)).sum::<usize>());
                assert_eq!(pool.install(step), 20 * 49 * 25);
                let all: usize = pool.install(|| (0..8).into_par_iter().with_max_len(1).map(|_| step()).sum());
                assert_eq!(all, 8 * 20 * 49 * 25);
            }
        }
    }

    /// A panic comes through, and nobody waits for what will not come.
    #[test]
    fn a_panic_lets_the_others_go() {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let work = || {
            together(3, || {
                if sum(50) > 0 {
                    panic!("on purpose")
                }
            })
        };
        assert!(catch_unwind(AssertUnwindSafe(|| pool.install(work))).is_err());
        assert_eq!(pool.install(|| together(3, || sum(50))), 49 * 25);
    }
}
