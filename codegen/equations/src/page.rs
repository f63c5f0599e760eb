//! A page of equations: a robot's function as expressions, with the names of its inputs and
//! entries.

use std::error::Error;
use std::fmt;

use regen_codegen::base::Base;
use regen_codegen::base::latex::parameter;
use regen_codegen::robot::{FunctionKind, Robot};
use regen_codegen::signature::GEOMETRY;

use crate::graph::{Graph, Id, Node};
use crate::latex::{self, symbol};
use crate::names::Names;
use crate::{load, sympy, text};

/// The equations or the matrix that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EquationSet {
    /// The closure equations f(q) (Eq. 6).
    Closure,
    /// Their Jacobian A (Eq. 7).
    Jacobian,
    /// X, with qd_e = -X qd_i (Eq. 10).
    X,
    /// The regressor W (Eq. 11), or that of the base parameters (Eq. 23).
    Regressor,
    /// The efforts of the independent coordinates.
    Dynamics,
    /// The mass matrix M over the independent coordinates.
    Mass,
    /// The matrix C of Coriolis and centrifugal efforts.
    Coriolis,
    /// The efforts g of gravity, springs and offsets.
    Gravity,
    /// The Jacobians J of the frames that the description names.
    Frames,
}

/// The parameters in which the regressor, the efforts and their parts are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parameters {
    /// The parameters of all bodies and joints.
    All,
    /// The base parameters.
    Base,
}

/// The language of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Plain text.
    Text,
    /// LaTeX for a document with `amsmath`.
    Latex,
    /// A Python script for SymPy.
    Sympy,
}

/// The robot does not have what was asked for: no loops, no named frames, or no base parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MissingFunction(pub FunctionKind);

impl fmt::Display for MissingFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            FunctionKind::Constraints | FunctionKind::Jacobian | FunctionKind::Velocities => {
                write!(
                    f,
                    "the robot has no loops, so that there is nothing to close"
                )
            }
            FunctionKind::FrameJacobian => {
                write!(f, "the spec names no frames (key `frames`)")
            }
            other => write!(f, "the robot has no function `{}`", other.name()),
        }
    }
}

impl Error for MissingFunction {}

/// The function that [`equations`] needs the robot to have.
fn kind(of: EquationSet, parameters: Parameters) -> FunctionKind {
    match (of, parameters) {
        (EquationSet::Closure, _) => FunctionKind::Constraints,
        (EquationSet::Jacobian, _) => FunctionKind::Jacobian,
        (EquationSet::X, _) => FunctionKind::Velocities,
        (EquationSet::Regressor, Parameters::All) => FunctionKind::Regressor,
        (EquationSet::Regressor, Parameters::Base) => FunctionKind::BaseRegressor,
        (EquationSet::Dynamics, Parameters::All) => FunctionKind::InverseDynamics,
        (EquationSet::Dynamics, Parameters::Base) => FunctionKind::BaseInverseDynamics,
        (EquationSet::Mass, Parameters::All) => FunctionKind::MassMatrix,
        (EquationSet::Mass, Parameters::Base) => FunctionKind::BaseMassMatrix,
        (EquationSet::Gravity, Parameters::All) => FunctionKind::Gravity,
        (EquationSet::Gravity, Parameters::Base) => FunctionKind::BaseGravity,
        (EquationSet::Coriolis, _) => FunctionKind::CoriolisMatrix,
        (EquationSet::Frames, _) => FunctionKind::FrameJacobian,
    }
}

/// The functions with which the robot of [`equations`] is derived; the first one is written.
pub fn kinds(of: EquationSet, parameters: Parameters) -> Vec<FunctionKind> {
    let mut kinds = vec![kind(of, parameters)];
    // there is no function of C in base parameters: their combinations are put into that of all
    if (of, parameters) == (EquationSet::Coriolis, Parameters::Base) {
        kinds.push(FunctionKind::ToBase);
    }
    kinds
}

/// Writes equations of a robot, with the names of the geometry that its functions take as arguments
/// ([`Mechanism::robot_in_names`](regen_codegen::Mechanism::robot_in_names)).
///
/// # Errors
/// When the robot does not have the functions, see [`kinds`]; a robot without dependent coordinates
/// has no X.
pub fn equations(
    robot: &Robot,
    of: EquationSet,
    parameters: Parameters,
    style: Style,
) -> Result<String, MissingFunction> {
    let page = Page::new(robot, of, parameters)?;
    Ok(match style {
        Style::Text => text::write(&page),
        Style::Latex => latex::write(&page),
        Style::Sympy => sympy::write(&page),
    })
}

