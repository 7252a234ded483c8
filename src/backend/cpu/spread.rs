//! Units of work spread over threads, of which the calling one is the first.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Runs `work` on each of `units`, with their numbers, and returns the results in that order.
///
/// Only as many threads of `pool` are woken as there are units beyond the first: to wake one takes
/// as long as a small batch.
pub(super) fn spread<T: Send, R: Send>(
    pool: &rayon::ThreadPool,
    units: impl ExactSizeIterator<Item = T> + Send,
    work: impl Fn(usize, T) -> R + Sync,
) -> Vec<R> {
    let helpers = units.len().min(pool.current_num_threads()).saturating_sub(1);
    let units = Mutex::new(units.enumerate());
    let results = Mutex::new(Vec::new());
    let drain = || {
        loop {
            // The lock is gone before the work begins.
            let unit = locked(&units).next();
            let Some((number, unit)) = unit else { break };
            let result = work(number, unit);
            locked(&results).push((number, result));
        }
    };
    pool.in_place_scope(|scope| {
        (0..helpers).for_each(|_| scope.spawn(|_| drain()));
        drain();
    });
    let mut results = results.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.sort_unstable_by_key(|(number, _)| *number);
    results.into_iter().map(|(_, result)| result).collect()
}

/// A panic of another thread goes on in the scope; here it changes nothing.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
