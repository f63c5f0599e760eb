"""Base regressors by Pinocchio's Python package, as its users write them."""
import math

import peers


def base_columns(robot, joints):
    """Indices of the base parameters' columns; `joints` has each body's joint, from 0."""
    return [10 * joints[body] + entry for body, entry in peers.pinocchio_columns(robot)]


def arm(robot):
    """W of one state of a serial arm, and how many rows it has."""
    import numpy as np
    import pinocchio as pin

    rows, gravity = peers.links(robot)
    model = pin.Model()
    model.gravity.linear = np.array(gravity)
    joint = 0
    for number, (alpha, length, d) in enumerate(rows):
        c, s = math.cos(alpha), math.sin(alpha)
        placement = pin.SE3(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([length, -s * d, c * d]))
        joint = model.addJoint(joint, pin.JointModelRZ(), placement, f"j{number}")
        model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
    data = model.createData()
    columns = base_columns(robot, range(len(rows)))

    def evaluate(q, qd, qdd):
        return pin.computeJointTorqueRegressor(model, data, q, qd, qdd)[:, columns]

    return evaluate, len(rows)


def closed_rps3():
    """W of one closed state of the 3-RPS: the tree's regressor, the Jacobians of both sides of each
    cut in the world's axes, X by numpy, K_i - X^T K_e."""
    import numpy as np
    import pinocchio as pin

    data_of_spec, names = peers.spec("rps3")
    model = pin.Model()
    model.gravity.linear = np.array([peers.number(g, names) for g in data_of_spec["gravity"]])
    upright = pin.SE3(pin.utils.rotate("x", math.pi / 2), np.zeros(3))
    joints = []
    for limb in data_of_spec["limbs"]:
        base = limb["base"]
        ground = pin.SE3(peers.fixed([peers.number(x, names) for x in base["rpy"]]),
                         np.array([peers.number(x, names) for x in base["xyz"]]))
        joint = 0
        for described in limb["joints"]:
            name = described["name"]
            if described["type"] == "spherical":
                kinds = [getattr(pin, f"JointModelR{axis.upper()}")() for axis in peers.SPHERICAL]
            else:
                kinds = [pin.JointModelRZ() if described["type"] == "revolute" else pin.JointModelPZ()]
            placement = upright if "dh" in described else pin.SE3.Identity() if joint else ground
            for part, kind in enumerate(kinds):
                joint = model.addJoint(joint, kind, placement if part == 0 else pin.SE3.Identity(), f"{name}.{part}")
            model.appendBodyToJoint(joint, pin.Inertia.Random(), pin.SE3.Identity())
            joints.append(joint - 1)
    cuts = []
    of_body = {body + 1: joint + 1 for body, joint in enumerate(joints)}
    for number, cut in enumerate(data_of_spec["cuts"]):
        sides = []
        for side in cut["between"]:
            point = np.array([peers.number(x, names) for x in side.get("xyz", [0, 0, 0])])
            frame = pin.Frame(f"cut{number}.{len(sides)}", of_body[side["body"]], 0,
                              pin.SE3(np.eye(3), point), pin.FrameType.OP_FRAME)
            sides.append(model.addFrame(frame))
        cuts.append(sides)
    data = model.createData()
    _, independent, dependent = peers.closure_rps3()
    columns = base_columns("rps3", joints)
    world = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED

    def evaluate(q, qd, qdd):
        K = pin.computeJointTorqueRegressor(model, data, q, qd, qdd)[:, columns]
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        A = np.vstack([(pin.getFrameJacobian(model, data, one, world) - pin.getFrameJacobian(model, data, two, world))[:3]
                       for one, two in cuts])
        X = np.linalg.solve(A[:, dependent], A[:, independent])
        return K[independent] - X.T @ K[dependent]

    return evaluate, len(independent)
