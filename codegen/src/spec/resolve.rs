//! Evaluates every expression of a spec whose names have been checked, and checks the values:
//! intervals, cone angles, pitches, masses, inertias.

pub(crate) mod adjustable;
mod drives;
mod springs;

use std::collections::BTreeMap;

use super::check::canonical;
use super::expression::{Ast, evaluate, linear, quantity};
use super::physical::{Flaw, flaw};
use super::raw::{
    RawBase, RawCut, RawDh, RawInertia, RawJoint, RawLimb, RawLimits, RawPlacement, RawSpec,
};
use super::shape::{BodyReference, Scalar, Word};
use super::types::{
    Axis, BaseChoices, BodyInertia, Cut, CutSide, Expr, Interval, Joint, JointFrame, JointKind,
    JointSpring, Limb, Limits, LinearForm, NamedFrame, Placement, Quantity, Spanned, Spec,
};
use crate::diag::{Diagnostic, Sink, Span};
use crate::sym::Number;

/// Largest negative part of a positive semidefinite tensor that is taken for rounding, relative to
/// its largest entry.
const SEMIDEFINITE_TOLERANCE: f64 = 1e-12;

/// Evaluates a spec whose names have been checked, and reports all errors to `sink`; `None` if a
/// part cannot be evaluated. The result may be `Some` although an error was reported, such as a
/// negative mass: the caller must consult `sink`.
pub(super) fn resolve(raw: &RawSpec, sink: &mut Sink) -> Option<Spec> {
    let mut resolver = Resolver {
        values: BTreeMap::new(),
        sink,
    };
    // evaluate every part, also after an error, so that all errors are reported
    let geometry = resolver.geometry(raw);
    let gravity = resolver.quantities(&raw.gravity);
    let limbs = collect_all(&raw.limbs, |limb| resolver.limb(limb));
    let cuts = collect_all(raw.cuts.iter().flatten(), |cut| resolver.cut(cut));
    let springs = collect_all(raw.springs.iter().flatten(), |spring| {
        resolver.spring(spring)
    });
    let couplings = collect_all(
        raw.couplings.iter().flat_map(|couplings| &couplings.0),
        |(key, form)| {
            let form = resolver.linear(&form.0)?;
            Some((spanned(&key.0), form))
        },
    );
    let frames = collect_all(raw.frames.iter().flatten(), |frame| {
        Some(NamedFrame {
            name: spanned(&frame.name.0),
            on: resolver.side(&frame.body, &frame.xyz, &frame.rpy)?,
        })
    });
    let drives = collect_all(raw.drives(), |(name, drive)| resolver.drive(name, drive));
    let home = collect_all(
        raw.home.iter().flat_map(|home| &home.value.0),
        |(key, value)| Some((spanned(&key.0), resolver.quantity(value)?)),
    );
    let bodies = collect_all(
        raw.bodies.iter().flat_map(|bodies| &bodies.0),
        |(label, inertia)| Some((spanned(&label.0), resolver.inertia(inertia, &label.0)?)),
    );
    let base = match &raw.base {
        Some(base) => resolver.base(base),
        None => Some(BaseChoices::default()),
    };
    let mut spec = Spec {
        name: spanned(&raw.name.0),
        description: raw.description.as_ref().map(|text| text.0.clone()),
        gravity: gravity?,
        geometry: geometry?,
        adjustable: raw.adjustable.iter().map(|name| spanned(&name.0)).collect(),
        limbs: limbs?,
        cuts: cuts?,
        springs: springs?,
        independent: raw.independent.as_ref().map(|names| Spanned {
            value: names.value.iter().map(|name| spanned(&name.0)).collect(),
            span: names.span,
        }),
        couplings: couplings?,
        drives: Vec::new(),
        home: home?,
        home_span: raw.home.as_ref().map(|home| home.span),
        bodies: bodies?,
        base: base?,
        frames: frames?,
        control: raw.control.value,
    };
    drives::add(drives?, &mut spec);
    adjustable::check(&spec, resolver.sink);
    resolver.check_home_of_drives(&spec);
    Some(spec)
}

