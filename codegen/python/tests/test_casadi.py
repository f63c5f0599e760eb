"""The generated C as functions of CasADi, beside this package's own functions."""

import subprocess

import numpy as np
import pytest

import regen

casadi = pytest.importorskip("casadi")


def compiled(robot, folder):
    """The shared library of a robot's files."""
    names = robot.generate(folder, target="casadi")
    assert [path.name for path in names] == [f"{robot.name}.c", f"{robot.name}.h", f"{robot.name}_casadi.c"]
    library = folder / f"{robot.name}.so"
    sources = [str(path) for path in names if path.suffix == ".c"]
    command = ["cc", "-O1", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", *sources, "-lm", "-o", str(library)]
    try:
        subprocess.run(command, check=True)
    except FileNotFoundError:
        pytest.skip("there is no compiler cc")
    return library


@pytest.fixture(scope="module", params=["fivebar", "scara"])
def both(request, tmp_path_factory):
    robot = request.getfixturevalue(request.param)
    return robot, compiled(robot, tmp_path_factory.mktemp(request.param))


def given(robot, count):
    """States near home, efforts and parameters."""
    rng = np.random.default_rng(4)
    home = robot.home[[robot.coordinates.index(name) for name in robot.independent]]
    q = home + 0.2 * rng.uniform(-1, 1, (count, robot.dof))
    bodies = len(robot.bodies)
    phi = np.full(len(robot.parameters), 0.05)
    phi[: 10 * bodies] = np.tile([0.02, 0, 0, 0.03, 0, 0.03, 0.1, 0, 0, 1.0], bodies)
    return q, *rng.normal(size=(2, count, robot.dof)), phi


def external(robot, library, name):
    return casadi.external(f"{robot.name}_casadi_{name}", str(library))


def test_values_and_jacobians_are_those_of_the_package(both):
    robot, library = both
    q, qd, last, phi = given(robot, 20)
    for name, derivatives in (
        ("inverse_dynamics", robot.derivatives(q, qd, last, phi=phi, by_phi=True)
         if robot.dof == len(robot.coordinates) else
         robot.derivatives(*robot.close(q, qd, last)[:3], phi=phi, by_phi=True)),
        ("forward_dynamics", robot.derivatives(q, qd, tau_i=last, phi=phi, by_phi=True)),
    ):
        function = external(robot, library, name)
        jacobian = function.jacobian()
        for k in range(20):
            arguments = (q[k], qd[k], last[k], phi)
            value = function(*arguments)
            np.testing.assert_allclose(value.full()[:, 0], derivatives.value[k], rtol=1e-9, atol=1e-10)
            for found, own in zip(jacobian(*arguments, value), derivatives[1:]):
                scale = abs(own[k]).max()
                np.testing.assert_allclose(found.full(), own[k], rtol=0, atol=1e-9 * scale, err_msg=name)


def test_jacobians_are_those_of_casadis_differences(both):
    robot, library = both
    q, qd, last, phi = given(robot, 1)
    arguments = {"inverse_dynamics": (q[0], qd[0], last[0], phi), "forward_dynamics": (q[0], qd[0], last[0], phi)}
    arguments |= dict.fromkeys(("close", "frame_pose"), (q[0],))
    checked = 0
    for name, values in arguments.items():
        if (name == "close" and robot.dof == len(robot.coordinates)) or (
            name == "frame_pose" and not robot._info["frames"]
        ):
            continue
        function = external(robot, library, name)
        # differences of a function that tells nothing of its derivatives
        plain = casadi.external(
            function.name(), str(library),
            {"enable_fd": True, "fd_method": "central"}
            | {f"enable_{kind}": False for kind in ("forward", "reverse", "jacobian")},
        )
        value, push = plain(*values), plain.forward(1)
        for k, exact in enumerate(function.jacobian()(*values, value) if len(values) > 1 else
                                  [function.jacobian()(*values, value)]):
            columns = []
            for unit in np.eye(len(values[k])):
                seeds = [unit if j == k else np.zeros(len(v)) for j, v in enumerate(values)]
                columns.append(push(*values, value, *seeds).full()[:, 0])
            assert exact.full().any()
            atol = 1e-6 * abs(exact.full()).max()
            np.testing.assert_allclose(np.transpose(columns), exact.full(), rtol=0, atol=atol, err_msg=name)
            checked += 1
    assert checked >= 8


def test_states_without_meaning_fail_and_constants_are_those_of_the_description(fivebar, tmp_path):
    library = compiled(fivebar, tmp_path)
    nominal = external(fivebar, library, "nominal")()["phi"].full()[:, 0]
    np.testing.assert_array_equal(nominal, fivebar.nominal)
    function = external(fivebar, library, "forward_dynamics")
    assert function.name_in() == ["q_i", "qd_i", "tau_i", "phi"] and function.name_out() == ["qdd_i"]
    with pytest.raises(RuntimeError):
        # the cranks point away from each other
        function([np.pi, 0.0], [0, 0], [0, 0], nominal)
    # a null pointer stands for zeros
    zeros = function(casadi.DM(fivebar.home[[0, 2]]), 0, casadi.DM(2, 1), nominal).full()
    np.testing.assert_allclose(zeros[:, 0], fivebar.forward_dynamics(fivebar.home, np.zeros(4), np.zeros(2)), rtol=1e-9)
    with pytest.raises(regen.CheckError):
        (tmp_path / "fivebar_casadi.c").write_text((tmp_path / "fivebar_casadi.c").read_text() + "\n")
        fivebar.generate(tmp_path, target="casadi", check=True)
