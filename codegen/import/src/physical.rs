//! Checks whether a rigid body may have the inertia that a file states.

use regen_codegen::spec::{Flaw, flaw};

use crate::log::Log;
use crate::tree::{Inertia, Link};

/// Tensors whose flaw is below this part of their largest entry are physical up to rounding.
const TOLERANCE: f64 = 1e-12;
/// Moments of inertia below the mass times this, m^2, are rounding: no body is so small.
const NEGLIGIBLE_M2: f64 = 1e-15;

/// The inertia of a link, without entries that are rounding. Adds an error or a note if no rigid body
/// can have it.
pub(crate) fn plausible(link: &Link, log: &mut Log) -> Inertia {
    let mut inertia = link.inertia.unwrap_or(Inertia::NONE);
    match flaw(inertia.tensor, TOLERANCE) {
        None => {}
        Some(_) if is_negligible(&inertia) => {
            inertia.tensor = [0.0; 6];
            let text = "inertias that are rounding count as 0: of {}";
            log.note_digits(link.place, text, &format!("'{}'", link.name));
        }
        Some(Flaw::Indefinite) => {
            let message = format!("no body has the inertia of '{}'", link.name);
            let hint = "it is not positive semidefinite: mend the file";
            log.error(link.place, message, hint);
        }
        Some(Flaw::Triangle) => {
            let text = "no body has the inertia of {}: it breaks the triangle inequality";
            log.note_of(link.place, text, &format!("'{}'", link.name));
        }
    }
    inertia
}

fn is_negligible(inertia: &Inertia) -> bool {
    let largest = inertia.tensor.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    largest <= NEGLIGIBLE_M2 * inertia.mass
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::Place;
    use crate::pose::Pose;

    fn taken(mass: f64, tensor: [f64; 6]) -> (bool, [f64; 6]) {
        let mut log = Log::default();
        let inertia = Inertia {
            mass,
            com: [0.0; 3],
            tensor,
        };
        let link = Link {
            name: "head".to_owned(),
            place: Place::default(),
            parent: None,
            pose: Pose::default(),
            joints: Vec::new(),
            inertia: Some(inertia),
            unknown: false,
        };
        let tensor = plausible(&link, &mut log).tensor;
        (log.failed(), tensor)
    }

    #[test]
    fn rounding_is_no_inertia_and_no_error() {
        let rounding = [0.0, 0.0, 2.4e-35, 0.0, 0.0, 0.0];
        assert_eq!(taken(1.3, rounding), (false, [0.0; 6]));
        // without a mass there is nothing to compare with
        assert!(taken(0.0, rounding).0);
        let indefinite = [1e-3, 0.0, 2e-3, 1e-3, 0.0, 1e-3];
        assert_eq!(taken(1.3, indefinite), (true, indefinite));
    }
}
