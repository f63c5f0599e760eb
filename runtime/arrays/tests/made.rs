//! Files that the usual programs do not write, made here byte by byte.
#![allow(clippy::unwrap_used)]

use std::path::PathBuf;

use regen_arrays::{ArrayError, Table};

/// A table: its columns by their names.
type Columns = Vec<(String, Vec<f64>)>;

/// Opens a file of these bytes, and removes it with its tables' numbers read.
fn read(name: &str, bytes: &[u8]) -> Result<Vec<Columns>, ArrayError> {
    let name = format!("regen-made-{}-{name}", std::process::id());
    let path: PathBuf = std::env::temp_dir().join(name);
    std::fs::write(&path, bytes).unwrap();
    let columns = |table: &Table| {
        let all: Vec<usize> = (0..table.titles().len()).collect();
        let numbers = table.columns(&all)?;
        Ok(table.titles().iter().cloned().zip(numbers).collect())
    };
    let found =
        regen_arrays::open(&path, None).and_then(|tables| tables.iter().map(columns).collect());
    std::fs::remove_file(&path).unwrap();
    found
}

/// The columns of the only table, by their names.
#[track_caller]
fn only(name: &str, bytes: &[u8]) -> Columns {
    let mut all = read(name, bytes).unwrap();
    assert_eq!(all.len(), 1, "{all:?}");
    all.remove(0)
}

fn named(name: &str, numbers: &[f64]) -> (String, Vec<f64>) {
    (name.to_owned(), numbers.to_vec())
}

/// A segment of TDMS with the most significant bytes first and interleaved values.
fn segment(channels: &[(&str, u32)], rows: u64, raw: &[u8]) -> Vec<u8> {
    let mut list = (channels.len() as u32).to_be_bytes().to_vec();
    for (name, kind) in channels {
        let path = format!("/'arm'/'{name}'");
        list.extend((path.len() as u32).to_be_bytes());
        list.extend(path.as_bytes());
        for word in [20, *kind, 1] {
            list.extend(word.to_be_bytes());
        }
        list.extend(rows.to_be_bytes());
        // no property
        list.extend([0; 4]);
    }
    // descriptions, a new list, values, interleaved, most significant byte first
    let mut out = b"TDSm".to_vec();
    out.extend((2_u32 | 4 | 8 | 0x20 | 0x40).to_le_bytes());
    out.extend(4713_u32.to_be_bytes());
    out.extend(((list.len() + raw.len()) as u64).to_be_bytes());
    out.extend((list.len() as u64).to_be_bytes());
    out.extend(list);
    out.extend(raw);
    out
}

#[test]
fn interleaved_segments_of_tdms() {
    let raw = |rows: std::ops::Range<i16>| -> Vec<u8> {
        let row = |k: i16| {
            let mut out = (f64::from(k) / 8.0).to_be_bytes().to_vec();
            out.extend((k - 2).to_be_bytes());
            out
        };
        rows.flat_map(row).collect()
    };
    let channels = [("time", 10), ("q1", 2)];
    // three rows as one of six values each, then two more
    let mut bytes = segment(&channels, 3, &raw(0..6));
    bytes.extend(segment(&channels, 2, &raw(6..8)));
    let times: Vec<f64> = (0..8).map(|k| f64::from(k) / 8.0).collect();
    let positions: Vec<f64> = (0..8).map(|k| f64::from(k) - 2.0).collect();
    let expected = [named("arm/time", &times), named("arm/q1", &positions)];
    assert_eq!(only("tdms", &bytes), expected);
    // what a recorder that was stopped left of the last row is no row
    bytes.truncate(bytes.len() - 1);
    let expected = [
        named("arm/time", &times[..7]),
        named("arm/q1", &positions[..7]),
    ];
    assert_eq!(only("tdms_cut", &bytes), expected);
    let error = read("tdms_daqmx", &[b"TDSm\x80", &[0; 23][..]].concat()).unwrap_err();
    assert!(
        error.is_refused() && error.reason().contains("DAQmx"),
        "{error}"
    );
}

/// Blocks of MDF, one behind the other from byte 64 on.
struct Blocks(Vec<u8>);

