//! Completes a drawn tree to a spec that closes: the second frame of each cut, the couplings'
//! constants, the mobility and a choice of independent coordinates, all computed numerically.

use std::fmt::Write as _;

use nalgebra::{DMatrix, DVector};

use super::draft::{Actuation, Draft, Placement, cut_word, home_text, side_text};
use crate::reference::{CutKind, Mechanism, Random, evaluate};

/// Singular values of A at home below this fraction of the largest count as zero.
const ZERO_PART: f64 = 1e-10;
/// Singular values above this fraction of the largest count towards the rank. If one is between
/// both fractions, home is too close to a singularity.
const REGULAR_PART: f64 = 1e-3;
/// If all singular values of A are below this, its entries are rounding errors.
const ENTRY_ROUNDING: f64 = 1e-12;
/// The smallest accepted ratio of the smallest to the largest singular value of A_e at home.
const MIN_CONDITIONING: f64 = 0.02;
/// Specs with more degrees of freedom are rejected.
const MAX_FREEDOMS: usize = 6;

/// Why a draft cannot be completed to a spec.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Reject {
    /// The mechanism cannot move.
    Immobile,
    /// The mechanism has more degrees of freedom than the tests need.
    TooMobile,
    /// Home is at or near a singularity: the rank of A is unclear there, or different nearby.
    SingularHome,
    /// No well-conditioned choice of independent coordinates was found.
    NoChoice,
    /// The mechanism can hardly move away from home.
    NoRoom,
    /// Some motion moves no mass.
    Massless,
    /// A shrunk draft refers to a part that was removed, or is not a spec for another reason.
    Unfit,
}

/// A spec with its parts and its second derivation.
#[derive(Clone, Debug)]
pub struct Sample {
    /// The parts of the spec.
    pub draft: Draft,
    /// The text of the spec.
    pub text: String,
    /// The second derivation of the spec.
    pub mechanism: Mechanism,
    /// The names of the independent coordinates, even if the spec does not list them.
    pub independent: Vec<String>,
}

/// Completes a draft.
///
/// # Errors
/// The reason why these parts make no good spec.
pub fn complete(draft: &Draft) -> Result<Sample, Reject> {
    let body = closed_text(draft)?;
    let guess = format!("{body}{}independent: []\n", home_text(&draft.home_pairs()));
    let open = Mechanism::from_yaml(&guess).map_err(|_| Reject::Unfit)?;
    let home = open.home_guess.clone();
    let mobility = mobility(&open, &home)?;
    neighbourhood(&open, &home, mobility, draft.choice)?;
    let independent = choose(draft, &open, &home, mobility)?;
    let mut draft = draft.clone();
    if draft.actuation == Actuation::Independent {
        for joint in draft.limbs.iter_mut().flat_map(|l| &mut l.joints) {
            let names = joint.coordinates();
            joint.actuated = names.iter().any(|n| independent.contains(n));
        }
    }
    let body = closed_text(&draft)?;
    let mut random = Random::new(draft.choice ^ 0xface);
    let mut pairs = draft.home_pairs();
    for (name, value) in &mut pairs {
        if draft.off_home > 0.0 && !independent.contains(name) {
            let number = evaluate(value, &lookup(&draft)).map_err(|_| Reject::Unfit)?;
            *value = number_text(number + random.uniform(-draft.off_home, draft.off_home));
        }
    }
    let default: Vec<String> = draft
        .joints()
        .filter(|j| j.actuated)
        .flat_map(super::draft::Joint::coordinates)
        .collect();
    let mut text = format!("{body}{}", home_text(&pairs));
    if default != independent {
        let _ = writeln!(text, "independent: [{}]", independent.join(", "));
    }
    let mechanism = Mechanism::from_yaml(&text).map_err(|_| Reject::Unfit)?;
    let closed = mechanism.home().map_err(|_| Reject::SingularHome)?;
    let mut random = Random::new(draft.choice);
    let state = mechanism
        .random_state(&closed, &mut random)
        .map_err(|_| Reject::NoRoom)?;
    check_every_motion_moves_mass(&mechanism, &state.q)?;
    Ok(Sample {
        draft,
        text,
        mechanism,
        independent,
    })
}

