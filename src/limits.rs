//! Limits of values that are set.

/// A field of [`Settings`] whose value is not allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    pub field: &'static str,
    pub value: f64,
    /// What is allowed, for a person.
    pub allowed: &'static str,
}

impl core::fmt::Display for Invalid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} = {}: allowed is {}", self.field, self.value, self.allowed)
    }
}

/// The value of a field must lie from `low` to `high`, both included; `allowed` says so for a person.
pub fn within(field: &'static str, value: f64, low: f64, high: f64, allowed: &'static str) -> Result<(), Invalid> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(Invalid { field, value, allowed }) }
}

/// All values of a field must be finite.
pub fn finite(field: &'static str, values: &[f64]) -> Result<(), Invalid> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(Invalid { field, value, allowed: "a finite number" }),
        None => Ok(()),
    }
}

/// The value of a field must be finite and above 0.
pub fn positive(field: &'static str, value: f64) -> Result<(), Invalid> {
    match value.is_finite() && value > 0.0 {
        true => Ok(()),
        false => Err(Invalid { field, value, allowed: "a finite number above 0" }),
    }
}
