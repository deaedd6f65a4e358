//! The units of a fleet: campaigns, or model files that were learned from them.

use std::path::{Path, PathBuf};

use learn::{Blunder, Run, mended};
use nalgebra::{DMatrix, DVector};
use north_finder::effects::ErrorModel;
use north_finder::effects::doubt::Process;
use north_finder::effects::effect::Effect;

use crate::campaign::{Campaign, MANIFEST, UNFINISHED};
use crate::diagnose::{self, Options};
use crate::failure::Failure;
use crate::file_error::{FileError, Problem};
use crate::model_file::ModelFile;
use crate::settings_file::campaign_settings;

/// Where what is known of a unit comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// The folder of a campaign.
    Campaign(PathBuf),
    /// A model file.
    Model(PathBuf),
}

impl Source {
    pub fn path(&self) -> &Path {
        match self {
            Self::Campaign(path) | Self::Model(path) => path,
        }
    }

    /// The name of the unit: that of its folder, or of its file without its ending.
    pub fn name(&self) -> String {
        let name = match self {
            Self::Campaign(path) => path.file_name(),
            Self::Model(path) => path.file_stem(),
        };
        name.map_or_else(|| self.path().display().to_string(), |name| name.to_string_lossy().into_owned())
    }

    /// Reads what says of itself what it is, before the work of hours begins.
    ///
    /// Errors: a campaign or a model that cannot be read.
    pub fn check(&self) -> Result<(), FileError> {
        match self {
            Self::Campaign(path) => Campaign::read(path).map(|_| ()),
            Self::Model(path) => ModelFile::read(path).map(|_| ()),
        }
    }

    /// Whether the path as it is says the name.
    fn has_name(&self) -> bool {
        self.path().file_name().is_some()
    }
}

/// Campaigns and models, by their paths or by folders that hold some of them; in the order of their names within a folder.
///
/// Errors: a path that is none of these; a folder that holds none; two units of one name.
pub fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, FileError> {
    let mut all: Vec<Source> = Vec::new();
    for path in paths {
        // A folder that is named `.` has a name only when it is written out; otherwise names and messages keep the path as it is given.
        let whole = path.canonicalize().map_err(|error| FileError::whole(path, error))?;
        let found = source(path).filter(Source::has_name).or_else(|| source(&whole));
        match found {
            Some(source) => all.push(source),
            None if path.is_dir() => {
                let entries = std::fs::read_dir(path).map_err(|error| FileError::whole(path, error))?;
                let mut below: Vec<Source> = entries.filter_map(|entry| source(&entry.ok()?.path())).collect();
                if below.is_empty() {
                    let text = "neither a campaign nor a folder of campaigns or of model files (.toml)";
                    return Err(FileError::whole(path, Problem::Syntax(text.into())));
                }
                below.sort_by_key(Source::name);
                all.extend(below);
            }
            None => {
                let text = "neither a campaign nor a model file (.toml)";
                return Err(FileError::whole(path, Problem::Syntax(text.into())));
            }
        }
    }
    let mut named: Vec<(String, &Source)> = all.iter().map(|source| (source.name(), source)).collect();
    named.sort_by(|a, b| a.0.cmp(&b.0));
    match named.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        Some([(name, first), (_, second)]) => {
            let text = format!(
                "{} has the name {name:?}, too: every campaign or model needs one of its own",
                first.path().display()
            );
            Err(FileError::whole(second.path(), Problem::Syntax(text)))
        }
        _ => Ok(all),
    }
}

fn source(path: &Path) -> Option<Source> {
    if path.is_dir() {
        // An unfinished recording is refused by its name when it is read, and not passed over.
        let is_campaign = [MANIFEST, UNFINISHED].iter().any(|file| path.join(file).is_file());
        return is_campaign.then(|| Source::Campaign(path.to_owned()));
    }
    if path.file_name().is_some_and(|name| name == MANIFEST) {
        return path.parent().map(|folder| Source::Campaign(folder.to_owned()));
    }
    (path.is_file() && path.extension().is_some_and(|ending| ending == "toml")).then(|| Source::Model(path.to_owned()))
}

/// Runs, and the process of their own.
pub type Runs = (Vec<Run>, Option<Process>);

/// What one unit taught by itself.
pub struct Unit {
    pub name: String,
    source: Source,
    /// Effects with their weights, of the likeliest model.
    pub effects: Vec<Effect>,
    /// Covariance of the weights, where a model file is all that is known.
    pub covariance: Option<DMatrix<f64>>,
    process: Option<Process>,
    blunders: Vec<Blunder>,
}

