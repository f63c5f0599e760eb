"""Writes twins of the usual kinds of parallel robots in several formats, and Pinocchio's inverse dynamics of them.

    pip install pin==4.1.0 numpy
    python tests/tools/vectors/closed.py

The mechanisms are ours. Each stands in tests/fixtures/import/closed as URDF with <loop>, those with other formats as
SDF, MJCF and USD too; all frames are parallel where the joints are at 0, and the loops are closed there. Beside the URDF
file of the first four is a JSON as those of import.py: 100 closed states, and the efforts of the independent coordinates there. Pinocchio
reads the open tree; the loops are constraints between points of it, with

    M qdd + h = S' tau + J' lambda

solved for tau and the multipliers together. The mobility is the number of coordinates less the rank of J, the Jacobian
of Pinocchio's constraint models. Nothing here uses regen.
"""

import json
import pathlib

import numpy as np
import pinocchio as pin

OUT = pathlib.Path(__file__).resolve().parents[2] / "fixtures/import/closed"
STATES = 100
X, Y, Z = "1 0 0", "0 1 0", "0 0 1"


class Mechanism:
    """Links by name, each after its parent: the joint that carries it, where, and its inertia."""

    def __init__(self, independent):
        self.links, self.loops, self.independent = [], [], independent

    def link(self, name, parent, joint, axis, at, com=None, mass=0.0, kind="continuous", yaw=0.0):
        """A link; without a centre of mass it has no mass."""
        size = 1.3 * max(np.abs(com)) if com else 0.0
        # no two moments are equal
        moments = [float(mass * size**2 * part) for part in (0.21, 0.26, 0.17)]
        self.links.append((name, parent, joint, axis, at, kind, yaw, mass, com or (0, 0, 0), moments))

    def universal(self, name, parent, joint, at, com, mass, yaw=0.0):
        self.link(f"{name}_cross", parent, f"{joint}_y", Y, at, yaw=yaw)
        self.link(name, f"{name}_cross", f"{joint}_x", X, (0, 0, 0), com, mass)

    def loop(self, name, first, at, second, there):
        self.loops.append((name, first, at, second, there))


def text(numbers):
    return " ".join(repr(float(x)) for x in numbers)


def five_bar():
    m = Mechanism(["q1", "q2"])
    m.link("a", "base", "q1", Y, (0, 0, 0), (-0.04, 0.01, 0.11), 0.8)
    m.link("b", "a", "p1", Y, (-0.1, 0, 0.2), (0.12, 0, 0.17), 0.5)
    m.link("c", "base", "q2", Y, (0.3, 0, 0), (0.05, 0, 0.12), 0.7)
    m.link("d", "c", "p2", Y, (0.1, 0, 0.25), (-0.11, 0.02, 0.14), 0.6)
    m.loop("tip", "b", (0.25, 0, 0.35), "d", (-0.25, 0, 0.3))
    return m


def delta(has_pairs=True):
    """With pairs of rods; or with one rod a leg and a platform that does not turn, whose base is derived faster."""
    m = Mechanism(["q1", "q2", "q3"])
    for axis, joint in ((X, "tx"), (Y, "ty"), (Z, "tz")):
        if joint == "tz" and not has_pairs:
            m.link("platform", "lty", "tz", Z, (0, 0, 0), (0.01, 0.02, -0.03), 0.7, kind="prismatic")
            break
        m.link(f"l{joint}", m.links[-1][0] if m.links else "base", joint, axis, (0, 0, -0.8 if joint == "tx" else 0), kind="prismatic")
    if has_pairs:
        m.link("lrz", "ltz", "rz", Z, (0, 0, 0))
        m.link("lry", "lrz", "ry", Y, (0, 0, 0))
        m.link("platform", "lry", "rx", X, (0, 0, 0), (0.01, 0.02, -0.03), 0.7)
    for k in range(3):
        yaw = float(2 * np.pi / 3 * k)
        c, s = np.cos(yaw), np.sin(yaw)
        m.link(f"crank{k + 1}", "base", f"q{k + 1}", Y, (0.2 * c, 0.2 * s, 0), (0.22, 0.01, 0.01), 1.2, yaw=yaw)
        for side, way in (("l", 0.05), ("r", -0.05)) if has_pairs else (("", 0.0),):
            rod = f"rod{k + 1}{side}"
            m.universal(rod, f"crank{k + 1}", f"u{k + 1}{side}", (0.4, way, 0), (-0.24, 0, -0.41), 0.2)
            at = (0.05 * c - way * s, 0.05 * s + way * c, 0)
            m.loop(f"ball{k + 1}{side}", "platform", at, rod, (-0.55, 0, -0.8))
    return m


