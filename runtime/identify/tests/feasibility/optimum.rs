//! The optimum is proven even for data that do not determine all parameters; every constraint is
//! fulfilled or refused.

use regen_identify::estimate::QrFactor;
use regen_identify::feasibility::{
    BaseMap, Bound, FeasibilityError, Options, Outcome, ParameterLayout, SYMBOLS, Scale, Total,
    Verdict, identify, inertial_parameters, verdict,
};

/// Pseudo-random numbers in -1..1 (SplitMix64), the same on every machine.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        2.0 * (((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
    }

    /// Three point masses near each other with the total mass `mass`, kg: a body that is nearly
    /// flat.
    fn body(&mut self, mass: f64) -> [f64; 10] {
        let mut j = [[0.0; 4]; 4];
        for _ in 0..3 {
            let r = [
                0.3 * self.signed(),
                0.3 * self.signed(),
                0.3 * self.signed(),
                1.0,
            ];
            for a in 0..4 {
                for b in 0..4 {
                    j[a][b] += mass / 3.0 * r[a] * r[b];
                }
            }
        }
        (0..3).for_each(|k| j[k][k] += 1e-4 * mass);
        inertial_parameters(&j)
    }
}

/// Two or three bodies, light and heavy ones together, whose combinations are observed by too few
/// or nearly dependent rows.
pub(crate) struct Problem {
    pub(crate) layout: ParameterLayout,
    pub(crate) combinations: BaseMap,
    pub(crate) factor: QrFactor,
    pub(crate) truth: Vec<f64>,
}

pub(crate) fn problem(seed: u64) -> Problem {
    let mut random = Random(seed);
    let bodies = 2 + usize::from(seed.is_multiple_of(3));
    let labels = crate::robots::labels(bodies);
    let layout = ParameterLayout::new(&labels).unwrap();
    let mut truth: Vec<f64> = Vec::new();
    for b in 0..bodies {
        truth.extend(random.body([6.0, 0.03, 0.8][b]));
    }
    truth.extend((0..bodies).map(|_| 0.2 + 0.1 * random.signed()));
    let p = labels.len();
    // every third inertial parameter is observed only as a part of two others
    let observed: Vec<usize> = (0..p).filter(|j| *j >= 10 * bodies || j % 3 != 1).collect();
    let mut rows: Vec<Vec<f64>> = observed
        .iter()
        .map(|k| (0..p).map(|j| if j == *k { 1.0 } else { 0.0 }).collect())
        .collect();
    for j in (0..10 * bodies).filter(|j| j % 3 == 1) {
        for _ in 0..2 {
            #[allow(clippy::cast_sign_loss, reason = "it is not negative")]
            let to =
                (f64::midpoint(random.signed(), 1.0) * (observed.len() - bodies) as f64) as usize;
            rows[to.min(observed.len() - bodies - 1)][j] += random.signed();
        }
    }
    let names: Vec<String> = observed.iter().map(|k| labels[*k].clone()).collect();
    let combinations = BaseMap::new(names.clone(), rows).unwrap();
    let beta = combinations.apply(&truth).unwrap();
    let (r, samples) = (
        observed.len(),
        if seed.is_multiple_of(2) {
            60
        } else {
            observed.len() - 3
        },
    );
    // columns that differ by orders of magnitude, and two that are nearly the same
    let mut w: Vec<f64> = (0..samples * r).map(|_| random.signed()).collect();
    for (k, column) in w.chunks_exact_mut(samples).enumerate() {
        let size = [1.0, 0.05, 3.0, 0.4][k % 4];
        for x in column {
            *x *= size;
        }
    }
    for i in 0..samples {
        w[samples + i] = 0.01 * w[samples + i] + 0.3 * w[i];
    }
    let tau: Vec<f64> = (0..samples)
        .map(|i| {
            let exact: f64 = (0..r).map(|k| w[k * samples + i] * beta[k]).sum();
            exact + 0.3 * random.signed()
        })
        .collect();
    let mut factor = QrFactor::new(names);
    factor.push_block(&w, &tau).unwrap();
    Problem {
        layout,
        combinations,
        factor,
        truth,
    }
}

