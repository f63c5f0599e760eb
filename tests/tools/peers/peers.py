#!/usr/bin/env python3
"""Compares the times of our base regressors with those of CasADi and Pinocchio, in one run.

    python3 tests/tools/peers/peers.py            # installs the peers into a virtual environment first

The peers are installed from PyPI. CasADi gets the joint-axis form of the regressor with only the base
columns: each joint's twist is carried outward to the links, and the body's columns are projected on
it. It writes C, which is compiled as its users do. Pinocchio's own full regressor is called from
C++. All times include sines and cosines. Columns are compared at random states
before anything is timed. Each program also times the C library's sine and cosine of as many
angles; figures are compared as ratios to that time, in interleaved rounds.
"""
import functools
import json
import math
import os
import platform
import random
import re
import subprocess
import sys
import venv
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
WORK = Path(os.environ.get("PEERS_DIR", ROOT / "target" / "peers"))
NEEDS = ["pin==4.1.0", "cmeel-eigen==3.4.1", "casadi==3.8.2", "pyyaml==6.0.3", "pandas==3.1.1", "matplotlib"]
SERIAL = ["puma560", "ur5e", "rx90", "panda", "iiwa14"]
# Earlier measurements: the time of CasADi's base regressor over that of the C library's sines and
# cosines; a peer must not be slower than that by more than 15 %.
KNOWN = {"puma560": 189 / 41, "panda": 265 / 50}
ROUNDS = 3


def in_environment():
    """Runs this script again inside an environment that has the peers."""
    where = WORK / "venv"
    python = where / "bin" / "python"
    if Path(sys.prefix) == where:
        return
    if not python.exists():
        venv.create(where, with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "-q", *NEEDS], check=True)
    os.execv(python, [str(python), *sys.argv])


def number(text, names):
    """The value of a spec's expression."""
    known = {"pi": math.pi, "sqrt": math.sqrt, "deg": math.radians, **names}
    return float(eval(str(text), {"__builtins__": {}}, known))  # our own files


def spec(robot):
    import yaml

    file = {"rps3": "3rps"}.get(robot, robot)
    data = yaml.safe_load((ROOT / "robots" / f"{file}.yaml").read_text())
    names = {}
    for name, text in (data.get("geometry") or {}).items():
        names[name] = number(text, names)
    return data, names


def links(robot):
    """(alpha, a, d) of each joint of a serial arm, modified Denavit-Hartenberg, and gravity."""
    data, names = spec(robot)
    (limb,) = data["limbs"]
    rows = []
    for joint in limb["joints"]:
        assert joint["type"] == "revolute"
        dh = joint.get("dh") or {}
        assert set(dh) <= {"alpha", "a", "d"}
        rows.append(tuple(number(dh.get(k, 0), names) for k in ("alpha", "a", "d")))
    return rows, [number(g, names) for g in data["gravity"]]


@functools.cache
def regen():
    """The command, built for release, or the file that PEERS_REGEN names."""
    if "PEERS_REGEN" in os.environ:
        return Path(os.environ["PEERS_REGEN"])
    subprocess.run(["cargo", "build", "--release", "--bin", "regen"], cwd=ROOT, check=True)
    return Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release" / "regen"


def module(robot):
    """The generated module of a robot; the first call runs regen for all robots."""
    folder = WORK / "modules"
    if not folder.is_dir():
        run([regen(), "generate", "--out", str(folder)], cwd=ROOT)
    return (folder / f"{robot}.rs").read_text()


def kept(robot):
    """Labels of the base parameters, from the generated module."""
    text = module(robot)
    table = text[text.index("pub const BASE:"):text.index("pub const FREE")]
    return re.findall(r"BaseParameter \{\s*label: \"([^\"]+)\"", table)


ENTRY = {n: i for i, n in enumerate(["Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz", "mx", "my", "mz", "m"])}


def exact(x):
    return float(round(x)) if abs(x - round(x)) < 1e-12 else x


