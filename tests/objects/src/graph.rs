//! Object files as a graph of sections and the references between them.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::Path;

use object::read::archive::ArchiveFile;
use object::{Object, ObjectSection, ObjectSymbol, RelocationTarget, SectionKind, SymbolIndex};

use crate::code::{self, Code};

/// A section of an object file: one function or one constant, as compilers give each its own
/// section.
pub struct Section {
    /// The symbol at its start, demangled, or the section's own name.
    pub name: String,
    /// What the instructions do, if it contains any.
    pub code: Option<Code>,
    /// Sections that it refers to, and whether the reference is to a symbol's start there.
    targets: BTreeSet<(usize, bool)>,
    /// Symbols that no object file defines.
    pub externals: BTreeSet<String>,
}

/// All sections of some object files, with references between them resolved.
#[derive(Default)]
pub struct Graph {
    /// The sections in the order of the files; methods take and return their indices.
    pub sections: Vec<Section>,
}

/// Where a relocation points before all files are known.
enum Reference {
    Local { section: usize, start: bool },
    Named(String),
}

impl Graph {
    /// Reads the object files of static libraries, rlibs included.
    pub fn read(libraries: &[&Path]) -> Self {
        let mut graph = Self::default();
        let mut defined = BTreeMap::new();
        let mut references = Vec::new();
        for library in libraries {
            let bytes = std::fs::read(library).unwrap();
            for member in ArchiveFile::parse(&*bytes).unwrap().members() {
                let data = member.unwrap().data(&*bytes).unwrap();
                // rlibs contain the crate's metadata too
                if let Ok(file) = object::File::parse(data) {
                    graph.add(&file, &mut defined, &mut references);
                }
            }
        }
        for (from, reference) in references {
            match reference {
                Reference::Local { section, start } => {
                    graph.sections[from].targets.insert((section, start));
                }
                Reference::Named(name) => {
                    if let Some(section) = defined.get(&name) {
                        graph.sections[from].targets.insert((*section, true));
                    } else {
                        graph.sections[from].externals.insert(demangled(&name));
                    }
                }
            }
        }
        graph
    }

    fn add(
        &mut self,
        file: &object::File<'_>,
        defined: &mut BTreeMap<String, usize>,
        references: &mut Vec<(usize, Reference)>,
    ) {
        // Sections that are not loaded, such as debug information, are left out.
        let mut places = BTreeMap::new();
        for section in file.sections() {
            let code = section.kind() == SectionKind::Text;
            let data = matches!(
                section.kind(),
                SectionKind::Data
                    | SectionKind::ReadOnlyData
                    | SectionKind::ReadOnlyDataWithRel
                    | SectionKind::ReadOnlyString
                    | SectionKind::UninitializedData
            );
            let name = section.name().unwrap_or_default().to_owned();
            // tables for unwinding refer to functions without calling them
            if (code || data) && !name.starts_with(".eh_frame") {
                places.insert(section.index().0, self.sections.len());
                self.sections.push(Section {
                    name,
                    code: None,
                    targets: BTreeSet::new(),
                    externals: BTreeSet::new(),
                });
            }
        }
        let mut starts = BTreeSet::new();
        for symbol in file.symbols() {
            let Some(place) = symbol.section_index().and_then(|at| places.get(&at.0)) else {
                continue;
            };
            let name = symbol.name().unwrap_or_default();
            starts.insert((*place, symbol.address()));
            if symbol.is_global() || symbol.is_weak() {
                defined.entry(name.to_owned()).or_insert(*place);
            }
            if symbol.address() == 0 && !name.is_empty() {
                self.sections[*place].name = demangled(name);
            }
        }
        for section in file.sections() {
            let Some(&from) = places.get(&section.index().0) else {
                continue;
            };
            if section.kind() == SectionKind::Text {
                let bytes = section.data().unwrap();
                self.sections[from].code = Some(code::read(&self.sections[from].name, bytes));
            }
            let mut relocated = BTreeSet::new();
            for (offset, relocation) in section.relocations() {
                relocated.insert(offset);
                let RelocationTarget::Symbol(at) = relocation.target() else {
                    panic!("{}: a relocation without symbol", self.sections[from].name);
                };
                let reference = refer(file, at, relocation.addend(), &places, &starts);
                // a reference past the function's start is a loop or a table of jumps, not a call
                let own = matches!(
                    reference,
                    Reference::Local { section, start: true } if section == from
                );
                if let Some(code) = &mut self.sections[from].code {
                    code.calls_itself |= own;
                }
                references.push((from, reference));
            }
            if let Some(code) = &mut self.sections[from].code {
                code.resolve(&relocated);
            }
        }
    }

    /// The sections whose names satisfy `wanted`.
    pub fn find(&self, wanted: impl Fn(&str) -> bool) -> Vec<usize> {
        (0..self.sections.len())
            .filter(|at| wanted(&self.sections[*at].name))
            .collect()
    }

    /// All sections that can be reached from some, each with the section that refers to it.
    pub fn reach(&self, from: &[usize]) -> BTreeMap<usize, Option<usize>> {
        let mut reached: BTreeMap<usize, Option<usize>> =
            from.iter().map(|at| (*at, None)).collect();
        let mut queue: VecDeque<usize> = from.iter().copied().collect();
        while let Some(at) = queue.pop_front() {
            for (to, _) in &self.sections[at].targets {
                if !reached.contains_key(to) {
                    reached.insert(*to, Some(at));
                    queue.push_back(*to);
                }
            }
        }
        reached
    }

    /// The chain of references by which [`Graph::reach`] reached a section, outermost first.
    pub fn path(&self, reached: &BTreeMap<usize, Option<usize>>, to: usize) -> String {
        let mut names = vec![self.sections[to].name.as_str()];
        let mut at = to;
        while let Some(Some(before)) = reached.get(&at) {
            names.push(&self.sections[*before].name);
            at = *before;
        }
        names.reverse();
        names.join(" -> ")
    }

    /// The functions that a function calls, or whose address it takes, also through constants.
    pub fn callees(&self, at: usize) -> BTreeSet<usize> {
        let mut found = BTreeSet::new();
        let mut constants = BTreeSet::new();
        let mut pending = vec![at];
        while let Some(from) = pending.pop() {
            for (to, start) in &self.sections[from].targets {
                if self.sections[*to].code.is_none() {
                    if constants.insert(*to) {
                        pending.push(*to);
                    }
                } else if *start && *to != at {
                    // tables of jumps refer to the middle of a function
                    found.insert(*to);
                }
            }
        }
        let code = self.sections[at].code.as_ref();
        if code.is_some_and(|code| code.calls_itself) {
            found.insert(at);
        }
        found
    }
}

/// The target of a relocation.
fn refer(
    file: &object::File<'_>,
    symbol: SymbolIndex,
    addend: i64,
    places: &BTreeMap<usize, usize>,
    starts: &BTreeSet<(usize, u64)>,
) -> Reference {
    let symbol = file.symbol_by_index(symbol).unwrap();
    let place = symbol.section_index().and_then(|at| places.get(&at.0));
    match place {
        Some(&section) => {
            // the addend of a reference relative to the next instruction is four bytes less
            let at = |shift: i64| symbol.address().checked_add_signed(addend + shift);
            let start = [0, 4]
                .iter()
                .filter_map(|s| at(*s))
                .any(|at| starts.contains(&(section, at)));
            Reference::Local { section, start }
        }
        None => Reference::Named(symbol.name().unwrap_or_default().to_owned()),
    }
}

fn demangled(name: &str) -> String {
    // the alternate form leaves out the hash
    format!("{:#}", rustc_demangle::demangle(name))
}
