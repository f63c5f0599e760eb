#!/usr/bin/env python3
"""Identification by mujoco.sysid and by `regen identify` from the same logs, in one run.

    python3 tests/tools/peers/sysid.py [--arm FOLDER] [--regen PATH] [ur10e] [fivebar]

`pip install 'mujoco[sysid]'` first. FOLDER has the UR10e's logs at 100 Hz, id50_l.csv and id40_l.csv,
its spec ur10e_off.yaml and published.txt; without it the arm is left out. The five-bar is that of the
guide, simulated here. Both programs fit one log and are scored on another by `regen validate`: the rms
of the residuals over that of the efforts, percent. Times are those of the clock, from files to parameters.
RECORD.md has the last recorded run.

What a user of mujoco.sysid must write is written here as one would: the arm's residual is inverse
dynamics (rolling out, its own way, takes several times longer there and fits worse), with smooth friction;
the five-bar's is rollouts of 0.1 s from states that are closed beforehand.
"""

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco import sysid
from mujoco.sysid._src.model_modifier import (
    cholesky_decompose_upper,
    pi_from_theta,
    theta_from_pseudoinertia,
)
from scipy.signal import butter, filtfilt

ROOT = Path(__file__).resolve().parents[3]
JOINTS = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]
# N m/A, published with the logs
GAINS = [10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232]
# the velocity over which their friction changes its direction, rad/s
WIDTH = 0.02


def run(regen, *words):
    """Runs the command; returns its output and its time."""
    begin = time.perf_counter()
    done = subprocess.run([regen, *map(str, words)], capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{words}: {done.stderr}")
    return done.stdout, time.perf_counter() - begin


def score(regen, spec, parameters, log, *reading):
    """rms of the residuals over that of the efforts in percent: all, and each effort."""
    out, _ = run(regen, "validate", spec, parameters, log, *reading, "--format", "json")
    found = json.loads(out)["models"][0]["logs"][0]
    each = ", ".join(f"{effort['relative_rms']:.2f}" for effort in found["efforts"])
    return f"{found['relative_rms']:.2f} % ({each})"


def columns(path):
    """The columns of a CSV file by name."""
    return {name: data for name, data in zip(*table(path))}


def table(path):
    with open(path) as file:
        names = file.readline().strip().split(",")
    return names, np.loadtxt(path, delimiter=",", skiprows=1).T


def parameter(name, start, low, high):
    return sysid.Parameter(name, np.asarray(start, float), np.asarray(low), np.asarray(high))


def moments(mass, com, inertia):
    """Inertia about the body's frame from that about the centre of mass."""
    com = np.asarray(com, float)
    return inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))


def theta_of(mass, com, inertia):
    """mujoco.sysid's parameters of a body."""
    about = moments(mass, com, inertia)
    pseudo = np.zeros((4, 4))
    pseudo[:3, :3] = 0.5 * np.trace(about) * np.eye(3) - about
    pseudo[:3, 3] = pseudo[3, :3] = mass * np.asarray(com)
    pseudo[3, 3] = mass
    return theta_from_pseudoinertia(pseudo)


def set_body(model, body, theta):
    """Writes a body's inertia into a compiled model, which spares compiling it for every candidate."""
    pi = pi_from_theta(theta)
    mass, com = pi[0], pi[1:4] / pi[0]
    about = pi[4:].reshape(3, 3) - mass * (com @ com * np.eye(3) - np.outer(com, com))
    values, axes = np.linalg.eigh(0.5 * (about + about.T))
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    model.body_mass[body], model.body_ipos[body] = mass, com
    model.body_inertia[body] = np.maximum(values, 1e-9)
    mujoco.mju_mat2Quat(model.body_iquat[body], axes.flatten())


def labels(pi, body):
    """The spec's parameters of a body."""
    m, h, i = pi[0], pi[1:4], pi[4:].reshape(3, 3)
    names = ["m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz"]
    values = [m, *h, i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2]]
    return {f"{name}({body})": float(value) for name, value in zip(names, values)}


