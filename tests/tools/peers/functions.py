#!/usr/bin/env python3
"""Compares the functions of controllers with Pinocchio's at 100 states of each robot: poses, Jacobians and
rates of frames of arms and loops; forward dynamics of loops with Pinocchio's constraints, and the
derivatives of inverse and forward dynamics along closed states.

    python3 tests/tools/peers/functions.py             # installs the peers into a virtual environment first
    python3 tests/tools/peers/functions.py ROBOT...    # only these

The tree and the cuts are Pinocchio's own, built from the description by tests/tools/vectors/forces.py, which
also closes the loops. A frame is put on every body. The largest difference is relative to the largest
entry. Exits with 1 if one is above its bound.
"""
import ctypes
import re
import sys

import peers

ARMS = ["puma560", "ur5e", "rx90", "panda", "iiwa14", "tree_branch"]
LOOPS = ["fivebar", "3rps", "stewart"]
STATES = 100
FRAMES, DYNAMICS = 1e-12, 1e-7
# of differences of fourth order, rad or m: a 6-UPS of 6 cm comes near singularities
STEP = 8e-6
PLACED = [0.1, -0.2, 0.3], [0.4, -0.5, 0.6]


class Compiled:
    """Our C of a robot with a frame on every body, as functions over arrays."""

    def __init__(self, robot, labels):
        import numpy as np

        self.np = np
        text = (peers.ROOT / "robots" / f"{robot}.yaml").read_text()
        rows = "".join(
            f"  - {{name: f{k}, body: {label}, xyz: {PLACED[0]}, rpy: {PLACED[1]}}}\n"
            for k, label in enumerate(labels)
        )
        text = re.sub(r"\nframes:\n( .*\n)+", "\n", text) + f"\nframes:\n{rows}"
        text = text if "\ncontrol: true" in text else text + "\ncontrol: true\n"
        self.description = peers.WORK / f"functions_{robot}.yaml"
        self.description.write_text(text)
        out = peers.run([peers.regen(), "generate", self.description.name, "--target", "c", "--out", "."], cwd=peers.WORK)
        self.name = next(word for word in out.split() if word.endswith(".c:")).strip("./:c").removesuffix(".")
        library = peers.WORK / f"functions_{robot}.so"
        options = ["-std=c99", "-O0", "-shared", "-fPIC", f"-D{self.name.upper()}_NO_FLOAT"]
        peers.run(["gcc", *options, f"{self.name}.c", "-o", library, "-lm"], cwd=peers.WORK)
        self.library = ctypes.CDLL(str(library))

    def names(self, table, count):
        return [word.decode() for word in (ctypes.c_char_p * count).in_dll(self.library, f"{self.name}_{table}")]

    def call(self, function, size, *arguments):
        """The entries that a function writes."""
        np = self.np
        out = np.full(size, np.nan)
        called = getattr(self.library, f"{self.name}_{function}")
        called.restype = ctypes.c_double
        pointer = ctypes.POINTER(ctypes.c_double)
        given = [np.ascontiguousarray(x, float) for x in (*arguments, out)]
        called(*[x.ctypes.data_as(pointer) for x in given])
        return given[-1]


class Judge:
    """The largest differences, by what is compared."""

    def __init__(self):
        self.worst = {}

    def see(self, what, bound, ours, theirs):
        size = max(abs(theirs).max(initial=0.0), abs(ours).max(initial=0.0))
        error = abs(ours - theirs).max(initial=0.0) / size if size > 0 else 0.0
        known = self.worst.get(what, (0.0, bound))[0]
        # NaN is no agreement
        self.worst[what] = (known if error <= known else error, bound)

    def tell(self, robot):
        misses = [what for what, (error, bound) in self.worst.items() if not error <= bound]
        told = ", ".join(f"{what} {error:.1e}" for what, (error, _) in self.worst.items())
        print(f"{robot}: {told}{'; MISSED: ' + ', '.join(misses) if misses else ''}", flush=True)
        return not misses


