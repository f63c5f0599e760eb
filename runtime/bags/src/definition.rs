//! Definitions of messages as recordings store them (`ros2msg`), and the decoding of messages by
//! them.

use crate::cdr::Cdr;
use crate::known;

/// Deepest nesting of messages.
const MAX_DEPTH: usize = 16;
/// The largest number of types and fields of a definition.
const MAX_FIELDS: usize = 2000;
/// Longest definition, bytes.
const MAX_TEXT: usize = 1 << 20;

/// The type of a field's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Element {
    Bool,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Text,
    WideText,
    /// A message, by the index of its type.
    Message(usize),
}

/// How many elements a field has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Count {
    One,
    Fixed(usize),
    Sequence,
}

#[derive(Clone, Debug)]
struct Field {
    name: String,
    element: Element,
    count: Count,
}

/// The definition of a message with those of the messages in it.
#[derive(Clone, Debug)]
pub(crate) struct Definition {
    /// The fields of each type; the first one is the message's.
    types: Vec<Vec<Field>>,
}

/// The type of the values of a field.
#[derive(Debug, PartialEq)]
pub(crate) enum Value {
    Number(f64),
    Numbers(Vec<f64>),
    Text(String),
    Texts(Vec<String>),
    Message(Message),
    Messages(Vec<Message>),
}

/// The fields of a message in their order.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Message(Vec<(String, Value)>);

impl Message {
    pub(crate) fn get(&self, name: &str) -> Option<&Value> {
        let found = self.0.iter().find(|(own, _)| own == name);
        found.map(|(_, value)| value)
    }

    /// The fields with their values.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (&str, &Value)> {
        self.0.iter().map(|(name, value)| (name.as_str(), value))
    }

    pub(crate) fn message(&self, name: &str) -> Option<&Message> {
        match self.get(name) {
            Some(Value::Message(message)) => Some(message),
            _ => None,
        }
    }

    pub(crate) fn number(&self, name: &str) -> Option<f64> {
        match self.get(name) {
            Some(Value::Number(number)) => Some(*number),
            _ => None,
        }
    }

    pub(crate) fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.get(name) {
            Some(Value::Numbers(numbers)) => Some(numbers),
            _ => None,
        }
    }

    pub(crate) fn texts(&self, name: &str) -> Option<&[String]> {
        match self.get(name) {
            Some(Value::Texts(texts)) => Some(texts),
            _ => None,
        }
    }

    pub(crate) fn messages(&self, name: &str) -> Option<&[Message]> {
        match self.get(name) {
            Some(Value::Messages(messages)) => Some(messages),
            _ => None,
        }
    }
}

/// The name of a type as `package/Type`, also if it is written as `package/msg/Type`.
pub(crate) fn short_name(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// The sections of a definition, each with the name of its type: that of the message first, then
/// those of the messages in it, which follow lines of `=`.
fn sections<'t>(root: &str, text: &'t str) -> Vec<(String, Vec<&'t str>)> {
    let mut out = vec![(short_name(root), Vec::new())];
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line.len() >= 20 && line.bytes().all(|byte| byte == b'=') {
            let title = lines.next().unwrap_or_default();
            let name = title.strip_prefix("MSG:").unwrap_or(title).trim();
            out.push((short_name(name), Vec::new()));
        } else if let Some((_, own)) = out.last_mut() {
            own.push(line);
        }
    }
    out
}

impl Definition {
    /// Reads the definition of a type.
    ///
    /// - `text`: its fields, and after lines of `=` those of the types in it; known types may be
    ///   missing there.
    pub(crate) fn read(root: &str, text: &str) -> Result<Self, String> {
        if text.len() > MAX_TEXT {
            return Err(format!("its definition has {} bytes", text.len()));
        }
        let sections = sections(root, text);
        let mut names = vec![short_name(root)];
        let mut types = Vec::new();
        let mut fields = 0;
        while let Some(name) = names.get(types.len()).cloned() {
            let own = sections.iter().find(|(own, _)| *own == name);
            let lines: Vec<&str> = match own {
                Some((_, lines)) => lines.clone(),
                None => known::part(&name)
                    .ok_or_else(|| format!("its definition lacks the type {name}"))?
                    .lines()
                    .collect(),
            };
            let mut own_fields = Vec::new();
            for line in lines {
                own_fields.extend(field(line, &name, &mut names)?);
            }
            fields += own_fields.len();
            if fields > MAX_FIELDS || names.len() > MAX_FIELDS {
                return Err(format!("its definition has more than {MAX_FIELDS} fields"));
            }
            types.push(own_fields);
        }
        Ok(Self { types })
    }

