//! Model files: `format = 2`, and all that calibrations find out.
//!
//! At the top level the error model of the one indexed gyro; a table for an accelerometer triad and one for a gyro triad. Every
//! command that takes a model reads the whole file, uses what says something of its subject, and refuses by name what
//! contradicts it.

use std::path::{Path, PathBuf};

use calibration::ellipsoid::Correction;
use calibration::six_position;
use nalgebra::{Matrix3, Vector3};
use north_finder::earth::{EarthRate, earth_rate};
use north_finder::effects::basis::harmonic::BodyHarmonic;
use north_finder::effects::doubt::{MAX_COEFFICIENTS, MAX_DIRECTIONS};
use north_finder::effects::{Basis, ErrorModel, IndexError, MAX_TERMS, Term};
use north_finder::settings::{AccelerometerCalibration, Invalid, Settings};
use north_finder::units::{ARCSEC_PER_RAD, DEG_PER_RAD, STANDARD_GRAVITY_M_S2};
use serde::{Deserialize, Serialize};

use crate::block_csv::{self, BlockRecording};
use crate::file_error::{FileError, Problem};
use crate::toml_file::TomlFile;

/// The format that is written, and those that are read: in the first there are no effects.
pub const FORMAT: i64 = 2;
const READ: std::ops::RangeInclusive<i64> = 1..=FORMAT;
const ACCELEROMETER: &str = "accelerometer";
const GYRO_TRIAD: &str = "gyro_triad";
/// Factors between the readings and the unit of gravity that are still a scale factor.
const SAME_UNIT: std::ops::RangeInclusive<f64> = 0.8..=1.25;

/// A model file that has been read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelFile {
    path: PathBuf,
    /// Of the indexed gyro; `None` where the file says nothing of it.
    pub error_model: Option<ErrorModel>,
    pub accelerometer: Option<Accelerometer>,
    pub gyro_triad: Option<GyroTriad>,
}

/// Specific force = matrix · (reading − bias), in the unit of `gravity`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Accelerometer {
    /// What |specific force| is at rest.
    pub gravity: f64,
    pub bias: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_bias: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_matrix: Option<[[f64; 3]; 3]>,
}

/// Output = bias + matrix · true rate, °/h.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GyroTriad {
    pub bias_deg_h: [f64; 3],
    pub matrix: [[f64; 3]; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_bias_deg_h: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_matrix: Option<[[f64; 3]; 3]>,
}

/// The triads' tables, as they are written.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Triads {
    #[serde(skip_serializing_if = "Option::is_none")]
    pub accelerometer: Option<Accelerometer>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gyro_triad: Option<GyroTriad>,
}

