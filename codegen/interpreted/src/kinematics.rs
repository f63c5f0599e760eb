//! A mechanism and its geometry for calibration: placements as chains of turns and shifts, whose
//! amounts are expressions in the names of `geometry` and errors that a calibration finds.

use nalgebra::{DMatrix, DVector, Matrix3, Rotation3, Vector3};
use regen_calibrate::{
    Amount, Axis, Chain, Coupling, Cut, Geometry, Kinematics, Row, Step, Unit, Unknown,
};
use regen_codegen::model::{self, Model, MotionKind, Side};
use regen_codegen::robot::Robot;
use regen_codegen::spec::edit::{PlacedFrame, Spot};
use regen_codegen::spec::{self, CutKind, CutRow, Expr, Function, JointFrame, Spec};
use regen_codegen::sym::Number;

/// Everything of a mechanism's geometry that can be unknown.
#[derive(Clone, Debug)]
pub struct Described {
    /// The mechanism. Its frames are the named ones, then those of the bodies by their labels.
    pub kinematics: Kinematics,
    /// The constants of `geometry` in their order.
    pub(crate) names: Vec<(String, Expr)>,
    /// The expression of each scalar.
    pub(crate) scalars: Vec<Expr>,
    /// Errors that can be added to scalars, in the order in which they are preferred.
    pub(crate) errors: Vec<PlacementError>,
    /// The scales of the coordinates, then the compliances, which are unknown only where they are named.
    of_joints: Vec<PlacementError>,
    /// The placements that errors belong to.
    owners: Vec<Owner>,
}

/// A placement with errors.
#[derive(Clone, Debug)]
struct Owner {
    name: String,
    holder: Holder,
    chain: Chain,
}

/// Where a description holds the errors of a placement.
#[derive(Clone, Copy, Debug)]
enum Holder {
    /// Before the joint of this name.
    Joint,
    /// At side A or B of the cut with this index.
    Side(usize, usize),
    /// At the named frame.
    Frame,
    /// Nowhere: the frame of a body is that of its joint.
    Body,
}

/// An error of one elementary motion of a placement.
#[derive(Clone, Debug)]
pub(crate) struct PlacementError {
    pub(crate) name: String,
    pub(crate) unit: Unit,
    pub(crate) scalar: usize,
    /// The frame at whose placement it is, for those of frames.
    frame: Option<usize>,
}

/// The unknowns that were chosen of a [`Described`] geometry.
#[derive(Clone, Debug)]
pub struct ChosenGeometry<'a> {
    described: &'a Described,
    unknowns: Vec<Unknown>,
    /// For each unknown, what it is.
    kinds: Vec<Chosen>,
}

#[derive(Clone, Copy, Debug)]
enum Chosen {
    /// The constant of `geometry` with this index.
    Name(usize),
    /// The error of this scalar.
    Error(usize),
}

/// A value with its derivatives by the unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Sloped {
    pub(crate) value: f64,
    slope: DVector<f64>,
}

fn axis(axis: spec::Axis) -> Axis {
    match axis {
        spec::Axis::X => Axis::X,
        spec::Axis::Y => Axis::Y,
        spec::Axis::Z => Axis::Z,
    }
}

fn row(row: CutRow, lead: f64) -> Row {
    match row {
        CutRow::Position(i) => Row::Position(axis(i)),
        CutRow::Axes(i, j) => Row::Axes(axis(i), axis(j)),
        CutRow::Offset(i) => Row::Offset(axis(i)),
        CutRow::Screw => Row::Screw(lead),
    }
}

/// Collects the scalars and errors of chains.
#[derive(Default)]
struct Builder {
    scalars: Vec<Expr>,
    errors: Vec<PlacementError>,
    owners: Vec<Owner>,
}

impl Builder {
    /// A step whose amount is an expression.
    fn step(&mut self, step: &model::Step) -> Step {
        let (turns, along, quantity) = match step {
            model::Step::Rotate(along, quantity) => (true, along, quantity),
            model::Step::Translate(along, quantity) => (false, along, quantity),
        };
        self.scalars.push(quantity.expr.clone());
        Step {
            turns,
            axis: axis(*along),
            amount: Amount::Scalar(self.scalars.len() - 1),
        }
    }

    /// A step that is an error alone.
    fn error_step(&mut self, turns: bool, along: Axis) -> Step {
        self.scalars.push(Expr::Number(Number::zero()));
        Step {
            turns,
            axis: along,
            amount: Amount::Scalar(self.scalars.len() - 1),
        }
    }