#[test]
fn the_optimum_is_proven_for_poor_data_without_a_reference() {
    let mut active = 0;
    for seed in 0..24 {
        let Problem {
            layout,
            combinations,
            factor,
            truth,
        } = problem(seed);
        let at = |label: &str| layout.find(label).unwrap();
        let mut options = Options::default();
        if seed % 4 > 0 {
            options.bounds.push(Bound {
                parameter: "m(1)".to_owned(),
                lowest: 0.3 * truth[at("m(1)")],
                highest: 0.8 * truth[at("m(1)")],
            });
            options.bounds.push(Bound {
                parameter: "Fv(q1)".to_owned(),
                lowest: 0.0,
                highest: 0.05,
            });
        }
        if seed % 4 > 1 {
            options.totals.push(Total {
                parameters: vec!["m(1)".to_owned(), "m(2)".to_owned()],
                value: 0.7 * truth[at("m(1)")],
            });
        }
        let found = identify(&factor, &combinations, &layout, &options).unwrap();
        // measured: at most 1.2e-6, and 1.4e-5 with fewer rows than unknowns, where only rounding
        // and the safety limits bound the optimum
        let most = if seed.is_multiple_of(2) { 3e-6 } else { 1e-4 };
        assert!(found.gap <= most, "{seed}: gap {:e}", found.gap);
        assert!(found.is_optimal() && found.check.is_physical(), "{seed}");
        assert!(found.limited.is_empty(), "{seed}: {:?}", found.limited);
        for bound in &options.bounds {
            let x = found.phi[at(&bound.parameter)];
            assert!(x >= bound.lowest && x <= bound.highest, "{seed}: {x}");
        }
        for total in &options.totals {
            let sum: f64 = total.parameters.iter().map(|l| found.phi[at(l)]).sum();
            assert!(
                (sum - total.value).abs() < 1e-12 * (1.0 + total.value),
                "{seed}"
            );
        }
        active += usize::from(found.rise() > 1e-3);
        // by the gap, no robot that fulfils all constraints fits better than this
        let lowest = found.squared_residual * (1.0 - found.gap) - 1e-12;
        if options.bounds.is_empty() {
            let beta = combinations.apply(&truth).unwrap();
            assert!(factor.squared_residual(&beta).unwrap() >= lowest, "{seed}");
        }
        // the same for mixtures of the result with random physical robots that fulfil all
        // constraints
        let mut random = Random(seed + 1000);
        for _ in 0..50 {
            let mut other = found.phi.clone();
            for body in layout.bodies() {
                let near = random.body(found.phi[body.columns[9]]);
                let part = 0.5 + 0.5 * random.signed();
                for (column, x) in body.columns.iter().zip(near) {
                    other[*column] += part * part * part * (x - other[*column]);
                }
            }
            let beta = combinations.apply(&other).unwrap();
            assert!(factor.squared_residual(&beta).unwrap() >= lowest, "{seed}");
        }
    }
    assert!(active >= 12, "constraints take part in {active} of 24");
}

/// Choosing parameters near a reference does not increase the residual of poor data.
#[test]
fn the_reference_does_not_worsen_the_fit() {
    for seed in 0..12 {
        let Problem {
            layout,
            combinations,
            factor,
            truth,
        } = problem(seed);
        let plain = identify(&factor, &combinations, &layout, &Options::default()).unwrap();
        let options = Options {
            reference: truth.iter().map(|x| Some(3.0 * x)).collect(),
            ..Options::default()
        };
        let near = identify(&factor, &combinations, &layout, &options).unwrap();
        let ratio = near.squared_residual / plain.squared_residual;
        assert!((ratio - 1.0).abs() < 3e-6, "{seed}: {ratio}");
        assert!(near.is_optimal() && near.check.is_physical(), "{seed}");
    }
}

/// Among the parameters that fit equally well, those near the reference are chosen, whether a
/// constraint is active or not.
#[test]
fn undetermined_parameters_follow_the_reference() {
    let (layout, _, _) = one();
    let observed = BaseMap::identity(layout.labels())
        .select(&[5, 6, 9, 10])
        .unwrap();
    for friction in [0.3, -0.3] {
        let mut factor = QrFactor::new(observed.labels().to_vec());
        let mut w = vec![0.0; 16];
        w.iter_mut().step_by(5).for_each(|x| *x = 1.0);
        factor.push_block(&w, &[0.2, 0.3, 2.0, friction]).unwrap();
        for open in [0.4, 1.5] {
            let mut reference = vec![None; 11];
            (reference[0], reference[3]) = (Some(open), Some(open));
            let options = Options {
                reference,
                ..Options::default()
            };
            let found = identify(&factor, &observed, &layout, &options).unwrap();
            let active = found.outcome == Outcome::Constrained;
            assert_eq!(active, friction < 0.0);
            for column in [0, 3] {
                let x = found.phi[column];
                // the weight of the reference is limited by what it may cost
                assert!((x - open).abs() < 0.02 * open, "{friction} {open}: {x}");
            }
            assert!((found.phi[5] - 0.2).abs() < 1e-4 && (found.phi[9] - 2.0).abs() < 1e-4);
        }
    }
}

