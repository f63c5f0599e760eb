//! `regen equations`: equations with named terms.

use regen_equations::{EquationSet, Parameters, Style, equations, kinds};

use crate::args::{EquationsArgs, OfArg, ParametersArg, StyleArg};
use crate::exit::Failure;
use crate::{load, terminal};

/// Runs the command.
pub(crate) fn run(args: &EquationsArgs) -> Result<(), Failure> {
    let source = load::source(&args.file)?;
    let mechanism = load::mechanism(&source)?;
    let has_loops = !mechanism.robot(&[])?.dependent.is_empty();
    let default = if has_loops {
        OfArg::Closure
    } else {
        OfArg::Dynamics
    };
    if !has_loops && matches!(args.of, Some(OfArg::Closure | OfArg::Jacobian | OfArg::X)) {
        return Err(Failure::Input(format!(
            "{}: the robot has no loops, so that there is nothing to close: --of regressor, dynamics, mass, coriolis or gravity",
            args.file.display()
        )));
    }
    if has_loops && args.of.is_none() && args.parameters.is_some() {
        let text = "--parameters has no effect here: without --of, the equations of a robot with loops are \
                    those of closure, which have no dynamic parameters";
        return Err(Failure::Usage(text.to_owned()));
    }
    let of = match args.of.unwrap_or(default) {
        OfArg::Closure => EquationSet::Closure,
        OfArg::Jacobian => EquationSet::Jacobian,
        OfArg::X => EquationSet::X,
        OfArg::Regressor => EquationSet::Regressor,
        OfArg::Dynamics => EquationSet::Dynamics,
        OfArg::Mass => EquationSet::Mass,
        OfArg::Coriolis => EquationSet::Coriolis,
        OfArg::Gravity => EquationSet::Gravity,
        OfArg::Frames => EquationSet::Frames,
    };
    let parameters = match args.parameters {
        None | Some(ParametersArg::All) => Parameters::All,
        Some(ParametersArg::Base) => Parameters::Base,
    };
    let style = match args.format {
        StyleArg::Text => Style::Text,
        StyleArg::Latex => Style::Latex,
        StyleArg::Sympy => Style::Sympy,
    };
    if parameters == Parameters::Base {
        load::analysis(&mechanism, &source)?;
    }
    let robot = mechanism.robot_in_names(&kinds(of, parameters))?;
    let text = equations(&robot, of, parameters, style)
        .map_err(|missing| Failure::Input(format!("{}: {missing}", args.file.display())))?;
    terminal::print(&text)
}
