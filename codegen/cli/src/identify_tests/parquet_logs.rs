//! Tests that Parquet logs give the same results as CSV logs.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::data_type::DoubleType;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use regen_identify::data::{DataError, Logs, Policy, Settings};
use regen_identify::identify::EquationKind;
use regen_identify::signals::Method;

use super::{Bench, FREQUENCY, HARMONICS, csv, run, scratch, with};

/// Writes a table of numbers, some of them missing, in row groups of `group` rows.
fn write(path: &Path, header: &[&str], rows: &[Vec<Option<f64>>], group: usize) {
    let fields = header.iter().map(|name| format!("optional double {name};"));
    let message = format!("message log {{ {} }}", fields.collect::<String>());
    let schema = Arc::new(parse_message_type(&message).unwrap());
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .build();
    let file = fs::File::create(path).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    for rows in rows.chunks(group) {
        let mut out = writer.next_row_group().unwrap();
        let mut column = 0;
        while let Some(mut to) = out.next_column().unwrap() {
            let values: Vec<f64> = rows.iter().filter_map(|row| row[column]).collect();
            let level = |row: &Vec<Option<f64>>| i16::from(row[column].is_some());
            let levels: Vec<i16> = rows.iter().map(level).collect();
            to.typed::<DoubleType>()
                .write_batch(&values, Some(&levels), None)
                .unwrap();
            to.close().unwrap();
            column += 1;
        }
        out.close().unwrap();
    }
    writer.close().unwrap();
}

/// The header and the numbers of a CSV text.
fn table(text: &str) -> (Vec<&str>, Vec<Vec<Option<f64>>>) {
    let mut lines = text.lines();
    let header = lines.next().unwrap().split(',').collect();
    let rows = lines.map(|line| line.split(',').map(|x| x.parse().ok()).collect());
    (header, rows.collect())
}

#[test]
fn a_log_gives_the_same_bits_as_csv_and_as_parquet() {
    // more rows than a batch and than a row group
    Bench::new().with(9000, 0.0025, |model, rows, _| {
        let text = csv(model, &rows);
        let (header, numbers) = table(&text);
        let plain = scratch("same.csv", &text);
        let columns = scratch("same.parquet", "");
        write(&columns, &header, &numbers, 5000);
        for method in [
            Method::Central,
            Method::Fourier {
                frequency: FREQUENCY,
                harmonics: HARMONICS,
            },
        ] {
            let a = run(model, &plain, &with(method), EquationKind::Forces);
            let b = run(model, &columns, &with(method), EquationKind::Forces);
            assert_eq!(a, b);
        }
        for path in [plain, columns] {
            fs::remove_file(path).unwrap();
        }
    });
}

#[test]
fn nulls_and_missing_columns_are_reported_as_in_csv() {
    Bench::new().with(300, 0.01, |model, rows, _| {
        let text = csv(model, &rows);
        let (header, mut numbers) = table(&text);
        numbers[100][1] = None;
        numbers[200][3] = Some(f64::NAN);
        let path = scratch("null.parquet", "");
        write(&path, &header, &numbers, 128);
        let open = |settings: &Settings| Logs::open(model, std::slice::from_ref(&path), settings);
        let error = open(&with(Method::Central)).err().unwrap();
        let DataError::Problems { problems, .. } = &error else {
            panic!("{error}");
        };
        let reported: Vec<(u64, &str)> = problems
            .first
            .iter()
            .map(|p| (p.row, p.what.kind()))
            .collect();
        assert_eq!(reported, [(101, "not a number"), (201, "not a number")]);
        assert!(
            error.to_string().contains("`null` in column `q1`"),
            "{error}"
        );
        let drop = Settings {
            policy: Policy::Drop,
            ..Settings::default()
        };
        assert_eq!(open(&drop).unwrap().reports()[0].rows, 298);
        write(&path, &header[..3], &numbers, 300);
        let error = open(&drop).err().unwrap();
        assert!(error.to_string().contains("no column `tau_q1`"), "{error}");
        // a file with the first bytes of Parquet and nothing else
        fs::write(&path, "PAR1 and no more").unwrap();
        assert!(matches!(open(&drop), Err(DataError::Io { .. })));
        fs::remove_file(path).unwrap();
    });
}
