//! `calibration.toml`: the positions of a gyro triad on its table.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use calibration::six_position::Knowledge;
use calibration::six_position::axes::Axes;
use serde::Deserialize;
use toml::Spanned;

use crate::file_error::{FileError, Problem};
use crate::toml_file::{self, TomlFile};

/// Name of the file in its folder.
pub const MANIFEST: &str = "calibration.toml";
const FORMAT: i64 = 1;
/// What a table is good to unless the file says something else, arcsec.
const TABLE_ARCSEC: f64 = 3.0;

/// The file, checked.
#[derive(Debug)]
pub struct Manifest {
    /// Of the manifest itself.
    pub path: PathBuf,
    pub knowledge: Knowledge,
    pub positions: Vec<Listed>,
}

/// A position: its recording and its axes.
#[derive(Debug)]
pub struct Listed {
    /// As the manifest names it.
    pub name: String,
    pub path: PathBuf,
    pub axes: Axes,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    #[expect(dead_code, reason = "for people only")]
    title: Option<String>,
    latitude_deg: Spanned<f64>,
    table_arcsec: Option<Spanned<f64>>,
    bias_instability_deg_h: Option<Spanned<f64>>,
    #[serde(default)]
    position: Vec<RawPosition>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPosition {
    file: Spanned<String>,
    axes: Spanned<String>,
}

impl Manifest {
    /// Reads the manifest of a folder, or a manifest by its own name.
    ///
    /// Errors: no such file, not TOML, another format, unknown or missing keys, values that are not allowed, a file listed
    /// twice, no positions.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let (folder, manifest) = toml_file::locate(path, MANIFEST);
        let file = TomlFile::read(&manifest)?;
        let raw: Raw = file.parse_format(FORMAT)?;
        raw.check(&file, manifest, &folder)
    }
}

impl Raw {
    fn check(self, file: &TomlFile, path: PathBuf, folder: &Path) -> Result<Manifest, FileError> {
        let within = |name: &str, value: Option<Spanned<f64>>, default: f64, low: f64, high: f64| {
            let Some(value) = value else { return Ok(default) };
            if (low..=high).contains(value.get_ref()) {
                return Ok(value.into_inner());
            }
            let problem = Problem::not_allowed(format!("{name} = {}", value.get_ref()), format!("{low} to {high}"));
            Err(file.at(value.span(), problem))
        };
        let knowledge = Knowledge {
            latitude_deg: within("latitude_deg", Some(self.latitude_deg), 0.0, -90.0, 90.0)?,
            table_arcsec: within("table_arcsec", self.table_arcsec, TABLE_ARCSEC, 0.0, 36_000.0)?,
            bias_instability_deg_h: within("bias_instability_deg_h", self.bias_instability_deg_h, 0.0, 0.0, 100.0)?,
        };
        if self.position.is_empty() {
            return Err(file.whole(Problem::Syntax("no [[position]] is listed".into())));
        }
        let mut seen = HashSet::new();
        let positions =
            self.position.into_iter().map(|raw| raw.check(file, folder, &mut seen)).collect::<Result<_, _>>()?;
        Ok(Manifest { path, knowledge, positions })
    }
}

impl RawPosition {
    fn check(self, file: &TomlFile, folder: &Path, seen: &mut HashSet<String>) -> Result<Listed, FileError> {
        let name = self.file.get_ref().clone();
        let not_allowed = |allowed| Problem::not_allowed(format!("file = {name}"), allowed);
        if name.is_empty() || Path::new(&name).is_absolute() {
            return Err(file.at(self.file.span(), not_allowed("a path relative to the folder")));
        }
        if !seen.insert(name.clone()) {
            return Err(file.at(self.file.span(), not_allowed("a file listed only once")));
        }
        let axes = Axes::parse(self.axes.get_ref()).map_err(|error| {
            file.at(
                self.axes.span(),
                Problem::not_allowed(format!("axes = {}", self.axes.get_ref()), error.to_string()),
            )
        })?;
        Ok(Listed { path: folder.join(&name), name, axes })
    }
}