/// The results of `evaluate_item` for all items; `None` if any call failed. The remaining items are
/// evaluated also after a failure, so that their errors are reported too.
fn collect_all<I: IntoIterator, T>(
    items: I,
    evaluate_item: impl FnMut(I::Item) -> Option<T>,
) -> Option<Vec<T>> {
    let results: Vec<Option<T>> = items.into_iter().map(evaluate_item).collect();
    results.into_iter().collect()
}

fn spanned(word: &Word) -> Spanned<String> {
    Spanned {
        value: word.text.clone(),
        span: word.span,
    }
}

/// The label of the body that is referred to; `None` for the world.
fn body_label(reference: &BodyReference) -> Option<Spanned<String>> {
    (reference.0.text != "world").then(|| spanned(&reference.0))
}

/// Returned after an error was reported to the sink.
struct Reported;

/// A joint or a cut whose pitch is evaluated, for the messages about it.
struct PitchOwner<'a> {
    kind: JointKind,
    /// The noun for it in messages: `joint` or `cut`.
    noun: &'static str,
    /// The path of its name in the spec; empty for a joint without a name.
    path: &'a str,
}

/// Evaluates the parts of a spec one after the other. Its methods return `None` after they reported
/// an error.
struct Resolver<'a> {
    /// The values of the geometry names evaluated so far; `None` for a name whose expression has
    /// a reported error, so that no error is reported for the expressions that use it.
    values: BTreeMap<String, Option<Number>>,
    sink: &'a mut Sink,
}

