//! Every robot as a trait object, whose table of methods refers to all functions of the robot.

use regen_runtime::BaseModel;

/// A robot for the number type `T`.
pub type Robot<T> = &'static (dyn BaseModel<T> + Sync);

/// Statics for some robots, and a list of them for `f64` with the names of their modules.
macro_rules! images {
    ($list:ident: $($name:ident = $module:ident :: $type:ident;)*) => {
        $(
            #[doc = concat!("The robot `", stringify!($module), "`.")]
            pub static $name: Robot<f64> = &regen_robots::$module::$type;
        )*

        static $list: &[(&str, &Robot<f64>)] = &[$((stringify!($module), &$name)),*];
    };
}

images! {
    CHECKED_IN:
    DELTA = delta::Delta;
    FIVEBAR = fivebar::Fivebar;
    FOURBAR = fourbar::Fourbar;
    PUMA560 = puma560::Puma560;
    RPS3 = rps3::Rps3;
    RPS3_FRICTION = rps3_friction::Rps3Friction;
}

#[cfg(feature = "derived")]
images! {
    DERIVED:
    HYBRID = hybrid::Hybrid;
    IIWA14 = iiwa14::Iiwa14;
    LINEAR_DELTA = linear_delta::LinearDelta;
    PALLETISER = palletiser::Palletiser;
    PANDA = panda::Panda;
    PRS3 = prs3::Prs3;
    RRR3 = rrr3::Rrr3;
    RX90 = rx90::Rx90;
    SCARA = scara::Scara;
    SLIDER_CRANK = slider_crank::SliderCrank;
    STANFORD = stanford::Stanford;
    STEWART = stewart::Stewart;
    TREE_BRANCH = tree_branch::TreeBranch;
    UR5E = ur5e::Ur5e;
}

/// All robots of this build for `f64`, with the names of their modules.
pub fn all() -> impl Iterator<Item = (&'static str, Robot<f64>)> {
    let robots = CHECKED_IN.iter();
    #[cfg(feature = "derived")]
    let robots = robots.chain(DERIVED);
    robots.map(|(name, robot)| (*name, **robot))
}

/// A closed loop in single precision.
pub static FIVEBAR_F32: Robot<f32> = &regen_robots::fivebar::Fivebar;
