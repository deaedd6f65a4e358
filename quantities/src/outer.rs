//! The outer product of two vectors, added to a matrix where that is.
//!
//! Not nalgebra's `ger`: its checks of shapes, which are known here, would leave a panic in the image.

use nalgebra::{SMatrix, SVector};

/// Adds `left · rightᵀ`, column by column.
pub fn add<const N: usize>(sum: &mut SMatrix<f64, N, N>, left: &SVector<f64, N>, right: &SVector<f64, N>) {
    for (column, right) in sum.as_mut_slice().as_chunks_mut::<N>().0.iter_mut().zip(right.iter()) {
        column.iter_mut().zip(left.iter()).for_each(|(place, left)| *place += left * right);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_left_vector_goes_down_the_rows() {
        let mut sum = SMatrix::from([[1.0, 2.0], [3.0, 4.0]]);
        add(&mut sum, &SVector::from([10.0, 20.0]), &SVector::from([1.0, 3.0]));
        // Columns: (1, 2) + 1 · (10, 20) and (3, 4) + 3 · (10, 20).
        assert_eq!(sum, SMatrix::from([[11.0, 22.0], [33.0, 64.0]]));
    }
}
