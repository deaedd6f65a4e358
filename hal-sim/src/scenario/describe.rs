//! What a scenario file may hold, for people: made from the declarations by which files are checked.

use std::fmt;

use serde::de::value::Error;
use serde::de::{DeserializeOwned, Deserializer, Error as _, Visitor};
use serde::{Serialize, forward_to_deserialize_any};

/// Where a group of values stands in the file.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Table {
    /// Dotted name; empty for the file itself.
    pub name: String,
    /// There may be several, each under a heading of its own: `[[name]]`.
    pub list: bool,
}

/// A group of values.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Group {
    /// Where it stands.
    pub table: Table,
    /// What it is.
    pub meaning: String,
    /// Its values.
    pub fields: Vec<Field>,
}

/// One value.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Field {
    /// Its key in the group's table.
    pub name: &'static str,
    /// What it is without being said, as TOML; empty where it is then absent.
    pub default: String,
    /// What it may be; empty where any value of its type is allowed.
    pub allowed: String,
    /// What it means, with its unit.
    pub meaning: String,
}

impl Table {
    /// The table of a group in this one.
    pub(super) fn inner(&self, field: &str) -> Self {
        let name = if self.name.is_empty() { field.to_owned() } else { format!("{}.{field}", self.name) };
        Self { name, list: false }
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self { list: false, name } => write!(f, "[{name}]"),
            Self { list: true, name } => write!(f, "[[{name}]]"),
        }
    }
}

impl Group {
    pub(super) fn new(table: &Table, doc: &[&str]) -> Self {
        Self { table: table.clone(), meaning: text(doc), fields: Vec::new() }
    }

    pub(super) fn add(&mut self, name: &'static str, doc: &[&str], default: &impl Serialize, allowed: String) {
        // What is absent has no value in TOML.
        let default = toml::Value::try_from(default).map(|value| value.to_string()).unwrap_or_default();
        self.fields.push(Field { name, default, allowed, meaning: text(doc) });
    }
}

/// The text of a doc comment.
fn text(doc: &[&str]) -> String {
    doc.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}

/// The names that a type of choices has in a file.
pub(super) fn names_of<T: DeserializeOwned>() -> &'static [&'static str] {
    struct Names<'a>(&'a mut &'static [&'static str]);

    impl<'de> Deserializer<'de> for Names<'_> {
        type Error = Error;

        fn deserialize_enum<V: Visitor<'de>>(
            self,
            _name: &'static str,
            variants: &'static [&'static str],
            _visitor: V,
        ) -> Result<V::Value, Error> {
            *self.0 = variants;
            Err(Error::custom("only the names are asked for"))
        }

        fn deserialize_any<V: Visitor<'de>>(self, _visitor: V) -> Result<V::Value, Error> {
            Err(Error::custom("only the names are asked for"))
        }

        forward_to_deserialize_any! {
            bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit unit_struct newtype_struct seq tuple
            tuple_struct map struct identifier ignored_any
        }
    }

    let mut names: &'static [&'static str] = &[];
    let _only_names = T::deserialize(Names(&mut names));
    names
}
