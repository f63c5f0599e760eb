//! Compiled engines: every `regen_runtime::Model`, checked in or of the macro.

use regen_codegen::signature::FunctionKind;
use regen_runtime::function::Sizes;
use regen_runtime::{Arguments, Function, Model, Status};

use crate::engine::{Answer, Engine, Names};

/// A model as an engine.
pub struct Compiled<'a>(pub &'a dyn Model<f64>);

impl Engine for Compiled<'_> {
    fn names(&self) -> Names {
        let info = self.0.info();
        let all = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect();
        let pick = |list: &[usize]| {
            let names = list.iter().map(|k| info.coordinates[*k].to_owned());
            names.collect()
        };
        Names {
            coordinates: all(info.coordinates),
            independent: pick(info.independent),
            actuated: pick(info.actuated),
            parameters: info.labels(),
            bodies: all(info.bodies),
            cuts: info
                .cuts
                .iter()
                .map(|c| (c.name.to_owned(), c.rows))
                .collect(),
            cones: info
                .cones
                .iter()
                .map(|c| (c.name.to_owned(), c.greatest))
                .collect(),
            nominal: info.nominal.to_vec(),
        }
    }

    fn home(&self) -> Vec<f64> {
        self.0.info().home.to_vec()
    }

    fn call(&self, kind: FunctionKind, inputs: &[&[f64]]) -> Answer<Vec<f64>> {
        let name = kind.name();
        let mut functions = Function::ALL.into_iter();
        let function = functions.find(|f| f.signature().name == name);
        let function = function.ok_or_else(|| format!("{name} is no function of Model"))?;
        let signature = function.signature();
        if inputs.len() != signature.arguments.len() {
            return Err(format!("{name}: {} arguments", inputs.len()));
        }
        let given = signature.arguments.iter().zip(inputs);
        let arguments = given.fold(Arguments::EMPTY, |all, (a, entries)| all.with(*a, entries));
        // What is not written stays recognisable.
        let mut out = vec![f64::NAN; Sizes::of(&self.0.info()).output(signature)];
        let condition = self.0.eval(function, arguments, &mut out);
        let condition = condition.map_err(|e| format!("{name}: {e}"))?;
        match condition.status() {
            Status::Singular => Err(format!("{name}: {condition:?}")),
            Status::Regular | Status::NearSingular => Ok(out),
        }
    }
}
