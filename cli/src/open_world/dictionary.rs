//! All atoms that a run's course is searched for among.

use nalgebra::{DMatrix, DVector};

use super::atom::{Atom, Extent, KINDS};
use super::habits::Habits;
use super::sheet::Sheet;

/// Share of its square that must be left of an atom beside the others and the run's own unknowns.
const LEAST_LEFT: f64 = 1e-3;

/// All atoms that a run is searched for, in noise: columns times the roots of the samples' weights.
#[derive(Debug)]
pub struct Dictionary {
    /// With their kinds.
    atoms: Vec<(Atom, usize)>,
    /// How many of each kind.
    numbers: [f64; KINDS],
    starts: Vec<usize>,
    columns: DMatrix<f64>,
    squares: Vec<f64>,
}

impl Dictionary {
    pub fn new(sheet: &Sheet, roots: &DVector<f64>) -> Self {
        let extent = Extent::new(sheet);
        let atoms: Vec<(Atom, usize)> =
            Atom::all(extent, roots.len()).into_iter().map(|atom| (atom, atom.kind(extent))).collect();
        let mut numbers = [0.0; KINDS];
        let (mut starts, mut columns) = (vec![0], Vec::new());
        for (atom, kind) in &atoms {
            numbers[*kind] += 1.0;
            let of_atom = atom.columns(sheet, extent);
            starts.push(starts[starts.len() - 1] + of_atom.len());
            columns.extend(of_atom);
        }
        let all: Vec<f64> = columns
            .iter()
            .flat_map(|column| column.iter().zip(roots.iter()).map(|(value, root)| value * root))
            .collect();
        let columns = DMatrix::from_vec(roots.len(), starts[starts.len() - 1], all);
        let squares = columns.column_iter().map(|column| column.norm_squared()).collect();
        Self { atoms, numbers, starts, columns, squares }
    }

    /// Logs of one over the prior rate of one atom of every kind.
    pub fn penalties(&self, habits: &Habits) -> [f64; KINDS] {
        std::array::from_fn(|kind| (self.numbers[kind] / habits.rates[kind]).ln())
    }

    /// The atom with its kind that gains most, less its penalty, beside directions (`q`, orthonormal), of which the rate has this left.
    pub fn best(
        &self,
        q: &DMatrix<f64>,
        left: &DVector<f64>,
        variance: f64,
        penalties: &[f64; KINDS],
    ) -> Option<((Atom, usize), f64)> {
        let n = self.columns.nrows();
        let right = self.columns.tr_mul(&left.rows(0, n));
        let along = self.columns.tr_mul(&q.rows(0, n));
        let dot = |i: usize, j: usize| along.row(i).dot(&along.row(j));
        let gain = |atom: usize| -> Option<f64> {
            let i = self.starts[atom];
            let first = self.squares[i] - dot(i, i);
            if !(first > LEAST_LEFT * self.squares[i]) {
                return None;
            }
            let single = || 0.5 * (right[i].powi(2) / (first + 1.0 / variance) - (variance * first).ln_1p());
            if self.starts[atom + 1] == i + 1 {
                return Some(single());
            }
            let j = i + 1;
            let second = self.squares[j] - dot(j, j);
            let cross = self.columns.column(i).dot(&self.columns.column(j)) - dot(i, j);
            let (a, b) = (first + 1.0 / variance, second + 1.0 / variance);
            let determinant = a * b - cross * cross;
            let explained =
                (b * right[i].powi(2) - 2.0 * cross * right[i] * right[j] + a * right[j].powi(2)) / determinant;
            Some(0.5 * (explained - (determinant * variance * variance).ln()))
        };
        (0..self.atoms.len())
            .filter_map(|atom| Some((self.atoms[atom], gain(atom)? - penalties[self.atoms[atom].1])))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }
}
