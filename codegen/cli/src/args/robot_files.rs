//! The options of `import` and `export`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use super::Format;

#[derive(Debug, Args)]
#[command(after_help = "\
Names, limits, inertias and friction are those of the file, and so are the zeros
of coordinates. Meshes are not read. Standard error lists what was decided, and
every element and attribute that was not used, with its place in the file. A
name that is not known and may tie links together (a joint, a loop, a gear) is
an error; --ignore leaves it out.

Loops close as the file says: <constraint>, <loop> and <coupling> (URDF+),
<gazebo><joint>, <drake:ball_constraint> and <drake:weld_constraint> in URDF, a
robot.yaml beside it with closed_loop, joints that close loops in SDF and USD,
<equality> in MJCF. Ratios of transmissions, gears of actuators and rotors of
motors become drives.

Angles that are a rounded multiple of pi become exact (1.5708 is pi/2), since
nearly parallel axes have other base parameters than parallel ones; --exact
keeps the digits.

A loop that the format cannot express is added with --cut, which describes the
joint that closes it by name, type, and a frame on each of its two bodies:
  NAME:TYPE:BODY@x,y,z[,roll,pitch,yaw]:BODY@x,y,z[,roll,pitch,yaw]
TYPE is spherical, universal, revolute, prismatic, cylindrical or fixed, along
or about the frames' z axes. Bodies are the file's links, or world, or frames by
their names (sites in MJCF); frames are relative to them, with angles in radians
(pi/2 is allowed). Two names without frames are held together as they are.
Without a frame on the second body alone, the two frames coincide at the file's
zero configuration.

Examples:
  regen import arm.urdf > robots/arm.yaml
  regen import gripper.xml --out robots/gripper.yaml
  regen import fourbar.urdf --actuated crank_joint --home crank_joint=pi/3 \\
      --cut pin:revolute:coupler@0.35,0,0:rocker@0.30,0,0
  regen import delta.sdf --cut tip:spherical:arm_end:plate_socket")]
pub(crate) struct ImportArgs {
    /// The file, URDF, SDF, MJCF or USD as text (usda)
    pub(crate) file: PathBuf,
    /// Where the spec is written [default: standard output]; an existing file is
    /// not replaced
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Replace the file of --out if it exists
    #[arg(long, requires = "out")]
    pub(crate) force: bool,
    /// The spec's name [default: the robot's in the file]
    #[arg(long, value_name = "NAME")]
    pub(crate) name: Option<String>,
    /// Close a loop: NAME:TYPE:BODY@FRAME:BODY@FRAME (may be repeated)
    #[arg(long = "cut", value_name = "CUT", allow_hyphen_values = true)]
    pub(crate) cuts: Vec<String>,
    /// Joints with motors [default: those of the file's transmissions or
    /// actuators, or else all that do not mimic others]
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    pub(crate) actuated: Vec<String>,
    /// The configuration from which loops are closed, as NAME=VALUE [default: 0]
    #[arg(long, value_name = "VALUES", value_delimiter = ',')]
    pub(crate) home: Vec<String>,
    /// How the root link is attached [default: as in the file; fixed in URDF]
    #[arg(long, value_enum, value_name = "BASE")]
    pub(crate) base: Option<Base>,
    /// Joints to lock: NAME, at 0, or NAME=VALUE in rad or m; * is any part
    /// of a name, as in 'wheel_*'
    #[arg(long, value_name = "JOINTS", value_delimiter = ',')]
    pub(crate) lock: Vec<String>,
    /// Give joints with motors friction and rotor inertia, as drives with
    /// gears have, where the file states none
    #[arg(long)]
    pub(crate) geared: bool,
    /// Leave out all elements and attributes of these names
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) ignore: Vec<String>,
    /// Keep angles as written, also rounded multiples of pi
    #[arg(long)]
    pub(crate) exact: bool,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// How an imported robot's root link is attached
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Base {
    /// Fixed to the world; a free joint there is left out
    Fixed,
    /// Floating, by three prismatic joints and a ball joint without motors
    Floating,
}

#[derive(Debug, Args)]
#[command(after_help = "\
PARAMS is a file of `regen identify --feasible --out`, or JSON or YAML (by its
extension) with values as in `bodies:` of the spec, about the centre of mass in
the body's frame, and friction by joint; every part and entry is optional.
  {\"bodies\": {\"forearm\": {\"mass\": 2.3, \"com\": [0, 0, 0.2],
                           \"inertia\": [0.03, 0, 0, 0.03, 0, 0.004]}},
   \"joints\": {\"elbow\": {\"Fv\": 1.2, \"Fc\": 0.4}}}
Masses, centres of mass and inertias are transformed to the frames of the file
and replace the numbers there, as do damping and friction (the larger of Fc+ and
Fc-); in SDF and MJCF also K as stiffness, in MJCF and USD J as armature. The
rest of the file is unchanged, and so are its loops. Parameters that the format
cannot express are listed. Values that no physical body has are refused.

Examples:
  regen export --urdf arm.urdf --spec robots/arm.yaml --parameters fit.json \\
      --out arm_identified.urdf
  regen export --urdf arm.urdf --spec robots/arm.yaml --parameters fit.json \\
      --to usd --out arm_identified.usda")]
pub(crate) struct ExportArgs {
    /// The robot file, URDF, SDF, MJCF or USD as text
    #[arg(long, visible_aliases = ["mjcf", "sdf", "usd"], value_name = "FILE")]
    pub(crate) urdf: PathBuf,
    /// The spec that the parameters belong to
    #[arg(long, value_name = "SPEC")]
    pub(crate) spec: PathBuf,
    /// The parameters, a JSON or YAML file
    #[arg(long, value_name = "PARAMS")]
    pub(crate) parameters: PathBuf,
    /// What is written: the robot file with the parameters, or something beside it
    #[arg(long, value_enum, default_value_t)]
    pub(crate) to: ExportTarget,
    /// Where the file is written [default: standard output]
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// How the result is printed
    #[arg(long, value_enum, default_value_t)]
    pub(crate) format: Format,
}

/// What `regen export` writes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum ExportTarget {
    /// The robot file with the new numbers
    #[default]
    Same,
    /// A layer of USD with masses, centres of mass and inertias of the links
    Usd,
    /// Isaac Lab's configuration of actuators, Python, with friction and armature
    IsaacLab,
}