impl ModelFile {
    /// Reads a file.
    ///
    /// Errors: no such file, not TOML, another format, unknown keys, values that make no sense.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let file = TomlFile::read(path)?;
        let rest = file.without(READ, &[ACCELEROMETER, GYRO_TRIAD])?;
        file.check_single_precision(None)?;
        let error_model = if rest.get_ref().is_empty() { None } else { Some(file.deserialize::<ErrorModel>(rest)?) };
        if let Some(model) = &error_model {
            model.validate().map_err(|invalid| {
                // In settings the model is a table of its own; here it is the file.
                let field = invalid.field.strip_prefix("model.").unwrap_or(invalid.field);
                file.at_number(None, field, invalid.value, invalid.allowed)
            })?;
        }
        let accelerometer: Option<Accelerometer> = file.parse_table(ACCELEROMETER)?;
        let gyro_triad: Option<GyroTriad> = file.parse_table(GYRO_TRIAD)?;
        let finite = |field: &str, numbers: &[f64]| match numbers.iter().find(|number| !number.is_finite()) {
            Some(number) => Err(file.at_field(None, field, Problem::not_allowed(number, "finite numbers"))),
            None => Ok(()),
        };
        if let Some(triad) = &accelerometer {
            finite("accelerometer.gravity", &[triad.gravity])?;
            finite("accelerometer.bias", &triad.bias)?;
            finite("accelerometer.matrix", triad.matrix.as_flattened())?;
            if triad.gravity <= 0.0 {
                let problem = Problem::not_allowed(triad.gravity, "a positive number");
                return Err(file.at_field(Some(ACCELEROMETER), "gravity", problem));
            }
        }
        if let Some(triad) = &gyro_triad {
            finite("gyro_triad.bias_deg_h", &triad.bias_deg_h)?;
            finite("gyro_triad.matrix", triad.matrix.as_flattened())?;
        }
        Ok(Self { path: path.to_owned(), error_model, accelerometer, gyro_triad })
    }

    /// Lays what the file knows over settings, for runs that were recorded: their latitude is that of the settings. A gyro
    /// triad is taken to be read through a virtual index.
    ///
    /// Errors: readings of the accelerometers that are not in g or m/s²; a model with more terms than a board holds.
    pub fn apply(&self, settings: &mut Settings) -> Result<(), FileError> {
        if let Some(model) = &self.error_model {
            settings.model = Some(model.clone());
        }
        if let Some(triad) = &self.gyro_triad {
            let Ok(earth) = earth_rate(settings.latitude_deg) else { return Ok(()) };
            let mut model = settings.model.take().unwrap_or_default();
            triad.add_as_indexed(&mut model, &earth).map_err(|problem| FileError::whole(&self.path, problem))?;
            settings.model = Some(model);
        }
        if let Some(triad) = &self.accelerometer {
            settings.accelerometer = Some(triad.on_board().map_err(|problem| FileError::whole(&self.path, problem))?);
        }
        Ok(())
    }

    /// The same for a board, which has one gyro and its own channels.
    ///
    /// Errors: as [`Self::apply`]; a term that follows a channel which no board measures, by its name; a gyro triad.
    pub fn apply_to_board(&self, settings: &mut Settings) -> Result<(), FileError> {
        if self.gyro_triad.is_some() {
            let allowed = "the model of the instrument's one indexed gyro: a triad's is for recordings of that triad (north \
                           solve, north diagnose)";
            return Err(FileError::whole(&self.path, Problem::not_allowed("[gyro_triad]", allowed)));
        }
        if let Some(channel) = self.error_model.as_ref().and_then(|model| model.off_board(&settings.channels())) {
            let value = format!("a term that follows channel `{}`", channel.as_str());
            let allowed = "what the board measures: temp_c, ax_g, ay_g, supply_v, chip_temp_c, block_temp_c with a block, its named analogue inputs, its time and its index angle";
            return Err(FileError::whole(&self.path, Problem::not_allowed(value, allowed)));
        }
        self.apply(settings)
    }

    /// Reads a recording of a block; with a file of its calibrations their errors are taken out of it.
    ///
    /// Errors: as [`block_csv::read`], [`Self::read`] and `Self::correct_block`.
    pub fn read_block(recording: &Path, model: Option<&Path>) -> Result<BlockRecording, FileError> {
        let mut recording = block_csv::read(recording)?;
        if let Some(path) = model {
            Self::read(path)?.correct_block(&mut recording)?;
        }
        Ok(recording)
    }

    /// Takes the errors of a block's two triads out of a recording of it.
    ///
    /// Errors: an error model of one indexed gyro, which says nothing of a block; a matrix without an inverse; readings of the
    /// accelerometers that are not in g or m/s².
    fn correct_block(&self, recording: &mut BlockRecording) -> Result<(), FileError> {
        let refused = |problem| FileError::whole(&self.path, problem);
        if self.error_model.is_some() {
            let allowed = "tables [gyro_triad] and [accelerometer]: a block has no index";
            return Err(refused(Problem::not_allowed("the error model of an indexed gyro", allowed)));
        }
        if let Some(triad) = &self.gyro_triad {
            let singular = || Problem::Syntax("the matrix of [gyro_triad] has no inverse".into());
            let inverse = matrix3(&triad.matrix).try_inverse().ok_or_else(|| refused(singular()))?;
            for row in &mut recording.rows {
                // 1 °/h is 1 arcsec/s.
                let bias_rad = Vector3::from(triad.bias_deg_h) * (row.interval_s / ARCSEC_PER_RAD);
                row.increment.angle_rad = inverse * (row.increment.angle_rad - bias_rad);
            }
        }
        if let Some(triad) = &self.accelerometer {
            let unit_m_s2 = STANDARD_GRAVITY_M_S2 / triad.unit_of_readings().map_err(refused)?;
            // The corrected force is in the unit of the declared gravity, which need not be that of the readings.
            let Some(force_m_s2) = unit_of(triad.gravity).map(|unit| STANDARD_GRAVITY_M_S2 / unit) else {
                let value = format!("[accelerometer] gravity = {}", triad.gravity);
                return Err(refused(Problem::not_allowed(value, "a gravity in g or m/s2")));
            };
            let (matrix, bias) = (matrix3(&triad.matrix), Vector3::from(triad.bias));
            for row in &mut recording.rows {
                let reading = row.increment.velocity_m_s / (row.interval_s * unit_m_s2);
                row.increment.velocity_m_s = matrix * (reading - bias) * (force_m_s2 * row.interval_s);
            }
        }
        Ok(())
    }

    /// What is done with the triads in it, in sentences.
    pub fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        if let Some(triad) = &self.gyro_triad {
            let off_deg = triad.not_square() * DEG_PER_RAD;
            notes.push(format!(
                "model of a gyro triad: the runs are taken for readings of that triad at virtual index angles (x at 0, y at 90 \
                 degrees); axes that are not square leave up to {off_deg:.4} deg, which is in the sigma"
            ));
        }
        if self.accelerometer.is_some() {
            notes.push("model of an accelerometer triad: ax_g and ay_g are corrected by it".into());
        }
        notes
    }

    /// The accelerometers' calibration.
    ///
    /// Errors: the file has none.
    pub fn accelerometer(&self) -> Result<&Accelerometer, FileError> {
        let missing = || FileError::whole(&self.path, Problem::Syntax("it has no table [accelerometer]".into()));
        self.accelerometer.as_ref().ok_or_else(missing)
    }
}

