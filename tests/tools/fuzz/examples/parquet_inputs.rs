//! Writes small Parquet logs of every kind that the reader supports into a directory, as first
//! inputs of the fuzz target: `cargo run -p regen-fuzz --example parquet_inputs -- DIR`.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;
use std::sync::Arc;

use parquet::basic::Compression;
use parquet::column::writer::ColumnWriter;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterVersion};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;

/// An entry of the log of a swinging pendulum: time, angle or torque.
fn entry(column: usize, row: usize) -> f64 {
    let time = row as f64 / 20.0;
    let angle = 0.6 * (std::f64::consts::TAU * time).sin();
    [
        time,
        angle,
        angle.sin() * 19.62 - 0.5 * std::f64::consts::TAU.powi(2) * angle,
    ][column % 3]
}

fn write(dir: &Path, name: &str, fields: &str, properties: WriterProperties, rows: usize) {
    let schema = Arc::new(parse_message_type(&format!("message log {{ {fields} }}")).unwrap());
    let file = std::fs::File::create(dir.join(name)).unwrap();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties)).unwrap();
    for start in (0..rows).step_by(12) {
        let rows = start..rows.min(start + 12);
        let mut group = writer.next_row_group().unwrap();
        let mut column = 0;
        while let Some(mut to) = group.next_column().unwrap() {
            let values: Vec<f64> = rows.clone().map(|row| entry(column, row)).collect();
            let levels = vec![1_i16; values.len()];
            let levels = fields.contains("optional").then_some(levels.as_slice());
            let whole = |x: &f64| *x as i64;
            match to.untyped() {
                ColumnWriter::DoubleColumnWriter(to) => to.write_batch(&values, levels, None),
                ColumnWriter::FloatColumnWriter(to) => {
                    let values: Vec<f32> = values.iter().map(|x| *x as f32).collect();
                    to.write_batch(&values, levels, None)
                }
                ColumnWriter::Int64ColumnWriter(to) => {
                    let values: Vec<i64> = values.iter().map(whole).collect();
                    to.write_batch(&values, levels, None)
                }
                ColumnWriter::Int32ColumnWriter(to) => {
                    let values: Vec<i32> = values.iter().map(|x| *x as i32).collect();
                    to.write_batch(&values, levels, None)
                }
                _ => panic!("no numbers"),
            }
            .unwrap();
            to.close().unwrap();
            column += 1;
        }
        group.close().unwrap();
    }
    writer.close().unwrap();
}

fn main() {
    let dir = std::env::args().nth(1).expect("a directory");
    let dir = Path::new(&dir);
    let plain = || {
        WriterProperties::builder()
            .set_statistics_enabled(EnabledStatistics::None)
            .set_created_by(String::new())
    };
    let doubles = "required double t; required double q1; required double tau_q1;";
    let compressed = || plain().set_compression(Compression::SNAPPY);
    write(
        dir,
        "plain",
        doubles,
        plain().set_dictionary_enabled(false).build(),
        10,
    );
    write(dir, "dictionary", doubles, plain().build(), 10);
    write(dir, "snappy", doubles, compressed().build(), 16);
    let second = compressed().set_writer_version(WriterVersion::PARQUET_2_0);
    write(
        dir,
        "optional",
        "optional double t; optional double q1; optional double tau_q1;",
        second.build(),
        8,
    );
    write(
        dir,
        "kinds",
        "required float t; required int64 q1; required int32 tau_q1;",
        plain().build(),
        8,
    );
}
