//! Reads a mechanism from the YAML of its spec. The reader assumes a valid file: the engine is
//! responsible for explaining a user's mistakes, and here a mistake only has to give some error.

mod tree;

use crate::load_fields::{Names, entries, list, scalar, text, vector};
use crate::mechanism::{Coupling, Cut, Mechanism, SwingLimit};
use crate::yaml::Value;

use tree::Tree;

impl Mechanism {
    /// Reads a spec.
    ///
    /// # Errors
    /// A text about the first mistake, where the YAML is not a spec.
    pub fn from_yaml(yaml: &str) -> Result<Mechanism, String> {
        let spec = Value::read(yaml)?;
        let mut names = Names::new();
        for (name, value) in entries(&spec, "geometry")? {
            let value = scalar(value, &names)?;
            names.insert(name, value);
        }
        let gravity = spec
            .get("gravity")
            .map_or(Ok([0.0, 0.0, -9.81]), |v| vector(v, &names))?;
        let mut tree = Tree::default();
        let limbs = list(&spec, "limbs")?;
        let mut coordinates = vec![0..0; limbs.len()];
        let mut bodies = coordinates.clone();
        for at in from_the_ground_up(limbs)? {
            let before = (tree.coordinates.len(), tree.bodies.len());
            tree.limb(&limbs[at], &names)
                .map_err(|e| in_item(&limbs[at], &e))?;
            coordinates[at] = before.0..tree.coordinates.len();
            bodies[at] = before.1..tree.bodies.len();
        }
        tree.number_as_written(
            &coordinates.into_iter().flatten().collect::<Vec<_>>(),
            &bodies.into_iter().flatten().collect::<Vec<_>>(),
        );
        let forms = entries(&spec, "drives")?
            .iter()
            .map(|(name, drive)| tree.drive(name, drive, &names))
            .collect::<Result<Vec<Coupling>, _>>()?;
        let cuts: Vec<Cut> = list(&spec, "cuts")?
            .iter()
            .map(|cut| tree.cut(cut, &names).map_err(|e| in_item(cut, &e)))
            .collect::<Result<_, _>>()?;
        for item in list(&spec, "springs")? {
            tree.spring(item, &names).map_err(|e| in_item(item, &e))?;
        }
        let mut couplings = entries(&spec, "couplings")?
            .iter()
            .map(|(key, form)| tree.coupling(key, form, &names))
            .collect::<Result<Vec<_>, _>>()?;
        let drives: Vec<usize> = forms.iter().map(|form| form.key).collect();
        couplings.extend(forms);
        for coupling in &mut couplings {
            // The forms were read where fewer drives were known.
            coupling.coefficients.resize(tree.coordinates.len(), 0.0);
        }
        for (label, value) in entries(&spec, "bodies")? {
            tree.nominal_body(&label, value, &names)?;
        }
        let independent = match spec.get("independent") {
            None => tree.actuated.clone(),
            Some(_) => list(&spec, "independent")?
                .iter()
                .map(|v| tree.coordinate(&text(v)?))
                .collect::<Result<_, _>>()?,
        };
        let n = tree.coordinates.len();
        let dependent = (0..n).filter(|k| !independent.contains(k)).collect();
        let mut home_guess = vec![0.0; n];
        let mut stated = vec![false; n];
        for (name, value) in entries(&spec, "home")? {
            let at = tree.coordinate(&name)?;
            home_guess[at] = scalar(value, &names)?;
            stated[at] = true;
        }
        // A drive starts where the home of its joints puts it. Joints without a stated home follow
        // from their couplings for this.
        let mut followed = home_guess.clone();
        for _ in 0..=couplings.len() {
            for coupling in couplings.iter().filter(|c| !stated[c.key]) {
                let terms = coupling.coefficients.iter().zip(&followed);
                followed[coupling.key] = coupling.constant + terms.map(|(a, q)| a * q).sum::<f64>();
            }
        }
        for drive in &drives {
            home_guess[*drive] = followed[*drive];
        }
        let mut cones = std::mem::take(&mut tree.cones);
        for (cut, item) in cuts.iter().zip(list(&spec, "cuts")?) {
            if let Some(cone) = item.get("limits").and_then(|l| l.get("cone")) {
                cones.push(SwingLimit {
                    name: cut.name.clone(),
                    greatest: scalar(cone, &names)?,
                    sides: cut.sides.clone(),
                });
            }
        }
        Ok(Mechanism {
            name: text(spec.get("name").ok_or("no name")?)?,
            gravity,
            parameters: tree.parameters(),
            coordinates: tree.coordinates,
            nodes: tree.nodes,
            bodies: tree.bodies,
            cuts,
            cones,
            couplings,
            drives,
            independent,
            dependent,
            actuated: tree.actuated,
            friction: tree.friction,
            offset: tree.offset,
            rotor: tree.rotor,
            springs: tree.springs,
            terms: tree.terms,
            home_guess,
            nominal: tree.nominal,
        })
    }
}

fn in_item(item: &Value, error: &str) -> String {
    let name = item.get("name").map_or(Ok(String::new()), text);
    format!("'{}': {error}", name.unwrap_or_default())
}

/// The indices of the limbs, ordered so that each starts from the world or a body of an earlier
/// limb.
fn from_the_ground_up(limbs: &[Value]) -> Result<Vec<usize>, String> {
    let mut order = Vec::new();
    let mut labels = vec!["world".to_owned()];
    while order.len() < limbs.len() {
        let before = order.len();
        for (at, limb) in limbs.iter().enumerate() {
            let from = limb.get("from").map_or(Ok("world".into()), text)?;
            if order.contains(&at) || !labels.contains(&from) {
                continue;
            }
            order.push(at);
            for joint in list(limb, "joints")? {
                labels.extend(joint.get("body").map(text).transpose()?);
            }
        }
        if order.len() == before {
            return Err("a limb starts nowhere".into());
        }
    }
    Ok(order)
}
