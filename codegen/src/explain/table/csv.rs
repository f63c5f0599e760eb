//! The table of base parameters as comma-separated values.

use std::fmt::Write as _;

use super::Table;

impl Table {
    /// The table as comma-separated values with a header: number, kept parameter, combination,
    /// its evidence, and the payload that it belongs to.
    pub fn csv(&self) -> String {
        let mut out = String::from("no,parameter,combination,rests_on,payload\n");
        for (k, row) in self.rows.iter().enumerate() {
            let kept = row.parts.first().map_or("", |part| part.label.as_str());
            let cells = [
                kept,
                &row.plain(),
                &row.provenance(),
                row.payload.as_deref().unwrap_or(""),
            ];
            let cells = cells.map(quoted);
            let _ = writeln!(out, "{},{}", k + 1, cells.join(","));
        }
        out
    }
}

/// A cell, in quotes where it needs them (RFC 4180).
fn quoted(cell: &str) -> String {
    if cell.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", cell.replace('"', "\"\""))
    } else {
        cell.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn cells_with_commas_and_quotes_are_quoted() {
        assert_eq!(quoted("m(3)"), "m(3)");
        assert_eq!(quoted("m(\"a,b\")"), "\"m(\"\"a,b\"\")\"");
    }
}