impl Resolver<'_> {
    /// Evaluates the geometry names in order, so that each may use those before it.
    fn geometry(&mut self, raw: &RawSpec) -> Option<Vec<(Spanned<String>, Quantity)>> {
        collect_all(
            raw.geometry.iter().flat_map(|geometry| &geometry.0),
            |(name, scalar)| {
                let quantity = self.quantity(scalar);
                let value = quantity.as_ref().map(|quantity| quantity.value.clone());
                self.values.insert(name.0.text.clone(), value);
                Some((spanned(&name.0), quantity?))
            },
        )
    }

    /// Whether an expression uses a geometry name whose own expression has a reported error.
    fn uses_failed_value(&self, ast: &Ast) -> bool {
        let mut is_failed = false;
        ast.names(&mut |_, name| is_failed |= matches!(self.values.get(name), Some(None)));
        is_failed
    }

    /// Evaluates an expression of numbers and geometry names.
    fn quantity(&mut self, scalar: &Scalar) -> Option<Quantity> {
        if self.uses_failed_value(&scalar.ast) {
            return None;
        }
        let lookup = |name: &str| self.values.get(name).cloned().flatten();
        match quantity(&scalar.ast, &lookup) {
            Ok(quantity) => Some(quantity),
            Err(error) => {
                self.sink.push(error.at(&scalar.path));
                None
            }
        }
    }

    /// Evaluates an expression that is linear in coordinates or parameters.
    fn linear(&mut self, scalar: &Scalar) -> Option<LinearForm> {
        if self.uses_failed_value(&scalar.ast) {
            return None;
        }
        let lookup = |name: &str| self.values.get(name).cloned().flatten();
        // since the names have been checked, each is a geometry name, a coordinate or a parameter
        match linear(
            &scalar.ast,
            &|name| !self.values.contains_key(name),
            &lookup,
        ) {
            Ok(form) => Some(form),
            Err(error) => {
                self.sink.push(error.at(&scalar.path));
                None
            }
        }
    }

    fn quantities<const N: usize>(&mut self, scalars: &[Scalar; N]) -> Option<[Quantity; N]> {
        collect_all(scalars, |scalar| self.quantity(scalar))?
            .try_into()
            .ok()
    }

    fn placement(&mut self, raw: &RawPlacement) -> Option<Placement> {
        let (xyz, rpy) = (self.quantities(&raw.xyz), self.quantities(&raw.rpy));
        Some(Placement {
            xyz: xyz?,
            rpy: rpy?,
        })
    }

    fn limb(&mut self, raw: &RawLimb) -> Option<Limb> {
        let base = self.placement(&raw.base);
        let joints = collect_all(&raw.joints, |joint| self.joint(joint));
        Some(Limb {
            name: spanned(&raw.name.0),
            from: body_label(&raw.from),
            base: base?,
            joints: joints?,
            span: raw.span,
        })
    }

    fn dh(&mut self, raw: &RawDh) -> Option<JointFrame> {
        let [alpha, a, d, theta] =
            [&raw.alpha, &raw.a, &raw.d, &raw.theta].map(|scalar| self.quantity(scalar));
        Some(JointFrame::Dh {
            alpha: alpha?,
            a: a?,
            d: d?,
            theta: theta?,
        })
    }

    fn joint(&mut self, raw: &RawJoint) -> Option<Joint> {
        let frame = match (&raw.dh, &raw.origin) {
            (Some(dh), _) => self.dh(dh),
            (None, Some(origin)) => self.placement(origin).map(JointFrame::Origin),
            (None, None) => {
                let zero = || zero_quantity(raw.span);
                Some(JointFrame::Dh {
                    alpha: zero(),
                    a: zero(),
                    d: zero(),
                    theta: zero(),
                })
            }
        };
        let kind = raw.kind.value;
        let path = raw.name.as_ref().map_or("", |name| &*name.0.path);
        let pitch_owner = PitchOwner {
            kind,
            noun: "joint",
            path,
        };
        let lead = self.lead(&pitch_owner, raw.kind.span, raw.pitch.as_ref());
        let limits = match &raw.limits {
            Some(limits) => self.limits(limits),
            None => Some(Limits::default()),
        };
        let nominal = collect_all(
            raw.nominal.iter().flat_map(|nominal| &nominal.0),
            |(symbol, scalar)| {
                let quantity = self.quantity(scalar)?;
                let nonnegative = match symbol.0.text.as_str() {
                    "J" => "a rotor inertia must not be negative",
                    "K" => "the stiffness of a spring must not be negative",
                    _ => "",
                };
                if !nonnegative.is_empty() && quantity.value.is_negative() {
                    self.report(scalar, nonnegative);
                    return None;
                }
                Some((spanned(&symbol.0), quantity))
            },
        );
        let spring = match &raw.spring {
            Some(spring) => self
                .quantity(&spring.rest)
                .map(|rest| Some(JointSpring { rest })),
            None => Some(None),
        };
        let terms = collect_all(
            raw.terms.iter().flat_map(|terms| &terms.0),
            |(name, factor)| Some((spanned(&name.0), self.effort_term(&factor.0)?)),
        );
        Some(Joint {
            name: raw.name.as_ref().map(|name| spanned(&name.0)),
            kind: Spanned {
                value: raw.kind.value,
                span: raw.kind.span,
            },
            frame: frame?,
            axis: raw.axis.map_or(Axis::Z, |axis| axis.value),
            lead: lead.ok()?,
            body: raw.body.as_ref().map(|body| spanned(&body.0)),
            payload: raw.payload.value,
            actuated: raw.actuated.value,
            friction: raw.friction.value,
            offset: raw.offset.value,
            rotor_inertia: raw.rotor_inertia.value,
            spring: spring?,
            terms: terms?,
            limits: limits?,
            nominal: nominal?,
            span: raw.span,
        })
    }

    /// Reports an error at a value.
    fn report(&mut self, scalar: &Scalar, message: &str) {
        self.sink
            .push(Diagnostic::new(scalar.ast.span, message).path(&*scalar.path));
    }

    fn limits(&mut self, raw: &RawLimits) -> Option<Limits> {
        let intervals = [
            &raw.position,
            &raw.velocity,
            &raw.acceleration,
            &raw.jerk,
            &raw.effort,
        ];
        let intervals = intervals.map(|interval| match interval {
            Some(interval) => self.interval(interval).map(Some),
            None => Some(None),
        });
        let [position, velocity, acceleration, jerk, effort] = intervals;
        let cone = self.cone(raw.cone.as_ref());
        Some(Limits {
            position: position?,
            velocity: velocity?,
            acceleration: acceleration?,
            jerk: jerk?,
            effort: effort?,
            cone: cone.ok()?,
        })
    }

    fn interval(&mut self, raw: &[Scalar; 2]) -> Option<Interval> {
        let interval = self.quantities(raw)?;
        if interval[0].value.cmp_value(&interval[1].value).is_gt() {
            let [low, high] = [interval[0].value.to_f64(), interval[1].value.to_f64()];
            let path = raw[0]
                .path
                .rsplit_once(", entry")
                .map_or("", |(path, _)| path);
            self.sink.push(
                Diagnostic::new(
                    raw[0].ast.span.to(raw[1].ast.span),
                    format!("the lower limit {low} is above the upper limit {high}"),
                )
                .path(path)
                .hint("write [lowest, highest]"),
            );
            return None;
        }
        Some(interval)
    }

    /// The largest swing angle of a cone limit, rad, if the spec has one; `Err` after reporting an
    /// error.
    fn cone(&mut self, raw: Option<&Scalar>) -> Result<Option<Quantity>, Reported> {
        let Some(raw) = raw else {
            return Ok(None);
        };
        let cone = self.quantity(raw).ok_or(Reported)?;
        let positive = !cone.value.is_negative() && !cone.value.is_zero();
        if !positive || cone.value.cmp_value(&Number::pi()).is_gt() {
            self.report(raw, "a cone's angle must be above 0 and at most pi");
            return Err(Reported);
        }
        Ok(Some(cone))
    }

    /// The lead (pitch over 2 pi, in m/rad for a pitch in m per turn) of a joint or cut that has a
    /// pitch, else `None`; `Err` after reporting an error.
    fn lead(
        &mut self,
        owner: &PitchOwner<'_>,
        kind_span: Span,
        raw: Option<&Scalar>,
    ) -> Result<Option<Quantity>, Reported> {
        let (kind_name, noun) = (owner.kind.name(), owner.noun);
        match (owner.kind.takes_pitch(), raw) {
            (false, None) => Ok(None),
            (false, Some(raw)) => {
                self.sink.push(
                    Diagnostic::new(raw.ast.span, format!("a {kind_name} {noun} takes no pitch"))
                        .path(&*raw.path)
                        .secondary(kind_span, format!("the {noun} is {kind_name}"))
                        .hint(format!("only helical {noun}s do")),
                );
                Err(Reported)
            }
            (true, None) => {
                self.sink.push(
                    Diagnostic::new(kind_span, format!("a {kind_name} {noun} needs a pitch"))
                        // the path of the joint or the cut, not that of its name
                        .path(owner.path.trim_end_matches(", name"))
                        .hint("write `pitch: 0.005` for 5 mm per turn"),
                );
                Err(Reported)
            }
            (true, Some(raw)) => {
                let pitch = self.quantity(raw).ok_or(Reported)?;
                if pitch.value.is_zero() {
                    self.report(raw, "a pitch must not be 0: that is a revolute joint");
                    return Err(Reported);
                }
                let two_pi = Number::from_i64(2).mul(&Number::pi());
                let value = pitch.value.div(&two_pi).ok_or(Reported)?;
                let two_pi = Expr::Mul(
                    Box::new(Expr::Number(Number::from_i64(2))),
                    Box::new(Expr::Pi),
                );
                Ok(Some(Quantity {
                    expr: Expr::Div(Box::new(pitch.expr), Box::new(two_pi)),
                    value,
                    span: pitch.span,
                }))
            }
        }
    }

    /// A frame on a body or the world.
    fn side(
        &mut self,
        body: &BodyReference,
        xyz: &[Scalar; 3],
        rpy: &[Scalar; 3],
    ) -> Option<CutSide> {
        let (xyz, rpy) = (self.quantities(xyz), self.quantities(rpy));
        Some(CutSide {
            body: body_label(body),
            placement: Placement {
                xyz: xyz?,
                rpy: rpy?,
            },
        })
    }

    fn cut(&mut self, raw: &RawCut) -> Option<Cut> {
        let sides = collect_all(&raw.between, |side| {
            self.side(&side.body, &side.xyz, &side.rpy)
        });
        let cone = self.cone(raw.limits.as_ref().and_then(|limits| limits.cone.as_ref()));
        let pitch_owner = PitchOwner {
            kind: raw.joint.value.joint(),
            noun: "cut",
            path: &raw.name.0.path,
        };
        let lead = self.lead(&pitch_owner, raw.joint.span, raw.pitch.as_ref());
        Some(Cut {
            name: spanned(&raw.name.0),
            kind: Spanned {
                value: raw.joint.value,
                span: raw.joint.span,
            },
            lead: lead.ok()?,
            sides: sides?.try_into().ok()?,
            limits: Limits {
                cone: cone.ok()?,
                ..Limits::default()
            },
            span: raw.span,
        })
    }

    fn inertia(&mut self, raw: &RawInertia, label: &Word) -> Option<BodyInertia> {
        let mass = self.quantity(&raw.mass);
        let (com, inertia) = (self.quantities(&raw.com), self.quantities(&raw.inertia));
        let (mass, com, inertia) = (mass?, com?, inertia?);
        if mass.value.is_negative() {
            self.report(&raw.mass, "a mass must not be negative");
        }
        let tensor = inertia.each_ref().map(|entry| entry.value.to_f64());
        if flaw(tensor, SEMIDEFINITE_TOLERANCE) == Some(Flaw::Indefinite) {
            let span = raw
                .inertia
                .iter()
                .map(|entry| entry.ast.span)
                .reduce(Span::to);
            let path = format!("bodies '{}', inertia", label.text);
            self.sink.push(
                Diagnostic::new(
                    span.unwrap_or(raw.span),
                    "no body has this inertia: it is not positive semidefinite",
                )
                .path(path)
                .hint("the order is Ixx, Ixy, Ixz, Iyy, Iyz, Izz, about the centre of mass"),
            );
        }
        Some(BodyInertia { mass, com, inertia })
    }

    fn base(&mut self, raw: &RawBase) -> Option<BaseChoices> {
        let zero = collect_all(&raw.zero, |form| {
            let linear = self.linear(&form.0)?;
            if !linear.constant.value.is_zero() {
                self.sink.push(
                    Diagnostic::new(
                        linear.constant.span,
                        "a form that is zero has no constant part",
                    )
                    .path(&*form.0.path)
                    .hint("only multiples of parameters may be added"),
                );
                return None;
            }
            if linear.terms.is_empty() {
                self.sink.push(
                    Diagnostic::new(linear.span, "this form has no parameter in it")
                        .path(&*form.0.path),
                );
                return None;
            }
            Some(linear)
        });
        let labels = |list: &[super::shape::ParameterReference]| {
            list.iter()
                .map(|label| spanned(&canonical(&label.0)))
                .collect()
        };
        Some(BaseChoices {
            eliminate: labels(&raw.eliminate),
            zero: zero?,
            equal: raw
                .equal
                .iter()
                .map(|group| group.iter().map(|label| spanned(&label.0)).collect())
                .collect(),
            drop: labels(&raw.drop),
        })
    }
}

/// The value zero, for keys that are missing.
fn zero_quantity(span: Span) -> Quantity {
    let ast = Ast::number(Number::zero(), span);
    Quantity {
        expr: ast.to_expr(),
        value: evaluate(&ast, &|_| None).unwrap_or_else(|_| Number::zero()),
        span,
    }
}