    fn note(&mut self, owner: &str, symbol: &str, step: &Step, frame: Option<usize>) {
        if let Amount::Scalar(scalar) = step.amount {
            self.errors.push(PlacementError {
                name: format!("{owner}.{symbol}"),
                unit: if step.turns {
                    Unit::Angle
                } else {
                    Unit::Length
                },
                scalar,
                frame,
            });
        }
    }

    /// A placement with the errors of its end: shifts and turns in the frame that it leads to.
    fn placed(
        &mut self,
        placement: &[model::Step],
        owner: &str,
        frame: Option<usize>,
    ) -> Vec<Step> {
        let mut steps: Vec<Step> = placement.iter().map(|step| self.step(step)).collect();
        for (turns, symbols) in [(false, ["x", "y", "z"]), (true, ["rx", "ry", "rz"])] {
            for (along, symbol) in [Axis::X, Axis::Y, Axis::Z].into_iter().zip(symbols) {
                let step = self.error_step(turns, along);
                self.note(owner, symbol, &step, frame);
                steps.push(step);
            }
        }
        steps
    }

    /// A placement that ends with a modified Denavit-Hartenberg row, with the errors of its four
    /// numbers and of a shift and a turn about y before it, which parallel axes need (Hayati 1983).
    fn placed_by_row(&mut self, placement: &[model::Step], owner: &str) -> Vec<Step> {
        let (before, own) = placement.split_at(placement.len().saturating_sub(4));
        let mut steps: Vec<Step> = before.iter().map(|step| self.step(step)).collect();
        let beside = [(false, "b"), (true, "beta")].map(|(turns, symbol)| {
            let step = self.error_step(turns, Axis::Y);
            steps.push(step);
            (step, symbol)
        });
        for (step, symbol) in own.iter().zip(["alpha", "a", "theta", "d"]) {
            let step = self.step(step);
            self.note(owner, symbol, &step, None);
            steps.push(step);
        }
        for (step, symbol) in &beside {
            self.note(owner, symbol, step, None);
        }
        steps
    }

    fn side(&mut self, side: &Side, owner: &str, holder: Holder) -> Chain {
        let steps = self.placed(&side.placement, owner, None);
        self.own(owner, holder, &steps);
        Chain {
            parent: side.link,
            steps,
        }
    }

    /// Notes what a placement's errors belong to.
    fn own(&mut self, name: &str, holder: Holder, steps: &[Step]) {
        self.owners.push(Owner {
            name: name.to_owned(),
            holder,
            chain: Chain {
                parent: None,
                steps: steps.to_vec(),
            },
        });
    }
}

