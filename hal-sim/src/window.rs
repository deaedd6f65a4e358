//! Windows of time in which a fault is in force.

/// Whether `t_s` lies in the window; no end means for ever.
pub fn contains(from_s: f64, to_s: Option<f64>, t_s: f64) -> bool {
    t_s >= from_s && to_s.is_none_or(|to_s| t_s < to_s)
}