/// The text of the spec with cuts and couplings, without home and independent coordinates.
pub(super) fn closed_text(draft: &Draft) -> Result<String, Reject> {
    let mut text = draft.tree_text();
    let home = home_text(&draft.home_pairs());
    let chain = Mechanism::from_yaml(&format!("{text}{home}independent: []\n"))
        .map_err(|_| Reject::Unfit)?;
    let poses = chain.poses(&chain.home_guess);
    let pose = |label: Option<&String>| -> Option<[f64; 12]> {
        match label {
            None => Some(IDENTITY),
            Some(label) => {
                let at = chain.bodies.iter().position(|b| b.label == *label)?;
                Some(poses[at])
            }
        }
    };
    if !draft.cuts.is_empty() {
        text.push_str("cuts:\n");
    }
    for (i, cut) in draft.cuts.iter().enumerate() {
        let a = pose(cut.a.body.as_ref()).ok_or(Reject::Unfit)?;
        let b = pose(cut.b.as_ref()).ok_or(Reject::Unfit)?;
        let mut frame = product(&a, &placed(&cut.a.placement, draft)?);
        let pitch = match cut.kind {
            CutKind::Helical => evaluate(cut.pitch, &lookup(draft)).map_err(|_| Reject::Unfit)?,
            _ => 0.0,
        };
        for motion in joint_motions(cut.kind, pitch, cut.displacement) {
            frame = product(&frame, &motion);
        }
        let second = placement_text(&relative(&b, &frame));
        let mut sides = [
            side_text(cut.a.body.as_ref(), &cut.a.placement),
            side_text(cut.b.as_ref(), &second),
        ];
        if cut.swapped {
            sides.reverse();
        }
        let _ = writeln!(
            text,
            "  - {{name: c{i}, joint: {}{}, between: [{}]{}}}",
            cut_word(cut.kind),
            match cut.kind {
                CutKind::Helical => format!(", pitch: {}", cut.pitch),
                _ => String::new(),
            },
            sides.join(", "),
            cut.more
        );
    }
    if !draft.couplings.is_empty() {
        let home = |name: &str| {
            let at = chain.coordinates.iter().position(|c| c == name);
            at.map(|at| chain.home_guess[at]).ok_or(Reject::Unfit)
        };
        let mut pairs = Vec::new();
        for coupling in &draft.couplings {
            let mut constant = home(&coupling.key)?;
            let mut form = String::new();
            for (factor, name) in &coupling.terms {
                let value = evaluate(factor, &lookup(draft)).map_err(|_| Reject::Unfit)?;
                constant -= value * home(name)?;
                let _ = write!(form, "{factor}*{name} + ");
            }
            pairs.push(format!("{}: {form}{}", coupling.key, number_text(constant)));
        }
        let _ = writeln!(text, "couplings: {{{}}}", pairs.join(", "));
    }
    Ok(text)
}

fn lookup(draft: &Draft) -> impl Fn(&str) -> Option<f64> + '_ {
    |name| {
        let (_, text) = draft.geometry.iter().find(|(n, _)| n == name)?;
        text.parse().ok()
    }
}

/// The number of degrees of freedom at home; an error where the rank is unclear.
fn mobility(mechanism: &Mechanism, q: &[f64]) -> Result<usize, Reject> {
    let rank = clear_rank(mechanism, q).ok_or(Reject::SingularHome)?;
    match mechanism.n() - rank {
        0 => Err(Reject::Immobile),
        m if m > MAX_FREEDOMS => Err(Reject::TooMobile),
        m => Ok(m),
    }
}

fn clear_rank(mechanism: &Mechanism, q: &[f64]) -> Option<usize> {
    if mechanism.rows() == 0 {
        return Some(0);
    }
    let values = mechanism.jacobian(q).singular_values();
    let largest = values.max();
    let unclear = |v: &&f64| **v > ZERO_PART * largest && **v < REGULAR_PART * largest;
    // Rows that are only rounding constrain nothing.
    if largest < ENTRY_ROUNDING {
        return Some(0);
    }
    let clear = !values.iter().any(|v| unclear(&v));
    clear.then(|| {
        values
            .iter()
            .filter(|v| **v > REGULAR_PART * largest)
            .count()
    })
}

