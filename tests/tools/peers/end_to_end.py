#!/usr/bin/env python3
"""From a log to base parameters: `regen identify` beside Pinocchio and CasADi from Python, in one run.

    python3 tests/tools/peers/end_to_end.py       # installs the peers into a virtual environment first

Logs of 75,001 rows are simulated. Pinocchio's regressor is called row by row and its base columns
are taken; CasADi's base regressor is compiled C, mapped over the rows. Both read the log by
pandas and end with numpy's least squares, without statistics. `regen identify` is a whole
process: derivation, reading, closure, estimates, their statistics and judgements.
All of it runs in turns; the least CPU time (user and system) of each part counts. Base parameters
are compared before that.
"""
import argparse
import functools
import itertools
import json
import os
import platform
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

# One thread each: a waiting thread of the linear algebra would count as CPU time of the peers.
for variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ[variable] = "1"
sys.dont_write_bytecode = True  # nothing is left beside the sources

import pinocchio_rows
import peers

# Standard deviations of the efforts' noise, N m or N.
NOISE = {"ur5e": 0.02, "rps3": 0.5}
STEP, DURATION = 0.001, 75
# Rows of the log that shows what a call costs before it has read much.
FEW = 200
# Rows that CasADi maps at once.
BLOCK = 500
FILES = {"ur5e": "ur5e", "rps3": "3rps"}
NAMES = {"ur5e": "UR5e", "rps3": "3-RPS"}


def spec_file(robot):
    return peers.ROOT / "robots" / f"{FILES[robot]}.yaml"


def logs_folder():
    folder = peers.WORK / "end_to_end"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def excite(robot):
    return [peers.regen(), "excite", spec_file(robot), "--out", logs_folder() / f"{robot}.json"]


def simulate(robot, log, *more):
    return [peers.regen(), "simulate", spec_file(robot), "--trajectory", logs_folder() / f"{robot}.json",
            "--step", str(STEP), "--duration", str(DURATION), "--out", log, *more]


def identify(robot, log, *more):
    return [peers.regen(), "identify", spec_file(robot), log, "--format", "json", *more]


def make_logs(robot):
    """The log that a machine would give (positions and noisy efforts of the actuated joints), and the
    same with all coordinates as they are, their velocities and accelerations."""
    import pandas

    measured, exact = (logs_folder() / f"{robot}_{kind}.csv" for kind in ("measured", "exact"))
    peers.run(excite(robot))
    peers.run(simulate(robot, measured, "--noise", f"0,{NOISE[robot]}"))
    peers.run(simulate(robot, exact, "--exact"))
    noisy, clean = (pandas.read_csv(log) for log in (measured, exact))
    efforts = [name for name in clean if name.startswith("tau_")]
    positions = [name.removeprefix("tau_") for name in efforts]
    # the same motion, so that the efforts may be exchanged
    assert noisy[positions].equals(clean[positions]), robot
    clean[efforts] = noisy[efforts]
    clean.to_csv(exact, index=False)
    return measured, exact


def beginning(log):
    """The first rows of a log, as a log of its own."""
    short = Path(log).with_suffix(".short.csv")
    with open(log) as whole:
        short.write_text("".join(itertools.islice(whole, FEW + 1)))
    return short


def coordinates(robot, columns):
    """Names of all coordinates, in the order of the regressor, and of the efforts."""
    efforts = [name for name in columns if name.startswith("tau_")]
    if robot == "rps3":
        order, independent, _ = peers.closure_rps3()
        assert efforts == [f"tau_{order[i]}" for i in independent]
        return order, efforts
    return [name.removeprefix("tau_") for name in efforts], efforts