fn one() -> (ParameterLayout, BaseMap, QrFactor) {
    let mut labels: Vec<String> = SYMBOLS.iter().map(|s| format!("{s}(1)")).collect();
    labels.push("Fc(q1)".to_owned());
    let mut factor = QrFactor::new(labels.clone());
    let mut w = vec![0.0; 121];
    w.iter_mut().step_by(12).for_each(|x| *x = 1.0);
    let values = [0.2, 0.0, 0.0, 0.2, 0.0, 0.2, 0.1, 0.05, 0.0, 3.0, -0.4];
    factor.push_block(&w, &values).unwrap();
    (
        ParameterLayout::new(&labels).unwrap(),
        BaseMap::identity(&labels),
        factor,
    )
}

/// A lower limit below 0 replaces the sign of friction; the offset of a torque sensor needs it.
#[test]
fn a_negative_lower_limit_of_friction_replaces_its_sign_constraint() {
    let (layout, combinations, factor) = one();
    let bounded = identify(&factor, &combinations, &layout, &Options::default()).unwrap();
    assert!(bounded.phi[10].abs() < 1e-6);
    let free = |lowest: f64| Options {
        bounds: vec![Bound {
            parameter: "Fc(q1)".to_owned(),
            lowest,
            highest: f64::INFINITY,
        }],
        ..Options::default()
    };
    for (lowest, expected) in [(-5.0, -0.4), (-0.1, -0.1), (f64::NEG_INFINITY, -0.4)] {
        if lowest.is_finite() {
            let found = identify(&factor, &combinations, &layout, &free(lowest)).unwrap();
            assert!((found.phi[10] - expected).abs() < 1e-4, "{:?}", found.phi);
            assert!(found.check.is_physical(), "{:?}", found.check);
            assert!(found.is_optimal(), "{:e}", found.gap);
        } else {
            let error = identify(&factor, &combinations, &layout, &free(lowest)).unwrap_err();
            assert!(matches!(error, FeasibilityError::Idle(_)), "{error}");
        }
    }
}

#[test]
fn options_without_effect_are_refused() {
    let (layout, combinations, factor) = one();
    let bound = |parameter: &str, lowest: f64, highest: f64| Bound {
        parameter: parameter.to_owned(),
        lowest,
        highest,
    };
    let bounded = |bounds: Vec<Bound>| Options {
        bounds,
        ..Options::default()
    };
    let known = |label: &str, value: f64| (label.to_owned(), value);
    let idle = [
        bounded(vec![bound("m(1)", -1.0, 5.0)]),
        bounded(vec![bound("m(1)", 0.0, f64::INFINITY)]),
        bounded(vec![bound("Fc(q1)", 0.0, f64::INFINITY)]),
        Options {
            known: vec![known("m(1)", 3.0), known("m(1)", 3.0)],
            ..Options::default()
        },
        Options {
            known: vec![known("m(1)", 3.0)],
            ..bounded(vec![bound("m(1)", 1.0, 5.0)])
        },
        Options {
            known: vec![known("m(1)", 3.0)],
            totals: vec![Total {
                parameters: vec!["m(1)".to_owned()],
                value: 3.0,
            }],
            ..Options::default()
        },
        Options {
            identical: vec![vec!["1".to_owned()]],
            ..Options::default()
        },
    ];
    for options in idle {
        let error = identify(&factor, &combinations, &layout, &options).unwrap_err();
        assert!(matches!(error, FeasibilityError::Idle(_)), "{error}");
    }
    let contradictory = [
        Options {
            known: vec![known("m(1)", 3.0), known("m(1)", 2.0)],
            ..Options::default()
        },
        Options {
            known: vec![known("m(1)", 3.0)],
            ..bounded(vec![bound("m(1)", 4.0, 5.0)])
        },
        Options {
            known: vec![known("Ixx(1)", 1.0), known("Iyy(1)", 1.0)],
            ..bounded(vec![bound("Izz(1)", 2.5, 5.0)])
        },
        Options {
            known: vec![known("Fc(q1)", -1.0)],
            ..Options::default()
        },
    ];
    for options in contradictory {
        let error = identify(&factor, &combinations, &layout, &options).unwrap_err();
        assert!(
            matches!(error, FeasibilityError::Contradiction(_)),
            "{error}"
        );
    }
}