impl Blocks {
    /// The address of the next block.
    fn next(&self) -> u64 {
        self.0.len() as u64
    }

    /// Adds a block, and returns its address.
    fn add(&mut self, kind: [u8; 4], links: &[u64], data: &[u8]) -> u64 {
        let at = self.next();
        self.0.extend(&kind);
        self.0.extend([0; 4]);
        self.0
            .extend((24 + 8 * links.len() as u64 + data.len() as u64).to_le_bytes());
        self.0.extend((links.len() as u64).to_le_bytes());
        self.0
            .extend(links.iter().flat_map(|own| own.to_le_bytes()));
        self.0.extend(data);
        self.0.resize(self.0.len().next_multiple_of(8), 0);
        at
    }

    fn text(&mut self, text: &str) -> u64 {
        self.add(*b"##TX", &[], format!("{text}\0").as_bytes())
    }

    fn conversion(&mut self, kind: u8, values: &[f64]) -> u64 {
        let mut data = vec![kind, 0, 0, 0, 0, 0];
        data.extend((values.len() as u16).to_le_bytes());
        data.extend([0; 16]);
        data.extend(values.iter().flat_map(|x| x.to_le_bytes()));
        self.add(*b"##CC", &[0; 4], &data)
    }

    /// A channel with its type, the type of its data, the first bit, the byte and the number of bits.
    fn channel(
        &mut self,
        next: u64,
        name: &str,
        conversion: u64,
        [kind, data, bit, byte, count]: [u8; 5],
    ) -> u64 {
        let name = self.text(name);
        let mut own = vec![kind, u8::from(kind == 2), data, bit];
        own.extend(u32::from(byte).to_le_bytes());
        own.extend(u32::from(count).to_le_bytes());
        own.resize(72, 0);
        self.add(*b"##CN", &[next, 0, name, 0, conversion, 0, 0, 0], &own)
    }

    fn group(
        &mut self,
        next: u64,
        channels: u64,
        name: &str,
        number: u64,
        rows: u64,
        bytes: u32,
    ) -> u64 {
        let name = self.text(name);
        let mut own = number.to_le_bytes().to_vec();
        own.extend(rows.to_le_bytes());
        own.extend([0; 8]);
        own.extend(bytes.to_le_bytes());
        own.extend([0; 4]);
        self.add(*b"##CG", &[next, channels, name, 0, 0, 0], &own)
    }
}

/// A file with one group of data of these groups of channels.
fn mdf(fill: impl FnOnce(&mut Blocks) -> (u64, u64), number_bytes: u8) -> Vec<u8> {
    let mut start = b"MDF     4.10    ".to_vec();
    start.resize(28, 0);
    start.extend(410_u16.to_le_bytes());
    start.resize(64, 0);
    let mut blocks = Blocks(start);
    // the header, whose first link is that of the group of data
    blocks.add(*b"##HD", &[0; 6], &[0; 32]);
    let (groups, data) = fill(&mut blocks);
    let own = blocks.add(
        *b"##DG",
        &[0, groups, data, 0],
        &[number_bytes, 0, 0, 0, 0, 0, 0, 0],
    );
    blocks.0[64 + 24..64 + 32].copy_from_slice(&own.to_le_bytes());
    blocks.0
}

#[test]
fn records_of_several_groups_of_mdf_one_after_another() {
    let bytes = mdf(
        |blocks| {
            let q = blocks.channel(0, "q1", 0, [0, 3, 0, 8, 16]);
            let t = blocks.channel(q, "t", 0, [2, 4, 0, 0, 64]);
            let heat = blocks.channel(0, "heat", 0, [0, 0, 0, 8, 8]);
            let slow_t = blocks.channel(heat, "t", 0, [2, 4, 0, 0, 64]);
            let slow = blocks.group(0, slow_t, "slow", 9, 2, 9);
            let fast = blocks.group(slow, t, "fast", 7, 4, 10);
            let mut data = Vec::new();
            for k in 0..4_i16 {
                data.push(7);
                data.extend(f64::from(k).to_le_bytes());
                data.extend((-k).to_be_bytes());
                if k % 2 == 0 {
                    data.push(9);
                    data.extend(f64::from(k).to_le_bytes());
                    data.push(40 + k.to_le_bytes()[0]);
                }
            }
            (fast, blocks.add(*b"##DT", &[], &data))
        },
        1,
    );
    let found = read("mdf_numbers", &bytes).unwrap();
    let expected = [
        [
            named("fast/t", &[0.0, 1.0, 2.0, 3.0]),
            named("fast/q1", &[0.0, -1.0, -2.0, -3.0]),
        ],
        [
            named("slow/t", &[0.0, 2.0]),
            named("slow/heat", &[40.0, 42.0]),
        ],
    ];
    assert_eq!(found, expected);
}