def optimized(params, residual):
    """Their optimiser, without its lines."""
    with contextlib.redirect_stdout(io.StringIO()):
        return sysid.optimize(params, residual, verbose=False, max_iters=60)[0]


# UR10e -------------------------------------------------------------------------------------------


def arm_spec(folder):
    """The arm in MuJoCo, with the bodies of the URDF."""
    text = (folder / "ur10e.urdf").read_text()
    # only inertias and joints: the meshes are elsewhere
    import re

    for tag in ("visual", "collision", "gazebo", "transmission"):
        text = re.sub(rf"<{tag}\b.*?</{tag}>", "", text, flags=re.S)
    head = '<mujoco><compiler fusestatic="true" discardvisual="true"/></mujoco>'
    return mujoco.MjModel.from_xml_string(text.replace("</robot>", head + "</robot>"))


def arm_motion(path):
    """Filtered motion and efforts, every fifth row."""
    data = columns(path)
    step = data["t"][1] - data["t"][0]
    wide = butter(5, 3 * 7 * 2 * step)
    narrow = butter(5, 7 * 2 * step)
    q = filtfilt(*wide, np.stack([data[j] for j in JOINTS], 1), axis=0)
    qd = filtfilt(*wide, np.stack([data[f"qd_{j}"] for j in JOINTS], 1), axis=0)
    qdd = np.gradient(qd, step, axis=0)
    tau = np.stack([data[f"i{k + 1}"] * gain for k, gain in enumerate(GAINS)], 1)
    tau = filtfilt(*narrow, tau, axis=0)
    inner = slice(50, -50, 5)
    return [x[inner] for x in (q, qd, qdd, tau)]


def arm_theirs(folder):
    model = arm_spec(folder)
    data = mujoco.MjData(model)
    places = [model.joint(name).qposadr[0] for name in JOINTS]
    bodies = [model.joint(name).bodyid[0] for name in JOINTS]
    q, qd, qdd, tau = arm_motion(folder / "id50_l.csv")
    weights = 1 / np.std(tau, axis=0)
    params = sysid.ParameterDict()
    for k, body in enumerate(bodies):
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, model.body_iquat[body])
        turn = turn.reshape(3, 3)
        inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
        start = theta_of(model.body_mass[body], model.body_ipos[body], inertia)
        params.add(parameter(f"body{k}", start, start - 3, start + 3))
    params.add(parameter("armature", np.full(6, 0.5), np.zeros(6), np.full(6, 20.0)))
    params.add(parameter("viscous", np.full(6, 5.0), np.zeros(6), np.full(6, 100.0)))
    params.add(parameter("coulomb", np.full(6, 3.0), np.zeros(6), np.full(6, 50.0)))
    params.add(parameter("offset", np.zeros(6), np.full(6, -10.0), np.full(6, 10.0)))

    def residual(x, own, **_):
        columns_of = np.atleast_2d(x.T).T if x.ndim > 1 else x[:, None]
        out = []
        for candidate in columns_of.T:
            own.update_from_vector(candidate)
            for k, body in enumerate(bodies):
                set_body(model, body, own[f"body{k}"].value)
            mujoco.mj_setConst(model, data)
            model.dof_armature[:] = own["armature"].value
            model.dof_frictionloss[:] = 0
            predicted = np.empty_like(tau)
            for row in range(len(q)):
                data.qpos[places], data.qvel[places], data.qacc[places] = q[row], qd[row], qdd[row]
                mujoco.mj_inverse(model, data)
                predicted[row] = data.qfrc_inverse[places]
            predicted += own["viscous"].value * qd + own["offset"].value
            predicted += own["coulomb"].value * np.tanh(qd / WIDTH)
            out.append(((predicted - tau) * weights).ravel())
        stacked = np.stack(out, 1)
        return [stacked if x.ndim > 1 else stacked[:, 0]], None, None

    found = optimized(params, residual)
    told = {}
    for k, body in enumerate(bodies):
        told |= labels(pi_from_theta(found[f"body{k}"].value), model.body(body).name)
    for k, joint in enumerate(JOINTS):
        told[f"J({joint})"] = float(found["armature"].value[k])
        told[f"Fv({joint})"] = float(found["viscous"].value[k])
        for sign, name in ((1, "Fc+"), (-1, "Fc-")):
            size = found["coulomb"].value[k] + sign * found["offset"].value[k]
            told[f"{name}({joint})"] = float(size)
    return told


