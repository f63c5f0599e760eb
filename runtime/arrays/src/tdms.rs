//! TDMS files of LabVIEW.

use std::collections::BTreeMap;

use crate::array::{Array, Container, Found, Remarks, require_few};
use crate::error::{Read, broken, refused};
use crate::input::{Fields, Input, text};
use crate::number::{Kind, Stored, index};

/// The first bytes of a file, and of each segment of it.
pub(crate) const MAGIC: &[u8] = b"TDSm";
/// The length of the start of a segment.
const LEAD_BYTES: u64 = 28;
/// The largest number of segments, and of pieces of all channels in them.
const MAX_SEGMENTS: usize = 1_000_000;
const MAX_PIECES: usize = 10_000_000;
/// Why raw values of a card are not read.
const DAQMX: &str = "it has raw values of DAQmx: save it again by LabVIEW, or convert it to CSV by npTDMS \
                     (`TdmsFile(..).as_dataframe().to_csv(..)`)";
/// Why raw values with a scaling beside them are not read.
const UNSCALED: &str = "it has raw values, and their scaling is not applied here: save scaled ones, or convert it to CSV \
                        by npTDMS (`TdmsFile(..).as_dataframe().to_csv(..)`)";
/// The largest number of scalings of a channel, and of coefficients of one.
const MAX_SCALES: f64 = 100.0;
/// The number of the raw values among the inputs of scalings.
const RAW: f64 = 4_294_967_295.0;
/// A fraction of a second in a time of LabVIEW.
const FRACTION: f64 = 1.0 / 18_446_744_073_709_551_616.0;

/// Seconds from 1904, from which LabVIEW counts, to 1970.
const EPOCH: i64 = 2_082_844_800;

/// A time of LabVIEW.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Stamp {
    seconds: i64,
    part: u64,
}

impl Stamp {
    fn read(bytes: &[u8], big: bool) -> Read<Self> {
        let mut fields = Fields::new(bytes, big);
        let (one, other) = (fields.u64()?, fields.u64()?);
        let (seconds, part) = if big { (one, other) } else { (other, one) };
        Ok(Self {
            seconds: seconds.cast_signed(),
            part,
        })
    }

    /// In ns since 1970, if so many ns reach it.
    fn nanoseconds(self) -> Option<i64> {
        let whole = self
            .seconds
            .checked_sub(EPOCH)?
            .checked_mul(1_000_000_000)?;
        whole.checked_add((self.part as f64 * FRACTION * 1e9) as i64)
    }
}

/// How the values of a channel are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    Number(Stored),
    /// Seconds, and fractions of one; with the most significant byte first.
    Time(bool),
    /// Neither; with the size of a value, if all have the same.
    Other(Option<u64>),
}

impl Type {
    fn of(code: u32, big: bool) -> Self {
        let (kind, size) = match code {
            1..=4 => (Kind::Signed, 1 << (code - 1)),
            5..=8 => (Kind::Unsigned, 1 << (code - 5)),
            9 | 0x19 => (Kind::Float, 4),
            10 | 0x1a => (Kind::Float, 8),
            0x21 => (Kind::Unsigned, 1),
            0x44 => return Self::Time(big),
            0x0008_000c => return Self::Other(Some(8)),
            11 | 0x1b | 0x0010_000d => return Self::Other(Some(16)),
            _ => return Self::Other(None),
        };
        Stored::new(kind, size, big).map_or(Self::Other(None), Self::Number)
    }

    fn size(self) -> Option<u64> {
        match self {
            Self::Number(stored) => Some(stored.size as u64),
            Self::Time(_) => Some(16),
            Self::Other(size) => size,
        }
    }
}

/// The values of a channel in a segment, once.
#[derive(Clone, Copy, Debug)]
struct Block {
    kind: Type,
    count: u64,
    bytes: u64,
}

/// Values of a channel that follow each other.
#[derive(Clone, Copy, Debug)]
struct Piece {
    at: u64,
    count: u64,
    /// From one value to the next, in bytes.
    step: u64,
    kind: Type,
}

