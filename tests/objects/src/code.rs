//! The stack that a function takes and the calls that it makes, read from its instructions.

use std::collections::BTreeSet;
use std::ops::Range;

use iced_x86::{Decoder, DecoderOptions, Instruction, Mnemonic, OpKind, Register};

/// What a function's instructions do to the stack.
pub struct Code {
    /// An upper bound of the stack that it takes, bytes, its return address included.
    pub frame: u64,
    /// Whether it calls into its own section.
    pub calls_itself: bool,
    /// The places of its direct calls in the section, bytes.
    calls: Vec<Range<u64>>,
}

impl Code {
    /// Finds direct calls into the own section: no relocation fills in their targets.
    pub(crate) fn resolve(&mut self, relocated: &BTreeSet<u64>) {
        let inside = |call: &Range<u64>| relocated.range(call.clone()).next().is_none();
        self.calls_itself |= self.calls.iter().any(inside);
    }
}

/// Reads a section that contains one function.
pub(crate) fn read(name: &str, bytes: &[u8]) -> Code {
    let instructions: Vec<Instruction> = Decoder::with_ip(64, bytes, 0, DecoderOptions::NONE)
        .into_iter()
        .collect();
    let mut code = Code {
        frame: 8,
        calls_itself: false,
        calls: Vec::new(),
    };
    for (k, instruction) in instructions.iter().enumerate() {
        assert!(
            instruction.mnemonic() != Mnemonic::INVALID,
            "{name}: no instruction at {:#x}",
            instruction.ip()
        );
        code.frame += taken(name, &instructions, k);
        if instruction.mnemonic() == Mnemonic::Call
            && instruction.op0_kind() == OpKind::NearBranch64
        {
            code.calls.push(instruction.ip()..instruction.next_ip());
        }
    }
    code
}

/// Bytes by which an instruction lowers the stack pointer. The sum counts every instruction once,
/// as if there were no branches.
fn taken(name: &str, all: &[Instruction], k: usize) -> u64 {
    let instruction = &all[k];
    let to_stack = instruction.op0_register() == Register::RSP;
    match instruction.mnemonic() {
        Mnemonic::Push => 8,
        Mnemonic::Lea if to_probe(instruction) => {
            instruction.memory_displacement64().wrapping_neg()
        }
        Mnemonic::Sub if k > 0 && copies_stack(&all[k - 1], instruction) => {
            instruction.immediate(1)
        }
        Mnemonic::Sub if to_stack && probes(instruction, &all[k + 1..]) => 0,
        Mnemonic::Sub if to_stack && immediate(instruction) => instruction.immediate(1),
        // alignment to a power of two, which lowers the pointer by less than that power
        Mnemonic::And if to_stack && immediate(instruction) => {
            instruction.immediate(1).wrapping_neg() - 1
        }
        Mnemonic::Add if to_stack && immediate(instruction) => {
            // add rsp, -128 is shorter than sub rsp, 128
            let change = instruction.immediate(1).cast_signed();
            u64::try_from(-change).unwrap_or(0)
        }
        // epilogues restore the stack pointer from the frame pointer
        Mnemonic::Lea if to_stack && instruction.memory_base() == Register::RBP => 0,
        Mnemonic::Mov if to_stack && instruction.op1_register() == Register::RBP => 0,
        Mnemonic::Pop | Mnemonic::Cmp | Mnemonic::Test => 0,
        _ => {
            assert!(
                !to_stack,
                "{name}: {instruction:?} moves the stack by an unknown amount"
            );
            0
        }
    }
}

fn immediate(instruction: &Instruction) -> bool {
    !matches!(instruction.op1_kind(), OpKind::Register | OpKind::Memory)
}

/// Whether an instruction is `lea r11, [rsp - n]`: a loop then touches the pages of a large frame
/// down to that address.
fn to_probe(instruction: &Instruction) -> bool {
    instruction.op0_register() == Register::R11
        && instruction.memory_base() == Register::RSP
        && instruction.memory_displacement64().cast_signed() < 0
}

/// Whether two instructions do the same: `mov r11, rsp`, `sub r11, n`.
fn copies_stack(copy: &Instruction, instruction: &Instruction) -> bool {
    let registers = (copy.op0_register(), copy.op1_register());
    copy.mnemonic() == Mnemonic::Mov
        && registers == (Register::R11, Register::RSP)
        && instruction.op0_register() == Register::R11
        && immediate(instruction)
}

/// Whether an instruction is the step of the loop that touches pages: a comparison with the last
/// address, r11, follows it.
fn probes(step: &Instruction, next: &[Instruction]) -> bool {
    immediate(step)
        && next.iter().take(2).any(|i| {
            i.mnemonic() == Mnemonic::Cmp
                && i.op0_register() == Register::RSP
                && i.op1_register() == Register::R11
        })
}
