//! Long work in slices, so that no tick of 2.5 ms takes long.
//!
//! What takes a microcontroller more than a few thousand instructions is written as an `async fn` that awaits [`pause`] between its
//! parts: the compiler makes the state machine. Live, a tick polls it once ([`slice`]); replay and diagnosis poll it to its end
//! ([`at_once`]). Both run the same instructions on the same numbers, so they agree with all digits.

use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::{Context, Poll, Waker};

/// The end of a slice: what follows is for the next tick.
pub async fn pause() {
    let mut paused = false;
    poll_fn(|_| if core::mem::replace(&mut paused, true) { Poll::Ready(()) } else { Poll::Pending }).await
}

/// One slice of some work.
pub fn slice<T>(work: Pin<&mut (impl Future<Output = T> + ?Sized)>) -> Poll<T> {
    work.poll(&mut Context::from_waker(Waker::noop()))
}

/// All slices of some work, one after the other. It must wait for nothing but [`pause`].
pub fn at_once<T>(work: impl Future<Output = T>) -> T {
    let mut work = pin!(work);
    loop {
        if let Poll::Ready(done) = slice(work.as_mut()) {
            return done;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_ends_at_every_pause() {
        let mut done = 0;
        let mut work = std::boxed::Box::pin(async {
            for _ in 0..3 {
                done += 1;
                pause().await;
            }
        });
        let slices = core::iter::repeat_with(|| slice(work.as_mut())).take_while(Poll::is_pending).count();
        drop(work);
        assert_eq!((slices, done), (3, 3));
        assert_eq!(
            at_once(async {
                pause().await;
                7
            }),
            7
        );
    }
}
