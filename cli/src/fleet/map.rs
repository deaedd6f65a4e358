//! Work on many campaigns, one on each of some threads: memory is that of as many campaigns as there are threads.

use std::num::NonZero;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

use crate::failure::Failure;

/// The threads of this machine.
pub fn cores() -> usize {
    thread::available_parallelism().map_or(1, NonZero::get)
}

/// Does something with every item, in the order in which threads are free; results are in the order of the items. What one work does by itself in
/// parallel stays on its own thread, so that no more works are begun than there are threads. None is begun any more once `stop` is raised.
///
/// Errors: a thread that cannot be started, an interrupt.
pub fn map<T: Sync, R: Send>(
    items: &[T],
    threads: usize,
    stop: &AtomicBool,
    work: impl Fn(&T) -> R + Sync,
) -> Result<Vec<R>, Failure> {
    let next = AtomicUsize::new(0);
    let done: Vec<Mutex<Option<R>>> = items.iter().map(|_| Mutex::new(None)).collect();
    let worker = || -> Result<(), Failure> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .map_err(|error| Failure::Refused(format!("no thread could be started: {error}")))?;
        while !stop.load(Ordering::Relaxed) {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(number) else { break };
            let result = pool.install(|| work(item));
            if let Ok(mut place) = done[number].lock() {
                *place = Some(result);
            }
        }
        Ok(())
    };
    let ended: Vec<Result<(), Failure>> = thread::scope(|scope| {
        let workers: Vec<_> = (0..threads.clamp(1, items.len().max(1))).map(|_| scope.spawn(worker)).collect();
        let join = |worker: thread::ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        workers.into_iter().map(join).collect()
    });
    ended.into_iter().collect::<Result<(), Failure>>()?;
    let results: Option<Vec<R>> = done.into_iter().map(|place| place.into_inner().ok().flatten()).collect();
    results.ok_or(Failure::Interrupted)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Never more at a time than there are threads, and all in order.
    #[test]
    fn results_are_in_order_and_no_more_works_than_threads() {
        let (now, most) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let items: Vec<u64> = (0..40).collect();
        let work = |item: &u64| {
            most.fetch_max(now.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            thread::sleep(std::time::Duration::from_millis(1 + item % 3));
            now.fetch_sub(1, Ordering::SeqCst);
            item * item
        };
        let squares = map(&items, 3, &AtomicBool::new(false), work).unwrap();
        assert!(squares.iter().zip(&items).all(|(square, item)| *square == item * item));
        assert!((1..=3).contains(&most.load(Ordering::SeqCst)), "{most:?}");
    }

    #[test]
    fn nothing_is_begun_once_the_flag_is_raised() {
        let (stop, begun) = (AtomicBool::new(false), AtomicUsize::new(0));
        let items: Vec<u64> = (0..3).collect();
        let work = |_: &u64| {
            begun.fetch_add(1, Ordering::SeqCst);
            stop.store(true, Ordering::SeqCst);
        };
        let ended = map(&items, 1, &stop, work);
        assert!(matches!(ended, Err(Failure::Interrupted)) && begun.load(Ordering::SeqCst) == 1, "{begun:?}");
    }
}
