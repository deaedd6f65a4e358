//! The last moves of the index, and switching on.

use heapless::Deque;

use super::conditions::Conditions;
use super::track::REST_DEG;
use crate::units::wrap_180_deg;

/// Moves that are remembered.
const MOVES: usize = 8;

/// A move of the index, or switching on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Move {
    /// When rest began, seconds.
    pub ended_s: f64,
    /// Its way, degrees, counter-clockwise positive.
    pub travel_deg: f32,
    /// Cosine and sine of the index angle that it led to.
    pub index: [f32; 2],
    /// How many moves were made before it; `None`: it is no move at all, the recording began.
    pub number: Option<u16>,
}

/// The index' last moves.
#[derive(Clone, Debug, Default)]
pub struct Moves {
    last_deg: Option<f64>,
    moving: bool,
    made: u16,
    /// Oldest first.
    moves: Deque<Move, MOVES>,
}

impl Moves {
    pub fn push(&mut self, conditions: &Conditions) {
        let Some(direction) = conditions.index else { return };
        let index_deg = direction.deg();
        let start_s = conditions.t_s - 0.5 * conditions.seconds;
        let index = [direction.cos as f32, direction.sin as f32];
        let Some(last_deg) = self.last_deg.replace(index_deg) else {
            self.begin(Move { ended_s: start_s, travel_deg: 0.0, index, number: None });
            return;
        };
        let way_deg = wrap_180_deg(index_deg - last_deg);
        let moving = way_deg.abs() > REST_DEG;
        if moving && !self.moving {
            self.begin(Move { ended_s: start_s, travel_deg: 0.0, index, number: Some(self.made) });
            self.made = self.made.saturating_add(1);
        }
        if let Some(last) = self.moves.back_mut() {
            last.index = index;
            if moving {
                last.travel_deg += way_deg as f32;
                // Where rows leave the move out, rest begins with this very row.
                last.ended_s = start_s;
            }
        }
        self.moving = moving;
    }

    fn begin(&mut self, each: Move) {
        if self.moves.is_full() {
            self.moves.pop_front();
        }
        let _ = self.moves.push_back(each);
    }

    /// The last moves, oldest first; until eight were made, switching on stands before them.
    pub fn iter(&self) -> impl Iterator<Item = &Move> {
        self.moves.iter()
    }
}