#[test]
fn bits_and_conversions_of_mdf() {
    let bytes = mdf(
        |blocks| {
            let rational = blocks.conversion(2, &[0.0, 0.0, 1.0, 0.0, 2.0, 0.0]);
            let between = blocks.conversion(4, &[0.0, 10.0, 4.0, 30.0]);
            let nearest = blocks.conversion(5, &[0.0, 10.0, 4.0, 30.0]);
            let formula = blocks.conversion(3, &[]);
            let last = blocks.channel(0, "formula", formula, [0, 0, 0, 2, 8]);
            let last = blocks.channel(last, "rational", rational, [0, 0, 0, 2, 8]);
            let last = blocks.channel(last, "between", between, [0, 0, 0, 2, 8]);
            let last = blocks.channel(last, "nearest", nearest, [0, 0, 0, 2, 8]);
            // five bits from the third one on, with a sign and without
            let last = blocks.channel(last, "signed", 0, [0, 2, 3, 0, 5]);
            let last = blocks.channel(last, "unsigned", 0, [0, 0, 3, 0, 5]);
            let first = blocks.channel(last, "t", 0, [2, 0, 0, 2, 8]);
            let group = blocks.group(0, first, "g", 0, 3, 3);
            let data: Vec<u8> = [1_u8, 2, 4]
                .into_iter()
                .flat_map(|k| [31 << 3, 0xff, k])
                .collect();
            (group, blocks.add(*b"##DT", &[], &data))
        },
        0,
    );
    let expected = [
        named("g/t", &[1.0, 2.0, 4.0]),
        named("g/unsigned", &[31.0; 3]),
        named("g/signed", &[-1.0; 3]),
        named("g/nearest", &[10.0, 10.0, 30.0]),
        named("g/between", &[15.0, 20.0, 30.0]),
        named("g/rational", &[0.5, 0.25, 0.125]),
    ];
    assert_eq!(only("mdf_bits", &bytes), expected);
}

#[test]
fn blocks_without_end_and_records_that_are_missing_are_refused() {
    let cut = mdf(
        |blocks| {
            let t = blocks.channel(0, "t", 0, [2, 4, 0, 0, 64]);
            let group = blocks.group(0, t, "g", 0, 5, 8);
            (group, blocks.add(*b"##DT", &[], &[0; 32]))
        },
        0,
    );
    let error = read("mdf_short", &cut).unwrap_err();
    assert!(error.reason().contains("32 bytes of 40"), "{error}");
    let endless = mdf(
        |blocks| {
            let t = blocks.channel(0, "t", 0, [2, 4, 0, 0, 64]);
            let group = blocks.group(0, t, "g", 0, 5, 8);
            let own = blocks.next();
            (group, blocks.add(*b"##DL", &[own, 0], &[0; 16]))
        },
        0,
    );
    let error = read("mdf_endless", &endless).unwrap_err();
    assert!(error.reason().contains("without end"), "{error}");
    // 2^40 rows in a file of some hundred bytes
    let claimed = mdf(
        |blocks| {
            let t = blocks.channel(0, "t", 0, [3, 0, 0, 0, 0]);
            let group = blocks.group(0, t, "g", 0, 1 << 40, 0);
            (group, blocks.add(*b"##DT", &[], &[]))
        },
        0,
    );
    let error = read("mdf_claimed", &claimed).unwrap_err();
    assert!(error.reason().contains("more rows"), "{error}");
}