def body_rows(ca, e, u, w, al, a):
    """The ten columns of a body on the twist (e, u): e.(I al + w x I w) + e.(m r x a) + u.(...)."""
    ww = w @ w.T
    wx, wy, wz = al[0], al[1], al[2]
    xx, yy, zz, xy, xz, yz = ww[0, 0], ww[1, 1], ww[2, 2], ww[0, 1], ww[0, 2], ww[1, 2]
    hat = [
        ca.vertcat(wx, xz, -xy),
        ca.vertcat(wy - xz, wx + yz, xx - yy),
        ca.vertcat(wz + xy, zz - xx, wx - yz),
        ca.vertcat(-yz, wy, xy),
        ca.vertcat(yy - zz, wz - xy, wy + xz),
        ca.vertcat(yz, -xz, wz),
    ]
    tilde = ca.skew(al) + ca.vertcat(
        ca.horzcat(-yy - zz, xy, xz), ca.horzcat(xy, -xx - zz, yz), ca.horzcat(xz, yz, -xx - yy)
    )
    moment = ca.cross(a, e) + tilde.T @ u
    return [ca.dot(e, h) for h in hat] + [moment[i] for i in range(3)] + [ca.dot(u, a)]


def casadi_serial(ca, robot):
    rows, gravity = links(robot)
    n = len(rows)
    q, qd, qdd = (ca.SX.sym(s, n) for s in ("q", "qd", "qdd"))
    zero = ca.SX.zeros(3)
    w, al, a = zero, zero, ca.SX([-g for g in gravity])
    twists, blocks = [], []
    z = ca.SX([0, 0, 1])
    for j, (alpha, length, d) in enumerate(rows):
        c, s = ca.cos(q[j]), ca.sin(q[j])
        ca_, sa = exact(math.cos(alpha)), exact(math.sin(alpha))
        turn = ca.SX(ca.vertcat(
            ca.horzcat(c, -s, 0), ca.horzcat(s * ca_, c * ca_, -sa), ca.horzcat(s * sa, c * sa, ca_)
        ))
        p = ca.SX([length, -sa * d, ca_ * d])
        p = ca.sparsify(p)
        a = turn.T @ (a + ca.cross(al, p) + ca.cross(w, ca.cross(w, p)))
        w = turn.T @ w
        al = turn.T @ al + ca.cross(w, z) * qd[j] + z * qdd[j]
        w = w + z * qd[j]
        twists = [(turn.T @ e, turn.T @ (u + ca.cross(e, p))) for e, u in twists] + [(z, zero)]
        blocks.append([body_rows(ca, e, u, w, al, a) for e, u in twists])
    columns = []
    for label in kept(robot):
        name, body = re.fullmatch(r"(\w+)\((\d+)\)", label).groups()
        block = blocks[int(body) - 1]
        columns.append([block[k][ENTRY[name]] if k < len(block) else 0 for k in range(n)])
    out = ca.vertcat(*[ca.SX(x) for column in columns for x in column])
    return ca.Function(f"{robot}_base", [q, qd, qdd], [ca.cse(ca.densify(out))])


def rotation(ca, axis, angle):
    c, s = (ca.cos(angle), ca.sin(angle))
    rows = {
        "x": ((1, 0, 0), (0, c, -s), (0, s, c)),
        "y": ((c, 0, s), (0, 1, 0), (-s, 0, c)),
        "z": ((c, -s, 0), (s, c, 0), (0, 0, 1)),
    }[axis]
    return ca.sparsify(ca.SX(ca.vertcat(*[ca.horzcat(*row) for row in rows])))


def fixed(rpy):
    """A constant rotation, its zeros exact."""
    import numpy as np

    cr, sr, cp, sp, cy, sy = (f(x) for x in rpy for f in (math.cos, math.sin))
    m = np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])
    return np.vectorize(exact)(m)


def closure_rps3():
    """The coordinates' names, and which are independent and dependent, from the generated module."""
    source = module("rps3")
    order = re.findall(r'"([^"]+)"', re.search(r"pub const COORDINATES[^=]*= \[(.*?)\];", source, re.S)[1])
    independent = [int(i) for i in re.search(r"INDEPENDENT[^=]*= \[(.*?)\]", source)[1].split(",")]
    return order, independent, [i for i in range(len(order)) if i not in independent]


