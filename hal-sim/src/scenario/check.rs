//! One declaration per setting: its type, its default and what it may be.
//!
//! The macro `part!` turns a list of fields into a serde structure that refuses unknown fields, has its defaults, and can report
//! every value outside its allowed range together with the path of the field.

use std::fmt::Debug;
use std::ops::RangeInclusive;

/// One value that is not allowed.
#[derive(Debug, Clone, PartialEq)]
pub struct Violation {
    /// Where it stands: field names and list positions from the root, for example `base`, `shocks`, `0`, `at_s`.
    pub path: Vec<String>,
    /// The value as written.
    pub value: String,
    /// What is allowed there.
    pub allowed: String,
}

impl Violation {
    /// The field as one dotted name, for example `base.shocks[0].at_s`.
    pub fn field(&self) -> String {
        let mut name = String::new();
        for step in &self.path {
            if step.parse::<usize>().is_ok() {
                name.push_str(&format!("[{step}]"));
            } else {
                if !name.is_empty() {
                    name.push('.');
                }
                name.push_str(step);
            }
        }
        name
    }
}

/// The path of the field that is being checked and what was found so far.
#[derive(Debug, Default)]
pub struct Findings {
    path: Vec<String>,
    /// Everything that is out of range, in the order of the fields.
    pub violations: Vec<Violation>,
}

impl Findings {
    /// Runs `check` with `step` appended to the path.
    pub fn within(&mut self, step: impl Into<String>, check: impl FnOnce(&mut Self)) {
        self.path.push(step.into());
        check(self);
        self.path.pop();
    }

    /// Notes that the value at the current path is not allowed.
    pub fn refuse(&mut self, value: impl Debug, allowed: impl Into<String>) {
        self.violations.push(Violation {
            path: self.path.clone(),
            value: format!("{value:?}"),
            allowed: allowed.into(),
        });
    }
}

/// A group of settings that can check itself.
pub trait Part {
    /// Notes every field whose value is not allowed.
    fn check(&self, findings: &mut Findings);
}

/// What a field may be: a range, or [`Any`], [`Inner`], [`Each`].
pub trait Allowed<T: ?Sized> {
    /// Notes the value if it is not allowed.
    fn check(&self, value: &T, findings: &mut Findings);
}

/// The type allows nothing wrong: text, switches, choices.
pub struct Any;
/// The field is itself a [`Part`].
pub struct Inner;
/// The field is a list of [`Part`]s.
pub struct Each;

impl<T> Allowed<T> for Any {
    fn check(&self, _value: &T, _findings: &mut Findings) {}
}

impl<T: Part> Allowed<T> for Inner {
    fn check(&self, value: &T, findings: &mut Findings) {
        value.check(findings);
    }
}

impl<T: Part> Allowed<Option<T>> for Inner {
    fn check(&self, value: &Option<T>, findings: &mut Findings) {
        if let Some(value) = value {
            value.check(findings);
        }
    }
}

impl<T: Part> Allowed<Vec<T>> for Each {
    fn check(&self, value: &Vec<T>, findings: &mut Findings) {
        for (position, item) in value.iter().enumerate() {
            findings.within(position.to_string(), |findings| item.check(findings));
        }
    }
}

impl<T: PartialOrd + Debug> Allowed<T> for RangeInclusive<T> {
    fn check(&self, value: &T, findings: &mut Findings) {
        if !self.contains(value) {
            findings.refuse(value, format!("{:?} to {:?}", self.start(), self.end()));
        }
    }
}

impl<T: PartialOrd + Debug> Allowed<Option<T>> for RangeInclusive<T> {
    fn check(&self, value: &Option<T>, findings: &mut Findings) {
        if let Some(value) = value {
            Allowed::<T>::check(self, value, findings);
        }
    }
}

impl<const N: usize> Allowed<[f64; N]> for RangeInclusive<f64> {
    fn check(&self, values: &[f64; N], findings: &mut Findings) {
        for (position, value) in values.iter().enumerate() {
            findings.within(position.to_string(), |findings| Allowed::<f64>::check(self, value, findings));
        }
    }
}

/// Declares a group of settings: `name: type = default, allowed;` for each field.
macro_rules! part {
    ($(#[$meta:meta])* $name:ident { $($(#[$field_meta:meta])* $field:ident : $type:ty = $default:expr, $allowed:expr;)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[$field_meta])*
                #[doc = concat!("\n\nDefault: `", stringify!($default), "`; allowed: `", stringify!($allowed), "`.")]
                pub $field: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::scenario::check::Part for $name {
            fn check(&self, findings: &mut $crate::scenario::check::Findings) {
                $(findings.within(stringify!($field), |findings| {
                    $crate::scenario::check::Allowed::<$type>::check(&$allowed, &self.$field, findings);
                });)*
            }
        }
    };
}
pub(crate) use part;
