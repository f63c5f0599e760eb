//! Sentences that the documentation of emitted code contains in every language.

use std::fmt::Write as _;

use crate::base::Analysis;
use crate::diag::counted;
use crate::optimize::Operations;
use crate::robot::Robot;

use super::elements::base_of;

/// The source of the equations and the meaning of their symbols, line by line.
pub(super) const EQUATIONS: [&str; 6] = [
    "Equations are those of V. Mata, N. Farhat, M. Diaz-Rodriguez, A. Valera, A. Page, \"Dynamic",
    "Parameter Identification for Parallel Manipulators\", in H. Wu (ed.), Parallel Manipulators,",
    "towards New Applications, I-Tech, 2008. K_i and K_e are the rows of the spanning tree's",
    "Gibbs-Appell regressor at independent and dependent coordinates (Eq. 4, 5), X carries velocities,",
    "qd_e = -X qd_i (Eq. 10), and the base parameters phi_b are the fewest combinations of the",
    "parameters phi with (K_i - X^T K_e) phi = W phi_b at every state (Eq. 11, 23).",
];

/// What the digest of a model is for.
pub(super) const DIGEST: &str =
    "What tells models apart: parameters that were identified for another one have another number.";

/// How many coordinates, bodies, parameters and closure rows a robot has.
pub(super) fn sizes(robot: &Robot) -> String {
    format!(
        "{} coordinates, {} independent; {} bodies, {} parameters; {} closure rows, {} of them redundant.",
        robot.coordinates.len(),
        robot.independent.len(),
        robot.bodies.len(),
        robot.parameters.len(),
        robot.rows,
        robot.redundant_rows.len(),
    )
}

/// The number of base parameters and whether it is certified to be minimal; `None` if no function
/// uses base parameters.
pub(super) fn base_sizes(robot: &Robot) -> Option<String> {
    let analysis = base_of(robot)?;
    let rank = analysis.base.rank();
    Some(format!("{rank} base parameters, {}.", certified(analysis)))
}

/// Whether the base parameters are certified to be the fewest, and which the spec left out.
pub(super) fn certified(analysis: &Analysis) -> String {
    let mut words = if analysis.complete {
        "certified to be minimal".to_owned()
    } else {
        "NOT certified to be minimal".to_owned()
    };
    let parameters = analysis.base.parameters.iter();
    let dropped = parameters.filter(|p| p.dropped).count();
    if dropped > 0 {
        let _ = write!(words, " before `base.drop` left {dropped} out");
    }
    let known = analysis.base.known.len();
    if known > 0 {
        let _ = write!(
            words,
            ", with {} known by `base.zero` and `base.equal`",
            counted(known, "parameter", "parameters")
        );
    }
    words
}

/// The number of a function's operations.
pub(super) fn operations(count: Operations) -> String {
    let Operations {
        add,
        mul,
        div,
        sincos,
        sqrt,
    } = count;
    let roots = match sqrt {
        0 => String::new(),
        1 => ", 1 square root".to_owned(),
        many => format!(", {many} square roots"),
    };
    format!(
        "{add} additions, {mul} multiplications, {div} divisions, {sincos} sines and cosines{roots}."
    )
}