def ur10e(regen, folder, scratch):
    reading = ["--butterworth", "5,7", "--problems", "drop"]
    for k, (joint, gain) in enumerate(zip(JOINTS, GAINS), 1):
        reading += ["--column", f"tau_{joint}=i{k}:A*{gain}"]
    spec, ours = folder / "ur10e_off.yaml", scratch / "ours.json"
    smooth = scratch / "atan.yaml"
    smooth.write_text(spec.read_text().replace("friction: coulomb_asymmetric", "friction: atan"))
    for name, own, more in (
        ("least squares", spec, []),
        ("instrumental variables", spec, ["--iv"]),
        ("feasible", spec, ["--feasible"]),
        ("feasible, smooth friction", smooth, ["--friction"]),
    ):
        _, seconds = run(regen, "identify", own, folder / "id50_l.csv", *reading, *more, "--out", ours)
        result = score(regen, own, ours, folder / "id40_l.csv", *reading)
        print(f"UR10e, regen, {name}: id40 {result} in {seconds:.1f} s", flush=True)
    begin = time.perf_counter()
    theirs = scratch / "theirs.json"
    theirs.write_text(json.dumps(arm_theirs(folder)))
    seconds = time.perf_counter() - begin
    result = score(regen, spec, theirs, folder / "id40_l.csv", *reading)
    print(f"UR10e, mujoco.sysid, inverse dynamics: id40 {result} in {seconds:.1f} s", flush=True)


# five-bar ----------------------------------------------------------------------------------------

CRANK, ROD, APART = 0.20, 0.30, 0.25
FIVEBAR = f"""
<mujoco><option timestep="0.0025" integrator="implicitfast"/>
<worldbody>
  <body name="1" euler="90 0 0"><joint name="q1" axis="0 0 1"/>
    <inertial pos="{CRANK / 2} 0 0" mass="0.2" diaginertia="7e-4 7e-4 7e-4"/>
    <body name="2" pos="{CRANK} 0 0"><joint name="q2" axis="0 0 1"/>
      <inertial pos="{ROD / 2} 0 0" mass="0.15" diaginertia="1.2e-3 1.2e-3 1.2e-3"/>
      <site name="a" pos="{ROD} 0 0"/></body></body>
  <body name="3" pos="{APART} 0 0" euler="90 0 0"><joint name="q3" axis="0 0 1"/>
    <inertial pos="{CRANK / 2} 0 0" mass="0.2" diaginertia="7e-4 7e-4 7e-4"/>
    <body name="4" pos="{CRANK} 0 0"><joint name="q4" axis="0 0 1"/>
      <inertial pos="{ROD / 2} 0 0" mass="0.15" diaginertia="1.2e-3 1.2e-3 1.2e-3"/>
      <site name="b" pos="{ROD} 0 0"/></body></body>
</worldbody>
<equality><connect site1="a" site2="b" solref="0.005 1"/></equality>
<actuator><motor joint="q1"/><motor joint="q3"/></actuator>
</mujoco>"""


