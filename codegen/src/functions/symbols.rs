//! The symbols of the functions' arguments.

use crate::model::Model;
use crate::sym::{Ex, Graph, SymbolId};

/// The symbols of each argument. The coordinates are the graph's first symbols, in order.
#[derive(Clone, Debug)]
pub struct Symbols {
    pub(super) q: Vec<SymbolId>,
    pub(super) qd: Vec<SymbolId>,
    pub(super) qdd: Vec<SymbolId>,
    pub(super) phi: Vec<SymbolId>,
    pub(super) tau: Vec<SymbolId>,
    pub(super) tau_i: Vec<SymbolId>,
    pub(super) qd_r: Vec<SymbolId>,
    pub(super) qdd_r: Vec<SymbolId>,
    /// The arguments for adjustable names of the geometry.
    pub(super) geometry: Vec<SymbolId>,
}

impl Symbols {
    /// Adds the symbols to a graph that has none yet, or those of the coordinates and, behind them, of an
    /// adjustable geometry.
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
        let tau_i = all("'tau_i", &model.independent);
        let phi = model.parameters.iter().map(|p| g.symbol_id(&p.label));
        Symbols {
            q,
            qd,
            qdd,
            phi: phi.collect(),
            tau,
            tau_i,
            qd_r,
            qdd_r,
            geometry: Vec::new(),
        }
    }

    /// The same with arguments for the adjustable geometry.
    #[must_use]
    pub fn with_geometry(self, geometry: Vec<SymbolId>) -> Self {
        Symbols { geometry, ..self }
    }

    /// Adds those of the coordinates, which are a graph's first.
    pub fn of_coordinates(g: &mut Graph, model: &Model) {
        for coordinate in &model.coordinates {
            g.symbol_id(&coordinate.name);
        }
    }

    pub(super) fn nodes(g: &mut Graph, ids: &[SymbolId]) -> Vec<Ex> {
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

    pub(super) fn tau_i_nodes(&self, g: &mut Graph) -> Vec<Ex> {
        Self::nodes(g, &self.tau_i)
    }

    pub(super) fn reference_nodes(&self, g: &mut Graph) -> (Vec<Ex>, Vec<Ex>) {
        (Self::nodes(g, &self.qd_r), Self::nodes(g, &self.qdd_r))
    }
}
