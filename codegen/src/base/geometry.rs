//! The geometry as elements of the field: lengths from their expressions, frames from their
//! placement steps, and the transformation of twists and parameters between frames.

use std::collections::BTreeSet;

use crate::model::{Model, Placement, Step};
use crate::spec::{Axis, Expr, Function, Quantity, Spec};
use crate::sym::Number;

use super::Coefficient;
use super::coupled;
use super::field::{Element, Field, Variable};
use super::known;
use super::linkage::Linkage;

/// A vector of three elements.
pub(super) type E3 = [Element; 3];
/// A rotation matrix, row by row.
pub(super) type Rotation = [E3; 3];

/// The geometry names as elements: a name defined by other names becomes their expression, any
/// other name a variable.
#[derive(Clone, Debug, Default)]
pub(super) struct Names {
    all: Vec<(String, Element)>,
}

impl Names {
    pub(super) fn new(field: &mut Field, spec: &Spec) -> Self {
        let mut names = Names::default();
        if field.has_named_angles() {
            // all names come first, then the sines and cosines, whatever the order of expressions
            for (name, quantity) in &spec.geometry {
                if !mentions_names(&quantity.expr) {
                    let variable = Variable::Name(name.value.clone());
                    field.variable(variable, quantity.value.clone());
                }
            }
            field.add_units();
        }
        for (name, quantity) in &spec.geometry {
            let element = if mentions_names(&quantity.expr) {
                names.element(field, quantity)
            } else {
                field.variable(Variable::Name(name.value.clone()), quantity.value.clone())
            };
            names.all.push((name.value.clone(), element));
        }
        names
    }

    /// The element of a quantity of the spec.
    pub(super) fn element(&self, field: &mut Field, quantity: &Quantity) -> Element {
        self.read(field, &quantity.expr).unwrap_or_else(|| {
            let value = quantity.value.clone();
            if mentions_names(&quantity.expr) {
                return Element::without_form(value);
            }
            field.variable(Variable::Written((&quantity.value).into()), value)
        })
    }

    /// Sine and cosine of an angle of the spec.
    pub(super) fn sin_cos(&self, field: &mut Field, angle: &Quantity) -> (Element, Element) {
        if !mentions_names(&angle.expr) {
            return field.sin_cos(&angle.value);
        }
        let element = self.element(field, angle);
        field.sin_cos_of(&element)
    }

    fn read(&self, field: &mut Field, expr: &Expr) -> Option<Element> {
        Some(match expr {
            Expr::Number(n) => constant(field, n),
            Expr::Pi => Element::exact(Number::pi()),
            Expr::Name(name) => self.all.iter().find(|(n, _)| n == name)?.1.clone(),
            Expr::Neg(a) => self.read(field, a)?.neg(),
            Expr::Add(a, b) => {
                let (a, b) = (self.read(field, a)?, self.read(field, b)?);
                field.add(&a, &b)
            }
            Expr::Sub(a, b) => {
                let (a, b) = (self.read(field, a)?, self.read(field, b)?);
                field.sub(&a, &b)
            }
            Expr::Mul(a, b) => {
                let (a, b) = (self.read(field, a)?, self.read(field, b)?);
                field.mul(&a, &b)
            }
            Expr::Div(a, b) => {
                let (a, b) = (self.read(field, a)?, self.read(field, b)?);
                field.div(&a, &b)?
            }
            Expr::Pow(a, b) => {
                let (a, b) = (self.read(field, a)?, self.read(field, b)?);
                let Some(exponent) = b.value().as_i64() else {
                    let root = a.value().sqrt()?;
                    return Some(written(field, Function::Sqrt, &a, root));
                };
                let mut power = Element::one();
                for _ in 0..u8::try_from(exponent.unsigned_abs()).ok()? {
                    power = field.mul(&power, &a);
                }
                if exponent < 0 {
                    power = field.div(&Element::one(), &power)?;
                }
                power
            }
            Expr::Call(function, a) => {
                let a = self.read(field, a)?;
                match function {
                    Function::Sqrt => {
                        let value = a.value().sqrt()?;
                        written(field, Function::Sqrt, &a, value)
                    }
                    // the same variables as in a placement
                    Function::Sin => field.sin_cos_of(&a).0,
                    Function::Cos => field.sin_cos_of(&a).1,
                    Function::Tan if a.weight() == 0 => {
                        let value = a.value().tan()?;
                        written(field, Function::Tan, &a, value)
                    }
                    Function::Tan => {
                        let (sin, cos) = field.sin_cos_of(&a);
                        field.div(&sin, &cos)?
                    }
                    // only effort terms call these, and no combination reads their factors
                    Function::Sign | Function::Abs => return None,
                    Function::Deg => {
                        let factor = Number::pi().div(&Number::from_i64(180))?;
                        field.mul(&a, &Element::exact(factor))
                    }
                }
            }
        })
    }
}