#[test]
fn sizes_that_a_header_claims_take_no_memory() {
    let npy = |descr: &str, shape: &str| {
        let header = format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend([0; 16]);
        bytes
    };
    assert_eq!(only("npy", &npy("'<f8'", "(2,)"))[0].1, [0.0; 2]);
    for (descr, shape) in [
        ("'<f8'", "(3,)"),
        ("'<f8'", "(4611686018427387904, 4)"),
        ("'|O'", "(2,)"),
        ("[('t', '<f8', (1000000000000, 1000000000000))]", "(2,)"),
        ("'<f8'", "(((((((((("),
    ] {
        assert!(
            read("npy_claims", &npy(descr, shape)).is_err(),
            "{descr} {shape}"
        );
    }
}

/// An element of a MAT file of level 5.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let head = [kind, data.len() as u32].map(u32::to_le_bytes).concat();
    let fill = vec![0; data.len().next_multiple_of(8) - data.len()];
    [head.as_slice(), data, &fill].concat()
}

/// A MAT file of level 5 with matrices of these parts.
fn level5(matrices: &[&[Vec<u8>]]) -> Vec<u8> {
    let head = format!("{:124}\0\u{1}IM", "MATLAB 5.0 MAT-file");
    let matrices = matrices.iter().map(|parts| element(14, &parts.concat()));
    [vec![head.into_bytes()], matrices.collect()]
        .concat()
        .concat()
}

/// The first part of a matrix: its class.
fn class(number: u32) -> Vec<u8> {
    element(6, &[number, 0].map(u32::to_le_bytes).concat())
}

fn numbers(kind: u32, all: &[u32]) -> Vec<u8> {
    element(
        kind,
        &all.iter()
            .flat_map(|x| x.to_le_bytes())
            .collect::<Vec<u8>>(),
    )
}

#[test]
fn objects_of_matlab_are_told_and_what_they_consist_of_is_no_column() {
    let vector = |name: &str, count: u32| {
        let doubles: Vec<u8> = (0..count)
            .flat_map(|k| f64::from(k).to_le_bytes())
            .collect();
        [
            class(6),
            numbers(5, &[count, 1]),
            element(1, name.as_bytes()),
            element(9, &doubles),
        ]
    };
    let kind = [element(1, b"MCOS"), element(1, b"timeseries")].concat();
    let reference = [
        class(13),
        numbers(5, &[6, 1]),
        element(1, b""),
        numbers(6, &[7; 6]),
    ]
    .concat();
    let object = [class(17), element(1, b"q"), kind, element(14, &reference)];
    let whole = level5(&[&vector("t", 3), &object, &vector("", 3)]);
    assert_eq!(only("object", &whole), [named("t", &[0.0, 1.0, 2.0])]);
    let alone = read("alone", &level5(&[&object])).unwrap_err().to_string();
    assert!(
        alone.contains("q: it is an object of MATLAB") && alone.contains("out.q.Data"),
        "{alone}"
    );
}

#[test]
fn sparse_matrices_beyond_themselves_or_the_limit_are_told() {
    let sparse = |rows: u32, row: u32, before: [u32; 2]| {
        let one = element(9, &1.5_f64.to_le_bytes());
        let lists = [numbers(5, &[row]), numbers(5, &before), one].concat();
        [class(5), numbers(5, &[rows, 1]), element(1, b"t"), lists]
    };
    let read = |name, parts: &[Vec<u8>]| read(name, &level5(&[parts]));
    assert_eq!(
        read("in", &sparse(3, 2, [0, 1])).unwrap()[0],
        [named("t", &[0.0, 0.0, 1.5])]
    );
    for (name, parts, expected) in [
        ("row", sparse(3, 3, [0, 1]), "numbers outside of it"),
        ("more", sparse(3, 2, [0, 9]), "numbers outside of it"),
        ("large", sparse(1 << 31, 2, [0, 1]), "zeros included"),
    ] {
        let error = read(name, &parts).unwrap_err().to_string();
        assert!(error.contains(expected), "{name}: {error}");
    }
    // the same of level 4: row, column and number of an entry, and the size behind it
    let level4 = |all: [f64; 6]| {
        let head = [2_u32, 2, 3, 0, 2].map(u32::to_le_bytes).concat();
        [
            head,
            b"t\0".to_vec(),
            all.iter().flat_map(|x| x.to_le_bytes()).collect(),
        ]
        .concat()
    };
    let found = only("level4", &level4([2.0, 3.0, 1.0, 1.0, 1.5, 0.0]));
    assert_eq!(found, [named("t", &[0.0, 1.5, 0.0])]);
}

