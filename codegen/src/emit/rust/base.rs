//! Emits the base parameters as constants.

use std::fmt::Write as _;

use crate::base::Analysis;
use crate::robot::Robot;

use super::super::documentation::certified;
use super::super::elements::eliminated_labels;
use super::names::literal;

/// Emits the constants `BASE`, `ZEROS` (if there are any), `FREE` and `BASE_INFO`.
pub(super) fn constants(robot: &Robot, analysis: &Analysis, out: &mut String) {
    let base = &analysis.base;
    let kept: Vec<_> = base.parameters.iter().filter(|p| !p.dropped).collect();
    let _ = writeln!(
        out,
        "/// The base parameters, in the order of `beta`: the columns of `base_regressor`."
    );
    let _ = writeln!(
        out,
        "pub const BASE: [BaseParameter<'static>; {}] = [",
        kept.len()
    );
    for parameter in kept {
        let label = &robot.parameters[parameter.column].label;
        let _ = writeln!(out, "    BaseParameter {{");
        let _ = writeln!(out, "        label: {label:?},");
        let _ = writeln!(out, "        terms: &[");
        for term in &parameter.terms {
            let _ = writeln!(
                out,
                "            BaseTerm {{ parameter: {:?}, index: {}, coefficient: {:?}, value: {} }},",
                robot.parameters[term.column].label,
                term.column,
                term.coefficient.to_string(),
                literal(term.value.to_f64()),
            );
        }
        let _ = writeln!(out, "        ],");
        let _ = writeln!(out, "    }},");
    }
    let _ = writeln!(out, "];");
    zeros(robot, analysis, out);
    let free = eliminated_labels(robot);
    let _ = writeln!(
        out,
        "/// Labels of the eliminated parameters, in the order of `free`."
    );
    let _ = writeln!(out, "pub const FREE: [&str; {}] = [", free.len());
    for label in &free {
        let _ = writeln!(out, "    {label:?},");
    }
    let _ = writeln!(out, "];");
    let minimal = certified(analysis);
    let _ = writeln!(out, "/// The base and its certificate: {minimal}.");
    let _ = writeln!(out, "pub const BASE_INFO: BaseInfo<'static> = BaseInfo {{");
    let _ = writeln!(out, "    base: &BASE,");
    let _ = writeln!(out, "    free: &FREE,");
    match &analysis.certificate {
        Ok(c) => {
            let _ = writeln!(out, "    certificate: Some(Certificate {{");
            for (field, value) in [
                ("columns", c.columns),
                ("rank", c.rank),
                ("states", c.states),
                ("digits", c.digits),
            ] {
                let _ = writeln!(out, "        {field}: {value},");
            }
            let _ = writeln!(
                out,
                "        smallest_pivot: {},",
                literal(c.smallest_pivot)
            );
            let _ = writeln!(
                out,
                "        largest_remainder: {},",
                literal(c.largest_remainder)
            );
            let _ = writeln!(out, "    }}),");
        }
        Err(_) => {
            let _ = writeln!(out, "    certificate: None,");
        }
    }
    let _ = writeln!(out, "    complete: {},", analysis.complete);
    let _ = writeln!(out, "}};");
}

/// Whether `base.zero`, `base.equal` or `base.drop` sets linear forms of the parameters to zero.
pub(super) fn has_zeros(analysis: &Analysis) -> bool {
    !analysis.base.known.is_empty() || analysis.base.parameters.iter().any(|p| p.dropped)
}

/// Emits the linear forms that `base.zero`, `base.equal` and `base.drop` set to zero.
fn zeros(robot: &Robot, analysis: &Analysis, out: &mut String) {
    if !has_zeros(analysis) {
        return;
    }
    let base = &analysis.base;
    let term = |column: usize, coefficient: &str, value: f64| {
        format!(
            "            BaseTerm {{ parameter: {:?}, index: {column}, coefficient: {coefficient:?}, \
             value: {} }},\n",
            robot.parameters[column].label,
            literal(value),
        )
    };
    let sum = |terms: &[crate::base::Term]| -> String {
        let each = terms.iter();
        each.map(|t| term(t.column, &t.coefficient.to_string(), t.value.to_f64()))
            .collect()
    };
    // a parameter that equals a combination of others: the combination less the parameter is zero
    let known = base.known.iter().map(|known| {
        let terms = term(known.column, "-1", -1.0) + &sum(&known.terms);
        (known.column, terms)
    });
    let dropped = base.parameters.iter().filter(|p| p.dropped);
    let dropped = dropped.map(|p| (p.column, sum(&p.terms)));
    let all: Vec<(usize, String)> = known.chain(dropped).collect();
    let _ = writeln!(
        out,
        "/// Forms that `base.zero`, `base.equal` and `base.drop` take as zero."
    );
    let _ = writeln!(
        out,
        "pub const ZEROS: [BaseParameter<'static>; {}] = [",
        all.len()
    );
    for (column, terms) in all {
        let label = &robot.parameters[column].label;
        let _ = writeln!(out, "    BaseParameter {{");
        let _ = writeln!(out, "        label: {label:?},");
        let _ = writeln!(out, "        terms: &[");
        out.push_str(&terms);
        let _ = writeln!(out, "        ],");
        let _ = writeln!(out, "    }},");
    }
    let _ = writeln!(out, "];");
}
