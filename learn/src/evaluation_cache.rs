//! What was evaluated of factors last.

use std::collections::HashMap;
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

/// What was evaluated last, how many values that is, and what is held beside it.
struct Last<T> {
    held: HashMap<String, T>,
    by_factor: LruCache<String, T>,
    values: usize,
}

impl<T: Clone> EvaluationCache<T> {
    /// `size`: how many values of single precision one is.
    pub fn new(size: fn(&T) -> usize) -> Self {
        Self { last: Mutex::new(Last { held: HashMap::new(), by_factor: LruCache::unbounded(), values: 0 }), size }
    }

    /// Of this factor: what is kept, or else is evaluated and kept.
    pub fn of(&self, factor: &Factor, evaluated: impl FnOnce() -> T) -> T {
        let key = format!("{factor:?}");
        if let Some(known) = self.last.lock().ok().and_then(|mut last| last.known(&key)) {
            return known;
        }
        let each = evaluated();
        if let Ok(mut last) = self.last.lock() {
            self.keep(&mut last, key, each.clone());
        }
        each
    }

    /// Holds what is in use elsewhere, too, as long as the cache is there.
    pub fn hold(&self, factor: &Factor, each: T) {
        if let Ok(mut last) = self.last.lock() {
            let key = format!("{factor:?}");
            let before = last.by_factor.pop(&key).map_or(0, |kept| (self.size)(&kept));
            last.values -= before;
            last.held.insert(key, each);
        }
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

impl<T: Clone> Last<T> {
    fn known(&mut self, key: &str) -> Option<T> {
        self.held.get(key).or_else(|| self.by_factor.get(key)).cloned()
    }
}

#[cfg(test)]
mod tests {
    use north_finder::effects::signal::Signal;

    use super::super::spans::IDENTITY;
    use super::*;

    /// Two of half of the room each are kept, and with a third the one goes that was asked for least recently; what is held does not go.
    #[test]
    fn what_is_held_does_not_go() {
        let cache: EvaluationCache<usize> = EvaluationCache::new(|_| MOST / 2);
        let factor = |signal: Signal| Factor::new(signal, &[], IDENTITY);
        let is_kept = |signal: Signal| cache.of(&factor(signal), || 0) == 1;
        let [time, since, turn, number] = [Signal::Time, Signal::Since, Signal::Turn, Signal::Number];
        cache.of(&factor(time), || 1);
        cache.hold(&factor(time), 1);
        for signal in [since, turn, number] {
            cache.of(&factor(signal), || 1);
        }
        assert!(is_kept(time) && is_kept(turn) && is_kept(number));
        assert!(!is_kept(since));
    }
}