/// Forms that the spec takes as zero are fulfilled, and verdicts include them.
#[test]
fn forms_that_the_spec_takes_as_zero_are_zero() {
    let (layout, _, _) = one();
    let all = BaseMap::identity(layout.labels());
    let observed = all.select(&[5, 6, 9]).unwrap();
    // my = 0.5 mx, and Iyy = 0
    let mut forms = vec![vec![0.0; 11]; 2];
    (forms[0][7], forms[0][6]) = (-1.0, 0.5);
    forms[1][3] = 1.0;
    let named = forms.into_iter().zip(["my(1)", "Iyy(1)"]);
    let zeros = named.map(|(row, name)| (name.to_owned(), row)).collect();
    let with_forms = observed.clone().with_zeros(zeros).unwrap();
    let mut factor = QrFactor::new(observed.labels().to_vec());
    let w = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
    factor.push_block(&w, &[0.2, 0.3, 2.0]).unwrap();
    let beta = [0.2, 0.3, 2.0];
    let free = verdict(&layout, &observed, &beta, Scale::default()).unwrap();
    assert!(free.is_feasible());
    // with Iyy = 0 all mass is on the y axis, so that mx is 0
    let decision = verdict(&layout, &with_forms, &beta, Scale::default()).unwrap();
    assert!(!decision.is_feasible(), "{decision:?}");
    let found = identify(&factor, &with_forms, &layout, &Options::default()).unwrap();
    assert!(found.phi[3].abs() < 1e-9 && (found.phi[7] - 0.5 * found.phi[6]).abs() < 1e-9);
    assert!(found.phi[6].abs() < 1e-9, "{:?}", found.phi);
    assert!((found.phi[9] - 2.0).abs() < 1e-4 && (found.phi[5] - 0.2).abs() < 1e-4);
    assert!(found.is_optimal(), "{:e}", found.gap);
    // a known value that contradicts a form of the spec
    let against = Options {
        known: vec![("Iyy(1)".to_owned(), 0.1)],
        ..Options::default()
    };
    let error = identify(&factor, &with_forms, &layout, &against).unwrap_err();
    assert!(
        matches!(error, FeasibilityError::Contradiction(_)),
        "{error}"
    );
}

/// With a single form the set still has an interior, and the proofs of both verdicts are valid.
#[test]
fn verdicts_with_a_zero_form_are_proven() {
    let (layout, _, _) = one();
    let observed = BaseMap::identity(layout.labels()).select(&[0, 5]).unwrap();
    // Iyy = Izz + 2 Ixx contradicts the triangle inequality for every Ixx above 0
    let mut row = vec![0.0; 11];
    (row[3], row[5], row[0]) = (-1.0, 1.0, 2.0);
    let with_forms = observed
        .with_zeros(vec![("Iyy(1)".to_owned(), row)])
        .unwrap();
    let decision = verdict(&layout, &with_forms, &[0.1, 0.2], Scale::default()).unwrap();
    let Verdict::Infeasible { certificate } = decision else {
        panic!("{decision:?}");
    };
    assert_eq!(certificate.weights.len(), 3);
    assert!(certificate.value < 0.0 && certificate.defect < 1e-9);
}