/// The names of an element of an argument.
#[derive(Clone, Debug)]
pub(crate) struct Input {
    pub(crate) text: String,
    pub(crate) latex: String,
}

/// An entry that is not zero at every state, by its row and column from 1; in a vector by its row.
pub(crate) struct Entry {
    pub(crate) index: Vec<usize>,
    pub(crate) id: Id,
}

/// A function as expressions.
pub(crate) struct Page<'p> {
    pub(crate) robot: &'p Robot,
    pub(crate) graph: Graph,
    pub(crate) names: Names,
    pub(crate) heading: String,
    pub(crate) letter: &'static str,
    /// Rows and columns; one column for a vector.
    pub(crate) shape: (usize, usize),
    /// The names of arguments, and of their elements.
    pub(crate) arguments: Vec<String>,
    pub(crate) inputs: Vec<Vec<Input>>,
    /// The place of the argument with the names of the geometry.
    pub(crate) geometry: Option<usize>,
    /// The entries, row by row.
    values: Vec<Id>,
    of: EquationSet,
    parameters: Parameters,
}

impl<'p> Page<'p> {
    fn new(
        robot: &'p Robot,
        of: EquationSet,
        parameters: Parameters,
    ) -> Result<Self, MissingFunction> {
        let kind = kind(of, parameters);
        let function = robot.function(kind).ok_or(MissingFunction(kind))?;
        let program = &function.program;
        if of == EquationSet::X && robot.dependent.is_empty() {
            return Err(MissingFunction(kind));
        }
        let mut graph = Graph::default();
        let (dof, n) = (robot.independent.len(), robot.coordinates.len());
        let arguments = program.arguments.iter();
        let mut arguments: Vec<(String, usize)> =
            arguments.map(|a| (a.name.clone(), a.len)).collect();
        let mut phi = None;
        if (of, parameters) == (EquationSet::Coriolis, Parameters::Base) {
            let at = arguments.iter().position(|(name, _)| name == "phi");
            let analysis = robot.analysis.as_ref();
            let missing = MissingFunction(FunctionKind::ToBase);
            let (at, analysis) = at.zip(analysis).ok_or(missing)?;
            let (count, values) = phi_of_base(&mut graph, robot, &analysis.base, at);
            arguments[at] = ("beta".to_owned(), count);
            phi = Some((at, values));
        }
        let parameter = |_: &mut Graph, argument: usize, element: usize| {
            let (at, values) = phi.as_ref()?;
            (*at == argument).then(|| values[element])
        };
        let (values, shape) = match of {
            EquationSet::X => {
                // column k holds the velocities for a unit velocity of independent coordinate k
                let mut columns = Vec::new();
                for k in 0..dof {
                    let unit = |g: &mut Graph, argument: usize, element: usize| {
                        let value = if element == k { 1.0 } else { 0.0 };
                        (argument == 1).then(|| g.constant(value))
                    };
                    columns.push(load::outputs(&mut graph, program, &unit));
                }
                let mut values = Vec::new();
                for row in &robot.dependent {
                    for column in &columns {
                        values.push(graph.neg(column[*row]));
                    }
                }
                (values, (robot.dependent.len(), dof))
            }
            EquationSet::Closure | EquationSet::Dynamics | EquationSet::Gravity => {
                let values = load::outputs(&mut graph, program, &parameter);
                let rows = values.len();
                (values, (rows, 1))
            }
            EquationSet::Jacobian => (
                load::outputs(&mut graph, program, &parameter),
                (robot.rows, n),
            ),
            EquationSet::Mass | EquationSet::Coriolis | EquationSet::Frames => {
                let values = load::outputs(&mut graph, program, &parameter);
                let rows = values.len() / dof.max(1);
                (values, (rows, dof))
            }
            EquationSet::Regressor => {
                let stored = load::outputs(&mut graph, program, &parameter);
                // columns are stored one after the other
                let columns = stored.len() / dof.max(1);
                let by_rows = (0..dof).flat_map(|r| (0..columns).map(move |c| c * dof + r));
                (by_rows.map(|at| stored[at]).collect(), (dof, columns))
            }
        };
        let is_coordinate = |node: Node| match node {
            Node::Input {
                argument: 0,
                element,
            } => robot.coordinates.get(element).cloned(),
            _ => None,
        };
        let names = Names::new(&graph, &values, &is_coordinate);
        let inputs = arguments
            .iter()
            .map(|(name, len)| inputs(robot, name, *len))
            .collect();
        let mut all = arguments.iter();
        let geometry = all.position(|(name, _)| name == GEOMETRY.name);
        Ok(Self {
            robot,
            geometry,
            names,
            heading: heading(of, parameters),
            letter: match of {
                EquationSet::Closure => "f",
                EquationSet::Jacobian => "A",
                EquationSet::X => "X",
                EquationSet::Regressor => "W",
                EquationSet::Dynamics => "tau",
                EquationSet::Mass => "M",
                EquationSet::Coriolis => "C",
                EquationSet::Gravity => "g",
                EquationSet::Frames => "J",
            },
            shape,
            arguments: arguments.into_iter().map(|(name, _)| name).collect(),
            inputs,
            values,
            of,
            parameters,
            graph,
        })
    }

