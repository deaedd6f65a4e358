//! Values on the command line.

/// A number from `LOW` to `HIGH`; anything else, not-a-number too, is a usage error that says what is allowed.
pub fn number<const LOW: i32, const HIGH: i32>(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (f64::from(LOW)..=f64::from(HIGH)).contains(&value) => Ok(value),
        _ => Err(format!("allowed is a number from {LOW} to {HIGH}")),
    }
}

/// A seed; of anything else a usage error says what is allowed.
pub fn seed(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| format!("allowed is a whole number from 0 to {}", u64::MAX))
}