/// What LabVIEW computes of raw values: polynomials, of which each takes what the one before it gives.
type Scaling = Vec<Vec<f64>>;

/// The properties of scalings, by the path of what has them.
type Scales = BTreeMap<String, BTreeMap<String, Property>>;

/// A channel.
#[derive(Clone, Debug, Default)]
struct Channel {
    /// How its values were stored in the last segment with a description of them.
    last: Option<Block>,
    pieces: Vec<Piece>,
    count: u64,
    /// Why it is not read.
    why: Option<&'static str>,
    /// The step of a waveform, and the time of its first value, s.
    step: Option<f64>,
    start: f64,
    /// The date from which the waveform's times count, ns since 1970.
    date: Option<i64>,
    unit: String,
}

/// What an array has.
#[derive(Clone, Debug)]
enum Place {
    Values(Vec<Piece>, Scaling),
    /// Times at a step from one on, and the date from which they count, ns since 1970.
    Steps(f64, f64, u64, Option<i64>),
}

#[derive(Debug)]
struct Tdms(Vec<Place>);

impl Container for Tdms {
    fn numbers(&self, input: &mut Input, place: usize) -> Read<Vec<f64>> {
        let (pieces, scaling) = match self.0.get(place) {
            Some(Place::Values(pieces, scaling)) => (pieces, scaling),
            Some(Place::Steps(start, step, count, _)) => {
                return Ok((0..*count).map(|k| start + step * k as f64).collect());
            }
            None => return refused("it has disappeared"),
        };
        let mut out = Vec::new();
        // times count from the first one, since those since 1904 resolve no microseconds
        let mut first: Option<Stamp> = None;
        for piece in pieces {
            let size = piece.kind.size().unwrap_or(0);
            let Some(last) = piece.count.checked_sub(1) else {
                continue;
            };
            let bytes = input.data(piece.at, last * piece.step + size)?;
            let values = bytes.chunks(piece.step as usize);
            match piece.kind {
                Type::Number(stored) => out.extend(values.map(|own| {
                    let raw = stored.number(own);
                    scaling.iter().fold(raw, |x, all| polynomial(all, x))
                })),
                Type::Time(big) => {
                    for own in values {
                        let own = Stamp::read(own, big)?;
                        let from = *first.get_or_insert(own);
                        let whole = own.seconds.wrapping_sub(from.seconds) as f64;
                        out.push(whole + (own.part as f64 - from.part as f64) * FRACTION);
                    }
                }
                Type::Other(_) => return refused("it has no numbers"),
            }
        }
        Ok(out)
    }

    fn date(&self, input: &mut Input, place: usize) -> Read<Option<i64>> {
        match self.0.get(place) {
            Some(Place::Steps(.., date)) => Ok(*date),
            Some(Place::Values(pieces, _)) => match pieces.iter().find(|own| own.count > 0) {
                Some(Piece {
                    at,
                    kind: Type::Time(big),
                    ..
                }) => Ok(Stamp::read(&input.data(*at, 16)?, *big)?.nanoseconds()),
                _ => Ok(None),
            },
            None => Ok(None),
        }
    }
}

/// The value of a polynomial, whose constant is the first coefficient; 0 without any.
fn polynomial(coefficients: &[f64], x: f64) -> f64 {
    let mut all = coefficients.iter().rev().copied();
    let last = all.next().unwrap_or(0.0);
    all.fold(last, |sum, own| own + sum * x)
}

