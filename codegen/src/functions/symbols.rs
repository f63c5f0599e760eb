//! The symbols that stand for the functions' arguments.

use crate::model::Model;
use crate::optimize::Argument;
use crate::sym::{Ex, Graph, SymbolId};

/// Symbols by argument. Coordinates come first in the graph, in order.
#[derive(Clone, Debug)]
pub struct Symbols {
    q: Vec<SymbolId>,
    qd: Vec<SymbolId>,
    qdd: Vec<SymbolId>,
    phi: Vec<SymbolId>,
    tau: Vec<SymbolId>,
    qd_r: Vec<SymbolId>,
    qdd_r: Vec<SymbolId>,
    independent: Vec<usize>,
}

impl Symbols {
    /// Makes the symbols in a graph that has none yet.
    pub fn new(g: &mut Graph, model: &Model) -> Self {
        let mut all = |suffix: &str, which: &[usize]| -> Vec<SymbolId> {
            which
                .iter()
                .map(|c| g.symbol_id(&format!("{}{suffix}", model.coordinates[*c].name)))
                .collect()
        };
        let every = (0..model.coordinates.len()).collect::<Vec<_>>();
        let q = all("", &every);
        let qd = all("'", &every);
        let qdd = all("''", &every);
        let qd_r = all("'r", &model.independent);
        let qdd_r = all("''r", &model.independent);
        let tau = all("'tau", &model.actuated);
        let phi = model.parameters.iter().map(|p| g.symbol_id(&p.label));
        Symbols {
            q,
            qd,
            qdd,
            phi: phi.collect(),
            tau,
            qd_r,
            qdd_r,
            independent: model.independent.clone(),
        }
    }

    fn nodes(g: &mut Graph, ids: &[SymbolId]) -> Vec<Ex> {
        let names: Vec<String> = ids.iter().map(|id| g.symbol_name(*id).to_owned()).collect();
        names.iter().map(|name| g.symbol(name)).collect()
    }

    pub(super) fn qd_nodes(&self, g: &mut Graph) -> Vec<Ex> {
        Self::nodes(g, &self.qd)
    }

    pub(super) fn qdd_nodes(&self, g: &mut Graph) -> Vec<Ex> {
        Self::nodes(g, &self.qdd)
    }

    pub(super) fn phi_nodes(&self, g: &mut Graph) -> Vec<Ex> {
        Self::nodes(g, &self.phi)
    }

    pub(super) fn tau_nodes(&self, g: &mut Graph) -> Vec<Ex> {
        Self::nodes(g, &self.tau)
    }

    pub(super) fn reference_nodes(&self, g: &mut Graph) -> (Vec<Ex>, Vec<Ex>) {
        (Self::nodes(g, &self.qd_r), Self::nodes(g, &self.qdd_r))
    }

    fn argument(name: &str, doc: &str, ids: Vec<SymbolId>) -> (Argument, Vec<SymbolId>) {
        let argument = Argument {
            name: name.to_owned(),
            len: ids.len(),
            doc: doc.to_owned(),
        };
        (argument, ids)
    }

    pub(super) fn q(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument(
            "q",
            "coordinates, rad or m, in the order of `COORDINATES`",
            self.q.clone(),
        )
    }

    pub(super) fn qd(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument("qd", "velocities of all coordinates", self.qd.clone())
    }

    pub(super) fn qdd(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument("qdd", "accelerations of all coordinates", self.qdd.clone())
    }

    pub(super) fn qd_i(&self) -> (Argument, Vec<SymbolId>) {
        let ids = self.independent.iter().map(|c| self.qd[*c]).collect();
        Self::argument(
            "qd_i",
            "velocities of the independent coordinates, in the order of `INDEPENDENT`",
            ids,
        )
    }

    pub(super) fn qdd_i(&self) -> (Argument, Vec<SymbolId>) {
        let ids = self.independent.iter().map(|c| self.qdd[*c]).collect();
        Self::argument("qdd_i", "accelerations of the independent coordinates", ids)
    }

    pub(super) fn phi(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument(
            "phi",
            "dynamic parameters, SI, in the order of `PARAMETERS`",
            self.phi.clone(),
        )
    }

    pub(super) fn tau(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument(
            "tau",
            "efforts of the actuated coordinates, N m or N, in the order of `ACTUATED`",
            self.tau.clone(),
        )
    }

    pub(super) fn qd_r(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument(
            "qd_r",
            "reference velocities of the independent coordinates",
            self.qd_r.clone(),
        )
    }

    pub(super) fn qdd_r(&self) -> (Argument, Vec<SymbolId>) {
        Self::argument(
            "qdd_r",
            "reference accelerations of the independent coordinates",
            self.qdd_r.clone(),
        )
    }
}
