//! The table of base parameters in LaTeX: rows that wrap, over as many pages as it takes.

use std::fmt::Write as _;

use crate::base::latex;

use super::factor::Factor;
use super::{Part, Row, Table};

/// The columns: the number, the combination, which wraps, and its evidence.
const COLUMNS: &str = "r >{\\raggedright\\arraybackslash}p{\\dimexpr\\linewidth-6\\tabcolsep-8.3em\\relax} \
                       >{\\raggedright\\arraybackslash}p{6.3em}";

/// What the symbols are, for the caption.
const SYMBOLS: &str = "$I_{xx,k}$ to $I_{zz,k}$ are the entries of the inertia tensor of body $k$ about the \
                       origin of its frame and in its axes ($I_{xy,k} = -\\int xy\\,dm$); $m_{k} x_{k}$, \
                       $m_{k} y_{k}$ and $m_{k} z_{k}$ its first moments; $m_{k}$ its mass";

impl Table {
    /// The table in LaTeX, as an `xtabular` over as many pages or columns as it takes, with caption and label; a
    /// `longtable` would not do on paper of two columns.
    pub fn latex(&self) -> String {
        let title = latex::escaped(&self.title());
        let label = self
            .robot
            .replace(|c: char| !c.is_ascii_alphanumeric(), "-");
        let head = "\\toprule\nNo & Base parameter & Evidence \\\\\n\\midrule\n";
        let mut out = format!(
            "% {}\n% needs \\usepackage{{array,booktabs,xtab}}\n\
             \\tablecaption{{{title}. {SYMBOLS}\\label{{tab:{label}-base}}}}\n\
             \\tablefirsthead{{{head}}}\n\\tablehead{{{head}}}\n\
             \\tabletail{{\\midrule\n\\multicolumn{{3}}{{r}}{{continued}}\\\\\n}}\n\
             \\tablelasttail{{\\bottomrule\n}}\n\\begin{{xtabular}}{{{COLUMNS}}}\n",
            self.title(),
        );
        for (k, row) in self.rows.iter().enumerate() {
            if let Some(payload) = self.payload_from(k) {
                let payload = latex::escaped(payload);
                let _ = writeln!(out, "\\midrule\n & payload {payload}: & \\\\");
            }
            let _ = writeln!(
                out,
                "{} & ${}$ & {} \\\\",
                k + 1,
                row.latex(),
                row.provenance()
            );
        }
        out.push_str("\\end{xtabular}\n\n{\\footnotesize\\raggedright\\noindent\n");
        for (name, text) in &self.facts {
            let (name, text) = (latex::escaped(name), latex::escaped(text));
            let _ = writeln!(out, "{name}: {text}.\\par");
        }
        out.push_str("}\n");
        out
    }
}

impl Row {
    /// The combination, with the terms of a common factor collected.
    fn latex(&self) -> String {
        let mut out = String::new();
        let mut written = vec![false; self.parts.len()];
        for (k, first) in self.parts.iter().enumerate() {
            if written[k] {
                continue;
            }
            let common = |part: &Part| part.signed.factor == first.signed.factor;
            let collects = first.signed.factor != Factor::One;
            let group: Vec<usize> = (k..self.parts.len())
                .filter(|at| *at == k || (collects && !written[*at] && common(&self.parts[*at])))
                .collect();
            for at in &group {
                written[*at] = true;
            }
            out.push_str(first.sign(k));
            out.push_str(&first.factor());
            if let [_] = group[..] {
                out.push_str(&first.latex);
                continue;
            }
            let mut sum = String::new();
            for at in group {
                let part = &self.parts[at];
                let minus = part.signed.negative != first.signed.negative;
                sum.push_str(match (sum.is_empty(), minus) {
                    (true, _) => "",
                    (false, true) => " - ",
                    (false, false) => " + ",
                });
                sum.push_str(&part.latex);
            }
            let _ = write!(out, "\\bigl({sum}\\bigr)");
        }
        out
    }
}

impl Part {
    /// The factor before the parameter; the line may end after it.
    fn factor(&self) -> String {
        let text = match &self.signed.factor {
            Factor::One => return String::new(),
            Factor::Expression(sum) if sum.is_sum() => {
                format!("\\bigl({}\\bigr)", latex::expression(sum))
            }
            Factor::Expression(expression) => latex::expression(expression),
            Factor::Number(text) => latex::number(text),
            Factor::Instead(text) => format!("{{\\sim}}{}", latex::number(text)),
        };
        format!("{text} \\,\\allowbreak ")
    }
}