/// The scaling of a channel, which it has itself, or its group, or the file; `Err` if it has another than
/// polynomials.
fn scaling(scales: &Scales, parts: &[String]) -> Result<Scaling, ()> {
    let own = (0..=parts.len()).rev().find_map(|k| {
        let own = scales.get(&parts.get(..k)?.join("/"))?;
        let count = own.get("NI_Number_Of_Scales")?.number()?;
        (count >= 1.0).then_some((own, count))
    });
    let Some((own, count)) = own else {
        return Ok(Vec::new());
    };
    if count > MAX_SCALES {
        return Err(());
    }
    let mut out = Vec::new();
    // the last one takes what another one gives, and so on, down to the raw values
    let mut at = count - 1.0;
    while (out.len() as f64) < count {
        let of = |name: &str| own.get(&format!("NI_Scale[{at}]_{name}"));
        let number = |name: &str| of(name).and_then(Property::number);
        let (coefficients, source) = match of("Scale_Type") {
            Some(Property::Text(kind)) if kind == "Linear" => (
                vec![
                    number("Linear_Y_Intercept").ok_or(())?,
                    number("Linear_Slope").ok_or(())?,
                ],
                number("Linear_Input_Source"),
            ),
            Some(Property::Text(kind)) if kind == "Polynomial" => {
                let size = number("Polynomial_Coefficients_Size").unwrap_or(4.0);
                if size > MAX_SCALES {
                    return Err(());
                }
                let all =
                    (0..index(size)).map(|k| number(&format!("Polynomial_Coefficients[{k}]")));
                let all: Option<Vec<f64>> = all.collect();
                (all.ok_or(())?, number("Polynomial_Input_Source"))
            }
            _ => return Err(()),
        };
        out.push(coefficients);
        match source {
            Some(source) if source < RAW => at = source,
            _ => {
                out.reverse();
                return Ok(out);
            }
        }
    }
    Err(())
}

/// The value of a property.
#[derive(Debug)]
enum Property {
    Text(String),
    Number(f64),
    Time(Stamp),
    Other,
}

impl Property {
    fn number(&self) -> Option<f64> {
        match self {
            Self::Number(own) => Some(*own),
            _ => None,
        }
    }
}

fn property(fields: &mut Fields<'_>, big: bool) -> Read<Property> {
    let code = fields.u32()?;
    if code == 0x20 {
        let length = fields.u32()? as usize;
        return Ok(Property::Text(text(fields.take(length)?)));
    }
    let kind = Type::of(code, big);
    let Some(size) = kind.size() else {
        return broken(format!("a property of it is of the unknown type {code}"));
    };
    let bytes = fields.take(size as usize)?;
    Ok(match kind {
        Type::Number(stored) => Property::Number(stored.number(bytes)),
        Type::Time(big) => Property::Time(Stamp::read(bytes, big)?),
        Type::Other(_) => Property::Other,
    })
}

/// The parts of a path such as `/'arm'/'q''1'`.
fn parts(path: &str) -> Vec<String> {
    let mut out: Vec<String> = Vec::new();
    let mut inside = false;
    let mut letters = path.chars().peekable();
    while let Some(c) = letters.next() {
        match (c, inside) {
            ('\'', true) if letters.peek() == Some(&'\'') => {
                letters.next();
                if let Some(own) = out.last_mut() {
                    own.push('\'');
                }
            }
            ('\'', _) => {
                inside = !inside;
                if inside {
                    out.push(String::new());
                }
            }
            (c, true) => {
                if let Some(own) = out.last_mut() {
                    own.push(c);
                }
            }
            _ => {}
        }
    }
    out
}

/// The channels of a file while it is read, in the order in which they appear.
#[derive(Default)]
struct Reader {
    names: BTreeMap<String, usize>,
    channels: Vec<(String, Channel)>,
    /// The channels that have values in the present segment.
    active: Vec<usize>,
    pieces: usize,
    properties: Remarks,
    scales: Scales,
}

impl Reader {
    fn channel(&mut self, path: &str) -> Read<usize> {
        if let Some(own) = self.names.get(path) {
            return Ok(*own);
        }
        let own = self.channels.len();
        require_few(own)?;
        self.names.insert(path.to_owned(), own);
        self.channels.push((path.to_owned(), Channel::default()));
        Ok(own)
    }

