//! The options of `import` and `export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

#[derive(Debug, Args)]
#[command(after_help = "\
Names, limits, inertias and friction are the file's; a coordinate is 0 where it
is 0 in the file. Meshes are not read. Standard error lists what was decided or
left out, with its place in the file.

Angles that print a multiple of pi are taken as such (1.5708 is pi/2), since
axes that are nearly parallel have other base parameters than parallel ones;
--exact keeps the digits.

A loop that the format cannot express is added with --cut: the joint at which it
is open, by its name, its type and a frame on each of two bodies,
  NAME:TYPE:BODY@x,y,z[,roll,pitch,yaw]:BODY@x,y,z[,roll,pitch,yaw]
TYPE is spherical, universal, revolute, prismatic, cylindrical or fixed, along
or about the frames' z axes. Bodies are the file's links, or world; frames are
in the links' frames, angles in radians (pi/2 is allowed). Without its frame the
second body has the first one's where the file's zero configuration has it.

Examples:
  regen import arm.urdf > robots/arm.yaml
  regen import gripper.xml --out robots/gripper.yaml
  regen import fourbar.urdf --actuated crank_joint --home crank_joint=pi/3 \\
      --cut pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0")]
pub(crate) struct ImportArgs {
    /// The file, URDF or MJCF
    pub(crate) file: PathBuf,
    /// Where the spec is written [default: standard output]; a file that exists
    /// is left as it is
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the file of --out where it exists
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// The spec's name [default: the robot's in the file]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Close a loop: NAME:TYPE:BODY@FRAME:BODY@FRAME (may be repeated)
    #[arg(long = "cut", value_name = "CUT", allow_hyphen_values = true)]
    pub(crate) cuts: Vec<String>,
    /// Joints with motors [default: those of the file's transmissions or
    /// actuators, or else all that follow no other]
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    pub(crate) actuated: Vec<String>,
    /// Where loops start to be closed, as NAME=VALUE [default: 0]
    #[arg(long, value_name = "VALUES", value_delimiter = ',')]
    pub(crate) home: Vec<String>,
    /// What the root stands on [default: what the file says; the world in URDF]
    #[arg(long, value_enum, value_name = "BASE")]
    pub(crate) base: Option<Base>,
    /// Joints taken as rigid: NAME, at 0, or NAME=VALUE in rad or m
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    pub(crate) lock: Vec<String>,
    /// Give joints with motors friction and a rotor's inertia, as drives with
    /// gears have, where the file states none
    #[arg(long)]
    pub(crate) geared: bool,
    /// Keep angles as printed, also where they print a multiple of pi
    #[arg(long)]
    pub(crate) exact: bool,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// What an imported robot's root stands on
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Base {
    /// The world; a free joint there is left out
    Fixed,
    /// Nothing: three slides and a ball, without motors
    Floating,
}

#[derive(Debug, Args)]
#[command(after_help = "\
PARAMS is what `regen identify --feasible --out` wrote, or JSON or YAML (by its
name) with values as in `bodies:` of the spec, about the centre of mass in the
body's frame, and friction by joint; each part and each entry may be missing.
  {\"bodies\": {\"forearm\": {\"mass\": 2.3, \"com\": [0, 0, 0.2],
                           \"inertia\": [0.03, 0, 0, 0.03, 0, 0.004]}},
   \"joints\": {\"elbow\": {\"Fv\": 1.2, \"Fc\": 0.4}}}
Masses, centres of mass and inertias are moved into the frames of the file and
replace the numbers there; damping and friction likewise, of Fc+ and Fc- the
larger; in MJCF also J as armature and K as stiffness. Nothing else of the file
changes. Parameters that the file has no place for are listed. Values that no
body can have are refused.

Examples:
  regen export --urdf arm.urdf --spec robots/arm.yaml --parameters fit.json \\
      --out arm_identified.urdf")]
pub(crate) struct ExportArgs {
    /// The robot file, URDF or MJCF
    #[arg(long, visible_alias = "mjcf", value_name = "FILE")]
    pub(crate) urdf: PathBuf,
    /// The spec that the parameters belong to
    #[arg(long, value_name = "SPEC")]
    pub(crate) spec: PathBuf,
    /// The parameters, a JSON or YAML file
    #[arg(long, value_name = "PARAMS")]
    pub(crate) parameters: PathBuf,
    /// Where the file is written [default: standard output]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}