    /// The entries that are not zero at every state.
    pub(crate) fn entries(&self) -> impl Iterator<Item = Entry> {
        let columns = self.shape.1.max(1);
        let all = self.values.iter().enumerate();
        all.filter(|(_, id)| self.graph.number(**id) != Some(0.0))
            .map(move |(at, id)| Entry {
                index: if self.is_vector() {
                    vec![at + 1]
                } else {
                    vec![at / columns + 1, at % columns + 1]
                },
                id: *id,
            })
    }

    fn is_vector(&self) -> bool {
        matches!(
            self.of,
            EquationSet::Closure | EquationSet::Dynamics | EquationSet::Gravity
        )
    }

    /// Whether entries are zero at every state.
    pub(crate) fn has_zeros(&self) -> bool {
        self.entries().count() < self.values.len()
    }

    /// Whether the elements of an argument are not symbols: X is written for unit velocities.
    pub(crate) fn is_given(&self, argument: usize) -> bool {
        self.of == EquationSet::X && argument == 1
    }

    /// The names of the geometry that occur, with their values.
    pub(crate) fn used_lengths(&self) -> impl Iterator<Item = (&str, f64)> {
        let all = self.robot.adjustable.iter().enumerate();
        all.filter(move |(element, _)| {
            let element = *element;
            self.geometry.is_some_and(|argument| {
                self.graph.find(Node::Input { argument, element }).is_some()
            })
        })
        .map(|(_, (name, value))| (name.as_str(), *value))
    }

    /// What rows and columns are.
    pub(crate) fn captions(&self) -> Vec<String> {
        let robot = self.robot;
        let of = |which: &[usize]| -> String {
            let names = which.iter().map(|k| robot.coordinates[*k].as_str());
            names.collect::<Vec<_>>().join(", ")
        };
        let independent = of(&robot.independent);
        let cuts = || {
            let each = robot.cuts.iter();
            let rows = each.map(|cut| format!("{} of {}", cut.rows, cut.name));
            rows.collect::<Vec<_>>().join(", ")
        };
        let mut captions = match self.of {
            EquationSet::Closure => vec![format!("rows: {}, then couplings", cuts())],
            EquationSet::Jacobian => vec![
                format!("rows: {}, then couplings", cuts()),
                format!("columns: {}", robot.coordinates.join(", ")),
            ],
            EquationSet::X => vec![
                format!("rows: {}", of(&robot.dependent)),
                format!("columns: {independent}"),
            ],
            EquationSet::Regressor => vec![
                format!("rows: {independent}"),
                format!("columns: {}", self.parameter_labels().join(", ")),
            ],
            EquationSet::Mass | EquationSet::Coriolis => {
                vec![format!("rows and columns: {independent}")]
            }
            EquationSet::Frames => vec![
                format!(
                    "rows: velocity (3) and angular velocity (3) of {}",
                    robot.frames.join(", ")
                ),
                format!("columns: {independent}"),
            ],
            EquationSet::Dynamics | EquationSet::Gravity => vec![format!("rows: {independent}")],
        };
        // a regressor has them as columns
        if self.arguments.iter().any(|name| name == "beta") {
            captions.push(format!("beta: {}", self.parameter_labels().join(", ")));
        }
        captions
    }

