//! The order of a tape's instructions, and the registers that they use.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use crate::tape::{Code, Instruction, System, Tape, Value};

/// The registers that the operands of a linear system are in.
fn read_by(system: &System) -> impl Iterator<Item = u32> {
    let rows = system.matrix.iter().chain(&system.rhs).flatten();
    let pivots = system.pivots.iter().map(|p| &p.0);
    let values = rows.chain(&system.fixed).chain(pivots);
    values.filter_map(|value| match value {
        Value::Register(r) => Some(*r),
        Value::Constant(_) => None,
    })
}

/// The registers that an instruction reads.
fn read(tape: &Tape, i: &Instruction) -> Vec<u32> {
    if i.code == Code::Solve {
        return read_by(&tape.systems[i.a as usize]).collect();
    }
    let own = [i.a, i.b, i.c].into_iter().zip(i.code.reads());
    own.filter_map(|(register, reads)| reads.then_some(register))
        .collect()
}

/// Orders the instructions by a topological sort that forms long stretches of one code: among the
/// instructions whose operands are computed, it takes all with the code that most of them have.
///
/// - `registers`: the number of (virtual) registers of the tape.
pub(super) fn by_code(tape: &Tape, registers: usize) -> Vec<Instruction> {
    let mut readers: Vec<Vec<usize>> = vec![Vec::new(); registers];
    let mut missing = vec![0_usize; tape.instructions.len()];
    for (at, i) in tape.instructions.iter().enumerate() {
        for register in read(tape, i) {
            readers[register as usize].push(at);
            missing[at] += 1;
        }
    }
    let mut ready: BTreeMap<Code, Vec<usize>> = BTreeMap::new();
    for (at, i) in tape.instructions.iter().enumerate() {
        if missing[at] == 0 {
            ready.entry(i.code).or_default().push(at);
        }
    }
    let mut out = Vec::with_capacity(tape.instructions.len());
    while let Some((code, _)) = ready
        .iter()
        .max_by_key(|(code, all)| (all.len(), Reverse(**code)))
    {
        let code = *code;
        while let Some(all) = ready.remove(&code) {
            for at in all {
                let i = tape.instructions[at];
                out.push(i);
                let results = match code {
                    Code::Store => Vec::new(),
                    Code::SinCos => vec![i.d, i.b],
                    Code::Solve => tape.systems[i.a as usize].results.clone(),
                    _ => vec![i.d],
                };
                for reader in results.iter().flat_map(|r| &readers[*r as usize]) {
                    missing[*reader] -= 1;
                    if missing[*reader] == 0 {
                        let own = tape.instructions[*reader].code;
                        ready.entry(own).or_default().push(*reader);
                    }
                }
            }
        }
    }
    out
}

/// Maps virtual registers to few registers, so that values with disjoint lifetimes share one, and
/// finds the stretches of instructions with the same code.
pub(super) fn allocate(tape: &mut Tape, virtual_registers: usize) {
    let mut last_use = vec![0; virtual_registers];
    for (at, i) in tape.instructions.iter().enumerate() {
        for register in read(tape, i) {
            last_use[register as usize] = at;
        }
    }
    let mut place = vec![u32::MAX; virtual_registers];
    let mut free: Vec<u32> = Vec::new();
    let mut count = 0;
    let mut take = |free: &mut Vec<u32>| {
        free.pop().unwrap_or_else(|| {
            count += 1;
            count - 1
        })
    };
    for at in 0..tape.instructions.len() {
        let i = &mut tape.instructions[at];
        let reads = i.code.reads();
        // a solver writes the solution before it has read all operands of its system, so that these
        // registers are freed only after the results have theirs
        let mut ending: Vec<u32> = Vec::new();
        if i.code == Code::Solve {
            let system = &mut tape.systems[i.a as usize];
            ending.extend(read_by(system));
            let mut values: Vec<&mut Value> = Vec::new();
            let rows = system.matrix.iter_mut().chain(&mut system.rhs).flatten();
            values.extend(rows.chain(&mut system.fixed));
            values.extend(system.pivots.iter_mut().map(|p| &mut p.0));
            for value in values {
                if let Value::Register(r) = value {
                    *r = place[*r as usize];
                }
            }
            let mut unused = Vec::new();
            for result in &mut system.results {
                let own = take(&mut free);
                place[*result as usize] = own;
                if last_use[*result as usize] <= at {
                    unused.push(own);
                }
                *result = own;
            }
            free.append(&mut unused);
        }
        let mut operands = [i.a, i.b, i.c];
        for (operand, _) in operands.iter_mut().zip(reads).filter(|r| r.1) {
            ending.push(*operand);
            *operand = place[*operand as usize];
        }
        ending.sort_unstable();
        ending.dedup();
        ending.retain(|r| last_use[*r as usize] == at);
        match i.code {
            Code::Solve => {}
            Code::Store => i.d = operands[0],
            // the angle is read before either result is written, so that both may reuse its register
            Code::SinCos => {
                free.extend(ending.drain(..).map(|r| place[r as usize]));
                let (sin, cos) = (i.d, i.b);
                i.d = take(&mut free);
                operands[1] = take(&mut free);
                place[sin as usize] = i.d;
                place[cos as usize] = operands[1];
                for (result, own) in [(sin, i.d), (cos, operands[1])] {
                    if last_use[result as usize] <= at {
                        free.push(own);
                    }
                }
            }
            _ => {
                free.extend(ending.drain(..).map(|r| place[r as usize]));
                let result = i.d;
                i.d = take(&mut free);
                place[result as usize] = i.d;
                if last_use[result as usize] <= at {
                    free.push(i.d);
                }
            }
        }
        free.extend(ending.into_iter().map(|r| place[r as usize]));
        let i = &mut tape.instructions[at];
        [i.a, i.b, i.c] = operands;
    }
    tape.registers = count as usize;
    tape.stretches.clear();
    for (at, i) in tape.instructions.iter().enumerate() {
        match tape.stretches.last_mut() {
            Some((code, end)) if *code == i.code => *end = at + 1,
            _ => tape.stretches.push((i.code, at + 1)),
        }
    }
}