def casadi_rps3(ca):
    """K_i - X^T K_e of the 3-RPS, base columns: the closure written in the frame of the leg that each
    cut is on, X by CasADi's own solve."""
    import numpy as np

    data, names = spec("rps3")
    order, independent, dependent = closure_rps3()
    n = len(order)
    q, qd, qdd = (ca.SX.sym(s, n) for s in ("q", "qd", "qdd"))
    gravity = np.array([number(g, names) for g in data["gravity"]])
    zero = ca.SX(3, 1)
    bodies, cuts = {}, {}
    vector = lambda v: ca.sparsify(ca.SX(np.vectorize(exact)(np.array(v, float))))
    for limb in data["limbs"]:
        base = limb["base"]
        turn0 = fixed([number(x, names) for x in base["rpy"]])
        state = dict(
            R=ca.sparsify(ca.SX(turn0)), o=vector([number(x, names) for x in base["xyz"]]),
            w=zero, al=zero, a=vector(-turn0.T @ gravity), twists=[], chain=[],
        )

        def joint(state, coordinate, axis, slide, before):
            """A link on this one: constant turn `before`, then the motion about or along an axis."""
            R = before if slide else before @ rotation(ca, axis, q[coordinate])
            unit = ca.sparsify(ca.SX([float(axis == k) for k in "xyz"]))
            p = before @ unit * q[coordinate] if slide else zero
            a = R.T @ (state["a"] + ca.cross(state["al"], p) + ca.cross(state["w"], ca.cross(state["w"], p)))
            w, al = R.T @ state["w"], R.T @ state["al"]
            if slide:
                a = a + 2 * ca.cross(w, unit) * qd[coordinate] + unit * qdd[coordinate]
            else:
                al = al + ca.cross(w, unit) * qd[coordinate] + unit * qdd[coordinate]
                w = w + unit * qd[coordinate]
            twists = [(c, R.T @ e, R.T @ (u + ca.cross(e, p))) for c, e, u in state["twists"]]
            twists.append((coordinate, zero, unit) if slide else (coordinate, unit, zero))
            return dict(w=w, al=al, a=a, twists=twists, chain=state["chain"] + [(R, p)])

        eye = ca.SX.eye(3)
        for spec_joint in limb["joints"]:
            kind, name = spec_joint["type"], spec_joint["name"]
            before = eye
            if "dh" in spec_joint:
                alpha = number(spec_joint["dh"]["alpha"], names)
                before = ca.sparsify(ca.SX(np.vectorize(exact)(np.array([
                    [1, 0, 0], [0, math.cos(alpha), -math.sin(alpha)], [0, math.sin(alpha), math.cos(alpha)],
                ]))))
            if kind == "spherical":
                for axis, part in zip(SPHERICAL, "123"):
                    state = joint(state, order.index(f"{name}.{part}"), axis, False, eye)
            else:
                state = joint(state, order.index(name), "z", kind == "prismatic", before)
            if "body" in spec_joint:
                bodies[str(spec_joint["body"])] = dict(state, base=(turn0, base))
    # closure: both sides as positions and velocities seen from the first leg's ground frame
    A = []
    R1 = bodies["3"]["base"][0]
    for cut in data["cuts"]:
        sides = []
        for side in cut["between"]:
            body = bodies[str(side["body"])]
            point = vector([number(x, names) for x in side.get("xyz", [0, 0, 0])])
            sides.append((body, point))
        (platform_, point), (leg, own) = sides
        # the velocity of the point by each coordinate, in the frame of the leg's last link
        R_leg = ca.SX.eye(3)
        for R, _ in leg["chain"]:
            R_leg = R_leg @ R
        R_platform = ca.SX.eye(3)
        for R, _ in platform_["chain"]:
            R_platform = R_platform @ R
        between = ca.sparsify(ca.SX(np.vectorize(exact)(np.round(leg["base"][0].T @ R1, 15))))
        across = R_leg.T @ between @ R_platform
        rows = ca.SX(3, n)
        for c, e, u in platform_["twists"]:
            rows[:, c] += across @ (u + ca.cross(e, point))
        for c, e, u in leg["twists"]:
            rows[:, c] -= u + ca.cross(e, own)
        A.append(rows)
    A = ca.sparsify(ca.vertcat(*A))
    X = ca.solve(A[:, dependent], A[:, independent])
    J = ca.SX(n, len(independent))
    for i, c in enumerate(independent):
        J[c, i] = 1
    for i, c in enumerate(dependent):
        J[c, :] = -X[i, :]
    columns = []
    for label in kept("rps3"):
        match = re.fullmatch(r"(\w+)\((\d+)\)", label)
        name, body = match.groups()
        b = bodies[body]
        column = [0] * len(independent)
        for c, e, u in b["twists"]:
            entry = body_rows(ca, e, u, b["w"], b["al"], b["a"])[ENTRY[name]]
            column = [x + J[c, i] * entry for i, x in enumerate(column)]
        columns.append(column)
    out = ca.vertcat(*[ca.SX(x) for column in columns for x in column])
    return ca.Function("rps3_base", [q, qd, qdd], [ca.cse(ca.densify(out))])


