//! Work on several threads whose result does not depend on how many there are.

use rayon::iter::{IndexedParallelIterator as _, IntoParallelIterator as _, ParallelIterator as _};

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
    let threads = threads.min(things.len());
    // Where no threads are to be had, the result is the same without.
    let pool = if threads > 1 { rayon::ThreadPoolBuilder::new().num_threads(threads).build().ok() } else { None };
    match pool {
        // One by one: pieces of work differ in size.
        Some(pool) => pool.install(|| things.into_par_iter().with_max_len(1).map(&work).collect()),
        None => things.into_iter().map(work).collect(),
    }
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