def leg():
    """A leg like Cassie's: a spring in the shin, a rod from the hip to the heel, and a crank that turns the toe."""
    m = Mechanism(["hip", "knee", "shin", "crank"])
    m.link("thigh", "base", "hip", Y, (0, 0, 0), (0.06, 0.02, -0.2), 5.0)
    m.link("shank", "thigh", "knee", Y, (0.1, 0, -0.4), (0.03, 0.01, -0.02), 0.6)
    m.link("shin_", "shank", "shin", Y, (0.04, 0, -0.02), (-0.1, 0, -0.2), 0.5)
    m.link("tarsus", "shin_", "tarsus_pitch", Y, (-0.19, 0, -0.38), (0.12, 0, -0.14), 0.8)
    m.link("crank_", "tarsus", "crank", Y, (0.03, 0, -0.08), (0.02, 0, 0.01), 0.15)
    m.link("plantar", "crank_", "plantar_pin", Y, (0.05, 0, 0.03), (0.14, 0.005, -0.12), 0.1)
    m.link("toe", "tarsus", "toe_pitch", Y, (0.35, 0, -0.35), (0.03, 0, -0.02), 0.2)
    m.universal("achilles", "thigh", "achilles", (0, 0.05, -0.05), (-0.06, -0.005, -0.39), 0.3)
    m.loop("heel", "tarsus", (-0.07, 0.04, -0.03), "achilles", (-0.12, -0.01, -0.78))
    m.loop("toe_rod", "toe", (0.02, 0, 0.05), "plantar", (0.29, 0, -0.25))
    return m


def ankle():
    m = Mechanism(["motor_l", "motor_r"])
    m.link("cross", "base", "pitch", Y, (0, 0, -0.3))
    m.link("foot", "cross", "roll", X, (0, 0, 0), (0.04, 0, -0.03), 0.9)
    for side, way in (("l", 1), ("r", -1)):
        m.link(f"crank_{side}", "base", f"motor_{side}", Y, (-0.03, way * 0.06, 0), (-0.03, 0, 0.005), 0.12)
        m.universal(f"rod_{side}", f"crank_{side}", f"rod_{side}", (-0.05, 0, 0), (0.001, -way * 0.005, -0.16), 0.08)
        m.loop(f"ball_{side}", "foot", (-0.08, way * 0.05, -0.02), f"rod_{side}", (0, -way * 0.01, -0.32))
    return m


def excavator():
    m = Mechanism(["swing", "slide1", "slide2", "slide3"])
    m.link("upper", "base", "swing", Z, (0, 0, 1), (-0.4, 0.1, 0.5), 4000.0)
    m.link("boom", "upper", "boom_pin", Y, (0.2, 0, 0.8), (2.6, 0, 1.2), 1100.0)
    m.link("stick", "boom", "stick_pin", Y, (5.2, 0, 0.6), (0.9, 0, -0.6), 500.0)
    m.link("bucket", "stick", "bucket_pin", Y, (1.9, 0, -2.1), (0.4, 0, -0.5), 450.0)
    m.link("rocker", "stick", "rocker_pin", Y, (1.6, 0, -1.7), (0.2, 0, 0.1), 40.0)
    m.link("coupler", "rocker", "coupler_pin", Y, (0.5, 0, 0.1), (0.1, 0, -0.2), 35.0)
    for k, (body, at, end, rod) in enumerate(
        (("upper", (0.7, 0, 0.4), "boom", (2.2, 0, 1.1)), ("boom", (2.4, 0, 1.5), "stick", (-0.5, 0, 0.4)), ("stick", (0.1, 0, 0.5), "rocker", (0.5, 0, 0.1)))
    ):
        # the slide is along z of the barrel, which is turned by its zero
        n = k + 1
        m.link(f"barrel{n}", body, f"barrel{n}_pin", Y, at, (0.5, 0, 0.1), 90.0 - 10 * k)
        m.link(f"rod{n}", f"barrel{n}", f"slide{n}", "AIM", (0, 0, 0), (0.4, 0, 0.05), 50.0 - 5 * k, kind="prismatic")
        m.loop(f"eye{n}", end, rod, f"rod{n}", "AIM")
    m.loop("link", "bucket", (0.25, 0, 0.35), "coupler", (0.05, 0, -0.15))
    return m.aimed()


