//! The global unknowns of a fit: base parameters, gains, and the values of signals.

use crate::setup::{Law, Setup, SignalKind, SignalModel, Value};

/// A value with its column among the unknowns, if it is estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) value: f64,
    pub(crate) column: Option<usize>,
}

/// The unknowns that all windows share, with their places.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unknowns {
    /// The number of base parameters, which come first.
    pub(crate) base: usize,
    pub(crate) labels: Vec<String>,
    /// For each controller, the places of its values.
    laws: Vec<[Option<usize>; 4]>,
    setup: Setup,
    signals: Vec<(SignalKind, [Option<usize>; 3])>,
}

impl Unknowns {
    /// Lists the unknowns; returns them with their first values.
    ///
    /// - `base`: labels and first values of the base parameters;
    /// - `joints`: the names of the actuated joints;
    /// - `signals`: all signals, with their names.
    pub(crate) fn new(
        base: &[(&str, f64)],
        joints: &[&str],
        signals: &[(SignalKind, String)],
        setup: &Setup,
    ) -> (Self, Vec<f64>) {
        let mut labels: Vec<String> = base.iter().map(|(label, _)| (*label).to_owned()).collect();
        let mut values: Vec<f64> = base.iter().map(|(_, value)| *value).collect();
        let mut place = |value: Value, label: String| {
            value.is_estimated().then(|| {
                labels.push(label);
                values.push(value.value);
                labels.len() - 1
            })
        };
        let mut laws = Vec::new();
        for (law, joint) in setup.laws.iter().zip(joints) {
            let mut own = [None; 4];
            for ((slot, value), name) in own.iter_mut().zip(law.gains()).zip(Law::NAMES) {
                *slot = place(value, format!("{name}({joint})"));
            }
            laws.push(own);
        }
        let mut all = Vec::new();
        for (kind, name) in signals {
            let mut own = [None; 3];
            let model = setup.signal(*kind);
            for ((slot, value), word) in own.iter_mut().zip(model.values()).zip(SignalModel::NAMES)
            {
                *slot = place(value, format!("{word}({name})"));
            }
            all.push((*kind, own));
        }
        let unknowns = Self {
            base: base.len(),
            labels,
            laws,
            setup: setup.clone(),
            signals: all,
        };
        (unknowns, values)
    }

    /// The number of unknowns.
    pub(crate) fn len(&self) -> usize {
        self.labels.len()
    }

    /// Whether an unknown is a base parameter or a controller's gain: multiplying all of these by
    /// the same factor does not change the motion.
    pub(crate) fn is_effort(&self, place: usize) -> bool {
        place < self.base || self.laws.iter().flatten().any(|p| *p == Some(place))
    }

    /// The values of a controller, at these unknowns.
    pub(crate) fn law(&self, joint: usize, at: &[f64]) -> [Entry; 4] {
        let places = self.laws.get(joint).copied().unwrap_or_default();
        let known = self.setup.laws.get(joint).map(Law::gains);
        let known = known.unwrap_or([Value::known(0.0); 4]);
        core::array::from_fn(|k| entry(places[k], known[k], at))
    }

    /// The values of a signal, at these unknowns.
    pub(crate) fn signal(&self, kind: SignalKind, at: &[f64]) -> [Entry; 3] {
        let own = self.signals.iter().find(|(k, _)| *k == kind);
        let places = own.map_or([None; 3], |(_, places)| *places);
        let known = self.setup.signal(kind).values();
        core::array::from_fn(|k| entry(places[k], known[k], at))
    }
}

fn entry(column: Option<usize>, known: Value, at: &[f64]) -> Entry {
    let own = column.and_then(|k| at.get(k)).copied();
    Entry {
        value: own.unwrap_or(known.value),
        column,
    }
}
