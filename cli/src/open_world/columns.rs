//! Matrices put together from columns.

use nalgebra::DMatrix;

/// Columns of a group: one row a sample.
pub type Columns = DMatrix<f64>;

/// Values column by column.
pub fn of_values(rows: usize, values: impl IntoIterator<Item = f64>) -> DMatrix<f64> {
    let all: Vec<f64> = values.into_iter().collect();
    let count = all.len() / rows.max(1);
    DMatrix::from_vec(rows, count, all)
}

/// One column after the other.
pub fn from_columns(rows: usize, columns: impl IntoIterator<Item = Vec<f64>>) -> DMatrix<f64> {
    of_values(rows, columns.into_iter().flatten())
}

/// The columns of one matrix after those of the other.
pub fn side_by_side<'a>(rows: usize, parts: impl IntoIterator<Item = &'a DMatrix<f64>>) -> DMatrix<f64> {
    of_values(rows, parts.into_iter().flat_map(|part| part.iter().copied()))
}
