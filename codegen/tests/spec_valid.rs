//! Valid specs: what is read from them.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use std::path::Path;

use regen_codegen::diag::Source;
use regen_codegen::spec::{Spec, parse};

fn read(text: &str) -> Spec {
    parse(&Source::new("test.yaml", text))
        .unwrap_or_else(|report| panic!("{}", report.render(false)))
}

fn oracle(name: &str) -> Spec {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../tests/oracle")
        .join(name);
    read(&std::fs::read_to_string(path).unwrap())
}

#[test]
fn the_oracle_files_are_valid_and_number_their_coordinates_in_order() {
    let rps3 = oracle("3rps.yaml");
    assert_eq!(
        rps3.coordinates(),
        ["q1", "q2", "s1.1", "s1.2", "s1.3", "q6", "q7", "q8", "q9"]
    );
    assert_eq!(rps3.body_labels(), ["1", "2", "3", "4", "5", "6", "7"]);
    assert_eq!(rps3.parameters().len(), 70);
    assert_eq!(rps3.parameters()[12], "Ixz(2)");
    assert_eq!(rps3.cuts.len(), 2);
    assert_eq!(rps3.base.eliminate.len(), 3);

    let tree = oracle("tree_branch.yaml");
    assert_eq!(tree.coordinates(), ["t1", "t2", "a1.1", "a1.2", "a2", "b1"]);
    assert_eq!(tree.limbs[1].from.as_ref().unwrap().value, "mast");

    assert_eq!(oracle("fivebar.yaml").coordinates().len(), 4);
    assert_eq!(oracle("puma560.yaml").coordinates().len(), 6);
}
