//! One topic of a recording.

use core::fmt;
use std::path::Path;

use crate::error::BagError;
use crate::known::Arrangement;
use crate::survey::{TopicSurvey, scan};
use crate::table::{self, Table};

/// A topic of a recording.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topic {
    /// Its name, such as `/joint_states`.
    pub name: String,
    /// The type of its messages, such as `sensor_msgs/msg/JointState`; empty where the recording
    /// does not have it.
    pub type_name: String,
    /// The number of its messages.
    pub messages: u64,
}

impl Topic {
    /// Whether its messages are of one of the [`KNOWN_TYPES`](crate::KNOWN_TYPES).
    pub fn is_known(&self) -> bool {
        Arrangement::of(&self.type_name).is_some()
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.type_name.is_empty() {
            "unknown type"
        } else {
            &self.type_name
        };
        let plural = if self.messages == 1 { "" } else { "s" };
        write!(
            f,
            "{} ({kind}, {} message{plural})",
            self.name, self.messages
        )
    }
}

/// The topics of a recording with their types and numbers of messages, those of databases in the
/// order of their tables, those of MCAP files in the order of their first messages.
///
/// # Errors
/// When a file cannot be read, is none of a recording, or is broken.
///
/// ```
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/bags");
/// let topics = regen_bags::topics(format!("{folder}/several.mcap").as_ref())?;
/// assert_eq!(topics[0].to_string(), "/joint_states (sensor_msgs/msg/JointState, 12 messages)");
/// assert!(topics[0].is_known());
/// # Ok::<(), regen_bags::BagError>(())
/// ```
pub fn topics(path: &Path) -> Result<Vec<Topic>, BagError> {
    Ok(scan(path, None)?
        .0
        .into_iter()
        .map(|survey| survey.topic)
        .collect())
}

/// The joint states of one topic of a recording, as tables.
///
/// ```
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/bags");
/// let log = regen_bags::Log::open(format!("{folder}/states.mcap").as_ref(), None)?;
/// let table = &log.tables()[0];
/// assert_eq!(table.titles()[..3], ["t", "t_received", "shoulder"]);
/// let mut rows = table.rows(&[0, 2])?;
/// let first = rows.next_row()?.ok_or("it has rows")?;
/// assert_eq!((first.number, &first.values[..]), (1, &[Some(0.0), Some(0.5)][..]));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Log {
    topic: Topic,
    start: i64,
    tables: Vec<Table>,
}

impl Log {
    /// Opens a recording: a file or the folder of a bag. Reads it once, so that broken files and
    /// messages are found here.
    ///
    /// - `topic`: the name of the topic; without one the only topic of a known type that has
    ///   messages. Of a named topic of another type the columns are the paths of the fields that
    ///   are numbers, such as `motor_state[3].q`, if the recording defines the type.
    ///
    /// # Errors
    /// When a file cannot be read, is none of a recording, is broken or cut off; when the topic is
    /// missing, not of a known type, without messages or not determined; when a message cannot be
    /// decoded or contradicts itself.
    pub fn open(path: &Path, topic: Option<&str>) -> Result<Self, BagError> {
        let (mut surveys, beside) = scan(path, topic)?;
        let own = choose(path, &surveys, topic)?;
        let own = surveys.swap_remove(own);
        if let Some(error) = own.error {
            return Err(error);
        }
        let start = own.first_stamp.unwrap_or_default();
        let mut tables = table::tables(path, &own)?;
        let others = surveys.iter().map(|other| {
            let why = format!("another topic is read, {}", own.topic.name);
            (other.topic.to_string(), why)
        });
        let fields = own.unread.into_iter();
        let fields = fields.map(|(path, why)| (path, why.to_owned()));
        let why = "it is an attachment or metadata of the file, which is not applied to numbers";
        let beside = beside.into_iter().map(|name| (name, why.to_owned()));
        let absent: Vec<(String, String)> = others.chain(fields).chain(beside).collect();
        for table in &mut tables {
            table.absent.extend_from_slice(&absent);
        }
        Ok(Self {
            topic: own.topic,
            start,
            tables,
        })
    }

    /// The topic.
    pub fn topic(&self) -> &Topic {
        &self.topic
    }

    /// The stamp from which the column `t` counts, ns; at first that of the first message.
    pub fn start(&self) -> i64 {
        self.start
    }

    /// Lets the column `t` count from another stamp in ns, so that recordings of the same clock
    /// have the same times.
    ///
    /// ```
    /// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/bags");
    /// use regen_bags::Log;
    ///
    /// let log = Log::open(format!("{folder}/states.mcap").as_ref(), None)?;
    /// let earlier = log.start() - 2_000_000_000;
    /// let log = log.starting_at(earlier);
    /// let first = log.tables()[0].rows(&[0])?.next_row()?.ok_or("it has rows")?;
    /// assert_eq!(first.values, [Some(2.0)]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn starting_at(mut self, start: i64) -> Self {
        self.start = start;
        for table in &mut self.tables {
            table.start = start;
        }
        self
    }

    /// The tables: one, or several where publishers of different joints share the topic, those with
    /// most messages first.
    pub fn tables(&self) -> &[Table] {
        &self.tables
    }
}

/// The index of the topic that is read.
fn choose(path: &Path, surveys: &[TopicSurvey], topic: Option<&str>) -> Result<usize, BagError> {
    let refused = |why: String| BagError::Topic {
        file: path.to_path_buf(),
        why,
        topics: surveys.iter().map(|own| own.topic.clone()).collect(),
    };
    let usable = |own: &TopicSurvey| own.topic.is_known() && own.topic.messages > 0;
    let places = |keep: &dyn Fn(&TopicSurvey) -> bool| -> Vec<usize> {
        let all = surveys.iter().enumerate().filter(|(_, own)| keep(own));
        all.map(|(k, _)| k).collect()
    };
    let known = || crate::KNOWN_TYPES.join(", ");
    let Some(name) = topic else {
        return match places(&usable)[..] {
            [own] => Ok(own),
            [] if surveys.is_empty() => Err(refused("it has no topic".to_owned())),
            [] => Err(refused(format!(
                "no topic has messages of a type with joint states ({}); name one of the others, whose columns \
                 are then the paths of its fields; there are",
                known()
            ))),
            _ => Err(refused(
                "several topics have joint states, so one must be named; there are".to_owned(),
            )),
        };
    };
    let bare = |text: &str| text.trim_start_matches('/').to_owned();
    let named = places(&|own: &TopicSurvey| bare(&own.topic.name) == bare(name));
    let first = match named[..] {
        [] => {
            return Err(refused(format!("it has no topic `{name}`; there are")));
        }
        [first, ..] => first,
    };
    let own = named.into_iter().find(|k| surveys[*k].topic.messages > 0);
    own.ok_or_else(|| {
        let topic = &surveys[first].topic;
        refused(format!(
            "the topic {} has no message; there are",
            topic.name
        ))
    })
}
