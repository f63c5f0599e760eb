//! Joint states in MCAP files and ROS 2 bags as tables of numbers.
//!
//! A [`Log`] is one topic of a recording: an MCAP file (`.mcap`), a database of rosbag2 (`.db3`), or
//! the folder of a bag with its `metadata.yaml`. Its messages are those that carry states of joints
//! by name, see [`KNOWN_TYPES`], in CDR of either byte order; chunks compressed by zstd and LZ4 are
//! read. Each message is a row. The columns are
//!
//! | column | what |
//! |---|---|
//! | `t` | the header's stamp, s from the first one of the topic |
//! | `t_received` | when the recorder got the message, s from the first one of the topic |
//! | `NAME` | position of the joint NAME |
//! | `qd_NAME`, `qdd_NAME`, `tau_NAME` | its velocity, acceleration and effort |
//! | `cmd_NAME`, `cmd_qd_NAME`, .. | the reference of a controller |
//! | `out_NAME`, `out_tau_NAME`, .. | what a controller puts out |
//! | `temperature_NAME`, .. | any other interface of `DynamicJointState` by its name |
//!
//! Of a named topic of any other type, whose definition the recording has, the columns are the paths
//! of all fields that are numbers, such as `motor_state[3].q`; without stamps `t` is when messages were
//! received.
//!
//! Numbers are those of the messages, in SI by their definition. A column whose array is empty in
//! all messages does not exist. Joints may come in any order. Joints that several publishers send
//! in separate messages are in a [`Table`] for each publisher; where the messages overlap, rows
//! are those messages that have all requested joints.
//!
//! Files are read from start to end, a chunk at a time, so that memory does not grow with their
//! length; each [`Table::rows`] reads the files again.

mod cdr;
mod compression;
mod definition;
mod error;
mod folder;
mod joints;
mod known;
mod log;
mod storage;
mod survey;
mod table;

pub use error::BagError;
pub use folder::is_bag;
pub use known::KNOWN_TYPES;
pub use log::{Log, Topic, topics};
pub use table::{Row, Rows, Table};