/// The names on which angles of a mechanism depend, and arguments of sines in its spec; with a name,
/// those that define it.
pub fn angle_names(spec: &Spec, model: &Model) -> BTreeSet<String> {
    fn add(expr: &Expr, is_angle: bool, found: &mut BTreeSet<String>) {
        match expr {
            Expr::Number(_) | Expr::Pi => {}
            Expr::Name(name) => {
                if is_angle {
                    found.insert(name.clone());
                }
            }
            Expr::Call(Function::Sin | Function::Cos | Function::Tan, a) => add(a, true, found),
            Expr::Neg(a) | Expr::Call(_, a) => add(a, is_angle, found),
            Expr::Add(a, b)
            | Expr::Sub(a, b)
            | Expr::Mul(a, b)
            | Expr::Div(a, b)
            | Expr::Pow(a, b) => {
                add(a, is_angle, found);
                add(b, is_angle, found);
            }
        }
    }
    let mut found = BTreeSet::new();
    let mut lengths: Vec<&Quantity> = model.gravity.iter().collect();
    let links = model.links.iter();
    lengths.extend(
        links
            .clone()
            .filter_map(|link| link.motion.as_ref()?.lead.as_ref()),
    );
    lengths.extend(model.cuts.iter().filter_map(|cut| cut.lead.as_ref()));
    let forms = spec
        .base
        .zero
        .iter()
        .chain(spec.couplings.iter().map(|c| &c.1));
    lengths.extend(forms.flat_map(|form| form.terms.iter().map(|term| &term.1)));
    let sides = model.cuts.iter().flat_map(|cut| &cut.sides);
    let placements = links.map(|link| &link.placement);
    for step in placements.chain(sides.map(|s| &s.placement)).flatten() {
        match step {
            Step::Rotate(_, angle) => add(&angle.expr, true, &mut found),
            Step::Translate(_, length) => lengths.push(length),
        }
    }
    lengths.extend(spec.geometry.iter().map(|(_, quantity)| quantity));
    for quantity in lengths {
        add(&quantity.expr, false, &mut found);
    }
    // a name is defined by earlier ones only
    for (name, quantity) in spec.geometry.iter().rev() {
        if found.contains(&name.value) {
            add(&quantity.expr, true, &mut found);
        }
    }
    found
}

/// The field of a mechanism's geometry.
pub(super) fn field(spec: &Spec, model: &Model) -> Field {
    if angle_names(spec, model).is_empty() {
        return Field::default();
    }
    Field::with_units_of(|field| {
        let linkage = Linkage::new(field, spec, model);
        coupled::null_directions(field, &linkage, model);
        known::substitutions(field, spec, model);
    })
}

pub(super) fn mentions_names(expr: &Expr) -> bool {
    match expr {
        Expr::Number(_) | Expr::Pi => false,
        Expr::Name(_) => true,
        Expr::Neg(a) | Expr::Call(_, a) => mentions_names(a),
        Expr::Add(a, b) | Expr::Sub(a, b) | Expr::Mul(a, b) | Expr::Div(a, b) | Expr::Pow(a, b) => {
            mentions_names(a) || mentions_names(b)
        }
    }
}

fn constant(field: &mut Field, value: &Number) -> Element {
    if value.is_exact() {
        return Element::exact(value.clone());
    }
    field.variable(Variable::Written(value.into()), value.clone())
}

/// The value of a function: an exact constant if possible, else a variable printed as the function
/// call.
fn written(field: &mut Field, function: Function, argument: &Element, value: Number) -> Element {
    if argument.weight() == 0 && value.is_exact() {
        return Element::exact(value);
    }
    let call = Coefficient::call(function, field.coefficient(argument));
    field.variable(Variable::Written(call), value)
}

/// A constant change of frame: rotation and offset of the child's frame in the parent's.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    pub(super) rotation: Rotation,
    pub(super) offset: E3,
}

fn unit(i: usize) -> E3 {
    let mut v = zero3();
    v[i] = Element::one();
    v
}

fn zero3() -> E3 {
    [Element::zero(), Element::zero(), Element::zero()]
}

impl Field {
    pub(super) fn dot(&mut self, a: &[Element], b: &[Element]) -> Element {
        let mut sum = Element::zero();
        for (x, y) in a.iter().zip(b) {
            if !x.is_zero() && !y.is_zero() {
                let product = self.mul(x, y);
                sum = self.add(&sum, &product);
            }
        }
        sum
    }

    pub(super) fn cross(&mut self, a: &E3, b: &E3) -> E3 {
        let mut component = |i: usize, j: usize| {
            let (l, r) = (self.mul(&a[i], &b[j]), self.mul(&a[j], &b[i]));
            self.sub(&l, &r)
        };
        [component(1, 2), component(2, 0), component(0, 1)]
    }

    pub(super) fn add3(&mut self, a: &E3, b: &E3) -> E3 {
        [
            self.add(&a[0], &b[0]),
            self.add(&a[1], &b[1]),
            self.add(&a[2], &b[2]),
        ]
    }
}

impl Placed {
    pub(super) fn identity() -> Self {
        Placed {
            rotation: [unit(0), unit(1), unit(2)],
            offset: zero3(),
        }
    }