impl Unit {
    /// Learns from a campaign, without a judgement, or reads a model. A campaign that cannot be diagnosed refuses with its name.
    pub fn read(source: &Source) -> Result<Self, Failure> {
        match source {
            Source::Campaign(path) => Self::of_campaign(source, path),
            Source::Model(path) => {
                let model = ModelFile::read(path)?.error_model.unwrap_or_default();
                Ok(Self {
                    name: source.name(),
                    source: source.clone(),
                    covariance: Some(covariance(&model)),
                    process: model.doubt.process,
                    effects: model.effects.iter().cloned().collect(),
                    blunders: Vec::new(),
                })
            }
        }
    }

    fn of_campaign(source: &Source, path: &Path) -> Result<Self, Failure> {
        let (campaign, options) = campaign(path)?;
        let learned = diagnose::learned(&campaign, &options).map_err(|refusal| refused(path, &refusal))?;
        let learned = learned.unwrap_or_default();
        let posterior = learned.best.posterior;
        Ok(Self {
            name: source.name(),
            source: source.clone(),
            effects: posterior.likeliest,
            covariance: None,
            process: posterior.process,
            blunders: learned.blunders,
        })
    }

    /// The runs that it was learned from, and the process of their own; `None` where only its model is known.
    pub fn runs(&self) -> Result<Option<Runs>, Failure> {
        let Source::Campaign(path) = &self.source else { return Ok(None) };
        let (campaign, options) = campaign(path)?;
        let runs = diagnose::searched(&campaign, &options).map_err(|refusal| refused(path, &refusal))?;
        Ok(Some((mended(runs, &self.blunders), self.process)))
    }

    /// Mean and covariance of the weights of its effects.
    pub fn posterior(&self) -> Option<(DVector<f64>, &DMatrix<f64>)> {
        let weights = self.effects.iter().flat_map(|effect| effect.weights.iter().map(|weight| f64::from(*weight)));
        Some((DVector::from_vec(weights.collect()), self.covariance.as_ref()?))
    }
}

/// A campaign and what its diagnosis is told by default.
pub fn campaign(path: &Path) -> Result<(Campaign, Options), Failure> {
    let campaign = Campaign::read(path)?;
    campaign.check_copies()?;
    let settings = campaign_settings(&campaign, None)?;
    Ok((campaign, Options { settings, ..Options::default() }))
}

fn refused(path: &Path, refusal: &diagnose::Refusal) -> Failure {
    Failure::Refused(format!("{}: {refusal}", path.display()))
}

/// Covariance of the weights of a model's effects.
fn covariance(model: &ErrorModel) -> DMatrix<f64> {
    let count: usize = model.effects.iter().map(Effect::count).sum();
    let before: usize = model.terms.iter().map(|term| term.coefficients.len()).sum();
    let mut covariance = DMatrix::zeros(count, count);
    for direction in &model.doubt.directions {
        let own = DVector::from_iterator(count, direction.iter().skip(before).map(|number| f64::from(*number)));
        covariance += &own * own.transpose();
    }
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_a_folder_in_the_order_of_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        std::fs::create_dir_all(root.join("b/runs")).unwrap();
        std::fs::write(root.join("b/campaign.toml"), "").unwrap();
        std::fs::write(root.join("a.toml"), "format = 2\n").unwrap();
        std::fs::write(root.join("notes.txt"), "").unwrap();
        let found = sources(&[root.to_owned()]).unwrap();
        assert_eq!(found.iter().map(Source::name).collect::<Vec<_>>(), ["a", "b"]);
        assert!(matches!(&found[..], [Source::Model(_), Source::Campaign(_)]));
        std::fs::create_dir_all(root.join("d/runs")).unwrap();
        std::fs::write(root.join("d/unfinished"), "").unwrap();
        let [.., unfinished] = &sources(&[root.to_owned()]).unwrap()[..] else { panic!() };
        let refusal = unfinished.check().unwrap_err().to_string();
        assert!(unfinished.name() == "d" && refusal.contains("came to no end"), "{refusal}");
        let refusal = sources(&[root.join("notes.txt")]).unwrap_err().to_string();
        assert!(refusal.contains("neither a campaign nor a model file"), "{refusal}");
        let twice = sources(&[root.join("b"), root.join("b/campaign.toml")]).unwrap_err().to_string();
        assert!(twice.contains("has the name \"b\", too"), "{twice}");
        std::fs::create_dir_all(root.join("c/b")).unwrap();
        std::fs::write(root.join("c/b/campaign.toml"), "").unwrap();
        let twice = sources(&[root.join("a.toml"), root.join("b"), root.join("c")]).unwrap_err().to_string();
        let paths = ["b", "c/b"].map(|path| root.join(path).display().to_string());
        assert!(paths.iter().all(|path| twice.contains(path.as_str())), "{twice}");
    }
}