impl Triads {
    /// Of an accelerometer triad: its correction, the standard deviations of bias and matrix, gravity in its unit.
    pub fn of_accelerometer(
        correction: &Correction,
        (sigma_bias, sigma_matrix): ([f64; 3], [[f64; 3]; 3]),
        gravity: f64,
    ) -> Self {
        let accelerometer = Accelerometer {
            gravity,
            bias: correction.bias,
            matrix: correction.matrix,
            sigma_bias: Some(sigma_bias),
            sigma_matrix: Some(sigma_matrix),
        };
        Self { accelerometer: Some(accelerometer), gyro_triad: None }
    }

    /// Of a gyro triad.
    pub fn of_gyros(calibration: &six_position::Calibration) -> Self {
        let six_position::Calibration { bias_deg_h, matrix, sigma_bias_deg_h, sigma_matrix, .. } = *calibration;
        let gyro_triad = GyroTriad {
            bias_deg_h,
            matrix,
            sigma_bias_deg_h: Some(sigma_bias_deg_h),
            sigma_matrix: Some(sigma_matrix),
        };
        Self { accelerometer: None, gyro_triad: Some(gyro_triad) }
    }

    /// Which commands refuse the model because its gravity is in another unit than theirs, in a sentence.
    pub fn doubt(&self) -> Option<String> {
        self.accelerometer.as_ref().and_then(Accelerometer::doubt)
    }

    /// Writes a file, over one that may be there.
    pub fn write(&self, path: &Path) -> Result<(), FileError> {
        let tables =
            toml::to_string(self).map_err(|error| FileError::whole(path, Problem::Syntax(error.to_string())))?;
        crate::output::write(path, format!("format = {FORMAT}\n\n{tables}"))
            .map_err(|error| FileError::whole(path, error))
    }
}

/// What standard gravity is in the unit of a gravity: 1 in g, 9.8 in m/s²; `None` where it is in neither.
fn unit_of(gravity: f64) -> Option<f64> {
    [1.0, STANDARD_GRAVITY_M_S2].into_iter().find(|unit| SAME_UNIT.contains(&(gravity / unit)))
}

impl Accelerometer {
    /// Which commands refuse it for its gravity. Runs and boards take forces in units of gravity, whatever that is, of readings in
    /// g or m/s²; a recording of a block is in m/s².
    fn doubt(&self) -> Option<String> {
        let refused = match (unit_of(self.gravity), self.unit_of_readings()) {
            (Some(_), _) => return None,
            (None, Ok(_)) => "`align` and `track` refuse this model",
            (None, Err(_)) => {
                "`solve`, `align`, `track` and a board refuse this model; it serves `--prior` and `--compare` only"
            }
        };
        Some(format!("gravity {} is neither in g nor in m/s2: {refused}", self.gravity))
    }

    /// As the core applies it.
    pub fn correction(&self) -> Correction {
        Correction { bias: self.bias, matrix: self.matrix }
    }