    /// Decodes a message.
    pub(crate) fn decode(&self, data: &[u8]) -> Result<Message, String> {
        let mut cdr = Cdr::new(data)?;
        let message = self.message(0, &mut cdr, 0)?;
        cdr.finish()?;
        Ok(message)
    }

    fn message(&self, index: usize, cdr: &mut Cdr<'_>, depth: usize) -> Result<Message, String> {
        if depth > MAX_DEPTH {
            return Err("its definition is nested too deep".to_owned());
        }
        let fields = self.types.get(index).map_or(&[][..], Vec::as_slice);
        if fields.is_empty() {
            // a message without fields has a byte in their place
            cdr.primitive::<1>()?;
        }
        let mut out = Vec::with_capacity(fields.len());
        for field in fields {
            let value = self
                .value(field, cdr, depth)
                .map_err(|why| format!("field `{}`: {why}", field.name))?;
            out.push((field.name.clone(), value));
        }
        Ok(Message(out))
    }

    fn value(&self, field: &Field, cdr: &mut Cdr<'_>, depth: usize) -> Result<Value, String> {
        let count = match field.count {
            Count::One => {
                return Ok(match field.element {
                    Element::Message(index) => {
                        Value::Message(self.message(index, cdr, depth + 1)?)
                    }
                    Element::Text => Value::Text(cdr.text()?),
                    Element::WideText => Value::Text(cdr.wide_text()?),
                    element => Value::Number(number(element, cdr)?),
                });
            }
            Count::Fixed(count) if count > cdr.remaining() => {
                return Err(format!("{count} elements in {} bytes", cdr.remaining()));
            }
            Count::Fixed(count) => count,
            Count::Sequence => cdr.count()?,
        };
        Ok(match field.element {
            Element::Message(index) => {
                let all = (0..count).map(|_| self.message(index, cdr, depth + 1));
                Value::Messages(all.collect::<Result<_, _>>()?)
            }
            Element::Text => {
                Value::Texts((0..count).map(|_| cdr.text()).collect::<Result<_, _>>()?)
            }
            Element::WideText => Value::Texts(
                (0..count)
                    .map(|_| cdr.wide_text())
                    .collect::<Result<_, _>>()?,
            ),
            element => {
                let all = (0..count).map(|_| number(element, cdr));
                Value::Numbers(all.collect::<Result<_, _>>()?)
            }
        })
    }
}

fn number(element: Element, cdr: &mut Cdr<'_>) -> Result<f64, String> {
    Ok(match element {
        Element::Bool | Element::U8 => f64::from(u8::from_le_bytes(cdr.primitive()?)),
        Element::I8 => f64::from(i8::from_le_bytes(cdr.primitive()?)),
        Element::I16 => f64::from(i16::from_le_bytes(cdr.primitive()?)),
        Element::U16 => f64::from(u16::from_le_bytes(cdr.primitive()?)),
        Element::I32 => f64::from(i32::from_le_bytes(cdr.primitive()?)),
        Element::U32 => f64::from(u32::from_le_bytes(cdr.primitive()?)),
        Element::I64 => i64::from_le_bytes(cdr.primitive()?) as f64,
        Element::U64 => u64::from_le_bytes(cdr.primitive()?) as f64,
        Element::F32 => f64::from(f32::from_le_bytes(cdr.primitive()?)),
        Element::F64 => f64::from_le_bytes(cdr.primitive()?),
        Element::Text | Element::WideText | Element::Message(_) => f64::NAN,
    })
}