/// Checks that small steps along random motions close again with the same rank: home is not
/// singular.
fn neighbourhood(
    mechanism: &Mechanism,
    home: &[f64],
    mobility: usize,
    seed: u64,
) -> Result<(), Reject> {
    if mechanism.rows() == 0 {
        return Ok(());
    }
    let mut random = Random::new(seed ^ 0xbeef);
    for _ in 0..3 {
        let a = mechanism.jacobian(home);
        // The part of a random motion that the rows allow.
        let drawn = DVector::from_vec(random.vector(mechanism.n(), 1.0));
        let svd = a.clone().svd(true, true);
        let bound = ZERO_PART * svd.singular_values.max();
        let blocked = svd
            .solve(&(&a * &drawn), bound)
            .map_err(|_| Reject::SingularHome)?;
        let motion = drawn - blocked;
        let step = 0.05 / motion.amax().max(1e-9);
        let mut q: Vec<f64> = home
            .iter()
            .zip(motion.iter())
            .map(|(x, d)| x + step * d)
            .collect();
        for _ in 0..12 {
            let f = DVector::from_vec(mechanism.constraints(&q));
            let svd = mechanism.jacobian(&q).svd(true, true);
            let bound = REGULAR_PART * svd.singular_values.max();
            let back = svd.solve(&f, bound).map_err(|_| Reject::SingularHome)?;
            for (x, d) in q.iter_mut().zip(back.iter()) {
                *x -= d;
            }
        }
        let rank = clear_rank(mechanism, &q);
        if mechanism.residual(&q) > 1e-12 || rank != Some(mechanism.n() - mobility) {
            return Err(Reject::SingularHome);
        }
    }
    Ok(())
}

/// Draws a choice of independent coordinates: columns of A are taken into A_e in a random order as
/// long as they increase its rank.
fn choose(
    draft: &Draft,
    open: &Mechanism,
    home: &[f64],
    mobility: usize,
) -> Result<Vec<String>, Reject> {
    let n = open.n();
    let rank = n - mobility;
    let a = open.jacobian(home);
    let mut random = Random::new(draft.choice);
    let coupled: Vec<usize> = (0..n)
        .filter(|k| {
            draft
                .couplings
                .iter()
                .any(|c| c.key == open.coordinates[*k])
        })
        .collect();
    for _ in 0..30 {
        // Coupled coordinates first: they are never independent.
        let mut order: Vec<usize> = (0..n).filter(|k| !coupled.contains(k)).collect();
        for i in (1..order.len()).rev() {
            #[allow(clippy::cast_sign_loss, reason = "not negative")]
            let j = random.uniform(0.0, (i + 1) as f64) as usize;
            order.swap(i, j.min(i));
        }
        let mut dependent: Vec<usize> = Vec::new();
        for k in coupled.iter().chain(&order) {
            if dependent.len() == rank {
                break;
            }
            dependent.push(*k);
            if conditioning(&a.select_columns(&dependent)) < MIN_CONDITIONING {
                dependent.pop();
            }
        }
        if dependent.len() == rank && coupled.iter().all(|k| dependent.contains(k)) {
            // the random order becomes that of the regressor's rows
            let rest = order.iter().filter(|k| !dependent.contains(k));
            let mut names: Vec<usize> = rest.copied().collect();
            if draft.actuation == Actuation::Independent {
                names.sort_unstable();
            }
            return Ok(names.iter().map(|k| open.coordinates[*k].clone()).collect());
        }
    }
    Err(Reject::NoChoice)
}

/// The smallest over the largest singular value.
fn conditioning(matrix: &DMatrix<f64>) -> f64 {
    if matrix.nrows() < matrix.ncols() {
        return 0.0;
    }
    let values = matrix.singular_values();
    values.min() / values.max()
}

/// Checks that every motion moves some mass.
fn check_every_motion_moves_mass(mechanism: &Mechanism, q: &[f64]) -> Result<(), Reject> {
    let mut random = Random::new(1);
    let bodies: Vec<f64> = mechanism
        .bodies
        .iter()
        .flat_map(|_| crate::reference::PhysicalBody::random(&mut random).parameters())
        .collect();
    let mut phi = vec![0.0; mechanism.parameters.len()];
    phi[..bodies.len()].copy_from_slice(&bodies);
    let still = vec![0.0; q.len()];
    let (mass, _) = mechanism
        .mass_matrix(q, &still, &phi)
        .map_err(|_| Reject::SingularHome)?;
    let values = mass.symmetric_eigenvalues();
    // the inertias of bodies of at least half a kilogram on arms of centimetres are far above this
    if values.min() > 1e-6 * values.max().max(1.0) {
        Ok(())
    } else {
        Err(Reject::Massless)
    }
}