SPHERICAL = "zyx"

TIMER = r"""
#include <math.h>
#include <stdio.h>
#include <time.h>
static double now(void) { struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t); return 1e9 * t.tv_sec + t.tv_nsec; }
#define CALLS 256
#define KEEP(p) __asm__ volatile("" : : "g"(p) : "memory")
"""


# The 3-RPS as its users would: the regressor of the tree, the Jacobians of both sides of each cut in
# the world's axes, X by Eigen's LU with partial pivoting, K_i - X^T K_e with all 70 columns.
PINOCCHIO_RPS3 = r"""
#include <pinocchio/algorithm/frames.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <Eigen/LU>
#include <iostream>
#include <vector>
static const double side = 0.4563;
static const int independent[3] = {1, 6, 8}, dependent[6] = {0, 2, 3, 4, 5, 7};
static const int columns[][2] = {COLUMNS};
struct Closed {
  Model m; Data d; Eigen::VectorXd q, v, a; FrameIndex sides[2][2];
  Eigen::Matrix<double, 6, 9> J[2]; Eigen::Matrix<double, 6, 9> A; Eigen::Matrix<double, 3, Eigen::Dynamic> W;
  static Model build(FrameIndex sides[2][2]) {
    Model m; const double r = side / sqrt(3.0), turn = 2 * M_PI / 3; JointIndex ends[3] = {};
    for (int leg = 0; leg < 3; leg++) {
      const double t = leg == 0 ? 0 : leg == 1 ? turn : -turn;
      Eigen::Matrix3d R = (Eigen::AngleAxisd(t, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX())).toRotationMatrix();
      SE3 ground(R, Eigen::Vector3d(r * cos(t), r * sin(t), 0));
      JointIndex j = m.addJoint(0, JointModelRZ(), ground, "r" + std::to_string(leg));
      m.appendBodyToJoint(j, Inertia::Random(), SE3::Identity());
      SE3 slide(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix(), Eigen::Vector3d::Zero());
      j = m.addJoint(j, JointModelPZ(), slide, "p" + std::to_string(leg));
      m.appendBodyToJoint(j, Inertia::Random(), SE3::Identity());
      if (leg == 0) {
        j = m.addJoint(j, JointModelRZ(), SE3::Identity(), "s1");
        j = m.addJoint(j, JointModelRY(), SE3::Identity(), "s2");
        j = m.addJoint(j, JointModelRX(), SE3::Identity(), "s3");
        m.appendBodyToJoint(j, Inertia::Random(), SE3::Identity());
      }
      ends[leg] = j;
    }
    const double height = side * sqrt(3.0) / 2;
    const Eigen::Vector3d corners[2] = {{side, 0, 0}, {side / 2, height, 0}};
    for (int cut = 0; cut < 2; cut++) {
      sides[cut][0] = m.addFrame(Frame("c" + std::to_string(cut), ends[0], 0, SE3(Eigen::Matrix3d::Identity(), corners[cut]), OP_FRAME));
      sides[cut][1] = m.addFrame(Frame("e" + std::to_string(cut), ends[cut + 1], 0, SE3::Identity(), OP_FRAME));
    }
    return m;
  }
  Closed() : m(build(sides)), d(m), q(9), v(9), a(9), W(3, 70) { J[0].setZero(); J[1].setZero(); }
  void set(double k) { for (int i = 0; i < 9; i++) { q[i] = 0.6 + 0.1 * sin(k + i); v[i] = sin(2 * k + i); a[i] = cos(k - i); } }
  void evaluate() {
    computeJointTorqueRegressor(m, d, q, v, a);
    computeJointJacobians(m, d, q);
    updateFramePlacements(m, d);
    for (int cut = 0; cut < 2; cut++) {
      for (int s = 0; s < 2; s++) { J[s].setZero(); getFrameJacobian(m, d, sides[cut][s], LOCAL_WORLD_ALIGNED, J[s]); }
      A.middleRows<3>(3 * cut) = J[0].topRows<3>() - J[1].topRows<3>();
    }
    Eigen::Matrix<double, 6, 6> Ae; Eigen::Matrix<double, 6, 3> Ai;
    for (int k = 0; k < 6; k++) Ae.col(k) = A.col(dependent[k]);
    for (int k = 0; k < 3; k++) Ai.col(k) = A.col(independent[k]);
    const Eigen::Matrix<double, 6, 3> X = Ae.partialPivLu().solve(Ai);
    // links without a body have columns of zeros that count for nothing
    static const int joints[7] = {0, 1, 4, 5, 6, 7, 8};
    for (int b = 0; b < 7; b++) {
      const auto K = d.jointTorqueRegressor.middleCols<10>(10 * joints[b]);
      Eigen::Matrix<double, 6, 10> Ke; Eigen::Matrix<double, 3, 10> Ki;
      for (int k = 0; k < 6; k++) Ke.row(k) = K.row(dependent[k]);
      for (int k = 0; k < 3; k++) Ki.row(k) = K.row(independent[k]);
      W.middleCols<10>(10 * b).noalias() = Ki - X.transpose() * Ke;
    }
  }
};
static void printed() {
  Closed c;
  while (true) {
    for (int i = 0; i < 27; i++) if (!(std::cin >> (i < 9 ? c.q[i] : i < 18 ? c.v[i - 9] : c.a[i - 18]))) return;
    c.evaluate();
    for (const auto& column : columns) for (int k = 0; k < 3; k++) printf("%.17g ", c.W(k, 10 * column[0] + column[1]));
    printf("\n");
  }
}
"""