def aimed(self):
    """Cylinders that point at their eyes where the joints are at 0."""
    world = {"base": np.zeros(3)}
    for name, parent, _, _, at, *_ in self.links:
        world[name] = world[parent] + at
    for k, (loop, first, at, second, there) in enumerate(self.loops):
        if there == "AIM":
            there = world[first] + at - world[second]
            self.loops[k] = (loop, first, at, second, tuple(there))
            rod = next(i for i, link in enumerate(self.links) if link[0] == second)
            link = list(self.links[rod])
            link[3] = text(there / np.linalg.norm(there))
            self.links[rod] = tuple(link)
    return self


Mechanism.aimed = aimed
MECHANISMS = {"fivebar": five_bar, "delta": delta, "delta3": lambda: delta(False), "leg": leg, "ankle": ankle, "excavator": excavator}
IN_VECTORS = ["fivebar", "delta", "leg", "ankle"]
# those that other formats have too
IN_ALL = ["fivebar", "delta3", "excavator"]


def urdf(name, m):
    out = [f'<robot name="{name}">', '  <link name="base"/>']
    for link, parent, joint, axis, at, kind, yaw, mass, com, (a, b, c) in m.links:
        inertial = (
            f'<inertial><origin xyz="{text(com)}"/><mass value="{mass!r}"/>'
            f'<inertia ixx="{a!r}" ixy="0" ixz="0" iyy="{b!r}" iyz="0" izz="{c!r}"/></inertial>'
        )
        out.append(f'  <link name="{link}">{inertial if mass else ""}</link>')
        limit = '<limit lower="-9" upper="9" effort="1e4" velocity="10"/>' if kind == "prismatic" else ""
        out.append(
            f'  <joint name="{joint}" type="{kind}"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="{text(at)}" rpy="0 0 {yaw!r}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
    for loop, first, at, second, there in m.loops:
        ends = [
            f'<{end} link="{link}"><origin xyz="{text(xyz)}"/></{end}>'
            for end, link, xyz in (("predecessor", first, at), ("successor", second, there))
        ]
        out.append(f'  <loop name="{loop}" type="spherical">{"".join(ends)}</loop>')
    return "\n".join([*out, "</robot>", ""])


def sdf(name, m):
    out = [f'<sdf version="1.9"><model name="{name}">']
    for link, parent, joint, axis, at, kind, yaw, mass, com, (a, b, c) in m.links:
        around = "" if parent == "base" else f' relative_to="{parent}"'
        out.append(
            f'  <link name="{link}"><pose{around}>{text(at)} 0 0 {yaw!r}</pose><inertial><pose>{text(com)} 0 0 0</pose>'
            f"<mass>{mass!r}</mass><inertia><ixx>{a!r}</ixx><iyy>{b!r}</iyy><izz>{c!r}</izz></inertia></inertial></link>"
        )
        on = "world" if parent == "base" else parent
        limit = "<limit><lower>-9</lower><upper>9</upper><effort>1e4</effort><velocity>10</velocity></limit>" if kind == "prismatic" else ""
        kind = "revolute" if kind == "continuous" else kind
        out.append(
            f'  <joint name="{joint}" type="{kind}"><parent>{on}</parent><child>{link}</child>'
            f"<axis><xyz>{axis}</xyz>{limit}</axis></joint>"
        )
    for loop, first, _, second, there in m.loops:
        out.append(
            f'  <joint name="{loop}" type="ball"><pose>{text(there)} 0 0 0</pose><parent>{first}</parent>'
            f"<child>{second}</child></joint>"
        )
    return "\n".join([*out, "</model></sdf>", ""])


def mjcf(name, m):
    def inside(parent):
        bodies = []
        for link, around, joint, axis, at, kind, yaw, mass, com, moments in m.links:
            if around != parent:
                continue
            kind = "slide\" limited=\"true\" range=\"-9 9" if kind == "prismatic" else "hinge"
            inertial = f'<inertial pos="{text(com)}" mass="{mass!r}" diaginertia="{text(moments)}"/>' if mass else ""
            bodies.append(
                f'<body name="{link}" pos="{text(at)}" euler="0 0 {yaw!r}"><joint name="{joint}" type="{kind}" '
                f'axis="{axis}"/>{inertial}{inside(link)}</body>\n'
            )
        return "".join(bodies)

    ties = [f'<connect name="{loop}" body1="{first}" body2="{second}" anchor="{text(at)}"/>' for loop, first, at, second, _ in m.loops]
    return (
        f'<mujoco model="{name}"><compiler angle="radian"/><worldbody>\n{inside("base")}</worldbody>\n<equality>\n'
        + "\n".join(ties)
        + "\n</equality></mujoco>\n"
    )


def usd(name, m):
    out = ["#usda 1.0", "(", f'    defaultPrim = "{name}"', "    metersPerUnit = 1", '    upAxis = "Z"', ")", "", f'def Xform "{name}"', "{"]

    def triple(numbers):
        return f"({', '.join(repr(float(x)) for x in numbers)})"

    def joint(kind, own, ends, axis, rest=""):
        rows = [f"        uniform token physics:axis = \"{axis}\""]
        for k, (link, at, turn) in enumerate(ends):
            if link != "base":
                rows.append(f"        rel physics:body{k} = </{name}/{link}>")
            rows += [f"        point3f physics:localPos{k} = {triple(at)}", f"        quatf physics:localRot{k} = {triple(turn)}"]
        return "\n".join([f'    def Physics{kind}Joint "{own}"', "    {", *rows, f"{rest}    }}"])

    for link, parent, own, axis, at, kind, yaw, mass, com, moments in m.links:
        out.append(
            f'    def Xform "{link}" (\n        prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"]\n    )\n    {{\n'
            f"        float physics:mass = {mass!r}\n        point3f physics:centerOfMass = {triple(com)}\n"
            f"        float3 physics:diagonalInertia = {triple(moments)}\n    }}"
        )
        vector = np.array([float(x) for x in axis.split()])
        # the rotation of z onto an axis that is none of the frame's
        letter, turn = {X: ("X", 0), Y: ("Y", 0), Z: ("Z", 0)}.get(axis, ("Z", 1))
        own_turn = np.array([1.0, 0, 0, 0])
        if turn:
            own_turn = np.array([1 + vector[2], -vector[1], vector[0], 0])
            own_turn /= np.linalg.norm(own_turn)
        about_z = np.array([np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)])
        first = about_z if yaw else own_turn
        limits = "        float physics:lowerLimit = -9\n        float physics:upperLimit = 9\n" if kind == "prismatic" else ""
        kind = "Prismatic" if kind == "prismatic" else "Revolute"
        out.append(joint(kind, own, [(parent, at, first), (link, (0, 0, 0), own_turn)], letter, limits))
    for loop, first, at, second, there in m.loops:
        closing = "        uniform bool physics:excludeFromArticulation = 1\n"
        ends = [(first, at, (1, 0, 0, 0)), (second, there, (1, 0, 0, 0))]
        out.append(joint("Spherical", loop, ends, "X", closing))
    return "\n".join([*out, "}", ""])


