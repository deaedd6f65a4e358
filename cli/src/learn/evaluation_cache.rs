//! What was evaluated of factors last.

use std::sync::Mutex;

use lru::LruCache;
use north_finder::effects::factor::Factor;

/// Most values that are kept: 64 MB of single precision. While the constants of one factor are tuned, those of the others are asked for again and again.
const MOST: usize = 16 << 20;

/// Something of factors, kept for a while once it was evaluated.
pub struct EvaluationCache<T> {
    last: Mutex<Last<T>>,
    size: fn(&T) -> usize,
}

/// What was evaluated last, and how many values that is.
struct Last<T> {
    by_factor: LruCache<String, T>,
    values: usize,
}

impl<T: Clone> EvaluationCache<T> {
    /// `size`: how many values of single precision one is.
    pub fn new(size: fn(&T) -> usize) -> Self {
        Self { last: Mutex::new(Last { by_factor: LruCache::unbounded(), values: 0 }), size }
    }

    /// Of this factor: what is kept, or else is evaluated and kept.
    pub fn of(&self, factor: &Factor, evaluated: impl FnOnce() -> T) -> T {
        let key = format!("{factor:?}");
        if let Some(known) = self.last.lock().ok().and_then(|mut last| last.by_factor.get(&key).cloned()) {
            return known;
        }
        let each = evaluated();
        if let Ok(mut last) = self.last.lock() {
            self.keep(&mut last, key, each.clone());
        }
        each
    }

    fn keep(&self, last: &mut Last<T>, key: String, each: T) {
        last.values += (self.size)(&each);
        last.values -= last.by_factor.put(key, each).map_or(0, |replaced| (self.size)(&replaced));
        while last.values > MOST
            && let Some((_, oldest)) = last.by_factor.pop_lru()
        {
            last.values -= (self.size)(&oldest);
        }
    }
}
