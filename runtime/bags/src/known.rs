//! Types of messages that carry states of joints, and their definitions for recordings that do not
//! store them.

use crate::definition::{Definition, Message, short_name};

/// The types of messages that make a table.
pub const KNOWN_TYPES: [&str; 4] = [
    "sensor_msgs/msg/JointState",
    "control_msgs/msg/JointTrajectoryControllerState",
    "control_msgs/msg/DynamicJointState",
    "control_msgs/msg/DynamicInterfaceGroupValues",
];

/// How the numbers of a type are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Arrangement {
    /// Lists for all joints: positions, velocities, efforts.
    State,
    /// The same in each of several points: reference, feedback, output.
    Controller,
    /// For each joint a list of named interfaces; with the field that names the joints.
    Interfaces(&'static str),
    /// Any fields, by their paths.
    Fields,
}

impl Arrangement {
    pub(crate) fn of(type_name: &str) -> Option<Self> {
        Some(match &*short_name(type_name) {
            "sensor_msgs/JointState" => Self::State,
            "control_msgs/JointTrajectoryControllerState" => Self::Controller,
            "control_msgs/DynamicJointState" => Self::Interfaces("joint_names"),
            "control_msgs/DynamicInterfaceGroupValues" => Self::Interfaces("interface_groups"),
            _ => return None,
        })
    }
}

const JOINT_STATE: &str = "\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
";

const CONTROLLER_STATE: [&str; 4] = [
    "\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_reference
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_feedback
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_output
",
    "\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint reference
trajectory_msgs/JointTrajectoryPoint feedback
trajectory_msgs/JointTrajectoryPoint error
trajectory_msgs/JointTrajectoryPoint output
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_reference
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_feedback
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_output
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual
",
    "\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
string[] multi_dof_joint_names
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_desired
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_actual
trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_error
",
    "\
std_msgs/Header header
string[] joint_names
trajectory_msgs/JointTrajectoryPoint desired
trajectory_msgs/JointTrajectoryPoint actual
trajectory_msgs/JointTrajectoryPoint error
",
];

const DYNAMIC_JOINT_STATE: &str = "\
std_msgs/Header header
string[] joint_names
InterfaceValue[] interface_values
";

const DYNAMIC_INTERFACE_GROUPS: &str = "\
std_msgs/Header header
string[] interface_groups
InterfaceValue[] interface_values
";

/// The fields of a type that occurs in known messages.
pub(crate) fn part(name: &str) -> Option<&'static str> {
    Some(match name {
        "std_msgs/Header" => "builtin_interfaces/Time stamp\nstring frame_id\n",
        "builtin_interfaces/Time" | "builtin_interfaces/Duration" => "int32 sec\nuint32 nanosec\n",
        "control_msgs/InterfaceValue" => "string[] interface_names\nfloat64[] values\n",
        "trajectory_msgs/JointTrajectoryPoint" => {
            "float64[] positions\nfloat64[] velocities\nfloat64[] accelerations\n\
             float64[] effort\nbuiltin_interfaces/Duration time_from_start\n"
        }
        "trajectory_msgs/MultiDOFJointTrajectoryPoint" => {
            "geometry_msgs/Transform[] transforms\ngeometry_msgs/Twist[] velocities\n\
             geometry_msgs/Twist[] accelerations\nbuiltin_interfaces/Duration time_from_start\n"
        }
        "geometry_msgs/Transform" => "Vector3 translation\nQuaternion rotation\n",
        "geometry_msgs/Twist" => "Vector3 linear\nVector3 angular\n",
        "geometry_msgs/Vector3" => "float64 x\nfloat64 y\nfloat64 z\n",
        "geometry_msgs/Quaternion" => "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
        _ => return None,
    })
}

/// How messages of a known type are decoded.
#[derive(Clone, Debug)]
pub(crate) struct Decoder {
    pub(crate) arrangement: Arrangement,
    /// The definitions that the messages may have; the first one that fits counts.
    definitions: Vec<Definition>,
}

impl Decoder {
    /// The decoder of a type; `None` if it is not a known one.
    ///
    /// - `stored`: the definition that the recording has, if any.
    pub(crate) fn new(type_name: &str, stored: Option<&str>) -> Option<Result<Self, String>> {
        let arrangement = Arrangement::of(type_name)?;
        let texts: &[&str] = match (stored, arrangement) {
            (Some(text), _) => &[text],
            (None, Arrangement::State) => &[JOINT_STATE],
            (None, Arrangement::Controller) => &CONTROLLER_STATE,
            (None, Arrangement::Interfaces("joint_names")) => &[DYNAMIC_JOINT_STATE],
            (None, Arrangement::Interfaces(_)) => &[DYNAMIC_INTERFACE_GROUPS],
            (None, Arrangement::Fields) => return None,
        };
        let all = texts.iter().map(|text| Definition::read(type_name, text));
        Some(all.collect::<Result<_, _>>().map(|definitions| Self {
            arrangement,
            definitions,
        }))
    }

    /// The decoder of a type of which all fields are columns.
    pub(crate) fn of_fields(type_name: &str, stored: Option<&str>) -> Result<Self, String> {
        let text = stored.ok_or_else(|| {
            format!(
                "the recording does not define its type {type_name} (in `ros2msg`); newer versions of rosbag2 \
                 and MCAP files do"
            )
        })?;
        Ok(Self {
            arrangement: Arrangement::Fields,
            definitions: vec![Definition::read(type_name, text)?],
        })
    }

    pub(crate) fn decode(&self, data: &[u8]) -> Result<Message, String> {
        let mut first = None;
        for definition in &self.definitions {
            match definition.decode(data) {
                Ok(message) => return Ok(message),
                Err(why) => drop(first.get_or_insert(why)),
            }
        }
        Err(first.unwrap_or_default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_of_known_types_are_decoded_also_if_the_recording_does_not_define_them() {
        for name in KNOWN_TYPES {
            let decoder = Decoder::new(name, None);
            assert!(matches!(decoder, Some(Ok(_))), "{name}: {decoder:?}");
        }
        assert!(Decoder::new("std_msgs/msg/String", None).is_none());
    }
}