def pinocchio_columns(robot):
    """Body, from 0, and entry of each base column, in Pinocchio's order of a body's ten."""
    order = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"]
    pairs = (re.fullmatch(r"(\w+)\((\d+)\)", label).groups() for label in kept(robot))
    return [(int(body) - 1, order.index(name)) for name, body in pairs]


def run(command, **more):
    return subprocess.run(command, check=True, text=True, capture_output=True, **more).stdout


def write_casadi(ca, functions, file, options):
    generator = ca.CodeGenerator(file, options)
    for f in functions:
        generator.add(f)
    generator.generate(str(WORK) + "/")


def compile_casadi(ca, functions, flags, tag):
    write_casadi(ca, functions, "peers.c", {"with_header": True, "casadi_int": "int"})
    main = TIMER + '#include "peers.h"\nint main(void) {\n'
    main += " static double in[3][32], out[4096], w[65536]; static int iw[64];\n"
    main += " for (int i = 0; i < 96; i++) in[i / 32][i % 32] = sin(0.3 + 1.7 * i) * 0.3 + (i < 32 ? 0.6 : 0);\n"
    main += " const double* arg[16] = {in[0], in[1], in[2]}; double* res[4] = {out};\n"
    names = ["sincos6", "sincos7"] + [f.name() for f in functions]
    main += f" double best[{len(names)}]; for (int i = 0; i < {len(names)}; i++) best[i] = 1e30;\n"
    main += " for (int round = 0; round < 400; round++) { double t;\n"
    for i, name in enumerate(names):
        if name.startswith("sincos"):
            body = f"for (int j = 0; j < {name[6:]}; j++) {{ out[j] = sin(in[1][j]); out[8 + j] = cos(in[1][j]); }}"
        else:
            body = f"{name}(arg, res, iw, w, 0);"
        main += f"  t = now(); for (int k = 0; k < CALLS; k++) {{ KEEP(in); {body} KEEP(out); }} t = (now() - t) / CALLS; if (t < best[{i}]) best[{i}] = t;\n"
    main += " }\n"
    for i, name in enumerate(names):
        main += f' printf("{name}\\t%.2f\\n", best[{i}]);\n'
    main += "}\n"
    (WORK / "main.c").write_text(main)
    program = WORK / f"casadi_{tag}"
    run(["gcc", *flags, "peers.c", "-c", "-o", f"peers_{tag}.o"], cwd=WORK)
    # the reference time is of the C library's functions, compiled without the flags under test
    run(["gcc", "-O2", "-fno-builtin", "main.c", f"peers_{tag}.o", "-o", program, "-lm"], cwd=WORK)
    return program