class Peer:
    """A description in Pinocchio, with its constraints."""

    def __init__(self, path):
        import forces
        import numpy as np
        import pinocchio as pin

        self.np, self.pin = np, pin
        self.d = d = forces.Description(path)
        (x, y, z), (r, p, w) = PLACED
        place = forces.shift(x, y, z) * forces.axis_turn("z", w) * forces.axis_turn("y", p) * forces.axis_turn("x", r)
        self.frames = []
        for label in d.bodies:
            joint, at = d.at[str(label)]
            self.frames.append(d.model.addFrame(pin.Frame(f"frame.{label}", joint, 0, at * place, pin.OP_FRAME)))
        self.constraints = pin.StdVec_RigidConstraintModel()
        for kind, sides in d.cuts:
            assert kind in ("spherical", "revolute"), kind
            (one, p1), (two, p2) = [(d.model.frames[s].parentJoint, d.model.frames[s].placement) for s in sides]
            # a planar loop closes where the points meet
            self.constraints.append(
                pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, d.model, one, p1, two, p2, pin.LOCAL_WORLD_ALIGNED)
            )
        d.data = d.model.createData()

    def pinned(self, x):
        y = self.np.zeros(self.d.model.nv)
        y[self.d.place] = x
        return y

    def closure(self, q):
        """The derivatives of all coordinates by the independent ones."""
        np, d = self.np, self.d
        along = np.zeros((len(q), len(d.independent)))
        for k, c in enumerate(d.independent):
            along[c, k] = 1.0
        if d.dependent:
            along[d.dependent] = d.dependents(q, -d.jacobian(q)[:, d.independent])
        return along

    def bias(self, q, qd):
        """The accelerations where the independent ones are zero."""
        np, d = self.np, self.d
        qdd = np.zeros(len(q))
        if d.dependent:
            qdd[d.dependent] = d.dependents(q, -d.rows(q, qd, qdd)[2])
        return qdd

    def frame_entries(self, q, qd, along, bias):
        """Poses, Jacobians and rates in the layout of our functions."""
        np, pin, d = self.np, self.pin, self.d
        world = pin.LOCAL_WORLD_ALIGNED
        pin.forwardKinematics(d.model, d.data, self.pinned(q), self.pinned(qd), self.pinned(bias))
        pin.computeJointJacobians(d.model, d.data, self.pinned(q))
        pin.updateFramePlacements(d.model, d.data)
        poses, jacobians, rates = [], [], []
        for frame in self.frames:
            at = d.data.oMf[frame]
            poses += [*at.rotation.ravel(), *at.translation]
            jacobians.append(pin.getFrameJacobian(d.model, d.data, frame, world)[:, d.place] @ along)
            rate = pin.getFrameClassicalAcceleration(d.model, d.data, frame, world)
            rates += [*rate.linear, *rate.angular]
        return np.array(poses), np.array(jacobians).ravel(), np.array(rates)

    def forward(self, q, qd, tau_i):
        """Accelerations under the constraints, and what their derivatives are computed from."""
        np, pin, d = self.np, self.pin, self.d
        tau = np.zeros(len(q))
        tau[d.independent] = tau_i
        data = d.model.createData()
        known = pin.StdVec_RigidConstraintData()
        for constraint in self.constraints:
            known.append(constraint.createData())
        pin.initConstraintDynamics(d.model, data, self.constraints, known)
        # a planar loop's point has a direction in which nothing moves; iterations take the regularisation out
        settings = pin.ProximalSettings(1e-14, 1e-14, 1e-10, 20)
        pinned = [self.pinned(x) for x in (q, qd, tau)]
        qdd = pin.constraintDynamics(d.model, data, *pinned, self.constraints, known, settings)
        return qdd[[d.place[k] for k in d.independent]], (data, known, settings)

    def slopes(self, q, qd, tau_i, along):
        """The derivatives of the accelerations along the closure: by qd and tau Pinocchio's, and by q the central
        differences of its accelerations at closed states, since computeConstraintDynamicsDerivatives of
        version 4.1.0 is not the derivative of constraintDynamics by q for these loops."""
        np, pin, d = self.np, self.pin, self.d
        _, (data, known, settings) = self.forward(q, qd, tau_i)
        _, by_qd, by_tau, *_ = pin.computeConstraintDynamicsDerivatives(
            d.model, data, self.constraints, known, settings
        )
        rows = [d.place[k] for k in d.independent]
        by_q = []
        for direction in along.T:
            def at(step):
                x = d.closed(q + step * direction)
                return self.forward(x, self.closure(x) @ qd[d.independent], tau_i)[0]

            near, far = at(STEP) - at(-STEP), at(2 * STEP) - at(-2 * STEP)
            by_q.append((8 * near - far) / (12 * STEP))
        return np.array(by_q).T, by_qd[rows][:, d.place] @ along, by_tau[rows][:, rows]


