//! Every robot as a trait object, whose table of methods refers to all functions of the robot.

use regen_runtime::BaseModel;

/// A robot for the number type `T`.
pub type Robot<T> = &'static (dyn BaseModel<T> + Sync);

macro_rules! images {
    ($($name:ident = $module:ident :: $type:ident;)*) => {
        $(
            #[doc = concat!("The robot `", stringify!($module), "`.")]
            pub static $name: Robot<f64> = &regen_robots::$module::$type;
        )*

        /// All robots for `f64`, with the names of their modules.
        pub fn all() -> impl Iterator<Item = (&'static str, Robot<f64>)> {
            [$((stringify!($module), $name)),*].into_iter()
        }
    };
}

images! {
    DELTA = delta::Delta;
    FIVEBAR = fivebar::Fivebar;
    FOURBAR = fourbar::Fourbar;
    HYBRID = hybrid::Hybrid;
    IIWA14 = iiwa14::Iiwa14;
    LINEAR_DELTA = linear_delta::LinearDelta;
    PALLETISER = palletiser::Palletiser;
    PANDA = panda::Panda;
    PRS3 = prs3::Prs3;
    PUMA560 = puma560::Puma560;
    RPS3 = rps3::Rps3;
    RPS3_FRICTION = rps3_friction::Rps3Friction;
    RRR3 = rrr3::Rrr3;
    RX90 = rx90::Rx90;
    SCARA = scara::Scara;
    SLIDER_CRANK = slider_crank::SliderCrank;
    STANFORD = stanford::Stanford;
    STEWART = stewart::Stewart;
    TREE_BRANCH = tree_branch::TreeBranch;
    UR5E = ur5e::Ur5e;
}

/// A closed loop in single precision.
pub static FIVEBAR_F32: Robot<f32> = &regen_robots::fivebar::Fivebar;