    /// Reads the descriptions at the start of a segment.
    fn describe(&mut self, bytes: &[u8], big: bool, is_new: bool) -> Read<()> {
        let mut fields = Fields::new(bytes, big);
        if is_new {
            self.active.clear();
        }
        for _ in 0..fields.u32()? {
            let length = fields.u32()? as usize;
            let path = text(fields.take(length)?);
            let own = self.channel(&path)?;
            let channel = &mut self.channels[own].1;
            let index = fields.u32()?;
            match index {
                // without values, or stored as before
                u32::MAX | 0 => {}
                0x1269 | 0x126a => {
                    return refused(DAQMX);
                }
                _ => {
                    let kind = Type::of(fields.u32()?, big);
                    let axes = fields.u32()?;
                    let count = fields.u64()?;
                    let bytes = match (index, kind.size()) {
                        (28, _) => fields.u64()?,
                        (_, Some(size)) => size.saturating_mul(count),
                        (_, None) => return broken("a channel has values of an unknown type"),
                    };
                    if axes != 1 {
                        return broken("a channel has values with several axes");
                    }
                    channel.last = Some(Block { kind, count, bytes });
                }
            }
            if index != u32::MAX && !self.active.contains(&own) {
                self.active.push(own);
            }
            for _ in 0..fields.u32()? {
                let length = fields.u32()? as usize;
                let name = text(fields.take(length)?);
                let value = property(&mut fields, big)?;
                match (&*name, value) {
                    ("wf_increment", Property::Number(step)) if step > 0.0 => {
                        channel.step = Some(step);
                    }
                    ("wf_start_offset", Property::Number(start)) => channel.start = start,
                    ("wf_start_time", Property::Time(own)) => channel.date = own.nanoseconds(),
                    ("unit_string", Property::Text(unit)) => channel.unit = unit,
                    ("NI_Scaling_Status", Property::Text(status)) if status == "unscaled" => {
                        channel.why = Some(UNSCALED);
                    }
                    // what LabVIEW writes by itself, and texts for people
                    (
                        "wf_samples" | "wf_start_time" | "wf_xname" | "name" | "title" | "author"
                        | "datetime",
                        _,
                    ) => {}
                    ("NI_UnitDescription", Property::Text(unit)) if channel.unit.is_empty() => {
                        channel.unit = unit;
                    }
                    (_, value)
                        if name.starts_with("NI_Scale[") || name == "NI_Number_Of_Scales" =>
                    {
                        let of = self.scales.entry(parts(&path).join("/"));
                        of.or_default().insert(name, value);
                    }
                    (name, _) if name.starts_with("NI_") => {}
                    ("description", Property::Text(text)) if text.trim().is_empty() => {}
                    ("wf_xunit_string", Property::Text(unit)) if unit == "s" => {}
                    (name, _) => {
                        self.properties
                            .add("a property", name, &parts(&path).join("/"));
                    }
                }
            }
        }
        Ok(())
    }

    /// Adds the values of a segment, which are from `at` to `end`.
    fn values(&mut self, at: u64, end: u64, interleaved: bool, big: bool) -> Read<()> {
        let blocks: Vec<(usize, Block)> = self
            .active
            .iter()
            .filter_map(|own| Some((*own, self.channels[*own].1.last?)))
            .collect();
        let sizes = blocks.iter().map(|(_, own)| own.bytes);
        let whole = sizes.fold(0_u64, u64::saturating_add);
        if whole == 0 {
            return Ok(());
        }
        let row: u64 = if interleaved {
            let sizes = blocks.iter().map(|(_, own)| own.kind.size());
            let Some(row) = sizes.sum::<Option<u64>>() else {
                return broken("interleaved values have different lengths");
            };
            row
        } else {
            0
        };
        let mut start = at;
        // a segment has its values as often as they fit; of one that was cut off, rows that all channels
        // have are kept, so that their lengths stay the same
        while start < end && (interleaved || end - start >= whole) {
            let rows = (end - start).checked_div(row).unwrap_or(u64::MAX);
            let mut first = start;
            for (own, block) in &blocks {
                let size = block.kind.size().unwrap_or(0);
                let at = first;
                first = first.saturating_add(if interleaved { size } else { block.bytes });
                let step = if interleaved { row } else { size };
                let channel = &mut self.channels[*own].1;
                // values of other orders of bytes keep their own
                let kind = match block.kind {
                    Type::Number(stored) => Type::Number(Stored { big, ..stored }),
                    Type::Time(_) => Type::Time(big),
                    other @ Type::Other(_) => other,
                };
                if matches!(kind, Type::Other(_)) {
                    channel.why =
                        Some("it has text, complex numbers or numbers of extended precision");
                    continue;
                }
                let inside = end.saturating_sub(at).checked_div(size).unwrap_or(0);
                let count = block.count.min(rows).min(inside);
                channel.count += count;
                self.pieces += 1;
                if self.pieces > MAX_PIECES {
                    return refused("its values are in too many pieces: save it again by LabVIEW");
                }
                channel.pieces.push(Piece {
                    at,
                    count,
                    step,
                    kind,
                });
            }
            start = start.saturating_add(whole);
        }
        Ok(())
    }