/// Bodies whose feasible set has no interior: without mass, or a rod along an axis.
#[test]
fn bodies_whose_feasible_set_has_no_interior_are_found_on_its_faces() {
    let (layout, combinations, factor) = one();
    let known = |label: &str| Options {
        known: vec![(label.to_owned(), 0.0)],
        ..Options::default()
    };
    let none = identify(&factor, &combinations, &layout, &known("m(1)")).unwrap();
    assert!(
        none.phi[6..10].iter().all(|x| x.abs() < 1e-12),
        "{:?}",
        none.phi
    );
    assert!(none.is_optimal() && none.check.is_physical());
    // the moments about the other axes are free, because distant masses can have any: all of 0.2
    // remain
    let rod = identify(&factor, &combinations, &layout, &known("Ixx(1)")).unwrap();
    assert!(
        rod.phi[1].abs() < 1e-9 && rod.phi[7].abs() < 1e-9,
        "{:?}",
        rod.phi
    );
    assert!((rod.phi[3] - rod.phi[5]).abs() < 1e-9 && (rod.phi[9] - 3.0).abs() < 1e-4);
    assert!(rod.is_optimal() && rod.check.is_physical());
}

/// The parameters in the frame of one body that those of a body welded to it add, column by column.
///
/// - `placed`: the homogeneous transform from the welded body's frame to that of the other.
fn carried(placed: &[[f64; 4]; 4]) -> [[f64; 10]; 10] {
    core::array::from_fn(|k| {
        let own = regen_identify::feasibility::pseudo_inertia(&core::array::from_fn(|j| {
            if j == k { 1.0 } else { 0.0 }
        }));
        let entry = |a: usize, b: usize| {
            let pairs = (0..16).map(|i| (i / 4, i % 4));
            pairs
                .map(|(c, d)| placed[a][c] * own[c][d] * placed[b][d])
                .sum::<f64>()
        };
        inertial_parameters(&core::array::from_fn(|a| {
            core::array::from_fn(|b| entry(a, b))
        }))
    })
}

#[test]
fn welded_bodies_fit_as_well_as_the_one_body_that_they_are() {
    for seed in 0..6_u64 {
        let mut random = Random(40 + seed);
        let bodies = 3 + 4 * usize::try_from(seed).unwrap();
        let labels: Vec<String> = (1..=bodies)
            .flat_map(|b| SYMBOLS.iter().map(move |s| format!("{s}({b})")))
            .collect();
        let lump = &labels[..10];
        // all but the first are welded to it
        let mut rows: Vec<Vec<f64>> = vec![vec![0.0; labels.len()]; 10];
        for b in 0..bodies {
            let (sin, cos) = (2.0 * random.signed()).sin_cos();
            let mut at = || 0.3 * random.signed();
            let placed = [
                [cos, -sin, 0.0, at()],
                [sin, cos, 0.0, at()],
                [0.0, 0.0, 1.0, at()],
                [0.0, 0.0, 0.0, 1.0],
            ];
            for (k, column) in carried(&placed).iter().enumerate() {
                for (row, x) in rows.iter_mut().zip(column) {
                    row[10 * b + k] = *x;
                }
            }
        }
        for (i, row) in rows.iter_mut().enumerate() {
            (0..10).for_each(|k| row[k] = f64::from(k == i));
        }
        let welded = BaseMap::new(lump.to_vec(), rows).unwrap();
        let alone = BaseMap::identity(lump);
        // the values of a body and noise that no body has
        let truth = random.body(2.0);
        let mut factor = QrFactor::new(lump.to_vec());
        for _ in 0..40 {
            let w: Vec<f64> = (0..10).map(|_| random.signed()).collect();
            let exact: f64 = w.iter().zip(&truth).map(|(w, x)| w * x).sum();
            factor
                .push_block(&w, &[exact + 0.5 * random.signed()])
                .unwrap();
        }
        let fit = |map: &BaseMap, labels: &[String]| {
            let layout = ParameterLayout::new(labels).unwrap();
            identify(&factor, map, &layout, &Options::default()).unwrap()
        };
        let (one, many) = (fit(&alone, lump), fit(&welded, &labels));
        assert_eq!(one.outcome, Outcome::Constrained, "{seed}");
        for found in [&one, &many] {
            assert!(
                found.is_optimal() && found.check.is_physical(),
                "{seed}: {}",
                found.gap
            );
            assert!(found.limited.is_empty(), "{seed}");
        }
        let allowed = (one.gap + many.gap) * one.squared_residual;
        assert!(
            (one.squared_residual - many.squared_residual).abs() <= allowed,
            "{seed}"
        );
        for (a, b) in one.beta.iter().zip(&many.beta) {
            assert!((a - b).abs() < 1e-4, "{seed}: {a} {b}");
        }
    }
}