/// A pose without displacement: the rotation row by row, then the origin.
const IDENTITY: [f64; 12] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];

/// The displacement of a cut's joint, as a product of the motions that the joint allows.
fn joint_motions(kind: CutKind, pitch: f64, [x, y, z, slide]: [f64; 4]) -> Vec<[f64; 12]> {
    match kind {
        CutKind::Spherical => vec![turn(2, z), turn(1, y), turn(0, x)],
        CutKind::Universal => vec![turn(0, x), turn(1, y)],
        CutKind::Revolute => vec![turn(2, z)],
        CutKind::Prismatic => vec![lift(slide)],
        CutKind::Helical => vec![turn(2, z), lift(pitch / std::f64::consts::TAU * z)],
        CutKind::Cylindrical => vec![turn(2, z), lift(slide)],
        CutKind::Fixed => Vec::new(),
    }
}

/// A rotation about an axis, rad.
fn turn(axis: usize, angle: f64) -> [f64; 12] {
    let (s, c) = if angle == 0.0 {
        (0.0, 1.0)
    } else {
        angle.sin_cos()
    };
    let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
    let mut out = IDENTITY;
    out[4 * axis] = 1.0;
    out[3 * j + j] = c;
    out[3 * k + k] = c;
    out[3 * j + k] = -s;
    out[3 * k + j] = s;
    out
}

/// A translation along z, m.
fn lift(z: f64) -> [f64; 12] {
    let mut out = IDENTITY;
    out[11] = z;
    out
}

/// A placement's value: the translation, then Rz(y) Ry(p) Rx(r).
fn placed(placement: &Placement, draft: &Draft) -> Result<[f64; 12], Reject> {
    let value = |text: &String| evaluate(text, &lookup(draft)).map_err(|_| Reject::Unfit);
    let mut out = IDENTITY;
    for k in 0..3 {
        out[9 + k] = value(&placement.xyz[k])?;
    }
    for k in [2, 1, 0] {
        out = product(&out, &turn(k, value(&placement.rpy[k])?));
    }
    Ok(out)
}

fn product(a: &[f64; 12], b: &[f64; 12]) -> [f64; 12] {
    let mut out = [0.0; 12];
    for i in 0..3 {
        for j in 0..3 {
            out[3 * i + j] = (0..3).map(|k| a[3 * i + k] * b[3 * k + j]).sum();
        }
        out[9 + i] = a[9 + i] + (0..3).map(|k| a[3 * i + k] * b[9 + k]).sum::<f64>();
    }
    out
}

/// The second frame relative to the first: rotation row by row, then the origin.
fn relative(from: &[f64; 12], to: &[f64; 12]) -> [f64; 12] {
    let mut back = [0.0; 12];
    for i in 0..3 {
        for j in 0..3 {
            back[3 * i + j] = from[3 * j + i];
        }
        back[9 + i] = -(0..3).map(|k| from[3 * k + i] * from[9 + k]).sum::<f64>();
    }
    product(&back, to)
}

/// The placement of a frame, with all digits of its doubles.
fn placement_text(m: &[f64; 12]) -> Placement {
    let level = m[7].hypot(m[8]);
    let pitch = (-m[6]).atan2(level);
    // At a pitch of a quarter turn, only the sum or difference of roll and yaw is defined.
    let rpy = if level < 1e-7 {
        [0.0, pitch, (-m[1]).atan2(m[4])]
    } else {
        [m[7].atan2(m[8]), pitch, m[3].atan2(m[0])]
    };
    Placement {
        xyz: [m[9], m[10], m[11]].map(number_text),
        rpy: rpy.map(angle_text),
    }
}

/// A number with all its digits; a zero with rounding errors is written as zero.
fn number_text(value: f64) -> String {
    if value.abs() < 1e-14 {
        "0".into()
    } else {
        format!("{value}")
    }
}

/// An angle, with quarter turns written exactly.
fn angle_text(value: f64) -> String {
    let quarters = (value / std::f64::consts::FRAC_PI_2).round();
    if (value - quarters * std::f64::consts::FRAC_PI_2).abs() > 1e-13 {
        return number_text(value);
    }
    #[allow(clippy::cast_possible_truncation, reason = "between -2 and 2")]
    match quarters as i32 {
        0 => "0".into(),
        1 => "pi/2".into(),
        -1 => "-pi/2".into(),
        2 => "pi".into(),
        _ => "-pi".into(),
    }
}