impl Described {
    /// The geometry of a mechanism; `robot` has its home and its limits.
    pub fn new(spec: &Spec, model: &Model, robot: &Robot) -> Self {
        let mut builder = Builder::default();
        let joints = model::joints_of_coordinates(spec);
        let mut links = Vec::new();
        for link in &model.links {
            let coordinate = link.motion.as_ref().map(|motion| motion.coordinate);
            let mut steps = if link.placement.is_empty() {
                Vec::new()
            } else {
                match coordinate.and_then(|c| Some((c, joints.get(c)?))) {
                    Some((c, joint)) => {
                        let name = owner(&model.coordinates[c].name);
                        let (steps, own) = if matches!(joint.frame, JointFrame::Dh { .. }) {
                            (builder.placed_by_row(&link.placement, name), 4)
                        } else {
                            (builder.placed(&link.placement, name, None), 6)
                        };
                        // what is before the joint's own frame is the limb's base and fixed joints
                        let before = link.placement.len().saturating_sub(own);
                        builder.own(name, Holder::Joint, &steps[before..]);
                        steps
                    }
                    // what is fixed to it has errors of its own
                    None => link
                        .placement
                        .iter()
                        .map(|step| builder.step(step))
                        .collect(),
                }
            };
            if let Some(motion) = &link.motion {
                let along = axis(motion.axis);
                let mut moves = |turns: bool, factor: f64| {
                    steps.push(Step {
                        turns,
                        axis: along,
                        amount: Amount::Coordinate(motion.coordinate, factor),
                    });
                };
                moves(motion.kind == MotionKind::Rotation, 1.0);
                if let Some(lead) = &motion.lead {
                    moves(false, lead.value.to_f64());
                }
            }
            links.push(Chain {
                parent: link.parent,
                steps,
            });
        }
        let cuts = model.cuts.iter().enumerate().map(|(k, cut)| {
            let lead = cut.lead.as_ref().map_or(0.0, |lead| lead.value.to_f64());
            let kind: CutKind = cut.kind;
            let sides = ["a", "b"].map(|side| format!("{}.{side}", cut.name));
            Cut {
                rows: kind.rows().iter().map(|r| row(*r, lead)).collect(),
                sides: [
                    builder.side(&cut.sides[0], &sides[0], Holder::Side(k, 0)),
                    builder.side(&cut.sides[1], &sides[1], Holder::Side(k, 1)),
                ],
            }
        });
        let cuts = cuts.collect();
        let named = model.frames.iter().map(|frame| {
            let side = &frame.side;
            let placement = side.placement.clone();
            (frame.name.clone(), side.link, placement, Holder::Frame)
        });
        let bodies = model.bodies.iter().map(|body| {
            (
                body.label.clone(),
                Some(body.link),
                Vec::new(),
                Holder::Body,
            )
        });
        let frames = named.chain(bodies).enumerate();
        let frames = frames.map(|(k, (name, parent, placement, holder))| {
            let steps = builder.placed(&placement, &name, Some(k));
            builder.own(&name, holder, &steps);
            (name, Chain { parent, steps })
        });
        let frames = frames.collect();
        let couplings = model.couplings.iter().map(|coupling| Coupling {
            key: coupling.key,
            constant: coupling.constant.to_f64(),
            terms: coupling
                .terms
                .iter()
                .map(|(c, factor)| (*c, factor.to_f64()))
                .collect(),
        });
        let geometry = spec.geometry.iter();
        let mut of_joints = Vec::new();
        for (symbol, value) in [("scale", Number::one()), ("compliance", Number::zero())] {
            for (c, coordinate) in model.coordinates.iter().enumerate() {
                builder.scalars.push(Expr::Number(value.clone()));
                let mut motions = model.links.iter().filter_map(|link| link.motion.as_ref());
                let turns =
                    motions.any(|own| own.coordinate == c && own.kind == MotionKind::Rotation);
                of_joints.push(PlacementError {
                    name: format!("{}.{symbol}", coordinate.name),
                    unit: match (symbol, turns) {
                        ("scale", _) => Unit::Plain,
                        (_, true) => Unit::AngleByEffort,
                        (_, false) => Unit::LengthByEffort,
                    },
                    scalar: builder.scalars.len() - 1,
                    frame: None,
                });
            }
        }
        let scalars = |all: &[PlacementError]| all.iter().map(|own| Some(own.scalar)).collect();
        let (scales, compliances) = of_joints.split_at(model.coordinates.len());
        Self {
            kinematics: Kinematics {
                coordinates: robot.coordinates.clone(),
                scalars: builder.scalars.len(),
                links,
                cuts,
                couplings: couplings.collect(),
                frames,
                home: robot.home.clone(),
                scales: scalars(scales),
                compliances: scalars(compliances),
                limits: model.coordinates.iter().map(|c| c.position).collect(),
                gravity: robot.gravity,
            },
            names: geometry
                .map(|(name, quantity)| (name.value.clone(), quantity.expr.clone()))
                .collect(),
            scalars: builder.scalars,
            errors: builder.errors,
            of_joints,
            owners: builder.owners,
        }
    }

    /// The names of everything that can be unknown: the constants of `geometry` that are no
    /// expressions of others, then errors of placements, then the scales and compliances of coordinates.
    pub fn names(&self) -> Vec<&str> {
        let free = self.names.iter().filter(|(_, expr)| is_free(expr));
        let free = free.map(|(name, _)| name.as_str());
        let errors = self.errors.iter().chain(&self.of_joints);
        free.chain(errors.map(|error| error.name.as_str()))
            .collect()
    }