def link_pinocchio(source, objects=()):
    """A C++ program that uses Pinocchio."""
    prefix = Path(run([sys.executable, "-c", "import cmeel, pathlib; import sys; print([p for p in map(pathlib.Path, sys.path) if (p / 'cmeel.prefix').exists()][0] / 'cmeel.prefix')"]).strip())
    program = WORK / Path(source).stem
    lib = prefix / "lib"
    libraries = [f for f in ("pinocchio_default", "pinocchio") if (lib / f"lib{f}.so").exists()][:1]
    run(["g++", "-std=c++17", "-O3", "-march=native", "-DNDEBUG",
         # as its package file says
         "-DBOOST_MPL_LIMIT_LIST_SIZE=30", "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS", "-DBOOST_FUSION_INVOKE_MAX_ARITY=10",
         "-fno-builtin-sin", "-fno-builtin-cos",
         source, *objects, "-o", program, f"-I{prefix}/include", f"-I{prefix}/include/eigen3",
         f"-L{lib}", f"-Wl,-rpath,{lib}", *[f"-l{x}" for x in libraries]], cwd=WORK)
    return program


def compile_pinocchio(models):
    code = "#include <pinocchio/multibody.hpp>\n#include <pinocchio/algorithm/regressor.hpp>\n" + TIMER
    code += "using namespace pinocchio;\nstatic Model arm(int n, const double (*t)[3]) { Model m; for (int i = 0; i < n; i++) {\n"
    code += " double ca = cos(t[i][0]), sa = sin(t[i][0]); Eigen::Matrix3d R; R << 1, 0, 0, 0, ca, -sa, 0, sa, ca;\n"
    code += " SE3 p(R, Eigen::Vector3d(t[i][1], -sa * t[i][2], ca * t[i][2]));\n"
    code += " JointIndex j = m.addJoint(i, JointModelRZ(), p, \"j\" + std::to_string(i)); m.appendBodyToJoint(j, Inertia::Random(), SE3::Identity()); }\n return m; }\n"
    code += PINOCCHIO_RPS3.replace("COLUMNS", ", ".join(f"{{{body}, {entry}}}" for body, entry in pinocchio_columns("rps3")))
    code += "int main(int argc, char**) {\n if (argc > 1) { printed(); return 0; }\n double best_s = 1e30; double x[8] = {.3, -.4, .5, 1.1, -.7, .2, .9}, y[16];\n"
    for name, (rows, _) in models.items():
        table = ", ".join("{" + ", ".join(repr(v) for v in row) + "}" for row in rows)
        n = len(rows)
        code += f" {{ static const double t[][3] = {{{table}}}; Model m = arm({n}, t); Data d(m); Eigen::VectorXd q = Eigen::VectorXd::LinSpaced({n}, -1, 1), v = 0.5 * q, a = 2 * q; double best = 1e30;\n"
        code += "  for (int r = 0; r < 200; r++) { double s = now(); for (int k = 0; k < CALLS; k++) { KEEP(&q); computeJointTorqueRegressor(m, d, q, v, a); KEEP(d.jointTorqueRegressor.data()); } s = (now() - s) / CALLS; if (s < best) best = s;\n"
        code += "   s = now(); for (int k = 0; k < CALLS; k++) { KEEP(x); for (int j = 0; j < 6; j++) { y[j] = sin(x[j]); y[8 + j] = cos(x[j]); } KEEP(y); } s = (now() - s) / CALLS; if (s < best_s) best_s = s; }\n"
        code += f'  printf("{name}_full\\t%.2f\\n", best); }}\n'
    code += " { Closed c; c.set(.6); double best = 1e30; for (int r = 0; r < 200; r++) { double s = now(); for (int k = 0; k < CALLS; k++) { KEEP(&c); c.evaluate(); KEEP(c.W.data()); } s = (now() - s) / CALLS; if (s < best) best = s; }\n"
    code += '  printf("rps3_full\\t%.2f\\n", best); }\n'
    code += ' printf("sincos6\\t%.2f\\n", best_s);\n}\n'
    (WORK / "pin.cpp").write_text(code)
    return link_pinocchio("pin.cpp")


