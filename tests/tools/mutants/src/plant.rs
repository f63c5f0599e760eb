//! Rewrites the sources so that they contain every drawn fault, switched off.

use std::collections::BTreeMap;
use std::fs;
use std::ops::Range;
use std::path::Path;

use proc_macro2::{LineColumn, Span};
use serde_json::Value;
use syn::spanned::Spanned;
use syn::visit::{self, Visit};

use crate::{TextResult, read};

/// The switch, written into each crate that has faults.
const SWITCH: &str = "\
//! Which fault is switched on.
// also in a crate that does without it
extern crate std;
pub(crate) fn on(number: u32) -> bool {
    static ON: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    *ON.get_or_init(|| {
        let set = std::env::var(\"REGEN_MUTANT\");
        set.ok().and_then(|text| text.parse().ok()).unwrap_or(0)
    }) == number
}
";

/// A fault: its place according to cargo-mutants, and the change it makes.
struct Fault {
    number: u64,
    genre: String,
    start: (usize, usize),
    end: (usize, usize),
    replacement: String,
}

/// A change of the text at `range`, which the fault with this number switches on.
struct Edit {
    range: Range<usize>,
    number: u64,
    how: Rewrite,
}

enum Rewrite {
    /// Return at once from the function.
    Leave { replacement: String },
    /// Replace the operator between two operands.
    Binary {
        left: Range<usize>,
        right: Range<usize>,
        operator: String,
    },
    /// Remove the unary operator of an operand.
    Bare { inner: Range<usize> },
    /// Make a match arm never match; `guard` is its guard, if it has one.
    Never { guard: Option<Range<usize>> },
    /// Replace the guard of a match arm.
    Guard { replacement: String },
}

/// Rewrites every file of the copy that has drawn mutants.
pub fn plant(copy: &Path, drawn: &Path) -> TextResult<()> {
    let mut files: BTreeMap<String, Vec<Fault>> = BTreeMap::new();
    let mut list = read(drawn)?;
    for mutant in &list {
        if mutant["unviable"] == true {
            continue;
        }
        let text = |key: &str| mutant[key].as_str().unwrap_or_default().to_owned();
        let at = |end: &str| {
            let place = &mutant["span"][end];
            let number = |v: &Value| v.as_u64().unwrap_or(0) as usize;
            (number(&place["line"]), number(&place["column"]))
        };
        files.entry(text("file")).or_default().push(Fault {
            number: mutant["number"].as_u64().unwrap_or(0),
            genre: text("genre"),
            start: at("start"),
            end: at("end"),
            replacement: text("replacement"),
        });
    }
    for (file, faults) in &files {
        let path = copy.join(file);
        let text = fs::read_to_string(&path).map_err(|e| format!("{file}: {e}"))?;
        let (planted, unplaced) = rewritten(&text, faults).map_err(|e| format!("{file}: {e}"))?;
        for mutant in &mut list {
            if mutant["number"]
                .as_u64()
                .is_some_and(|n| unplaced.contains(&n))
            {
                println!("not planted: {}", mutant["name"]);
                mutant["unviable"] = true.into();
            }
        }
        fs::write(&path, planted).map_err(|e| format!("{file}: {e}"))?;
    }
    let text = serde_json::to_string_pretty(&list).map_err(|e| e.to_string())?;
    fs::write(drawn, text).map_err(|e| e.to_string())?;
    let mut crates: Vec<&str> = files
        .keys()
        .filter_map(|f| f.split_once("/src/"))
        .map(|f| f.0)
        .collect();
    crates.dedup();
    for name in crates {
        let src = copy.join(name).join("src");
        fs::write(src.join("switch_of_faults.rs"), SWITCH).map_err(|e| e.to_string())?;
        let root = src.join("lib.rs");
        let mut text = fs::read_to_string(&root).map_err(|e| e.to_string())?;
        text.push_str("\n#[allow(unreachable_pub, dead_code)]\nmod switch_of_faults;\n");
        fs::write(&root, text).map_err(|e| e.to_string())?;
    }
    Ok(())
}

/// The text with all faults that have a place in it, and the numbers of those that have none.
fn rewritten(text: &str, faults: &[Fault]) -> TextResult<(String, Vec<u64>)> {
    let file = syn::parse_file(text).map_err(|e| e.to_string())?;
    let lines = Lines::new(text);
    let mut search = Search {
        lines: &lines,
        faults,
        edits: Vec::new(),
    };
    search.visit_file(&file);
    let mut edits = search.edits;
    let found: Vec<u64> = edits.iter().map(|e| e.number).collect();
    let unplaced = faults
        .iter()
        .map(|f| f.number)
        .filter(|n| !found.contains(n))
        .collect();
    // outer edits first; two edits of the same range in any order
    edits.sort_by(|a, b| (a.range.start, b.range.end).cmp(&(b.range.start, a.range.end)));
    let edits: Vec<&Edit> = edits.iter().collect();
    Ok((render(text, 0..text.len(), &edits), unplaced))
}

/// A part of the text with the edits inside it applied.
fn render(text: &str, range: Range<usize>, edits: &[&Edit]) -> String {
    let inside: Vec<&Edit> = edits
        .iter()
        .copied()
        .filter(|e| e.range.start >= range.start && e.range.end <= range.end)
        .collect();
    let mut out = String::new();
    let mut at = range.start;
    let mut k = 0;
    while k < inside.len() {
        let edit = inside[k];
        let rest: Vec<&Edit> = inside[k + 1..].to_vec();
        // edits that overlap an edit are inside it
        let nested = rest
            .iter()
            .take_while(|e| e.range.start < edit.range.end)
            .count();
        out.push_str(&text[at..edit.range.start]);
        out.push_str(&edited(text, edit, &rest[..nested]));
        at = edit.range.end;
        k += 1 + nested;
    }
    out.push_str(&text[at..range.end]);
    out
}

fn edited(text: &str, edit: &Edit, nested: &[&Edit]) -> String {
    let part = |range: &Range<usize>| render(text, range.clone(), nested);
    let whole = || part(&edit.range);
    let on = format!("crate::switch_of_faults::on({})", edit.number);
    match &edit.how {
        Rewrite::Leave { replacement } => {
            format!(" if {on} {{ return {replacement}; }}")
        }
        Rewrite::Binary {
            left,
            right,
            operator,
        } => format!(
            "(if {on} {{ {} {operator} {} }} else {{ {} }})",
            part(left),
            part(right),
            whole()
        ),
        Rewrite::Bare { inner } => {
            format!("(if {on} {{ {} }} else {{ {} }})", part(inner), whole())
        }
        Rewrite::Never { guard: None } => format!("{} if !{on}", whole()),
        Rewrite::Never { guard: Some(guard) } => {
            let pattern = edit.range.start..guard.start;
            format!("{} !{on} && ({})", part(&pattern), part(guard))
        }
        Rewrite::Guard { replacement } => {
            format!("(if {on} {{ {replacement} }} else {{ {} }})", whole())
        }
    }
}

/// Finds the syntax to which each fault belongs.
struct Search<'a> {
    lines: &'a Lines,
    faults: &'a [Fault],
    edits: Vec<Edit>,
}