def casadi_function(ca, robot):
    """The base regressor whose output is W of a row, row by row."""
    f = peers.casadi_rps3(ca) if robot == "rps3" else peers.casadi_serial(ca, robot)
    inputs = [ca.SX.sym(name, f.size1_in(0)) for name in ("q", "qd", "qdd")]
    columns = len(peers.kept(robot))
    by_columns = ca.reshape(f(*inputs), f.size1_out(0) // columns, columns)
    return ca.Function(f"{robot}_rows", inputs, [ca.vec(by_columns.T)])


def casadi_library():
    return logs_folder() / "regressors.so"


def compile_library():
    import casadi as ca

    functions = [casadi_function(ca, robot) for robot in FILES]
    peers.write_casadi(ca, functions, "end_to_end.c", {})
    command = ["gcc", "-O3", "-march=native", "-shared", "-fPIC", "end_to_end.c", "-o", casadi_library(), "-lm"]
    peers.run(command, cwd=peers.WORK)


class Stages:
    """CPU times of the parts of this process that were ended one after the other."""

    def __init__(self):
        self.times, self.last = {}, time.process_time()

    def end(self, name):
        now = time.process_time()
        self.times[name], self.last = now - self.last, now


def by_casadi(robot, motion):
    """All rows of W by the compiled regressor, mapped over blocks of rows without copies of input or
    output. One map over all rows takes ten times as long, most of it to set the map up."""
    import casadi as ca
    import numpy as np

    rows, columns = len(motion[0]), len(peers.kept(robot))
    regressor = ca.external(f"{robot}_rows", str(casadi_library()))
    mapped = functools.cache(lambda count: regressor.map(count).buffer())
    W = np.empty((rows, regressor.size1_out(0)))
    for start in range(0, rows, BLOCK):
        part = slice(start, start + BLOCK)
        buffer, evaluate = mapped(len(W[part]))
        for i, values in enumerate(motion):
            buffer.set_arg(i, memoryview(values[part].reshape(-1)))
        buffer.set_res(0, memoryview(W[part].reshape(-1)))
        evaluate()
    return W.reshape(-1, columns)


def by_pinocchio(robot, motion):
    """All rows of W by Pinocchio's regressor, called for each row."""
    import numpy as np

    evaluate, rows = pinocchio_rows.closed_rps3() if robot == "rps3" else pinocchio_rows.arm(robot)
    W = np.empty((len(motion[0]), rows, len(peers.kept(robot))))
    for k, (q, qd, qdd) in enumerate(zip(*motion)):
        W[k] = evaluate(q, qd, qdd)
    return W.reshape(-1, W.shape[2])


def peer(name, robot, log, motion_log):
    """The estimate of one peer and the CPU times of its parts, of this process."""
    import numpy as np
    import pandas

    functions = {"casadi": by_casadi, "pinocchio": by_pinocchio}
    __import__(name)
    peers.kept(robot)
    stages = Stages()
    data = pandas.read_csv(log)
    stages.end("read")
    moved = data if motion_log == log else pandas.read_csv(motion_log)
    stages.end("read motion")
    q, efforts = coordinates(robot, moved)
    motion = [np.ascontiguousarray(moved[[before + c for c in q]].to_numpy()) for before in ("", "qd_", "qdd_")]
    tau = data[efforts].to_numpy().reshape(-1)
    W = functions[name](robot, motion)
    stages.end("regressor")  # with the arrays of the motion
    parameters, *_ = np.linalg.lstsq(W, tau)
    stages.end("lstsq")
    print(json.dumps(dict(stages.times, whole=cpu_of(resource.RUSAGE_SELF), parameters=list(parameters))))


def cpu_of(who):
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def run_peer(name, robot, log, motion_log):
    return json.loads(peers.run([sys.executable, __file__, "--peer", name, robot, log, motion_log]))


def timed(command):
    """The CPU time of a command."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        raise subprocess.CalledProcessError(process.returncode, command, stderr=said)
    return usage.ru_utime + usage.ru_stime


def compare(robot, log, motion_log):
    """Ours and the peers' parameters, with all equations of one weight as numpy's are, then as
    weighted by default."""
    import numpy as np

    def ours(*more):
        found = json.loads(peers.run(identify(robot, log, *more)))["parameters"]
        assert [p["label"] for p in found] == peers.kept(robot)
        return np.array([p["value"] for p in found]), np.array([p["sigma"] for p in found])

    values, sigma = ours("--weighting", "equal")
    weighted, _ = ours()
    differences = {}
    for name in ("casadi", "pinocchio"):
        theirs = np.array(run_peer(name, robot, log, motion_log)["parameters"])
        differences[name] = float(np.max(np.abs(theirs - values) / sigma))
    differences["weighted"] = float(np.max(np.abs(weighted - values) / sigma))
    print(f"{NAMES[robot]}, {Path(log).name}: {len(sigma)} parameters differ from CasADi's by at most "
          f"{differences['casadi']:.1e} and from Pinocchio's by {differences['pinocchio']:.1e} standard deviations, "
          f"ours weighted per effort from unweighted by {differences['weighted']:.1e}", flush=True)
    # from the same states nothing but rounding may differ; from positions, velocities do as well
    bound = 1e-6 if log == motion_log else 0.1
    assert max(differences["casadi"], differences["pinocchio"]) < bound, differences
    return differences


def least(best, new):
    for key, value in new.items():
        if key != "parameters":
            best[key] = min(value, best.get(key, float("inf")))


def commands():
    """Commands that are timed by themselves."""
    folder = logs_folder()
    return {
        "excite robots/3rps.yaml": excite("rps3")[:-1] + [folder / "again.json"],
        "simulate robots/3rps.yaml, 75 s at 1 kHz": simulate("rps3", folder / "again.csv", "--noise", f"0,{NOISE['rps3']}"),
        "simulate robots/ur5e.yaml, 75 s at 1 kHz": simulate("ur5e", folder / "again.csv", "--noise", f"0,{NOISE['ur5e']}"),
    }


def turns(cases, rounds):
    """The least CPU times of everything, each run once in a turn."""
    times = {}
    for turn in range(rounds):
        for case in cases:
            robot, log, _ = case
            found = times.setdefault(case, {name: {} for name in ("ours", "casadi", "pinocchio")})
            few = timed(identify(robot, beginning(log)))
            least(found["ours"], dict(cpu=timed(identify(robot, log)), few=few))
            for name in ("casadi", "pinocchio"):
                least(found[name], run_peer(name, *case))
        for name, command in commands().items():
            least(times.setdefault(name, {}), dict(cpu=timed(command)))
        print(f"turn {turn + 1} of {rounds} done", flush=True)
    return times


def report(cases, times):
    import casadi
    import numpy
    import pandas
    import pinocchio

    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())[1]
    load = " ".join(f"{x:.1f}" for x in os.getloadavg())
    print(f"\n{model}, {os.cpu_count()} processors, load {load} at the end; Python {platform.python_version()}, "
          f"pandas {pandas.__version__}, numpy {numpy.__version__}, CasADi {casadi.__version__}, "
          f"Pinocchio {pinocchio.__version__}; CPU seconds\n")
    print(f"| log | MB | regen identify | of {FEW} rows | read | CasADi mapped | lstsq | sum | ours/sum "
          "| Pinocchio's loop | read, loop, lstsq | ours/that |")
    print("|---|---|---|---|---|---|---|---|---|---|---|---|")
    whole = []
    for case in cases:
        robot, log, motion_log = case
        ours, mapped, looped = (times[case][name] for name in ("ours", "casadi", "pinocchio"))
        parts = [mapped["read"], mapped["regressor"], mapped["lstsq"]]
        other = looped["read"] + looped["regressor"] + looped["lstsq"]
        what = "all coordinates" if log == motion_log else "actuated positions"
        print(f"| {NAMES[robot]}, {what} | {Path(log).stat().st_size / 1e6:.0f} | {ours['cpu']:.2f} | {ours['few']:.2f} "
              f"| {' | '.join(f'{x:.3f}' for x in parts)} | {sum(parts):.3f} | {ours['cpu'] / sum(parts):.2f} "
              f"| {looped['regressor']:.2f} | {other:.2f} | {ours['cpu'] / other:.2f} |")
        whole.append(f"{NAMES[robot]}, {what}: CasADi {mapped['whole']:.2f}, Pinocchio {looped['whole']:.2f}")
    print("\nWhole processes of the peers, with imports: " + "; ".join(whole))
    print("\n| command | CPU, s |\n|---|---|")
    for name in commands():
        print(f"| regen {name} | {times[name]['cpu']:.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--peer", nargs=4, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    peers.WORK.mkdir(parents=True, exist_ok=True)
    if arguments.peer:
        return peer(*arguments.peer)
    peers.in_environment()
    made = {robot: tuple(map(str, make_logs(robot))) for robot in FILES}
    compile_library()
    (_, arm), (measured, exact) = made["ur5e"], made["rps3"]
    # the peers are given the closed coordinates where the log has only the actuated ones
    cases = [("ur5e", arm, arm), ("rps3", exact, exact), ("rps3", measured, exact)]
    for case in cases:
        compare(*case)
    report(cases, turns(cases, arguments.rounds))


if __name__ == "__main__":
    main()