    /// The geometry with every error of placements unknown, of frames those that are observed.
    pub fn with_all_errors(&self, observed: &[usize]) -> ChosenGeometry<'_> {
        let errors = self.errors.iter();
        let errors =
            errors.filter(|error| error.frame.is_none_or(|frame| observed.contains(&frame)));
        self.chosen(errors.map(|error| self.error(error)).collect())
    }

    /// The geometry with these unknowns: names of [`names`](Described::names), or what such names
    /// begin with before a dot, such as `q3` or `tool`, for all of them but scales and compliances. A `*`
    /// stands for any part of a name without a dot.
    ///
    /// # Errors
    /// The first name that is none.
    pub fn with<'n>(&self, wanted: &'n [String]) -> Result<ChosenGeometry<'_>, &'n str> {
        let mut out: Vec<(Unknown, Chosen)> = Vec::new();
        for name in wanted {
            let before = out.len();
            let constants = self.names.iter().enumerate();
            for (k, (own, expr)) in constants {
                if own == name && is_free(expr) {
                    let value = self.evaluate(expr, &[], 0).value;
                    let unit = self.unit_of(own);
                    out.push((unknown(own, unit, value), Chosen::Name(k)));
                }
            }
            for error in &self.errors {
                let mut dots = error.name.match_indices('.');
                if matches(name, &error.name) || dots.any(|(k, _)| matches(name, &error.name[..k]))
                {
                    out.push(self.error(error));
                }
            }
            let of_joints = self.of_joints.iter();
            let of_joints = of_joints.filter(|own| matches(name, &own.name));
            out.extend(of_joints.map(|own| self.error(own)));
            if out.len() == before {
                return Err(name);
            }
        }
        let mut seen: Vec<String> = Vec::new();
        out.retain(|(unknown, _)| {
            let is_new = !seen.contains(&unknown.name);
            seen.push(unknown.name.clone());
            is_new
        });
        Ok(self.chosen(out))
    }

    fn error(&self, error: &PlacementError) -> (Unknown, Chosen) {
        let names: Vec<Sloped> = self.values_of_names(&[], &[]);
        let nominal = self.evaluate(&self.scalars[error.scalar], &names, 0).value;
        (
            unknown(&error.name, error.unit, nominal),
            Chosen::Error(error.scalar),
        )
    }

    fn chosen(&self, chosen: Vec<(Unknown, Chosen)>) -> ChosenGeometry<'_> {
        let (unknowns, kinds) = chosen.into_iter().unzip();
        ChosenGeometry {
            described: self,
            unknowns,
            kinds,
        }
    }

    /// A constant is a length if it enters shifts only, and an angle if it enters turns only.
    fn unit_of(&self, name: &str) -> Unit {
        let chains = self.kinematics.links.iter();
        let sides = self.kinematics.cuts.iter().flat_map(|cut| &cut.sides);
        let frames = self.kinematics.frames.iter().map(|(_, chain)| chain);
        let all = chains.chain(sides).chain(frames);
        let mut found = [false; 2];
        for step in all.flat_map(|chain| &chain.steps) {
            if let Amount::Scalar(k) = step.amount
                && self.depends(&self.scalars[k], name)
            {
                found[usize::from(step.turns)] = true;
            }
        }
        match found {
            [true, false] => Unit::Length,
            [false, true] => Unit::Angle,
            _ => Unit::Plain,
        }
    }

    fn depends(&self, expr: &Expr, name: &str) -> bool {
        match expr {
            Expr::Number(_) | Expr::Pi => false,
            Expr::Name(own) => {
                let mut names = self.names.iter();
                own == name || names.any(|(other, inner)| other == own && self.depends(inner, name))
            }
            Expr::Neg(a) | Expr::Call(_, a) => self.depends(a, name),
            Expr::Add(a, b)
            | Expr::Sub(a, b)
            | Expr::Mul(a, b)
            | Expr::Div(a, b)
            | Expr::Pow(a, b) => self.depends(a, name) || self.depends(b, name),
        }
    }

    /// The constants of `geometry` where some have other values, with derivatives by these.
    fn values_of_names(&self, kinds: &[Chosen], values: &[f64]) -> Vec<Sloped> {
        let mut names: Vec<Sloped> = Vec::new();
        for (k, (_, expr)) in self.names.iter().enumerate() {
            let unknown = kinds
                .iter()
                .position(|kind| matches!(kind, Chosen::Name(own) if *own == k));
            let value = match unknown.zip(unknown.and_then(|at| values.get(at))) {
                Some((at, value)) => {
                    let mut slope = DVector::zeros(kinds.len());
                    slope[at] = 1.0;
                    Sloped {
                        value: *value,
                        slope,
                    }
                }
                None => self.evaluate(expr, &names, kinds.len()),
            };
            names.push(value);
        }
        names
    }

    /// An expression in the constants before it, with derivatives by `width` unknowns.
    pub(crate) fn evaluate(&self, expr: &Expr, names: &[Sloped], width: usize) -> Sloped {
        let constant = |value: f64| Sloped {
            value,
            slope: DVector::zeros(width),
        };
        let of = |expr: &Expr| self.evaluate(expr, names, width);
        match expr {
            Expr::Number(number) => constant(number.to_f64()),
            Expr::Pi => constant(core::f64::consts::PI),
            Expr::Name(name) => {
                let at = self.names.iter().position(|(own, _)| own == name);
                at.and_then(|at| names.get(at))
                    .cloned()
                    .unwrap_or_else(|| constant(f64::NAN))
            }
            Expr::Neg(a) => {
                let a = of(a);
                a.composed(-a.value, -1.0)
            }
            Expr::Add(a, b) => of(a).joined(&of(b), |a, b| a + b, |_, _| (1.0, 1.0)),
            Expr::Sub(a, b) => of(a).joined(&of(b), |a, b| a - b, |_, _| (1.0, -1.0)),
            Expr::Mul(a, b) => of(a).joined(&of(b), |a, b| a * b, |a, b| (b, a)),
            Expr::Div(a, b) => of(a).joined(&of(b), |a, b| a / b, |a, b| (1.0 / b, -a / (b * b))),
            Expr::Pow(a, b) => of(a).joined(&of(b), libm::pow, |a, b| {
                let by_exponent = if a > 0.0 {
                    libm::pow(a, b) * libm::log(a)
                } else {
                    0.0
                };
                (b * libm::pow(a, b - 1.0), by_exponent)
            }),
            Expr::Call(function, a) => {
                let a = of(a);
                let x = a.value;
                let (value, slope) = match function {
                    Function::Sqrt => (libm::sqrt(x), 0.5 / libm::sqrt(x)),
                    Function::Sin => (libm::sin(x), libm::cos(x)),
                    Function::Cos => (libm::cos(x), -libm::sin(x)),
                    Function::Tan => {
                        let tangent = libm::tan(x);
                        (tangent, 1.0 + tangent * tangent)
                    }
                    Function::Deg => (x.to_radians(), 1_f64.to_radians()),
                    Function::Sign => (if x == 0.0 { 0.0 } else { x.signum() }, 0.0),
                    Function::Abs => (x.abs(), x.signum()),
                };
                a.composed(value, slope)
            }
        }
    }
}

