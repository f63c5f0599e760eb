"""The table of base parameters."""

import numpy as np
import pytest

import regen
from conftest import ROBOTS


def test_the_table_is_the_map_to_base_parameters(fivebar):
    base = fivebar.base
    phi = np.random.default_rng(3).normal(size=len(fivebar.parameters))
    np.testing.assert_allclose(base.matrix @ phi, fivebar.to_base(phi), rtol=1e-12, atol=1e-12)
    assert base.complete and base.certificate["rank"] == len(base) == len(base.labels)


def test_expressions_of_sympy_have_the_same_values(fivebar):
    sympy = pytest.importorskip("sympy")
    found, geometry = fivebar.base.to_sympy(), geometry_of_the_fivebar()
    for row, own in zip(fivebar.base, fivebar.base.matrix):
        expression = found[row.label]
        for term in row.terms:
            slope = expression.coeff(sympy.Symbol(term.parameter, real=True))
            k = fivebar.parameters.index(term.parameter)
            names = {s: geometry[s.name] for s in slope.free_symbols}
            assert float(slope.subs(names)) == pytest.approx(own[k], rel=1e-13)


def geometry_of_the_fivebar():
    """The geometry of the five-bar, read from its description."""
    text = (ROBOTS / "fivebar.yaml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("geometry:"))
    pairs = line.split("{")[1].split("}")[0].split(",")
    return {name.strip(): float(value) for name, value in (pair.split(":") for pair in pairs)}


def test_the_table_in_other_forms(fivebar):
    pandas = pytest.importorskip("pandas")
    base = fivebar.base
    frame = base.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and list(frame.index) == base.labels
    assert "\\toprule" in base.to_latex() and "|" in base.to_markdown()
    page = base._repr_html_()
    assert page.count("<tr>") == len(base) + 1
    assert base.labels[0] in str(base)


def test_a_robot_of_urdf_text():
    urdf = """<robot name="one"><link name="base"/><link name="rod"><inertial>
      <origin xyz="0.5 0 0"/><mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
      <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
      <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint></robot>"""
    robot = regen.Robot(urdf)
    assert robot.name == "one" and robot.dof == 1
    # the inertia about the axis, with Steiner's part
    assert robot.mass_matrix([0.3])[0, 0] == pytest.approx(0.2 + 2 * 0.25, rel=1e-12)
    assert abs(robot.gravity([0.0])[0]) == pytest.approx(2 * 9.81 * 0.5, rel=1e-12)