class Tree:
    def __init__(self, path, m):
        self.model = pin.buildModelFromUrdf(str(path))
        self.data = self.model.createData()
        self.ends = []
        for _, *ends in m.loops:
            sides = []
            for link, at in zip(ends[::2], ends[1::2]):
                frame = self.model.frames[self.model.getFrameId(link, pin.FrameType.BODY)]
                sides.append((frame.parentJoint, frame.placement * pin.SE3(np.eye(3), np.array(at, float))))
            self.ends.append(sides)
        self.constraints = pin.StdVec_RigidConstraintModel()
        for (one, p1), (two, p2) in self.ends:
            kind = pin.ContactType.CONTACT_3D
            self.constraints.append(pin.RigidConstraintModel(kind, self.model, one, p1, two, p2, pin.LOCAL))

    def pinned(self, x):
        """The configuration of Pinocchio, which has cosines and sines of joints without limits."""
        return pin.integrate(self.model, pin.neutral(self.model), x)

    def gaps(self, x):
        pin.forwardKinematics(self.model, self.data, self.pinned(x))
        ends = [[self.data.oMi[joint].act(place.translation) for joint, place in sides] for sides in self.ends]
        return np.concatenate([a - b for a, b in ends])

    def rows(self, x, qd=None):
        """The Jacobian of the gaps, and their accelerations without those of the joints."""
        np_ = len(x)
        qd = np.zeros(np_) if qd is None else qd
        zero = np.zeros(np_)
        pin.forwardKinematics(self.model, self.data, self.pinned(x), qd, zero)
        pin.computeJointJacobians(self.model, self.data, self.pinned(x))
        jacobians, drift = [], []
        for sides in self.ends:
            parts = []
            for joint, place in sides:
                turn = self.data.oMi[joint].rotation
                world = pin.getJointJacobian(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
                arm = turn @ place.translation
                velocity = pin.getVelocity(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
                acceleration = pin.getClassicalAcceleration(self.model, self.data, joint, pin.LOCAL_WORLD_ALIGNED)
                parts.append(
                    (
                        world[:3] - pin.skew(arm) @ world[3:],
                        acceleration.linear
                        + np.cross(acceleration.angular, arm)
                        + np.cross(velocity.angular, np.cross(velocity.angular, arm)),
                    )
                )
            jacobians.append(parts[0][0] - parts[1][0])
            drift.append(parts[0][1] - parts[1][1])
        return np.vstack(jacobians), np.concatenate(drift)

    def mobility(self, x):
        """Of Pinocchio's own Jacobian of its constraints."""
        pin.forwardKinematics(self.model, self.data, self.pinned(x))
        pin.computeJointJacobians(self.model, self.data, self.pinned(x))
        known = pin.StdVec_RigidConstraintData()
        for constraint in self.constraints:
            known.append(constraint.createData())
        for constraint, data in zip(self.constraints, known):
            constraint.calc(self.model, self.data, data)
        jacobian = pin.getConstraintsJacobian(self.model, self.data, self.constraints, known)
        sizes = np.linalg.svd(jacobian, compute_uv=False)
        return self.model.nv - int(np.sum(sizes > 1e-9 * sizes[0]))


def states(tree, m):
    model = tree.model
    names = [model.names[k + 1] for k in range(model.njoints - 1)]
    free = [names.index(name) for name in m.independent]
    held = [k for k in range(len(names)) if k not in free]
    random = np.random.default_rng(47)
    assert np.abs(tree.gaps(np.zeros(model.nv))).max() < 1e-14
    out, worst = [], 0.0
    while len(out) < STATES:
        x = np.zeros(model.nv)
        target = random.uniform(-0.35, 0.35, len(free))
        for part in np.linspace(0.1, 1, 10):
            x[free] = part * target
            for _ in range(30):
                gap = tree.gaps(x)
                x[held] -= np.linalg.lstsq(tree.rows(x)[0][:, held], gap, rcond=1e-10)[0]
                if np.abs(gap).max() < 1e-15:
                    break
        if np.abs(tree.gaps(x)).max() > 1e-14:
            continue
        jacobian = tree.rows(x)[0]
        sizes = np.linalg.svd(jacobian[:, held], compute_uv=False)
        # far from singular
        if sizes[len(held) - 1] < 1e-2 * sizes[0] or tree.mobility(x) != len(free):
            continue
        qd, qdd = np.zeros(model.nv), np.zeros(model.nv)
        qd[free], qdd[free] = random.uniform(-2, 2, (2, len(free)))
        solve = lambda right: np.linalg.lstsq(jacobian[:, held], right, rcond=1e-10)[0]
        qd[held] = solve(-jacobian[:, free] @ qd[free])
        qdd[held] = solve(-jacobian[:, free] @ qdd[free] - tree.rows(x, qd)[1])
        forces = pin.rnea(model, tree.data, tree.pinned(x), qd, qdd)
        selected = np.eye(model.nv)[:, free]
        balance = np.hstack([selected, jacobian.T])
        solved = np.linalg.lstsq(balance, forces, rcond=1e-12)[0]
        worst = max(worst, np.abs(balance @ solved - forces).max() / np.abs(forces).max())
        values = {"q": x, "qd": qd, "qdd": qdd, "tau": solved[: len(free)]}
        out.append({key: list(value) for key, value in values.items()})
    assert worst < 1e-11, worst
    return names, out


def main():
    OUT.mkdir(exist_ok=True)
    for name, build in MECHANISMS.items():
        m = build()
        path = OUT / f"{name}.urdf"
        path.write_text(urdf(name, m))
        if name in IN_ALL:
            (OUT / f"{name}.sdf").write_text(sdf(name, m))
            (OUT / f"{name}.xml").write_text(mjcf(name, m))
        if name in IN_ALL and all(link[7] for link in m.links):
            # a body without mass has that of its shapes there
            (OUT / f"{name}.usda").write_text(usd(name, m))
        if name not in IN_VECTORS:
            continue
        tree = Tree(path, m)
        names, found = states(tree, m)
        mobility = tree.mobility(np.zeros(tree.model.nv))
        head = {"by": f"Pinocchio {pin.__version__}", "coordinates": names, "independent": m.independent, "mobility": mobility}
        rows = ",\n".join(json.dumps(state) for state in found)
        (OUT / f"{name}.urdf.json").write_text(json.dumps(head)[:-1] + f', "states": [\n{rows}\n]}}\n')
        print(name, len(names), "coordinates, mobility", mobility)


if __name__ == "__main__":
    main()