    /// The arrays of the channels.
    fn finish(self) -> Found {
        let (mut arrays, mut places, mut unread) = (Vec::new(), Vec::new(), Vec::new());
        let mut groups: Vec<String> = Vec::new();
        // the waveforms that have a time already, by group, length, step and start
        let mut waves: Vec<(usize, u64, u64, u64, Option<i64>)> = Vec::new();
        for (path, channel) in self.channels {
            let parts = parts(&path);
            let [group, name] = &parts[..] else { continue };
            let title = format!("{group}/{name}");
            let scaling = scaling(&self.scales, &parts);
            // values that are said to be raw, and how they are scaled is not
            let is_known = scaling.as_ref().is_ok_and(|all| !all.is_empty());
            let why = match (channel.why, &scaling) {
                (Some(UNSCALED), _) if is_known => None,
                (None, Err(())) => Some(UNSCALED),
                (why, _) => why,
            };
            let scaling = scaling.unwrap_or_default();
            if let Some(why) = why {
                unread.push((title, why.to_owned()));
                continue;
            }
            if channel.count == 0 {
                unread.push((title, "it has no values".to_owned()));
                continue;
            }
            let own = groups.iter().position(|own| own == group);
            let own = own.unwrap_or_else(|| {
                groups.push(group.clone());
                groups.len() - 1
            });
            let is_clock = matches!(
                channel.last,
                Some(Block {
                    kind: Type::Time(_),
                    ..
                })
            );
            let is_time = is_clock
                || matches!(
                    &*name.to_lowercase(),
                    "t" | "time" | "time (s)" | "time [s]"
                );
            if let Some(step) = channel.step.filter(|_| !is_time) {
                let (start, date) = (channel.start, channel.date);
                let wave = (own, channel.count, step.to_bits(), start.to_bits(), date);
                if !waves.contains(&wave) {
                    waves.push(wave);
                    let number = waves.iter().filter(|wave| wave.0 == own).count();
                    let name = match number {
                        1 => format!("{group}/(time of the waveforms)"),
                        _ => format!("{group}/(time {number} of the waveforms)"),
                    };
                    arrays.push(Array {
                        place: places.len(),
                        group: Some(own),
                        is_time: true,
                        is_clock: true,
                        ..Array::new(name, vec![channel.count])
                    });
                    places.push(Place::Steps(start, step, channel.count, date));
                }
            }
            arrays.push(Array {
                place: places.len(),
                group: Some(own),
                is_time,
                is_clock,
                unit: channel.unit,
                ..Array::new(title, vec![channel.count])
            });
            places.push(Place::Values(channel.pieces, scaling));
        }
        self.properties.tell(&mut unread);
        Found {
            arrays,
            unread,
            container: Box::new(Tdms(places)),
        }
    }
}