    /// The labels of the parameters.
    fn parameter_labels(&self) -> Vec<String> {
        let label = |column: usize| {
            let parameter = self.robot.parameters.get(column);
            parameter.map_or_else(String::new, |p| p.label.clone())
        };
        match self.parameters {
            Parameters::All => (0..self.robot.parameters.len()).map(label).collect(),
            Parameters::Base => {
                let analyses = self.robot.analysis.iter();
                let base = analyses.flat_map(|a| &a.base.parameters);
                let kept = base.filter(|p| !p.dropped);
                kept.map(|p| {
                    p.terms
                        .first()
                        .map_or_else(String::new, |t| label(t.column))
                })
                .collect()
            }
        }
    }
}

/// All parameters as expressions of the base parameters, which are argument `at`, and their number: the
/// eliminated ones are zero.
fn phi_of_base(g: &mut Graph, robot: &Robot, base: &Base, at: usize) -> (usize, Vec<Id>) {
    let mut phi = vec![g.constant(0.0); robot.parameters.len()];
    let mut count = 0;
    for kept in base.parameters.iter().filter(|p| !p.dropped) {
        phi[kept.column] = g.input(at, count);
        count += 1;
    }
    for known in &base.known {
        let mut sum = g.constant(0.0);
        for term in &known.terms {
            let factor = g.constant(term.value.to_f64());
            let product = g.mul(factor, phi[term.column]);
            sum = g.add(sum, product);
        }
        phi[known.column] = sum;
    }
    (count, phi)
}

fn heading(of: EquationSet, parameters: Parameters) -> String {
    let text = match of {
        EquationSet::Closure => "the closure equations f(q) = 0 (Eq. 6)",
        EquationSet::Jacobian => "the Jacobian A = df/dq of the closure equations (Eq. 7)",
        EquationSet::X => "X, with qd_e = -X qd_i (Eq. 10)",
        EquationSet::Regressor if parameters == Parameters::All => {
            "the regressor W, with tau = W phi (Eq. 11)"
        }
        EquationSet::Regressor => {
            "the regressor W of the base parameters, with tau = W beta (Eq. 23)"
        }
        EquationSet::Dynamics => "the efforts tau",
        EquationSet::Mass => "the mass matrix M",
        EquationSet::Coriolis => "the matrix C of the Coriolis and centrifugal efforts C qd_i",
        EquationSet::Gravity => "the efforts g of gravity, springs and offsets",
        EquationSet::Frames => "the Jacobians J of the named frames, with velocities J qd_i",
    };
    match (of, parameters) {
        (
            EquationSet::Dynamics
            | EquationSet::Mass
            | EquationSet::Coriolis
            | EquationSet::Gravity,
            _,
        ) => {
            let source = match parameters {
                Parameters::All => "the parameters of all bodies",
                Parameters::Base => "the base parameters beta",
            };
            format!("{text} from {source}")
        }
        _ => text.to_owned(),
    }
}

/// The names of an argument's elements.
fn inputs(robot: &Robot, argument: &str, count: usize) -> Vec<Input> {
    let coordinate = |k: usize, before: &str, accent: &str| {
        let name = robot.coordinates.get(k).map_or("", String::as_str);
        Input {
            text: format!("{before}{name}"),
            latex: symbol(name, accent),
        }
    };
    let each = |k: usize| match argument {
        "q" => coordinate(k, "", ""),
        "qd" => coordinate(k, "d", "dot"),
        "qdd" => coordinate(k, "dd", "ddot"),
        "phi" => Input {
            text: robot
                .parameters
                .get(k)
                .map_or_else(String::new, |p| p.label.clone()),
            latex: robot.parameters.get(k).map_or_else(String::new, parameter),
        },
        name if name == GEOMETRY.name => {
            let name = robot
                .adjustable
                .get(k)
                .map_or("", |(name, _)| name.as_str());
            Input {
                text: name.to_owned(),
                latex: symbol(name, ""),
            }
        }
        other => Input {
            text: format!("{other}_{}", k + 1),
            latex: format!("\\{other}_{{{}}}", k + 1),
        },
    };
    (0..count).map(each).collect()
}
