//! One declaration per setting: its type, its default and what it may be.
//!
//! The macro `part!` turns a list of fields into a serde structure that refuses unknown fields, has its defaults, and can report
//! every value outside its allowed range together with the path of the field.

use std::fmt::Debug;
use std::ops::RangeInclusive;

use serde::de::DeserializeOwned;

use super::describe::{self, Group, Table};

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

    /// Describes this group, which stands at `table`, and those in it.
    fn describe(table: Table, groups: &mut Vec<Group>);
}

/// What a field may be: a range, or [`Any`], [`Inner`], [`Each`].
pub trait Allowed<T: ?Sized> {
    /// Notes the value if it is not allowed.
    fn check(&self, value: &T, findings: &mut Findings);

    /// What is allowed, in words; empty where the type says it.
    fn allowed(&self) -> String {
        String::new()
    }

    /// Describes the groups of a field called `table`; gives whether it is one.
    fn describe(&self, _table: &Table, _groups: &mut Vec<Group>) -> bool {
        false
    }
}

/// The type allows nothing wrong: text, switches.
pub struct Any;
/// One of the names that the type has.
pub struct Choice;
/// The field is itself a [`Part`].
pub struct Inner;
/// The field is a list of [`Part`]s.
pub struct Each;

impl<T> Allowed<T> for Any {
    fn check(&self, _value: &T, _findings: &mut Findings) {}
}

impl<T: DeserializeOwned> Allowed<T> for Choice {
    fn check(&self, _value: &T, _findings: &mut Findings) {}

    fn allowed(&self) -> String {
        describe::names_of::<T>().join(", ")
    }
}

impl<T: Part> Allowed<T> for Inner {
    fn check(&self, value: &T, findings: &mut Findings) {
        value.check(findings);
    }

    fn describe(&self, table: &Table, groups: &mut Vec<Group>) -> bool {
        T::describe(table.clone(), groups);
        true
    }
}

impl<T: Part> Allowed<Option<T>> for Inner {
    fn check(&self, value: &Option<T>, findings: &mut Findings) {
        if let Some(value) = value {
            value.check(findings);
        }
    }

    fn describe(&self, table: &Table, groups: &mut Vec<Group>) -> bool {
        T::describe(table.clone(), groups);
        true
    }
}

impl<T: Part> Allowed<Vec<T>> for Each {
    fn check(&self, value: &Vec<T>, findings: &mut Findings) {
        for (position, item) in value.iter().enumerate() {
            findings.within(position.to_string(), |findings| item.check(findings));
        }
    }

    fn describe(&self, table: &Table, groups: &mut Vec<Group>) -> bool {
        T::describe(Table { list: true, ..table.clone() }, groups);
        true
    }
}

impl<T: PartialOrd + Debug> Allowed<T> for RangeInclusive<T> {
    fn check(&self, value: &T, findings: &mut Findings) {
        if !self.contains(value) {
            findings.refuse(value, Allowed::<T>::allowed(self));
        }
    }

    fn allowed(&self) -> String {
        format!("{:?} to {:?}", self.start(), self.end())
    }
}

impl<T: PartialOrd + Debug> Allowed<Option<T>> for RangeInclusive<T> {
    fn check(&self, value: &Option<T>, findings: &mut Findings) {
        if let Some(value) = value {
            Allowed::<T>::check(self, value, findings);
        }
    }

    fn allowed(&self) -> String {
        Allowed::<T>::allowed(self)
    }
}

impl<const N: usize> Allowed<[f64; N]> for RangeInclusive<f64> {
    fn check(&self, values: &[f64; N], findings: &mut Findings) {
        for (position, value) in values.iter().enumerate() {
            findings.within(position.to_string(), |findings| Allowed::<f64>::check(self, value, findings));
        }
    }

    fn allowed(&self) -> String {
        Allowed::<f64>::allowed(self)
    }
}

/// Declares a group of settings: `name: type = default, allowed;` for each field.
macro_rules! part {
    ($(#[doc = $doc:literal])* $name:ident { $($(#[doc = $field_doc:literal])* $field:ident : $type:ty = $default:expr, $allowed:expr;)* }) => {
        $(#[doc = $doc])*
        #[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct $name {
            $(
                $(#[doc = $field_doc])*
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

            fn describe(table: $crate::scenario::Table, groups: &mut Vec<$crate::scenario::Group>) {
                let of = groups.len();
                groups.push($crate::scenario::Group::new(&table, &[$($doc),*]));
                $({
                    let default: $type = $default;
                    let inner = table.inner(stringify!($field));
                    if !$crate::scenario::check::Allowed::<$type>::describe(&$allowed, &inner, groups) {
                        let allowed = $crate::scenario::check::Allowed::<$type>::allowed(&$allowed);
                        groups[of].add(stringify!($field), &[$($field_doc),*], &default, allowed);
                    }
                })*
            }
        }
    };
}
pub(crate) use part;
