//! Solves closed states from the independent coordinates.

use regen_runtime::{LoopClosure, Outcome};

use crate::exit::Failure;
use regen_identify::files::MotionState;
use regen_interpreted::Interpreted;

/// Solves the loop closure for the dependent coordinates, velocities and accelerations, given those
/// of the independent ones; the inner error says why the loops do not close.
pub(crate) fn close(
    closure: &mut LoopClosure<'_, Interpreted<'_>>,
    independent: &MotionState,
) -> Result<Result<MotionState, String>, Failure> {
    let MotionState { q, qd, qdd } = independent;
    let state = closure.solve_state(q, qd, qdd)?;
    Ok(match state.outcome {
        Outcome::Closed => Ok(MotionState {
            q: state.q,
            qd: state.qd,
            qdd: state.qdd,
        }),
        other => Err(reason(other)),
    })
}

/// Describes why a state is not closed.
pub(crate) fn reason(outcome: Outcome) -> String {
    let percent = |at: f64| format!("{:.0} % of the way from home", 100.0 * at);
    match outcome {
        Outcome::Closed => "closed".to_owned(),
        Outcome::NotClosed { at, residual } => {
            format!(
                "the loops cannot be closed at {} (residual {residual:.1e})",
                percent(at)
            )
        }
        Outcome::Singular { at, condition } => format!(
            "a singularity lies at {} (pivot {:.1e})",
            percent(at),
            condition.pivot
        ),
        Outcome::BranchLost { at } => format!("the assembly branch is lost at {}", percent(at)),
    }
}