/// Whether a name is the one that is wanted, where any part without a dot may stand for its `*`.
fn matches(wanted: &str, name: &str) -> bool {
    match wanted.split_once('*') {
        None => wanted == name,
        Some((before, after)) => {
            let rest = name.strip_prefix(before);
            let part = rest.and_then(|rest| rest.strip_suffix(after));
            part.is_some_and(|part| !part.contains('.'))
        }
    }
}

/// The joint that a coordinate belongs to: `s1` of `s1.2`.
fn owner(coordinate: &str) -> &str {
    coordinate
        .split_once('.')
        .map_or(coordinate, |(joint, _)| joint)
}

pub(crate) fn is_free(expr: &Expr) -> bool {
    match expr {
        Expr::Number(_) | Expr::Pi => true,
        Expr::Name(_) => false,
        Expr::Neg(a) | Expr::Call(_, a) => is_free(a),
        Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) | Expr::Div(a, b) | Expr::Pow(a, b) => {
            is_free(a) && is_free(b)
        }
    }
}

fn unknown(name: &str, unit: Unit, nominal: f64) -> Unknown {
    Unknown {
        name: name.to_owned(),
        unit,
        nominal,
    }
}

impl Sloped {
    fn composed(&self, value: f64, slope: f64) -> Self {
        Self {
            value,
            // a slope that is infinite where nothing changes is none
            slope: self
                .slope
                .map(|own| if own == 0.0 { 0.0 } else { slope * own }),
        }
    }

    fn joined(
        &self,
        other: &Self,
        value: impl Fn(f64, f64) -> f64,
        slopes: impl Fn(f64, f64) -> (f64, f64),
    ) -> Self {
        let (left, right) = slopes(self.value, other.value);
        let left = self.composed(0.0, left).slope;
        Self {
            value: value(self.value, other.value),
            slope: left + other.composed(0.0, right).slope,
        }
    }
}