/// Opens a file.
pub(crate) fn open(input: &mut Input) -> Read<Found> {
    let mut reader = Reader::default();
    let mut at = 0;
    let mut segments = 0;
    while at < input.len() {
        segments += 1;
        if segments > MAX_SEGMENTS {
            return refused(format!("it has more than {MAX_SEGMENTS} segments"));
        }
        let lead = input.up_to(at, LEAD_BYTES)?;
        // a recorder that was stopped may leave a part of the start of a segment
        if (lead.len() as u64) < LEAD_BYTES {
            break;
        }
        let mut fields = Fields::new(&lead, false);
        if fields.take(4)? != MAGIC {
            return broken(format!("there is no segment at byte {at}"));
        }
        let contents = fields.u32()?;
        let big = contents & 0x40 != 0;
        let mut fields = Fields::new(fields.rest(), big);
        fields.skip(4)?;
        let (next, raw) = (fields.u64()?, fields.u64()?);
        let begin = at + LEAD_BYTES;
        let data = begin.saturating_add(raw);
        // an unfinished segment has no end
        let end = begin.saturating_add(next).min(input.len());
        if contents & 0x80 != 0 {
            return refused(DAQMX);
        }
        if contents & 2 != 0 {
            let bytes = input.bytes(begin, raw)?;
            reader.describe(&bytes, big, contents & 4 != 0)?;
        }
        if contents & 8 != 0 {
            reader.values(data, end, contents & 0x20 != 0, big)?;
        }
        at = end;
    }
    Ok(reader.finish())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scalings_are_polynomials_one_behind_the_other_and_those_of_a_group_are_of_its_channels() {
        let of = |all: &[(&str, Property)]| -> Scales {
            let copied = all.iter().map(|(name, own)| {
                let own = match own {
                    Property::Text(text) => Property::Text(text.clone()),
                    Property::Number(x) => Property::Number(*x),
                    Property::Time(own) => Property::Time(*own),
                    Property::Other => Property::Other,
                };
                ((*name).to_owned(), own)
            });
            Scales::from([("arm".to_owned(), copied.collect())])
        };
        let kind = |text: &str| Property::Text(text.to_owned());
        let mut all = vec![
            ("NI_Number_Of_Scales", Property::Number(2.0)),
            ("NI_Scale[0]_Scale_Type", kind("Linear")),
            ("NI_Scale[0]_Linear_Slope", Property::Number(2.0)),
            ("NI_Scale[0]_Linear_Y_Intercept", Property::Number(1.0)),
            ("NI_Scale[0]_Linear_Input_Source", Property::Number(RAW)),
            ("NI_Scale[1]_Scale_Type", kind("Polynomial")),
            (
                "NI_Scale[1]_Polynomial_Coefficients_Size",
                Property::Number(3.0),
            ),
            (
                "NI_Scale[1]_Polynomial_Coefficients[0]",
                Property::Number(5.0),
            ),
            (
                "NI_Scale[1]_Polynomial_Coefficients[1]",
                Property::Number(0.0),
            ),
            (
                "NI_Scale[1]_Polynomial_Coefficients[2]",
                Property::Number(1.0),
            ),
            ("NI_Scale[1]_Polynomial_Input_Source", Property::Number(0.0)),
        ];
        let channel = ["arm".to_owned(), "q".to_owned()];
        let chain = scaling(&of(&all), &channel).unwrap_or_default();
        // (2 x + 1)^2 + 5
        let value = chain.iter().fold(3.0, |x, own| polynomial(own, x));
        assert!((value - 54.0).abs() < 1e-15 && chain.len() == 2, "{value}");
        let other = ["leg".to_owned(), "q".to_owned()];
        assert_eq!(scaling(&of(&all), &other), Ok(Vec::new()));
        // one that takes its own values, and one of another kind
        all[10].1 = Property::Number(1.0);
        assert_eq!(scaling(&of(&all), &channel), Err(()));
        all[1].1 = kind("Thermocouple");
        all[10].1 = Property::Number(0.0);
        assert_eq!(scaling(&of(&all), &channel), Err(()));
    }

    #[test]
    fn paths_are_divided_at_their_quotation_marks() {
        assert_eq!(parts("/"), Vec::<String>::new());
        assert_eq!(parts("/'arm'/'q''1'"), ["arm", "q'1"]);
        assert_eq!(parts("/'a/b'/'c'"), ["a/b", "c"]);
    }
}
