//! A table of texts and numbers in a Parquet file, written as its rows come.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use crate::failure::Failure;
use crate::file_error::FileError;
use crate::interrupt;
use crate::output::{self, Output};

/// Rows that are kept until they are written.
const ROWS: usize = 65_536;

/// A table: first the columns of texts, then those of numbers, which may be empty in a row.
pub struct ParquetTable {
    path: PathBuf,
    writer: SerializedFileWriter<Output>,
    texts: Vec<Vec<ByteArray>>,
    numbers: Vec<Vec<Option<f64>>>,
    /// Rows that are kept, and all.
    kept: usize,
    rows: u64,
}

impl ParquetTable {
    /// A table called `name`. Until it is finished there is no file; after an error nothing is left.
    ///
    /// Errors: a file that is there or cannot be written.
    pub fn create<'a>(
        path: &Path,
        name: &str,
        texts: &[&str],
        numbers: impl Iterator<Item = &'a str>,
    ) -> Result<Self, Failure> {
        let file = output::create(path).map_err(|error| FileError::whole(path, error))?;
        let failed = |error| failure(path, error);
        let mut fields = Vec::new();
        for name in texts {
            let text = Type::primitive_type_builder(name, Physical::BYTE_ARRAY);
            fields
                .push(text.with_repetition(Repetition::REQUIRED).with_logical_type(Some(LogicalType::String)).build());
        }
        for name in numbers {
            fields.push(
                Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::OPTIONAL).build(),
            );
        }
        let count = fields.len() - texts.len();
        let fields =
            fields.into_iter().map(|field| field.map(Arc::new)).collect::<Result<Vec<_>, _>>().map_err(failed)?;
        let schema = Type::group_type_builder(name).with_fields(fields).build().map_err(failed)?;
        let properties = WriterProperties::builder().set_compression(Compression::SNAPPY).build();
        let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties)).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            writer,
            texts: vec![Vec::new(); texts.len()],
            numbers: vec![Vec::new(); count],
            kept: 0,
            rows: 0,
        })
    }

    /// Takes a row.
    ///
    /// Errors: what is kept cannot be written; an interrupt.
    pub fn push<'a>(
        &mut self,
        texts: impl IntoIterator<Item = &'a str>,
        numbers: impl IntoIterator<Item = Option<f64>>,
    ) -> Result<(), Failure> {
        self.texts.iter_mut().zip(texts).for_each(|(column, text)| column.push(text.into()));
        self.numbers.iter_mut().zip(numbers).for_each(|(column, value)| column.push(value));
        self.kept += 1;
        self.rows += 1;
        if self.kept == ROWS { self.flush() } else { Ok(()) }
    }

    /// Brings everything to the disk, and gives the number of rows.
    pub fn finish(mut self) -> Result<u64, Failure> {
        self.flush()?;
        let (path, rows) = (self.path, self.rows);
        let file = self.writer.into_inner().map_err(|error| failure(&path, error))?;
        file.finish().map_err(|error| FileError::whole(&path, error))?;
        Ok(rows)
    }

    /// Writes the rows that are kept.
    fn flush(&mut self) -> Result<(), Failure> {
        if interrupt::requested() {
            return Err(Failure::Interrupted);
        }
        if self.kept > 0 {
            self.write_group().map_err(|error| failure(&self.path, error))?;
        }
        self.kept = 0;
        Ok(())
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        let (mut texts, mut numbers) = (self.texts.iter_mut(), self.numbers.iter_mut());
        while let Some(mut column) = group.next_column()? {
            match column.untyped() {
                ColumnWriter::ByteArrayColumnWriter(typed) => {
                    let values = texts.next().map(std::mem::take).unwrap_or_default();
                    typed.write_batch(&values, None, None)?;
                }
                ColumnWriter::DoubleColumnWriter(typed) => {
                    let values = numbers.next().map(std::mem::take).unwrap_or_default();
                    let levels: Vec<i16> = values.iter().map(|value| value.is_some().into()).collect();
                    let values: Vec<f64> = values.into_iter().flatten().collect();
                    typed.write_batch(&values, Some(&levels), None)?;
                }
                _ => return Err(ParquetError::General("a column is neither text nor a number".into())),
            }
            column.close()?;
        }
        group.close()?;
        Ok(())
    }
}

fn failure(path: &Path, error: ParquetError) -> Failure {
    FileError::whole(path, io::Error::other(error)).into()
}