def compare(robot):
    import numpy as np

    peer = Peer(peers.ROOT / "robots" / f"{robot}.yaml")
    d = peer.d
    ours = Compiled(robot, d.bodies)
    assert ours.names("coordinates", len(d.coordinates)) == d.coordinates
    assert ours.names("parameters", len(d.parameters)) == d.parameters
    random, judge = np.random.default_rng(48), Judge()
    home = d.closed(d.home)
    m, count = len(d.independent), len(peer.frames)
    for _ in range(STATES):
        q, qd, qdd = d.state(random, home)
        phi = d.draw(random)
        along = peer.closure(q)
        poses, jacobians, rates = peer.frame_entries(q, qd, along, peer.bias(q, qd))
        judge.see("pose", FRAMES, ours.call("frame_pose", 12 * count, q), poses)
        judge.see("Jacobian", FRAMES, ours.call("frame_jacobian", 6 * count * m, q), jacobians)
        judge.see("its rate", FRAMES, ours.call("frame_jacobian_rate", 6 * count, q, qd), rates)
        if not d.cuts:
            continue
        d.forces(q, qd, qdd, phi)  # gives the bodies their inertias
        tau = ours.call("inverse_dynamics", m, q, qd, qdd, phi)
        found, _ = peer.forward(q, qd, tau)
        by_q, by_qd, by_tau = peer.slopes(q, qd, tau, along)
        own = ours.call("forward_dynamics", m, q, qd, tau, phi)
        judge.see("qdd", DYNAMICS, own, found)
        judge.see("inverse, forward", DYNAMICS, own, qdd[d.independent])
        slopes = ours.call("forward_dynamics_derivatives", 3 * m * m, q, qd, tau, phi)
        own = [x.T for x in slopes.reshape(3, m, m)]
        judge.see("qdd by q", DYNAMICS, own[0], by_q)
        judge.see("by qd", DYNAMICS, own[1], by_qd)
        judge.see("by tau", DYNAMICS, own[2], by_tau)
        # tau(q, qd, qdd(q, qd, tau)) = tau
        mass = np.linalg.inv(by_tau)
        slopes = ours.call("inverse_dynamics_derivatives", 2 * m * m, q, qd, qdd, phi)
        own = [x.T for x in slopes.reshape(2, m, m)]
        judge.see("tau by q", DYNAMICS, own[0], -mass @ by_q)
        judge.see("tau by qd", DYNAMICS, own[1], -mass @ by_qd)
    return judge.tell(robot)


def main():
    peers.WORK.mkdir(parents=True, exist_ok=True)
    peers.in_environment()
    sys.path.insert(0, str(peers.ROOT / "tests/tools/vectors"))
    held = [compare(robot) for robot in sys.argv[1:] or [*ARMS, *LOOPS]]
    return 0 if all(held) else 1


if __name__ == "__main__":
    sys.exit(main())