def closed(q1, q3):
    """All joints from the driven ones, elbows out."""
    a = CRANK * np.stack([np.cos(q1), np.sin(q1)])
    b = np.stack([APART + CRANK * np.cos(q3), CRANK * np.sin(q3)])
    between = b - a
    distance = np.hypot(*between)
    height = np.sqrt(ROD**2 - distance**2 / 4)
    tip = (a + b) / 2 + height * np.stack([-between[1], between[0]]) / distance
    q2 = np.unwrap(np.arctan2(*(tip - a)[::-1])) - q1
    q4 = np.unwrap(np.arctan2(*(tip - b)[::-1])) - q3
    return np.stack([q1, q2, q3, q4], 1)


def fivebar_theirs(log):
    data = columns(log)
    step = data["t"][1] - data["t"][0]
    filtered = [filtfilt(*butter(4, 40 * 2 * step), data[name]) for name in ("q1", "q3")]
    q = closed(*filtered)
    qd = np.gradient(q, step, axis=0)
    tau = np.stack([data["tau_q1"], data["tau_q3"]], 1)
    model = mujoco.MjModel.from_xml_string(FIVEBAR)
    state = mujoco.MjData(model)
    length = 40
    starts = range(40, len(q) - length - 40, length)
    params = sysid.ParameterDict()
    for k in range(1, 5):
        params.add(parameter(f"m{k}", model.body(str(k)).mass, [0.01], [1.0]))
        com = model.body(str(k)).ipos[:2]
        params.add(parameter(f"com{k}", com, com - 0.2, com + 0.2))
        params.add(parameter(f"I{k}", model.body(str(k)).inertia[2:], [1e-6], [0.02]))
    params.add(parameter("viscous", [0.03, 0.03], [0, 0], [1, 1]))
    params.add(parameter("coulomb", [0.05, 0.05], [0, 0], [1, 1]))
    driven = [0, 2]
    # positions and velocities count by how much they change within a window
    weights = np.concatenate([1 / np.std(q, axis=0), 1 / np.std(qd, axis=0)])

    def residual(x, own, **_):
        candidates = x.T if x.ndim > 1 else x[None]
        out = []
        for candidate in candidates:
            own.update_from_vector(candidate)
            for k in range(1, 5):
                body = model.body(str(k)).id
                model.body_mass[body] = own[f"m{k}"].value[0]
                model.body_ipos[body][:2] = own[f"com{k}"].value
                model.body_inertia[body][:] = own[f"I{k}"].value[0]
            mujoco.mj_setConst(model, state)
            model.dof_damping[driven] = own["viscous"].value
            model.dof_frictionloss[driven] = own["coulomb"].value
            found = []
            for start in starts:
                mujoco.mj_resetData(model, state)
                state.qpos[:], state.qvel[:] = q[start], qd[start]
                for row in range(start, start + length):
                    # the effort of a row holds to the next one
                    state.ctrl[:] = (tau[row] + tau[row + 1]) / 2
                    mujoco.mj_step(model, state)
                    off = [state.qpos - q[row + 1], state.qvel - qd[row + 1]]
                    found.append(np.concatenate(off) * weights)
            out.append(np.concatenate(found))
        stacked = np.stack(out, 1)
        return [stacked if x.ndim > 1 else stacked[:, 0]], None, None

    found = optimized(params, residual)
    told = {}
    for k in range(1, 5):
        mass, com = found[f"m{k}"].value[0], [*found[f"com{k}"].value, 0.0]
        inertia = np.eye(3) * found[f"I{k}"].value[0]
        about = moments(mass, com, inertia)
        told |= labels(np.concatenate([[mass], mass * np.array(com), about.ravel()]), str(k))
    for k, joint in enumerate(("q1", "q3")):
        told[f"Fv({joint})"] = float(found["viscous"].value[k])
        told[f"Fc({joint})"] = float(found["coulomb"].value[k])
    return told


