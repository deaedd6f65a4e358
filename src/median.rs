//! The middle of some numbers.

use crate::slices::{at_once, pause};

/// The middle value, or the mean of the two middle ones; sorts `values`. `None` of nothing.
///
/// By Shell's method with the gaps 1, 4, 13 … 3h + 1 (D. E. Knuth, The Art of Computer Programming 3, 1998, section 5.2.1): quick for the
/// hundred numbers that a board has at most, and a small part of the standard library's sort in its flash.
pub fn median(values: &mut [f64]) -> Option<f64> {
    at_once(in_slices(values))
}

/// The same in slices, each of which goes through the numbers once.
pub async fn in_slices(values: &mut [f64]) -> Option<f64> {
    let mut gap = 1;
    while gap < values.len() / 3 {
        gap = 3 * gap + 1;
    }
    while gap > 0 {
        for start in gap..values.len() {
            let mut at = start;
            while let Some(before) = at.checked_sub(gap) {
                match (values.get(before), values.get(at)) {
                    (Some(a), Some(b)) if a.total_cmp(b).is_gt() => values.swap(before, at),
                    _ => break,
                }
                at = before;
            }
        }
        gap /= 3;
        pause().await;
    }
    let upper = *values.get(values.len() / 2)?;
    let lower = *values.get(values.len().checked_sub(1)? / 2)?;
    Some(0.5 * (lower + upper))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn of_few() {
        assert_eq!(median(&mut []), None);
        assert_eq!(median(&mut [3.0]), Some(3.0));
        assert_eq!(median(&mut [3.0, 1.0]), Some(2.0));
        assert_eq!(median(&mut [9.0, -1.0, 3.0]), Some(3.0));
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), Some(2.5));
    }

    proptest! {
        #[test]
        fn it_sorts(mut values in prop::collection::vec(-1e3..1e3_f64, 0..200)) {
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            median(&mut values);
            prop_assert_eq!(values, sorted);
        }
    }
}