impl Search<'_> {
    /// The faults of a genre whose place is a given span.
    fn at(&self, genre: &str, span: Span) -> Vec<(u64, String)> {
        let (start, end) = (place(span.start()), place(span.end()));
        let here = |f: &&Fault| {
            f.genre == genre
                && f.start == start
                && (f.end == end || genre == "UnaryOperator" || genre == "BinaryOperator")
        };
        self.faults
            .iter()
            .filter(here)
            .map(|f| (f.number, f.replacement.clone()))
            .collect()
    }

    fn push(&mut self, range: Range<usize>, number: u64, how: Rewrite) {
        self.edits.push(Edit { range, number, how });
    }

    fn body(&mut self, block: &syn::Block, constant: bool) {
        if constant {
            return;
        }
        let brace = block.brace_token.span.open();
        let after = self.lines.offset(brace.end());
        let (open, close) = (brace.end(), block.brace_token.span.close().start());
        let within = |f: &&Fault| {
            f.genre == "FnValue" && f.start >= place(open) && f.end <= place(close)
                || f.genre == "FnValue"
                    && f.start == place(block.span().start())
                    && f.end == place(block.span().end())
        };
        // another iterator would have a type different from the function's own
        let found: Vec<(u64, String)> = self
            .faults
            .iter()
            .filter(within)
            .filter(|f| !f.replacement.contains("::std::iter::"))
            .map(|f| (f.number, f.replacement.clone()))
            .collect();
        for (number, replacement) in found {
            // an inner function is visited later, and its own body is the right place
            self.edits.retain(|e| e.number != number);
            self.push(after..after, number, Rewrite::Leave { replacement });
        }
    }
}

