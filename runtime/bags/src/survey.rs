//! Surveys the topics of a recording in one pass over its messages.

use std::collections::BTreeSet;
use std::path::Path;

use crate::error::BagError;
use crate::joints::{Sample, Shape};
use crate::log::Topic;
use crate::storage::{Channel, Messages};

/// The largest number of kinds of messages on a topic, by their joints and lists.
const MAX_SHAPES: usize = 1000;

/// The messages of a topic: their joints, stamps and errors.
pub(crate) struct TopicSurvey {
    pub(crate) topic: Topic,
    /// The joints and lists of messages, with the number of such messages, in the order of
    /// appearance.
    pub(crate) shapes: Vec<(Shape, u64)>,
    /// The stamp of the first message, ns.
    pub(crate) first_stamp: Option<i64>,
    /// When the first message was received, ns.
    pub(crate) first_received: i64,
    /// Whether any stamp differs from 0.
    pub(crate) stamped: bool,
    /// What the messages have and no column has, by paths, with the reasons.
    pub(crate) unread: BTreeSet<(String, &'static str)>,
    /// Why the messages cannot be decoded.
    pub(crate) error: Option<BagError>,
}

impl TopicSurvey {
    fn new(channel: &Channel) -> Self {
        Self {
            topic: Topic {
                name: channel.topic.clone(),
                type_name: channel.type_name.clone(),
                messages: 0,
            },
            shapes: Vec::new(),
            first_stamp: None,
            first_received: 0,
            stamped: false,
            unread: BTreeSet::new(),
            error: None,
        }
    }

    fn add(&mut self, sample: Sample, received: i64) -> Result<(), String> {
        if self.first_stamp.is_none() {
            self.first_stamp = Some(sample.stamp);
            self.first_received = received;
        }
        self.stamped |= sample.stamp != 0;
        if let Some((_, count)) = self.shapes.iter_mut().find(|own| own.0 == sample.shape) {
            *count += 1;
        } else if self.shapes.len() < MAX_SHAPES {
            self.shapes.push((sample.shape, 1));
        } else {
            return Err(format!(
                "the messages have more than {MAX_SHAPES} different lists of joints"
            ));
        }
        Ok(())
    }
}

/// The index of a channel's topic; adds the topic if it is new.
fn place(all: &mut Vec<TopicSurvey>, channel: &Channel) -> usize {
    let own = all
        .iter()
        .position(|found| channel.same(&found.topic.name, &found.topic.type_name));
    own.unwrap_or_else(|| {
        all.push(TopicSurvey::new(channel));
        all.len() - 1
    })
}

/// Reads a whole recording; the topics are in the order of their first messages, and the names of what it has
/// besides messages.
///
/// - `any`: the topic whose messages are read whatever their type is.
pub(crate) fn scan(
    path: &Path,
    any: Option<&str>,
) -> Result<(Vec<TopicSurvey>, BTreeSet<String>), BagError> {
    let mut all: Vec<TopicSurvey> = Vec::new();
    let mut messages = Messages::open(path, None, any)?;
    loop {
        let mut begun = |channel: &Channel, count: u64| {
            let k = place(&mut all, channel);
            // messages of known types are counted when they are decoded
            if channel.decoder.is_none() {
                all[k].topic.messages += count;
            }
        };
        let recorded = match messages.next(&mut begun) {
            Ok(Some(recorded)) => recorded,
            Ok(None) => return Ok((all, messages.beside)),
            Err(error) => return Err(with_readable(error, &all)),
        };
        let k = place(&mut all, recorded.channel);
        let survey = &mut all[k];
        survey.topic.messages += 1;
        let Some(decoder) = &recorded.channel.decoder else {
            continue;
        };
        if survey.error.is_some() {
            continue;
        }
        let read = decoder.as_ref().map_err(String::clone).and_then(|own| {
            let message = own.decode(recorded.data)?;
            own.arrangement
                .unread(&message, &mut Vec::new(), &mut survey.unread);
            Sample::of(own.arrangement, &message)
        });
        let (received, place) = (recorded.received, recorded.place);
        if let Err(why) = read.and_then(|sample| survey.add(sample, received)) {
            survey.error = Some(BagError::Message {
                file: recorded.file.to_path_buf(),
                topic: survey.topic.name.clone(),
                number: survey.topic.messages,
                place: place.to_string(),
                why,
            });
        }
    }
}

/// Adds the topics that were read before the error to an error of a truncated file.
fn with_readable(error: BagError, all: &[TopicSurvey]) -> BagError {
    match error {
        BagError::Truncated {
            file,
            length,
            record,
            ..
        } => BagError::Truncated {
            file,
            length,
            record,
            readable: all.iter().map(|found| found.topic.clone()).collect(),
        },
        other => other,
    }
}
