//! Limits of values that are set.

/// A field of `Settings` whose value is not allowed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Invalid {
    pub field: &'static str,
    pub value: f64,
    /// What is allowed, for a person.
    pub allowed: &'static str,
    /// Where a number that follows from others is the limit: that number, and `allowed` says what it is.
    pub least: Option<f64>,
}

impl Invalid {
    /// A value outside of what is allowed.
    pub fn new(field: &'static str, value: f64, allowed: &'static str) -> Self {
        Self { field, value, allowed, least: None }
    }
}

impl Invalid {
    /// What is allowed, with its number.
    pub fn write_allowed(&self, f: &mut impl core::fmt::Write) -> core::fmt::Result {
        match self.least {
            // Rounded upwards, so that what is read is allowed.
            Some(least) => write!(f, "at least {} ({})", libm::ceil(1000.0 * least) / 1000.0, self.allowed),
            None => f.write_str(self.allowed),
        }
    }
}

impl core::fmt::Display for Invalid {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{} = {}: allowed is ", self.field, self.value)?;
        self.write_allowed(f)
    }
}

/// The value of a field must lie from `low` to `high`, both included; `allowed` says so for a person.
pub fn within(field: &'static str, value: f64, low: f64, high: f64, allowed: &'static str) -> Result<(), Invalid> {
    if (low..=high).contains(&value) { Ok(()) } else { Err(Invalid::new(field, value, allowed)) }
}

/// All values of a field must be finite.
pub fn finite(field: &'static str, values: &[f64]) -> Result<(), Invalid> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(Invalid::new(field, value, "a finite number")),
        None => Ok(()),
    }
}

/// The value of a field must be finite and above 0.
pub fn positive(field: &'static str, value: f64) -> Result<(), Invalid> {
    match value.is_finite() && value > 0.0 {
        true => Ok(()),
        false => Err(Invalid::new(field, value, "a finite number above 0")),
    }
}