def compile_ours(package="ours"):
    environment = {**os.environ, "RUSTFLAGS": "-C target-cpu=native", "CARGO_TARGET_DIR": str(WORK / package)}
    subprocess.run(["cargo", "build", "--release"], cwd=HERE / package, env=environment, check=True)
    return WORK / package / "release" / f"peers-{package}"


def agree(ours, functions):
    import numpy as np

    rng = random.Random(1)
    for f in functions:
        robot = f.name().removesuffix("_base")
        n = f.size1_in(0)
        states = [[rng.uniform(-1, 1) + (0.6 if i < n and robot == "rps3" else 0) for i in range(3 * n)] for _ in range(20)]
        text = "\n".join(" ".join(map(repr, s)) for s in states)
        lines = run([ours, "columns", robot], input=text).splitlines()
        worst = 0.0
        for state, line in zip(states, lines):
            mine = np.array([float(x) for x in line.split()])
            theirs = np.array(f(state[:n], state[n:2 * n], state[2 * n:])).ravel()
            worst = max(worst, np.abs(mine - theirs).max() / np.abs(mine).max())
        print(f"{robot}: {f.n_instructions()} instructions of CasADi; columns agree to {worst:.1e}")
        assert worst < 1e-10, robot


def agree_pinocchio(ours, pin):
    import numpy as np

    rng = random.Random(2)
    states = [[rng.uniform(-1, 1) + (0.6 if i < 9 else 0) for i in range(27)] for _ in range(20)]
    text = "\n".join(" ".join(map(repr, s)) for s in states)
    both = zip(run([ours, "columns", "rps3"], input=text).splitlines(), run([pin, "columns"], input=text).splitlines())
    worst = 0.0
    for mine, theirs in both:
        mine, theirs = (np.array([float(x) for x in line.split()]) for line in (mine, theirs))
        worst = max(worst, np.abs(mine - theirs).max() / np.abs(mine).max())
    print(f"rps3: columns agree with Pinocchio's and Eigen's to {worst:.1e}")
    assert worst < 1e-9


def figures(programs, rounds=ROUNDS):
    """The minimum time of each figure of each program, in interleaved rounds."""
    least = [{} for _ in programs]
    for _ in range(rounds):
        for program, best in zip(programs, least):
            for line in run([program]).splitlines():
                name, value = line.split("\t")
                best[name] = min(float(value), best.get(name, 1e30))
    return least


def counted(robot):
    text = module(robot)
    add, mul, div, angles = map(int, re.search(r"\[`base_regressor`\] \| (\d+) \| (\d+) \| (\d+) \| (\d+)", text).groups())
    return f"{mul}/{add}" + (f" + {div} div" if div else "")


def plot(points, line, label, along, title, file):
    """Plots times over a number, with a line."""
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5, 4))
    axes.plot([x for x, _ in points], [y for _, y in points], "o-", label=label)
    axes.plot([x for x, _ in points], [line(x) for x, _ in points], ":", label="straight line")
    axes.set(xlabel=along, ylabel="s", title=title)
    axes.legend()
    return figure, axes, HERE / file


def save(figure, file):
    import matplotlib

    # so that the same points give the same bytes
    with matplotlib.rc_context({"svg.hashsalt": "peers"}):
        figure.savefig(file, metadata={"Date": None})


def plot_samples(ours):
    lines = [line.split() for line in run([ours, "growth"]).splitlines()[1:]]
    points = [(int(c), float(s)) for c, s in (line for line in lines if len(line) == 2)]
    (first, least), *_ = points
    figure, axes, file = plot(points, lambda x: x * least / first, "PUMA 560, base regressor",
                              "samples", "time grows in proportion to the samples", "samples.svg")
    axes.set(xscale="log", yscale="log")
    save(figure, file)
    print("samples: " + ", ".join(f"{c}: {1e9 * s / c:.1f} ns each" for c, s in points))
    print(*(" ".join(line) + " s" for line in lines if line[0] == "threads"), sep="\n")


