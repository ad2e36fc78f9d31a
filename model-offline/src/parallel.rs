//! Work on several threads whose result does not depend on how many there are.

use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::cell::Cell;

/// Runs `work` for 0..count on at most `threads` threads; results come in order, whatever the number of threads.
///
/// # Example
/// ```
/// assert_eq!(model_offline::parallel::map(4, 2, |i| i * i), [0, 1, 4, 9]);
/// ```
pub fn map<T: Send>(count: usize, threads: usize, work: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    map_each((0..count).collect(), threads, work)
}

/// The same for things that the work takes and keeps.
pub fn map_each<I: Send, T: Send>(things: Vec<I>, threads: usize, work: impl Fn(I) -> T + Sync + Send) -> Vec<T> {
    match pool(threads.min(things.len())) {
        // One by one: pieces of work differ in size.
        Some(pool) => pool.install(|| things.into_par_iter().with_max_len(1).map(&work).collect()),
        None => things.into_iter().map(work).collect(),
    }
}

thread_local! {
    /// Threads that may share the work of this one.
    static SHARING: Cell<usize> = const { Cell::new(1) };
}

/// Runs `work` where dense work inside of it, such as that of a large factor, is shared by so many threads. Results do not
/// depend on how many there are. What [`map`] runs beside other things is not shared once more.
///
/// # Example
/// ```
/// assert_eq!(model_offline::parallel::within(2, || 1 + 1), 2);
/// ```
pub fn within<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    match pool(threads) {
        // The pool ends with the work, and with it the thread that knows of it.
        Some(pool) => pool.install(|| {
            SHARING.set(threads);
            work()
        }),
        None => work(),
    }
}

/// So many threads; none for one, or where none are to be had: the result is the same without.
fn pool(threads: usize) -> Option<ThreadPool> {
    if threads > 1 { ThreadPoolBuilder::new().num_threads(threads).build().ok() } else { None }
}

/// Threads that may share work called from here: one, but [`within`] more.
pub(crate) fn here() -> usize {
    SHARING.get()
}

/// More threads than this help nobody, and starting them may fail.
const MOST_THREADS: usize = 256;

/// As many threads as are asked for, within reason; without a wish, as many as the machine runs at once.
pub fn threads(asked: Option<usize>) -> usize {
    asked.unwrap_or_else(available).clamp(1, MOST_THREADS)
}

/// As many threads as the machine runs at once.
pub fn available() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZero::get)
}