    /// Its misalignments were not estimated: the sigmas of its matrix beside the diagonal are all 0.
    pub fn has_no_misalignments(&self) -> bool {
        self.sigma_matrix
            .is_some_and(|sigmas| (0..3).all(|row| (0..3).all(|column| row == column || sigmas[row][column] == 0.0)))
    }

    /// The reading of standard gravity: 1 where readings are in g, 9.8 where they are in m/s².
    ///
    /// Errors: they are neither.
    fn unit_of_readings(&self) -> Result<f64, Problem> {
        let of_gravity = self.gravity / self.matrix[0][0];
        let allowed = "readings in g or m/s2: those of this triad are counts, which no recording of north-finder holds";
        unit_of(of_gravity).ok_or_else(|| Problem::not_allowed(format!("{of_gravity:.1} of gravity"), allowed))
    }

    /// For readings in g, and forces in units of the local gravity: what a board has.
    ///
    /// How the triad stands in its box, which only a matrix that is not upper triangular knows, is left out.
    fn on_board(&self) -> Result<AccelerometerCalibration, Problem> {
        let Some(Correction { bias, matrix }) = self.correction().of_sensors() else {
            return Err(Problem::Syntax("the matrix of [accelerometer] is no triad's".into()));
        };
        let unit = self.unit_of_readings()?;
        let in_g = Correction {
            bias: bias.map(|bias| bias / unit),
            matrix: matrix.map(|row| row.map(|part| part * unit / self.gravity)),
        };
        let calibration = AccelerometerCalibration::new(&in_g);
        let refused = |Invalid { field, value, allowed, .. }| {
            Problem::not_allowed(format!("{field} = {value}, in units of gravity"), allowed)
        };
        calibration.validate().map_err(refused)?;
        Ok(calibration)
    }
}

impl GyroTriad {
    /// What a virtual index makes of the triad, added to an error model.
    ///
    /// At the index angle θ the gyro is cos θ · x + sin θ · y. With ω along it, v along the axis at θ + 90°, and Ω sin φ
    /// upwards, it reads to the first order: ω · (1 + s + a cos 2θ + b sin 2θ) + v · (r + b cos 2θ − a sin 2θ) + (x0 + m13 Ω
    /// sin φ) cos θ + (y0 + m23 Ω sin φ) sin θ, where 1 + s and a are half the sum and half the difference of m11 and m22, and
    /// b and r half the sum and half the difference of m12 and m21. The factor of ω is a scale factor, the last two terms
    /// are a rate fixed to the body, r turns the index. What is left of v moves the azimuth by b cos 2ψ at positions 90° apart
    /// (axes that are not square): no term of a model has that, so that it goes into the sigma.
    fn add_as_indexed(&self, model: &mut ErrorModel, earth: &EarthRate) -> Result<(), Problem> {
        let [[m11, m12, m13], [m21, m22, m23], _] = self.matrix;
        let [x0, y0, _] = self.bias_deg_h;
        let (a, b) = (0.5 * (m11 - m22), 0.5 * (m12 + m21));
        let fixed = Term::new(Basis::BodyHarmonic(BodyHarmonic { order: 1 }))
            .with_coefficients(&[x0 + m13 * earth.up_deg_h, y0 + m23 * earth.up_deg_h]);
        let unequal = Term::scaling(Basis::BodyHarmonic(BodyHarmonic { order: 2 })).with_coefficients(&[a, b]);
        let full = || {
            Problem::Syntax(format!(
                "[gyro_triad] adds 2 terms with 4 coefficients to the error model, which may have {MAX_TERMS} terms, {MAX_COEFFICIENTS} coefficients and \
                 {MAX_DIRECTIONS} directions of doubt"
            ))
        };
        let before: usize = model.terms.iter().map(|term| term.coefficients.len()).sum();
        model.add(fixed).and_then(|()| model.add(unequal)).map_err(|_| full())?;
        model.scale_error += 0.5 * (m11 + m22) - 1.0;
        // The gyro at θ reads what one at θ + r would: the index is r further than it is measured.
        let turned = 0.5 * (m12 - m21) * DEG_PER_RAD;
        let index_error = model.index_error.get_or_insert_with(IndexError::default);
        index_error.offset_deg -= turned;
        let not_square_deg = self.not_square() * DEG_PER_RAD;
        model.doubt.azimuth_sigma_deg = model.doubt.azimuth_sigma_deg.hypot(not_square_deg / 2f64.sqrt());
        self.doubt_biases(model, before, earth).ok_or_else(full)
    }