def fivebar(regen, scratch):
    spec = ROOT / "runtime/guide/fivebar/fivebar.yaml"
    for seed, name in ((1, "a"), (2, "b")):
        # the same robot along two motions
        motion = scratch / f"{name}.json"
        run(regen, "excite", spec, "--frequency", "0.2", "--harmonics", "5", "--samples", "60",
            "--starts", "1", "--seed", seed, "--out", motion)
        run(regen, "simulate", spec, "--trajectory", motion, "--parameters", truth(regen, spec, scratch),
            "--noise", "1e-5,0.01", "--bandwidth", "20", "--step", "0.0025", "--duration", "5", "--settle", "5",
            "--seed", seed, "--out", scratch / f"{name}.csv")
    reading = ["--butterworth", "4,20"]
    ours = scratch / "ours.json"
    for name, more in (("least squares", []), ("feasible", ["--feasible"])):
        words = ["identify", spec, scratch / "a.csv", *reading, *more, "--out", ours]
        _, seconds = run(regen, *words)
        result = score(regen, spec, ours, scratch / "b.csv", *reading)
        print(f"five-bar, regen, {name}: {result} in {seconds:.1f} s; {off(ours, scratch)}", flush=True)
    begin = time.perf_counter()
    theirs = scratch / "theirs.json"
    theirs.write_text(json.dumps(fivebar_theirs(scratch / "a.csv")))
    seconds = time.perf_counter() - begin
    result = score(regen, spec, theirs, scratch / "b.csv", *reading)
    true = score(regen, spec, scratch / "truth.json", scratch / "b.csv", *reading)
    told = json.loads(theirs.read_text())
    print(f"five-bar, mujoco.sysid, rollouts of 0.1 s: {result} in {seconds:.1f} s; {friction(told, scratch)}")
    print(f"five-bar, the true parameters: {true}")


def truth(regen, spec, scratch):
    """Nominal parameters, each up to 20 % off, the same in every run."""
    path = scratch / "truth.json"
    if not path.exists():
        out, _ = run(regen, "info", spec, "--format", "json")
        names = [p["label"] if isinstance(p, dict) else p for p in json.loads(out)["parameters"]]
        told = {}
        for k, mass, com, inertia in ((1, 0.2, 0.1, 7e-4), (2, 0.15, 0.15, 1.2e-3),
                                      (3, 0.2, 0.1, 7e-4), (4, 0.15, 0.15, 1.2e-3)):
            mass, com, inertia = mass * (0.9 + 0.05 * k), com * (1.15 - 0.06 * k), inertia * (0.8 + 0.1 * k)
            about = moments(mass, [com, 0.005 * k, 0], np.diag([1e-5, inertia, inertia]))
            told |= labels(np.concatenate([[mass], mass * np.array([com, 0.005 * k, 0]), about.ravel()]), str(k))
        told |= {"Fv(q1)": 0.035, "Fc(q1)": 0.043, "Fv(q3)": 0.026, "Fc(q3)": 0.058}
        path.write_text(json.dumps({name: told.get(name, 0.0) for name in names}))
    return path


def friction(found, scratch):
    """How far the friction is off, percent."""
    true = json.loads((scratch / "truth.json").read_text())
    names = [name for name in true if name.startswith("F")]
    each = [f"{name} {100 * (found[name] / true[name] - 1):+.1f} %" for name in names]
    return ", ".join(each)


def off(path, scratch):
    told = json.loads(path.read_text())
    rows = {row["label"]: row["value"] for row in told["parameters"]}
    return friction(rows, scratch)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--arm", type=Path)
    parser.add_argument("--regen", default=os.environ.get("REGEN", str(ROOT / "target/release/regen")))
    parser.add_argument("names", nargs="*", default=["fivebar", "ur10e"])
    args = parser.parse_args()
    print(f"mujoco {mujoco.__version__}, {os.cpu_count()} cores")
    for name in args.names or ["fivebar", "ur10e"]:
        with tempfile.TemporaryDirectory() as scratch:
            if name == "fivebar":
                fivebar(args.regen, Path(scratch))
            elif args.arm is None:
                print("UR10e: left out, no --arm FOLDER")
            else:
                ur10e(args.regen, args.arm, Path(scratch))


if __name__ == "__main__":
    main()