impl<'a> Visit<'a> for Search<'_> {
    fn visit_item_fn(&mut self, item: &'a syn::ItemFn) {
        self.body(&item.block, item.sig.constness.is_some());
        visit::visit_item_fn(self, item);
    }

    fn visit_impl_item_fn(&mut self, item: &'a syn::ImplItemFn) {
        self.body(&item.block, item.sig.constness.is_some());
        visit::visit_impl_item_fn(self, item);
    }

    fn visit_trait_item_fn(&mut self, item: &'a syn::TraitItemFn) {
        if let Some(block) = &item.default {
            self.body(block, item.sig.constness.is_some());
        }
        visit::visit_trait_item_fn(self, item);
    }

    fn visit_expr_binary(&mut self, binary: &'a syn::ExprBinary) {
        let binds = binds(&binary.left) || binds(&binary.right);
        for (number, operator) in self.at("BinaryOperator", binary.op.span()) {
            // only `&&` may stand beside `let`
            if binds {
                continue;
            }
            let how = Rewrite::Binary {
                left: self.lines.range(binary.left.span()),
                right: self.lines.range(binary.right.span()),
                operator,
            };
            self.push(self.lines.range(binary.span()), number, how);
        }
        visit::visit_expr_binary(self, binary);
    }

    fn visit_expr_unary(&mut self, unary: &'a syn::ExprUnary) {
        for (number, _) in self.at("UnaryOperator", unary.op.span()) {
            let inner = self.lines.range(unary.expr.span());
            self.push(
                self.lines.range(unary.span()),
                number,
                Rewrite::Bare { inner },
            );
        }
        visit::visit_expr_unary(self, unary);
    }

    fn visit_arm(&mut self, arm: &'a syn::Arm) {
        for (number, _) in self.at("MatchArm", arm.span()) {
            let pattern = self.lines.range(arm.pat.span());
            let (range, guard) = match &arm.guard {
                Some((_, guard)) => {
                    let guard = self.lines.range(guard.span());
                    (pattern.start..guard.end, Some(guard))
                }
                None => (pattern, None),
            };
            self.push(range, number, Rewrite::Never { guard });
        }
        if let Some((_, guard)) = &arm.guard {
            for (number, replacement) in self.at("MatchArmGuard", guard.span()) {
                self.push(
                    self.lines.range(guard.span()),
                    number,
                    Rewrite::Guard { replacement },
                );
            }
        }
        visit::visit_arm(self, arm);
    }
}

/// Whether an expression is a condition with `let`.
fn binds(expression: &syn::Expr) -> bool {
    match expression {
        syn::Expr::Let(_) => true,
        syn::Expr::Binary(binary) => binds(&binary.left) || binds(&binary.right),
        _ => false,
    }
}

/// Line and column counted from one, as by cargo-mutants.
fn place(at: LineColumn) -> (usize, usize) {
    (at.line, at.column + 1)
}

/// A text with the offsets at which its lines start.
struct Lines {
    starts: Vec<usize>,
    text: String,
}

impl Lines {
    fn new(text: &str) -> Self {
        let starts = std::iter::once(0)
            .chain(text.match_indices('\n').map(|(i, _)| i + 1))
            .collect();
        Self {
            starts,
            text: text.to_owned(),
        }
    }

    fn offset(&self, at: LineColumn) -> usize {
        let start = self.starts[at.line - 1];
        let line = &self.text[start..];
        // columns are characters
        start
            + line
                .char_indices()
                .nth(at.column)
                .map_or(line.len(), |(i, _)| i)
    }

    fn range(&self, span: Span) -> Range<usize> {
        self.offset(span.start())..self.offset(span.end())
    }
}