    /// The sigmas of the biases, each a direction of its own.
    fn doubt_biases(&self, model: &mut ErrorModel, before: usize, earth: &EarthRate) -> Option<()> {
        let (Some([x0, y0, _]), Some([[_, _, m13], [_, _, m23], _])) = (self.sigma_bias_deg_h, self.sigma_matrix)
        else {
            return Some(());
        };
        let after: usize = model.terms.iter().map(|term| term.coefficients.len()).sum();
        for direction in &mut model.doubt.directions {
            direction.resize(after, 0.0).ok()?;
        }
        for (place, sigma) in [x0.hypot(m13 * earth.up_deg_h), y0.hypot(m23 * earth.up_deg_h)].into_iter().enumerate() {
            let mut direction = heapless::Vec::new();
            direction.resize(after, 0.0).ok()?;
            *direction.get_mut(before + place)? = sigma as f32;
            model.doubt.directions.push(direction).ok()?;
        }
        Some(())
    }

    /// Half the angle by which the axes x and y are not square, rad: the most that it moves an azimuth.
    fn not_square(&self) -> f64 {
        let [[_, m12, _], [m21, _, _], _] = self.matrix;
        0.5 * (m12 + m21).abs()
    }
}

fn matrix3(rows: &[[f64; 3]; 3]) -> Matrix3<f64> {
    Matrix3::from_fn(|i, j| rows[i][j])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written(triads: Triads) -> ModelFile {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.toml");
        triads.write(&path).unwrap();
        ModelFile::read(&path).unwrap()
    }

    fn accelerometer(gravity: f64, bias: [f64; 3], scale: f64) -> Accelerometer {
        let matrix = [[scale, 0.002, 0.0], [0.0, scale, 0.0], [0.0, 0.0, scale]];
        Accelerometer { gravity, bias, matrix, sigma_bias: None, sigma_matrix: None }
    }

    #[test]
    fn what_is_written_is_read_again() {
        let accelerometer = accelerometer(9.81, [0.1, -1e-7, 32_768.125], 1.0 / 3.0);
        let file = written(Triads { accelerometer: Some(accelerometer), gyro_triad: None });
        assert_eq!((file.accelerometer, file.gyro_triad, file.error_model), (Some(accelerometer), None, None));
    }

    #[test]
    fn a_block_is_corrected_by_the_models_of_its_triads() {
        use crate::block_csv::BlockRow;
        use inertial::Increment;

        // A tenth of a second of true rates (100, −50, 20) °/h, that is 10, −5, 2 arcsec, and of forces (0, 0, 9.81) m/s².
        // Gyros: biases 30, −20, 10 °/h add 3, −2, 1 arcsec; x reads 1.02 of itself and 0.01 of y: 10.2 − 0.05 + 3.
        // Accelerometers in g: the reading is force / 1.02 / 9.80665 + bias, z: 0.980731 + 0.03.
        let read_rad = Vector3::new(13.15, -7.0, 3.0) / ARCSEC_PER_RAD;
        let read_m_s2 = Vector3::new(0.0, 0.0, 9.81 / 1.02 + 0.03 * STANDARD_GRAVITY_M_S2);
        let increment = Increment { angle_rad: read_rad, velocity_m_s: read_m_s2 * 0.1 };
        let row = BlockRow { t_s: 0.1, interval_s: 0.1, increment, ..BlockRow::default() };
        let mut recording = BlockRecording { rows: vec![row], step_s: 0.1 };
        let gyro_triad = GyroTriad {
            bias_deg_h: [30.0, -20.0, 10.0],
            matrix: [[1.02, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            sigma_bias_deg_h: None,
            sigma_matrix: None,
        };
        let mut triad = accelerometer(1.0, [0.0, 0.0, 0.03], 1.02);
        triad.matrix[0][1] = 0.0;
        let model = written(Triads { accelerometer: Some(triad), gyro_triad: Some(gyro_triad) });
        model.correct_block(&mut recording).unwrap();
        let Increment { angle_rad, velocity_m_s } = recording.rows[0].increment;
        assert!((angle_rad * ARCSEC_PER_RAD - Vector3::new(10.0, -5.0, 2.0)).norm() < 1e-9, "{angle_rad:?}");
        assert!((velocity_m_s - Vector3::new(0.0, 0.0, 0.981)).norm() < 1e-12, "{velocity_m_s:?}");
        let indexed = ModelFile { error_model: Some(ErrorModel::default()), ..ModelFile::default() };
        assert!(indexed.correct_block(&mut recording).unwrap_err().to_string().contains("no index"));
    }

    #[test]
    fn readings_in_g_and_in_m_s2_become_the_boards_and_counts_do_not() {
        // In m/s²: 0.0981 of 9.81 is a bias of 0.01 g; the matrix has no unit.
        let metric = accelerometer(9.81, [0.0980665, 0.0, 0.0], 1.0).on_board().unwrap();
        assert!((metric.bias_g[0] - 0.01).abs() < 1e-12);
        assert!((metric.matrix[0] - 9.80665 / 9.81).abs() < 1e-12, "{metric:?}");
        // In g, corrected to m/s².
        let mixed = accelerometer(9.81, [0.01, 0.0, 0.0], 9.81).on_board().unwrap();
        assert!((mixed.bias_g[0] - 0.01).abs() < 1e-12 && (mixed.matrix[0] - 1.0).abs() < 1e-12);
        let refusal = accelerometer(9.81, [33_000.0; 3], 0.0024).on_board().unwrap_err().to_string();
        assert!(refusal.contains("counts"), "{refusal}");
    }

    #[test]
    fn a_gravity_in_another_unit_is_doubted_with_the_commands_that_refuse_it() {
        let doubt = |gravity, scale| accelerometer(gravity, [0.0; 3], scale).doubt();
        assert_eq!((doubt(9.81, 1.0), doubt(1.0, 1.0), doubt(9.81, 0.0024)), (None, None, None));
        // Readings in g, forces in units of a fifth of it; readings in mg.
        assert_eq!(
            doubt(5.0, 5.0).unwrap(),
            "gravity 5 is neither in g nor in m/s2: `align` and `track` refuse this model"
        );
        assert!(doubt(1000.0, 1.0).unwrap().contains("`solve`, `align`, `track` and a board refuse"));
        let file = written(Triads { accelerometer: Some(accelerometer(5.0, [0.0; 3], 5.0)), gyro_triad: None });
        let refusal = file.correct_block(&mut BlockRecording { rows: Vec::new(), step_s: 0.1 }).unwrap_err();
        assert!(refusal.to_string().contains("\"[accelerometer] gravity = 5\" is not allowed"), "{refusal}");
        file.apply(&mut Settings::default()).unwrap();
    }

    #[test]
    fn a_triad_through_a_virtual_index_by_hand() {
        // At 30° N the Earth turns upwards with 7.52 °/h. x: bias 0.1, 1000 ppm, 0.001 of z; y: bias −0.2, 0.003 of x.
        let matrix = [[1.001, 0.0, 0.001], [0.003, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triad = GyroTriad { bias_deg_h: [0.1, -0.2, 5.0], matrix, sigma_bias_deg_h: None, sigma_matrix: None };
        let mut settings = Settings { latitude_deg: 30.0, ..Settings::default() };
        written(Triads { accelerometer: None, gyro_triad: Some(triad) }).apply(&mut settings).unwrap();
        let model = settings.model.unwrap();
        assert!((model.scale_error - 0.0005).abs() < 1e-12);
        let coefficients: Vec<_> =
            model.terms.iter().flat_map(|term| term.coefficients.iter().map(|part| f64::from(*part))).collect();
        for (found, expected) in coefficients.iter().zip([0.1 + 0.001 * 7.5205, -0.2, 0.0005, 0.0015]) {
            assert!((found - expected).abs() < 1e-6, "{coefficients:?}");
        }
        assert!(model.terms[1].scales && !model.terms[0].scales);
        // y feels 0.003 of x: half of it is a turn by −0.0015 rad, that is, the index reads 0.0859° too much; half is not.
        assert!((model.index_error.unwrap().offset_deg - 0.085_94).abs() < 1e-4);
        assert!((model.doubt.azimuth_sigma_deg - 0.085_94 / 2f64.sqrt()).abs() < 1e-4);
    }

    #[test]
    fn a_board_refuses_a_triad_by_name() {
        let matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let triad = GyroTriad { bias_deg_h: [0.0; 3], matrix, sigma_bias_deg_h: None, sigma_matrix: None };
        let file = written(Triads { accelerometer: None, gyro_triad: Some(triad) });
        let refusal = file.apply_to_board(&mut Settings::default()).unwrap_err().to_string();
        assert!(refusal.contains("[gyro_triad]") && refusal.contains("one indexed gyro"), "{refusal}");
    }
}