    /// The frame that the placement steps of the spec describe.
    pub(super) fn new(field: &mut Field, names: &Names, placement: &Placement) -> Self {
        let mut placed = Placed::identity();
        for step in placement {
            match step {
                Step::Translate(axis, quantity) => {
                    let length = names.element(field, quantity);
                    if length.is_zero() {
                        continue;
                    }
                    let i = axis.index();
                    for (offset, row) in placed.offset.iter_mut().zip(&placed.rotation) {
                        let shift = field.mul(&length, &row[i]);
                        *offset = field.add(offset, &shift);
                    }
                }
                Step::Rotate(axis, angle) => {
                    let (sin, cos) = names.sin_cos(field, angle);
                    if sin.is_zero() && cos.is_one() {
                        continue;
                    }
                    placed.turn(field, *axis, &(sin, cos));
                }
            }
        }
        placed
    }

    /// Rotates the frame about one of its axes by an angle, given by its sine and cosine.
    pub(super) fn turn(&mut self, field: &mut Field, axis: Axis, (sin, cos): &(Element, Element)) {
        // a rotation in the plane of columns j and k
        let (j, k) = match axis {
            Axis::X => (1, 2),
            Axis::Y => (2, 0),
            Axis::Z => (0, 1),
        };
        for row in &mut self.rotation {
            let (a, b) = (row[j].clone(), row[k].clone());
            row[j] = field.dot(&[a.clone(), b.clone()], &[cos.clone(), sin.clone()]);
            row[k] = field.dot(&[a, b], &[sin.neg(), cos.clone()]);
        }
    }

    /// The inverse change of frame: the parent's frame in the child's.
    pub(super) fn inverse(&self, field: &mut Field) -> Self {
        let rotation: Rotation =
            [0, 1, 2].map(|i| [0, 1, 2].map(|j: usize| self.rotation[j][i].clone()));
        let offset = [0, 1, 2].map(|i: usize| field.dot(&rotation[i], &self.offset).neg());
        Placed { rotation, offset }
    }

    /// `R v`: from the child's axes to the parent's.
    fn out(&self, field: &mut Field, v: &E3) -> E3 {
        [0, 1, 2].map(|i: usize| field.dot(&self.rotation[i], v))
    }

    /// `R^T v`: from the parent's axes to the child's.
    fn into(&self, field: &mut Field, v: &E3) -> E3 {
        [0, 1, 2].map(|i: usize| {
            let column = [0, 1, 2].map(|j: usize| self.rotation[j][i].clone());
            field.dot(&column, v)
        })
    }

    /// A direction in the parent's axes, converted to the child's axes.
    pub(super) fn direction_into(&self, field: &mut Field, v: &E3) -> E3 {
        self.into(field, v)
    }

    /// A twist (w, v) at the parent's origin, converted to the child's origin and axes.
    pub(super) fn twist_into(&self, field: &mut Field, w: &E3, v: &E3) -> (E3, E3) {
        let swing = field.cross(w, &self.offset);
        let v = field.add3(v, &swing);
        (self.into(field, w), self.into(field, &v))
    }

    /// The transformation of the ten parameters of a body from the child's frame to the parent's,
    /// about the parent's origin: a 10 x 10 matrix, column by column.
    pub(super) fn parameters_out(&self, field: &mut Field) -> Vec<Vec<Element>> {
        (0..10)
            .map(|entry| {
                let mut parameters = vec![Element::zero(); 10];
                parameters[entry] = Element::one();
                self.parameters_on_parent(field, &parameters)
            })
            .collect()
    }

    fn parameters_on_parent(&self, field: &mut Field, phi: &[Element]) -> Vec<Element> {
        let e = |i: usize| phi[i].clone();
        let tensor = [[e(0), e(1), e(2)], [e(1), e(3), e(4)], [e(2), e(4), e(5)]];
        // R I R^T, as columns first
        let columns = tensor.map(|column| self.out(field, &column));
        let rows: Rotation = [0, 1, 2].map(|i| [0, 1, 2].map(|j: usize| columns[j][i].clone()));
        let full = rows.map(|row| self.out(field, &row));
        let h = self.out(field, &[e(6), e(7), e(8)]);
        let mass = e(9);
        let p = &self.offset;
        let shift = p.clone().map(|x| field.mul(&mass, &x));
        let shifted = field.add3(&h, &shift);
        let (one, two) = (field.dot(p, &shifted), field.dot(p, &h));
        let trace = field.add(&one, &two);
        let mut out = Vec::with_capacity(10);
        for i in 0..3 {
            for j in i..3 {
                let one = field.mul(&p[i], &shifted[j]);
                let two = field.mul(&h[i], &p[j]);
                let outer = field.add(&one, &two);
                let mut entry = field.sub(&full[i][j], &outer);
                if i == j {
                    entry = field.add(&entry, &trace);
                }
                out.push(entry);
            }
        }
        out.extend(shifted);
        out.push(mass);
        out
    }
}