#[test]
fn dates_of_numpy_are_exact_seconds_from_the_first_one_and_the_time() {
    let npy = |rows: &[(i64, f64)], kind: &str| {
        let header = format!(
            "{{'descr': [('stamp', '{kind}'), ('q', '<f8')], 'fortran_order': False, 'shape': ({},), }}\n",
            rows.len()
        );
        let mut out = b"\x93NUMPY\x01\x00".to_vec();
        out.extend((header.len() as u16).to_le_bytes());
        out.extend(header.as_bytes());
        for (stamp, q) in rows {
            out.extend(stamp.to_le_bytes());
            out.extend(q.to_le_bytes());
        }
        out
    };
    // in 2026, in steps of 2 ms and 1 ns, and a time that is none
    let since = 1_764_504_000_000_000_001_i64;
    let rows = [
        (since, 1.0),
        (since + 2_000_001, 2.0),
        (i64::MIN, 3.0),
        (since - 5, 4.0),
    ];
    let found = only("dates.npy", &npy(&rows, "<M8[ns]"));
    assert_eq!(found[1], named("q", &[1.0, 2.0, 3.0, 4.0]));
    let bits = |all: &[f64]| all.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(
        bits(&found[0].1),
        bits(&[0.0, 0.002_000_001, f64::NAN, -5e-9])
    );
    // spans of time count from 0
    let found = only("spans.npy", &npy(&[(3, 1.0), (4, 2.0)], "<m8[ms]"));
    assert_eq!(found[0], named("stamp", &[0.003, 0.004]));
    let path = std::env::temp_dir().join(format!("regen-made-{}-named.npy", std::process::id()));
    std::fs::write(&path, npy(&rows, "<M8[25us]")).unwrap();
    let tables = regen_arrays::open(&path, None).unwrap();
    std::fs::remove_file(&path).unwrap();
    assert_eq!((tables[0].time(), tables[0].unit(0)), (Some(0), Some("s")));
    // a vector has a first column
    assert_eq!(
        (tables[0].place("q[:,0]"), tables[0].place("q[:,1]")),
        (Some(1), None)
    );
    // months have no length
    let months = read("months.npy", &npy(&[(3, 1.0), (4, 2.0)], "<M8[M]")).unwrap();
    assert_eq!(months, [vec![named("q", &[1.0, 2.0])]]);
}

#[test]
fn dates_of_several_files_count_from_the_same_one() {
    let record = |name: &str, first: i64| {
        let dates: Vec<u8> = (0..3)
            .flat_map(|k| (first + 10 * k).to_le_bytes())
            .collect();
        let header = "{'descr': '<M8[ms]', 'fortran_order': False, 'shape': (3,), }\n";
        let head = [
            b"\x93NUMPY\x01\x00",
            &(header.len() as u16).to_le_bytes()[..],
        ]
        .concat();
        let name = format!("regen-made-{}-{name}.npy", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, [&head, header.as_bytes(), &dates].concat()).unwrap();
        let table = regen_arrays::open(&path, None).unwrap().remove(0);
        let date = table.date().unwrap();
        let own = table.columns(&[0]).unwrap();
        let shifted = table.counting_from(1_000_000_000).columns(&[0]).unwrap();
        std::fs::remove_file(&path).unwrap();
        (date, own, shifted)
    };
    let (date, own, shifted) = record("first", 1000);
    assert_eq!((date, &own), (1_000_000_000, &shifted));
    let (date, own, shifted) = record("second", 1370);
    assert_eq!(date, 1_370_000_000);
    assert_eq!(own, [[0.0, 0.01, 0.02]]);
    assert_eq!(shifted, [[0.37, 0.38, 0.39]]);
}
