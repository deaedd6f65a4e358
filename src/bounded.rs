//! Lists of a fixed room.

use heapless::Vec;

/// The first of these, as many as there is room for: where `collect` would panic, the rest is left out.
pub fn bounded<T, const N: usize>(items: impl IntoIterator<Item = T>) -> Vec<T, N> {
    let mut list = Vec::new();
    for item in items {
        if list.push(item).is_err() {
            break;
        }
    }
    list
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rest_is_left_out() {
        assert_eq!(bounded::<_, 2>([1, 2, 3]), [1, 2]);
    }
}
