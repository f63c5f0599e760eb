//! Programs as bytes, and back.

use crate::bytes::{Reader, Writer};
use crate::optimize::{Argument, Group, Op, Operand, Output, Program, SolveStep, Step, Temp};

pub(super) fn write(out: &mut Writer, program: &Program) {
    let Program {
        arguments,
        steps,
        groups,
        output,
        outputs,
        names,
    } = program;
    out.list(arguments, |out, argument| {
        out.text(&argument.name);
        out.size(argument.len);
        out.text(&argument.doc);
    });
    out.list(steps, |out, step| {
        write_op(out, &step.op);
        out.list(&step.results, |out, temp| out.integer(temp.0.into()));
    });
    out.list(groups, |out, group| {
        out.text(&group.title);
        for range in [&group.steps, &group.outputs] {
            out.size(range.start);
            out.size(range.end);
        }
    });
    out.text(&output.name);
    out.list(&output.shape, |out, length| out.size(*length));
    out.text(&output.doc);
    out.list(outputs, write_operand);
    out.list(names, |out, name| {
        out.flag(name.is_some());
        if let Some(name) = name {
            out.text(name);
        }
    });
}

pub(super) fn read(from: &mut Reader<'_>) -> Option<Program> {
    Some(Program {
        arguments: from.list(|from| {
            Some(Argument {
                name: from.text()?,
                len: from.size()?,
                doc: from.text()?,
            })
        })?,
        steps: from.list(|from| {
            Some(Step {
                op: read_op(from)?,
                results: from.list(|from| Some(Temp(u32::try_from(from.integer()?).ok()?)))?,
            })
        })?,
        groups: from.list(|from| {
            Some(Group {
                title: from.text()?,
                steps: from.size()?..from.size()?,
                outputs: from.size()?..from.size()?,
            })
        })?,
        output: Output {
            name: from.text()?,
            shape: from.list(Reader::size)?,
            doc: from.text()?,
        },
        outputs: from.list(read_operand)?,
        names: from.list(|from| {
            let named = from.flag()?;
            Some(if named { Some(from.text()?) } else { None })
        })?,
    })
}

fn write_operand(out: &mut Writer, operand: &Operand) {
    match operand {
        Operand::Input { argument, element } => {
            out.byte(0);
            out.size(*argument);
            out.size(*element);
        }
        Operand::Constant(value) => {
            out.byte(1);
            out.double(*value);
        }
        Operand::Temp(temp) => {
            out.byte(2);
            out.integer(temp.0.into());
        }
    }
}

fn read_operand(from: &mut Reader<'_>) -> Option<Operand> {
    Some(match from.byte()? {
        0 => Operand::Input {
            argument: from.size()?,
            element: from.size()?,
        },
        1 => Operand::Constant(from.double()?),
        2 => Operand::Temp(Temp(u32::try_from(from.integer()?).ok()?)),
        _ => return None,
    })
}

/// Writes an operation: its number, then its operands.
fn write_op(out: &mut Writer, op: &Op) {
    let number = match op {
        Op::Neg(_) => 0,
        Op::Add(..) => 1,
        Op::Sub(..) => 2,
        Op::Mul(..) => 3,
        Op::MulAdd(..) => 4,
        Op::NegMulAdd(..) => 5,
        Op::MulSub(..) => 6,
        Op::Div(..) => 7,
        Op::SinCos(_) => 8,
        Op::Sqrt(_) => 9,
        Op::Sign(_) => 10,
        Op::Positive(_) => 11,
        Op::Negative(_) => 12,
        Op::Solve(_) => 13,
    };
    out.byte(number);
    if let Op::Solve(system) = op {
        for rows in [&system.matrix, &system.rhs, &system.fixed] {
            out.list(rows, |out, row| out.list(row, write_operand));
        }
        out.list(&system.pivots, |out, (pivot, usual)| {
            write_operand(out, pivot);
            out.double(*usual);
        });
        return;
    }
    for operand in op.operands() {
        write_operand(out, &operand);
    }
}

fn read_op(from: &mut Reader<'_>) -> Option<Op> {
    let number = from.byte()?;
    if number == 13 {
        return Some(Op::Solve(Box::new(read_system(from)?)));
    }
    let a = read_operand(from)?;
    Some(match number {
        0 => Op::Neg(a),
        1 => Op::Add(a, read_operand(from)?),
        2 => Op::Sub(a, read_operand(from)?),
        3 => Op::Mul(a, read_operand(from)?),
        4 => Op::MulAdd(a, read_operand(from)?, read_operand(from)?),
        5 => Op::NegMulAdd(a, read_operand(from)?, read_operand(from)?),
        6 => Op::MulSub(a, read_operand(from)?, read_operand(from)?),
        7 => Op::Div(a, read_operand(from)?),
        8 => Op::SinCos(a),
        9 => Op::Sqrt(a),
        10 => Op::Sign(a),
        11 => Op::Positive(a),
        12 => Op::Negative(a),
        _ => return None,
    })
}

fn read_system(from: &mut Reader<'_>) -> Option<SolveStep> {
    let mut rows = || from.list(|from| from.list(read_operand));
    let (matrix, rhs, fixed) = (rows()?, rows()?, rows()?);
    let pivots = from.list(|from| Some((read_operand(from)?, from.double()?)))?;
    Some(SolveStep {
        matrix,
        rhs,
        fixed,
        pivots,
    })
}