/// The field of a line; `None` for constants, comments and empty lines.
///
/// - `of`: the type that has the field;
/// - `names`: the names of the types so far; a new type of the field is added to them.
fn field(line: &str, of: &str, names: &mut Vec<String>) -> Result<Option<Field>, String> {
    let line = line.split('#').next().unwrap_or_default().trim();
    let Some((written, rest)) = line.split_once(char::is_whitespace) else {
        return if line.is_empty() {
            Ok(None)
        } else {
            Err(format!("its definition has the line `{line}`"))
        };
    };
    let rest = rest.trim_start();
    let name = rest
        .split(|c: char| c.is_whitespace() || c == '=')
        .next()
        .unwrap_or_default();
    if rest[name.len()..].trim_start().starts_with('=') {
        return Ok(None);
    }
    let (kind, count) = match written.split_once('[') {
        None => (written, Count::One),
        Some((kind, bounds)) => {
            let bounds = bounds.trim_end_matches(']');
            let count = match bounds.parse() {
                Ok(count) => Count::Fixed(count),
                Err(_) if bounds.is_empty() || bounds.starts_with("<=") => Count::Sequence,
                Err(_) => return Err(format!("its definition has the type `{written}`")),
            };
            (kind, count)
        }
    };
    // texts may be bounded, which is not encoded
    let kind = kind.split("<=").next().unwrap_or(kind);
    let element = match kind {
        "bool" => Element::Bool,
        "byte" | "char" | "uint8" => Element::U8,
        "int8" => Element::I8,
        "int16" => Element::I16,
        "uint16" => Element::U16,
        "int32" => Element::I32,
        "uint32" => Element::U32,
        "int64" => Element::I64,
        "uint64" => Element::U64,
        "float32" => Element::F32,
        "float64" => Element::F64,
        "string" => Element::Text,
        "wstring" => Element::WideText,
        other => {
            let full = match (other, other.contains('/')) {
                ("Header", _) => "std_msgs/Header".to_owned(),
                (_, true) => short_name(other),
                (_, false) => match of.rsplit_once('/') {
                    Some((package, _)) => format!("{package}/{other}"),
                    None => other.to_owned(),
                },
            };
            let place = names.iter().position(|own| *own == full);
            Element::Message(place.unwrap_or_else(|| {
                names.push(full);
                names.len() - 1
            }))
        }
    };
    Ok(Some(Field {
        name: name.to_owned(),
        element,
        count,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_bounds_and_nested_types_are_read() {
        let text = "\
uint8 MODE=3 # a constant
string<=10 name \"x\"
float32[2] pair
Point[<=4] points
bool on true
================================================================================
MSG: demo/Point
int16 x
wstring label
";
        let definition = Definition::read("demo/msg/Path", text).unwrap();
        let mut data = vec![0, 1, 0, 0, 2, 0, 0, 0, b'a', 0, 0, 0];
        for value in [1.5_f32, -2.0] {
            data.extend(value.to_le_bytes());
        }
        data.extend([1, 0, 0, 0, 0xfe, 0xff, 0, 0, 1, 0, 0, 0, b'z', 0, 1]);
        let message = definition.decode(&data).unwrap();
        assert_eq!(message.get("name"), Some(&Value::Text("a".to_owned())));
        assert_eq!(message.numbers("pair"), Some(&[1.5, -2.0][..]));
        let points = message.messages("points").unwrap();
        assert_eq!(points[0].number("x"), Some(-2.0));
        assert_eq!(points[0].get("label"), Some(&Value::Text("z".to_owned())));
        assert_eq!(message.number("on"), Some(1.0));
        for end in 0..data.len() {
            assert!(definition.decode(&data[..end]).is_err(), "{end}");
        }
    }

    #[test]
    fn definitions_with_missing_or_endless_types_are_refused() {
        let missing = Definition::read("demo/msg/A", "other/B b\n");
        assert!(missing.unwrap_err().contains("lacks the type other/B"));
        let endless = Definition::read("demo/msg/A", "A a\n").unwrap();
        assert!(
            endless
                .decode(&[0, 1, 0, 0])
                .unwrap_err()
                .contains("too deep")
        );
        assert!(Definition::read("demo/msg/A", "float64[x] a").is_err());
        assert!(Definition::read("demo/msg/A", "float64").is_err());
    }
}
