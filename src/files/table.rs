//! Tables with a name for each column, as CSV and as Parquet.

use std::io::Write;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{Type, TypePtr};

use crate::error::{Error, Result};

/// Named columns of equal length.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    columns: Vec<(String, Column)>,
}

/// The cells of a column.
#[derive(Clone, Debug, PartialEq)]
pub enum Column {
    /// Words.
    Text(Vec<String>),
    /// Whole numbers, at most 2^63 - 1.
    Count(Vec<u64>),
    /// Numbers, some of which may be missing.
    Float(Vec<Option<f64>>),
}

impl Column {
    /// Number of cells.
    fn len(&self) -> usize {
        match self {
            Self::Text(cells) => cells.len(),
            Self::Count(cells) => cells.len(),
            Self::Float(cells) => cells.len(),
        }
    }

    /// The cell of `row` as text; empty where the number is missing.
    fn text(&self, row: usize) -> String {
        match self {
            Self::Text(cells) => cells[row].clone(),
            Self::Count(cells) => cells[row].to_string(),
            Self::Float(cells) => cells[row].map_or_else(String::new, |number| number.to_string()),
        }
    }

    /// Its type in a Parquet file.
    fn schema(&self, name: &str) -> std::result::Result<Type, ParquetError> {
        let (physical, logical, repetition) = match self {
            Self::Text(_) => {
                (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED)
            }
            Self::Count(_) => (Physical::INT64, None, Repetition::REQUIRED),
            Self::Float(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
        };
        Type::primitive_type_builder(name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
    }

    /// Writes it as the next column of `rows`.
    fn write<W: Write + Send>(
        &self,
        rows: &mut SerializedRowGroupWriter<'_, W>,
    ) -> std::result::Result<(), ParquetError> {
        let mut column = rows
            .next_column()?
            .ok_or_else(|| ParquetError::General("more columns than the schema has".into()))?;
        match self {
            Self::Text(cells) => {
                let cells: Vec<ByteArray> =
                    cells.iter().map(|text| ByteArray::from(text.as_str())).collect();
                column.typed::<ByteArrayType>().write_batch(&cells, None, None)?;
            }
            Self::Count(cells) => {
                let cells: Vec<i64> = cells.iter().map(|count| *count as i64).collect();
                column.typed::<Int64Type>().write_batch(&cells, None, None)?;
            }
            Self::Float(cells) => {
                let present: Vec<f64> = cells.iter().flatten().copied().collect();
                let levels: Vec<i16> = cells.iter().map(|cell| cell.is_some().into()).collect();
                column.typed::<DoubleType>().write_batch(&present, Some(&levels), None)?;
            }
        }
        column.close()
    }
}

impl Table {
    /// Appends a column.
    ///
    /// # Panics
    /// If it is not as long as the others, or has the name of one: readers of either format take
    /// columns by their names.
    pub fn add(&mut self, name: &str, column: Column) {
        let is_new = self.columns.iter().all(|(other, _)| other != name);
        assert!(is_new, "`{name}` is the name of one column");
        let fits = self.columns.first().is_none_or(|(_, first)| first.len() == column.len());
        assert!(fits, "`{name}` is as long as the other columns");
        self.columns.push((name.to_owned(), column));
    }

    /// The columns with their names.
    pub fn columns(&self) -> &[(String, Column)] {
        &self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, column)| column.len())
    }

    /// The table as CSV with a header; cells with commas, quotes or line breaks are quoted.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the writer refuses a cell.
    pub fn csv(&self) -> Result<Vec<u8>> {
        let refused = |error: &dyn std::fmt::Display| Error::invalid("csv", error.to_string());
        let mut writer = csv::Writer::from_writer(Vec::new());
        let header = self.columns.iter().map(|(name, _)| name.as_str());
        writer.write_record(header).map_err(|error| refused(&error))?;
        for row in 0..self.rows() {
            let cells = self.columns.iter().map(|(_, column)| column.text(row));
            writer.write_record(cells).map_err(|error| refused(&error))?;
        }
        writer.into_inner().map_err(|error| refused(&error))
    }

    /// The table as a Parquet file of one row group.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the writer refuses a column.
    pub fn parquet(&self) -> Result<Vec<u8>> {
        self.parquet_bytes().map_err(|error| Error::invalid("parquet", error.to_string()))
    }

    fn parquet_bytes(&self) -> std::result::Result<Vec<u8>, ParquetError> {
        let fields: Vec<TypePtr> = self
            .columns
            .iter()
            .map(|(name, column)| column.schema(name).map(Arc::new))
            .collect::<std::result::Result<_, _>>()?;
        let schema = Type::group_type_builder("schema").with_fields(fields).build()?;
        let properties = Arc::new(WriterProperties::builder().build());
        let mut bytes = Vec::new();
        let mut writer = SerializedFileWriter::new(&mut bytes, Arc::new(schema), properties)?;
        if self.rows() > 0 {
            let mut rows = writer.next_row_group()?;
            for (_, column) in &self.columns {
                column.write(&mut rows)?;
            }
            rows.close()?;
        }
        writer.close()?;
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    use super::*;

    fn table() -> Table {
        let mut table = Table::default();
        table.add("noise, kind", Column::Text(vec!["a,\"b\"".to_owned(), "c\nd".to_owned()]));
        table.add("samples", Column::Count(vec![16, 1 << 40]));
        table.add("cost", Column::Float(vec![None, Some(-0.1)]));
        table
    }

    #[test]
    fn cells_that_need_it_are_quoted() {
        let text = String::from_utf8(table().csv().unwrap()).unwrap();
        let expected =
            "\"noise, kind\",samples,cost\n\"a,\"\"b\"\"\",16,\n\"c\nd\",1099511627776,-0.1\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn parquet_comes_back_as_it_was() {
        let bytes = table().parquet().unwrap();
        let reader = SerializedFileReader::new(bytes::Bytes::from(bytes)).unwrap();
        let rows: Vec<Vec<(String, Field)>> =
            reader.get_row_iter(None).unwrap().map(|row| row.unwrap().into_columns()).collect();
        let cell = |name: &str, field| (name.to_owned(), field);
        assert_eq!(
            rows,
            [
                [
                    cell("noise, kind", Field::Str("a,\"b\"".to_owned())),
                    cell("samples", Field::Long(16)),
                    cell("cost", Field::Null)
                ],
                [
                    cell("noise, kind", Field::Str("c\nd".to_owned())),
                    cell("samples", Field::Long(1 << 40)),
                    cell("cost", Field::Double(-0.1))
                ],
            ]
        );
    }

    #[test]
    fn a_table_without_rows_is_its_header() {
        let mut empty = Table::default();
        empty.add("samples", Column::Count(Vec::new()));
        assert_eq!(empty.csv().unwrap(), b"samples\n");
        let reader = SerializedFileReader::new(bytes::Bytes::from(empty.parquet().unwrap()));
        assert_eq!(reader.unwrap().metadata().file_metadata().num_rows(), 0);
    }

    #[test]
    #[should_panic(expected = "is the name of one column")]
    fn columns_have_names_of_their_own() {
        table().add("samples", Column::Count(vec![1, 2]));
    }

    #[test]
    #[should_panic(expected = "as long as the other columns")]
    fn columns_are_equally_long() {
        table().add("short", Column::Count(vec![1]));
    }
}
