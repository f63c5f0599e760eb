//! Tables of Denavit and Hartenberg parameters become specs.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use regen_codegen::diag::Source;
use regen_codegen::spec;
use regen_import::{Rows, from_dh_table};

fn spec_of(table: &str, rows: Rows) -> String {
    from_dh_table(&Source::new("arm.csv", table), "arm", rows).unwrap()
}

/// The row of each joint as the spec's reader sees it: alpha, a, theta, d.
fn rows_of(text: &str) -> Vec<String> {
    let read = spec::parse(&Source::new("arm.yaml", text)).unwrap();
    assert_eq!(read.name.value, "arm");
    let lines = text.lines().map(str::trim);
    let mut rows: Vec<String> = Vec::new();
    for line in lines {
        if line.starts_with("type:") {
            rows.push(String::new());
        }
        if let (Some(dh), Some(row)) = (line.strip_prefix("dh: "), rows.last_mut()) {
            dh.clone_into(row);
        }
    }
    rows
}

#[test]
fn alpha_and_a_of_classic_rows_move_to_the_next_row() {
    let classic = "joint;type;alpha;a;theta;d\nq1;R;pi/2;0;q1;0.4\nq2;R;0;0.3;q2 + pi/2;0\nq3;P;pi/2;0.1;0;d3\n";
    let modified =
        "joint;type;alpha;a;theta;d\nq1;R;0;0;q1;0.4\nq2;R;pi/2;0;q2 + pi/2;0\nq3;P;0;0.3;0;q3\n";
    let rows = rows_of(&spec_of(classic, Rows::Classic));
    assert_eq!(rows, rows_of(&spec_of(modified, Rows::Modified)));
    assert_eq!(rows, ["{d: 0.4}", "{alpha: pi/2, theta: pi/2}", "{a: 0.3}"]);
}

#[test]
fn units_in_brackets_are_converted_exactly() {
    let table = "alpha [deg],a [mm],theta [deg],d,min [deg],max [deg]\n-90,300,0,0.1,-170,170\n";
    let text = spec_of(table, Rows::Modified);
    assert_eq!(rows_of(&text), ["{alpha: deg(-90), a: (300)/1000, d: 0.1}"]);
    assert!(text.contains("position: [deg(-170), deg(170)]"), "{text}");
}

#[test]
fn mistakes_are_named_with_their_place() {
    for (table, line, message) in [
        ("", 1, "the table is empty"),
        ("alpha,a,theta,d\n", 1, "the table has no row of a joint"),
        ("alpha,a,theta,e\n0,0,0,0\n", 1, "unknown column 'e'"),
        ("alpha,a,theta\n0,0,0\n", 1, "there is no column 'd'"),
        (
            "alpha,a,theta,d\n0,0,0,0\n0,0,0\n",
            3,
            "3 cells, but the first line has 4",
        ),
        ("alpha,a,theta,d\n0,L1,0,0\n", 2, "'L1' is not a number"),
        (
            "alpha,a,theta,d\n0,\"0.3\",0,0\n",
            2,
            "'\"0.3\"' is not a number",
        ),
        ("alpha [rpm],a,theta,d\n0,0,0,0\n", 1, "unknown unit 'rpm'"),
        (
            "joint,alpha,a,theta,d\n1st,0,0,0,0\n",
            2,
            "'1st' is not the name of a joint",
        ),
        (
            "type,alpha,a,theta,d\nscrew,0,0,0,0\n",
            2,
            "unknown type 'screw'",
        ),
        (
            "type,alpha [deg],a,theta,d,min [mm],max [mm]\nR,0,0,0,0.3,-170,170\n",
            2,
            "'-170' is an angle, and its column has another unit",
        ),
        (
            "type,alpha [deg],a,theta,d,min [deg],max [deg]\nP,0,0,0,0.3,0,350\n",
            2,
            "'0' is a length, and its column has another unit",
        ),
        ("alpha [mm],a,theta,d\n90,0,0,0\n", 2, "'90' is an angle"),
        ("alpha,a [rad],theta,d\n0,0.3,0,0\n", 2, "'0.3' is a length"),
        (
            "type,alpha,a,theta,d,min [deg],max [mm]\nR,0,0,0,0.3,-90,90\n",
            2,
            "'90' is an angle",
        ),
    ] {
        let report =
            from_dh_table(&Source::new("arm.csv", table), "arm", Rows::Modified).unwrap_err();
        let text = report.render(false);
        assert!(text.contains(message), "{table:?}: {text}");
        assert!(
            text.contains(&format!("arm.csv:{line}:")),
            "{table:?}: {text}"
        );
    }
}
