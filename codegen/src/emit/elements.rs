//! The names of the elements that a robot's sizes count: coordinates, bodies, parameters and
//! others.

use crate::base::Analysis;
use crate::robot::Robot;
use crate::signature::{Argument, FunctionKind, Size};

use super::names::identifier;

/// The base parameters, if the robot has functions over them.
pub(super) fn base_of(robot: &Robot) -> Option<&Analysis> {
    robot.function(FunctionKind::ToBase)?;
    robot.analysis.as_ref()
}

/// Names of the elements that a size counts; numbers for elements without names.
pub(super) fn elements(robot: &Robot, size: Size) -> Vec<String> {
    let of = |which: &[usize]| -> Vec<String> {
        which
            .iter()
            .map(|c| robot.coordinates[*c].clone())
            .collect()
    };
    let numbered = || (1..=robot.length(size)).map(|k| k.to_string()).collect();
    match size {
        Size::Coordinates => robot.coordinates.clone(),
        Size::Independent => of(&robot.independent),
        Size::Dependent => of(&robot.dependent),
        Size::Actuated => of(&robot.actuated),
        Size::Parameters => robot.parameters.iter().map(|p| p.label.clone()).collect(),
        Size::Bodies => robot.bodies.clone(),
        Size::Frames => robot.frames.clone(),
        Size::Base => kept_labels(robot),
        Size::Free => eliminated_labels(robot),
        Size::Rows
        | Size::Cones
        | Size::Pose
        | Size::FrameRates
        | Size::State
        | Size::StateEfforts => numbered(),
    }
}

/// The preferred names of an argument's elements in an emitted function.
pub(super) fn preferred_names(robot: &Robot, argument: Argument) -> Vec<String> {
    let row = argument.row();
    let elements = elements(robot, row.size).into_iter();
    elements
        .map(|element| format!("{}{}", row.prefix, identifier(&element)))
        .collect()
}

/// The preferred names of the adjustable geometry in an emitted function.
pub(super) fn adjustable_names(robot: &Robot) -> Vec<String> {
    let names = robot.adjustable.iter();
    names.map(|(name, _)| format!("g_{name}")).collect()
}

/// Labels of the base parameters that functions take as `beta`.
pub(super) fn kept_labels(robot: &Robot) -> Vec<String> {
    let analysis = robot.analysis.iter();
    let parameters = analysis.flat_map(|a| &a.base.parameters);
    parameters
        .filter(|p| !p.dropped)
        .map(|p| robot.parameters[p.column].label.clone())
        .collect()
}

/// Labels of the eliminated parameters, which functions take as `free`.
pub(super) fn eliminated_labels(robot: &Robot) -> Vec<String> {
    let analysis = robot.analysis.iter();
    let columns = analysis.flat_map(|a| &a.base.null).map(|n| n.column);
    columns.map(|c| robot.parameters[c].label.clone()).collect()
}