/// A placement as x, y, z and roll, pitch, yaw with R = Rz(y) Ry(p) Rx(r).
fn pose(axes: Matrix3<f64>, point: Vector3<f64>) -> [f64; 6] {
    let (roll, pitch, yaw) = Rotation3::from_matrix_unchecked(axes).euler_angles();
    // rounding errors of what is zero
    [point.x, point.y, point.z, roll, pitch, yaw].map(|x| if x.abs() < 1e-15 { 0.0 } else { x })
}

impl ChosenGeometry<'_> {
    /// The placements whose errors are not zero at values of the unknowns, as a description holds them.
    ///
    /// Returned with the names of unknowns that it cannot hold.
    pub fn placements(&self, values: &[f64]) -> (Vec<PlacedFrame>, Vec<&str>) {
        let described = self.described;
        let mut without = values.to_vec();
        let mut unheld = Vec::new();
        for (k, kind) in self.kinds.iter().enumerate() {
            let (Chosen::Error(scalar), unknown) = (kind, &self.unknowns[k]) else {
                continue;
            };
            let is_changed = values
                .get(k)
                .is_some_and(|value| (value - unknown.nominal).abs() > 0.0);
            let of_body = described
                .owners
                .iter()
                .filter(|own| matches!(own.holder, Holder::Body));
            let mut steps = of_body.flat_map(|own| &own.chain.steps);
            let is_unheld = described.of_joints.iter().any(|own| own.scalar == *scalar)
                || steps.any(|step| step.amount == Amount::Scalar(*scalar));
            if is_changed && is_unheld {
                unheld.push(unknown.name.as_str());
            }
            if let Some(own) = without.get_mut(k) {
                *own = unknown.nominal;
            }
        }
        let [own, other] = [values, &without].map(|values| {
            let all = self.evaluated(values);
            all.iter().map(|scalar| scalar.value).collect::<Vec<f64>>()
        });
        let mut out = Vec::new();
        for owner in &described.owners {
            let along = |scalars| described.kinematics.along(&[], &owner.chain, scalars, &[]);
            let (new, old) = (along(&own), along(&other));
            if new.axes == old.axes && new.point == old.point {
                continue;
            }
            let spot = match owner.holder {
                Holder::Joint => Spot::Before(owner.name.clone()),
                Holder::Side(cut, side) => Spot::Side(cut, side),
                Holder::Frame => Spot::Frame(owner.name.clone()),
                Holder::Body => continue,
            };
            let at = if matches!(owner.holder, Holder::Joint) {
                // what comes before the frame and leads to the new one
                let axes = new.axes * old.axes.transpose();
                pose(axes, new.point - axes * old.point)
            } else {
                pose(new.axes, new.point)
            };
            out.push(PlacedFrame { spot, at });
        }
        (out, unheld)
    }

    fn evaluated(&self, values: &[f64]) -> Vec<Sloped> {
        let width = self.kinds.len();
        let names = self.described.values_of_names(&self.kinds, values);
        let scalars = self.described.scalars.iter();
        let mut out: Vec<Sloped> = scalars
            .map(|expr| self.described.evaluate(expr, &names, width))
            .collect();
        for (k, kind) in self.kinds.iter().enumerate() {
            if let (Chosen::Error(scalar), Some(value)) = (kind, values.get(k)) {
                // the unknown is the value with the error
                out[*scalar].value += value - self.unknowns[k].nominal;
                out[*scalar].slope[k] += 1.0;
            }
        }
        out
    }

    /// The names of `geometry` among the unknowns, with their places.
    pub fn constants(&self) -> impl Iterator<Item = (usize, &str)> {
        let kinds = self.kinds.iter().enumerate();
        kinds.filter_map(|(k, kind)| match kind {
            Chosen::Name(name) => Some((k, self.described.names[*name].0.as_str())),
            Chosen::Error(_) => None,
        })
    }
}

impl Geometry for ChosenGeometry<'_> {
    fn unknowns(&self) -> &[Unknown] {
        &self.unknowns
    }

    fn scalars(&self, values: &[f64]) -> Option<Vec<f64>> {
        let scalars: Vec<f64> = self.evaluated(values).iter().map(|s| s.value).collect();
        scalars.iter().all(|x| x.is_finite()).then_some(scalars)
    }

    fn slopes(&self, values: &[f64]) -> DMatrix<f64> {
        let all = self.evaluated(values);
        DMatrix::from_fn(all.len(), self.kinds.len(), |i, k| all[i].slope[k])
    }
}