def plot_legs(legs):
    least = {}
    for _ in range(ROUNDS):
        for line in run([legs]).splitlines():
            count, ns = line.split()
            least[int(count)] = min(float(ns), least.get(int(count), math.inf))
    points = [(n, 1e-9 * ns) for n, ns in least.items()]
    (first, low), *_, (last, high) = points
    line = lambda x: low + (high - low) * (x - first) / (last - first)
    figure, axes, file = plot(points, line, "n-UPS platform, regressor", "legs",
                              "each leg takes as long as the one before", "legs.svg")
    axes.set(xlim=0, ylim=0)
    save(figure, file)
    print("legs: " + ", ".join(f"{n}: {ns:.0f} ns" for n, ns in least.items()))


def main():
    WORK.mkdir(parents=True, exist_ok=True)
    in_environment()
    import casadi as ca

    functions = [casadi_serial(ca, robot) for robot in SERIAL] + [casadi_rps3(ca)]
    ours_program = compile_ours()
    agree(ours_program, functions)
    fast = compile_casadi(ca, functions, ["-O3", "-march=native", "-ffast-math"], "fast")
    plain = compile_casadi(ca, functions, ["-O3", "-march=native"], "plain")
    pin = compile_pinocchio({robot: links(robot) for robot in SERIAL})
    agree_pinocchio(ours_program, pin)
    ours, fast, plain, pin = figures([ours_program, fast, plain, pin])
    import pinocchio

    model = re.search(r"model name\s*: (.*)", Path("/proc/cpuinfo").read_text())[1]
    print(f"\n{model}, {platform.python_version()}, CasADi {ca.__version__}, Pinocchio {pinocchio.__version__}, "
          f"{run(['gcc', '--version']).splitlines()[0]}, {run(['rustc', '--version']).strip()}")
    yard = {n: min(ours[f"sincos {n}"], fast[f"sincos{n}"]) for n in (6, 7)}
    print(f"sines and cosines by the C library: 6 angles {yard[6]:.1f} ns, 7 angles {yard[7]:.1f} ns\n")
    print("| robot | ours, ns | operations | CasADi best, ns | ours/CasADi | Pinocchio full, ns | ours/Pinocchio "
          "| batch/scalar | batch AVX2/scalar | inverse dynamics, ns | normal equations, ns a sample |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for robot in [*SERIAL, "rps3", "stewart"]:
        own = ours[f"{robot} base"]
        casadi = min(fast.get(f"{robot}_base", math.inf), plain.get(f"{robot}_base", math.inf))
        full = pin.get(f"{robot}_full", math.inf)
        cell = lambda x: f"{x:.0f}" if math.isfinite(x) else "-"
        ratio = lambda x: f"{own / x:.3f}" if math.isfinite(x) else "-"
        batch = {k: f"{ours[f'{robot} {k}'] / own:.3f}" if f"{robot} {k}" in ours else "-" for k in ("batch", "batch avx2")}
        print(f"| {robot} | {own:.0f} | {counted(robot)} | {cell(casadi)} | {ratio(casadi)} | {cell(full)} | {ratio(full)} "
              f"| {batch['batch']} | {batch['batch avx2']} | {ours[f'{robot} inverse dynamics']:.0f} | {cell(ours.get(f'{robot} normal equations', math.inf))} |")
    for robot, known in KNOWN.items():
        n = 6 if robot == "puma560" else 7
        found = min(fast[f"{robot}_base"], plain[f"{robot}_base"]) / yard[n]
        verdict = "holds" if found <= 1.15 * known else "VOID: the peer is slower than it is known to be"
        print(f"CasADi's {robot} is {found:.2f} times the sines and cosines, known {known:.2f}: {verdict}")
    plot_samples(ours_program)
    plot_legs(compile_ours("legs"))
    (WORK / "figures.json").write_text(json.dumps(dict(ours=ours, casadi_fast=fast, casadi_plain=plain, pinocchio=pin), indent=1))


if __name__ == "__main__":
    main()
