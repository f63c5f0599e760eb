//! The base parameters: which combinations of the dynamic parameters a
//! mechanism's forces depend on, exactly (`codegen/BASE.md` explains the method).

mod choice;
pub mod field;
mod geometry;
mod known;
mod linkage;
mod span;
mod tree;
mod trees;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diag::Source;

    #[test]
    fn try_it() {
        for name in ["3rps", "fivebar", "puma560", "tree_branch"] {
            let path = format!("{}/../tests/oracle/{name}.yaml", env!("CARGO_MANIFEST_DIR"));
            let text = std::fs::read_to_string(path).unwrap();
            let spec = crate::spec::parse(&Source::new(name, text)).unwrap();
            let model = crate::model::build(&spec);
            let mut field = field::Field::default();
            let t = std::time::Instant::now();
            let linkage = linkage::Linkage::new(&mut field, &spec, &model);
            let sum = trees::sum(&mut field, &linkage, None);
            eprintln!("{name}: {} trees, dim {} rank {} {:?}", sum.trees, sum.span.dimension(), model.parameters.len() - sum.span.dimension(), t.elapsed());
            let null: Vec<_> = sum.span.vectors().cloned().collect();
            let first: Vec<usize> = spec.base.eliminate.iter().filter_map(|l| model.parameters.iter().position(|p| p.label == l.value)).collect();
            let order = choice::preference(&model, &first);
            let gone = choice::eliminated(&null, &order);
            let rows = choice::reduced(&mut field, &null, &gone);
            for kept in 0..model.parameters.len() {
                if gone.contains(&kept) { continue; }
                let mut s = model.parameters[kept].label.clone();
                for (g, row) in gone.iter().zip(&rows) {
                    if let Some(e) = row.get(&kept) { s += &format!(" + [{}] {}", field.text(&e.neg()), model.parameters[*g].label); }
                }
                eprintln!("{s}");
            }
            for c in field.coincidences() { eprintln!("note {c}"); }
            eprintln!("{:?}", t.elapsed());
        }
    }
}
