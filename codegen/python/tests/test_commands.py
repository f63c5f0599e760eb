"""What the commands beside identification give."""

import importlib.util
import json
import pickle

import numpy as np
import pytest

import regen

URDF = """<robot name="one"><link name="base"/><link name="rod"><inertial>
  <origin xyz="0.5 0 0"/><mass value="2"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.3"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="rod"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="2"/></joint></robot>"""


@pytest.fixture(scope="module")
def excitation(picker):
    return picker.excite(harmonics=5, frequency=0.4, steps=20, starts=1, threads=1)


def test_equations_are_text_or_a_script(picker):
    text = picker.equations()
    assert "closure equations" in text and "s_12 = sin(q2 + q1)" in text
    assert "\\begin" in picker.equations(of="dynamics", parameters="base", format="latex")
    pytest.importorskip("sympy")
    space = {}
    exec(picker.equations(of="jacobian", format="sympy"), space)
    assert any(hasattr(value, "shape") for value in space.values())


def test_sources_are_written_and_checked(picker, tmp_path):
    for target, names in (("rust", ["picker.rs"]), ("c", ["picker.c", "picker.h"])):
        found = picker.generate(tmp_path, target=target)
        assert [path.name for path in found] == names and all(path.is_file() for path in found)
        assert picker.generate(tmp_path, target=target, check=True) == found
    (tmp_path / "picker.h").unlink()
    with pytest.raises(regen.CheckError) as error:
        picker.generate(tmp_path, target="c", check=True)
    assert json.loads(error.value.printed)[1]["state"] == "missing"


def test_the_mechanism_in_3d_is_a_page(picker, excitation):
    still, moving = picker.view(), picker.view(excitation)
    assert still.html.startswith("<!") and moving.html != still.html
    assert "iframe" in still._repr_html_()


def test_a_rehearsal_scores_the_estimates(picker, excitation):
    options = {"noise": (1e-5, 0.01), "butterworth": (4, 20), "settle": 5.0, "step": 0.002}
    # a score that is not reached, as a filter of so low a cutoff leaves no equation, is a result too
    missed = picker.rehearse(excitation, seeds=3, score=99.9, **(options | {"butterworth": (4, 0.3)}))
    assert not missed.passed and missed.score == 0.0 and "not passed" in repr(missed)
    assert missed.data["seeds"] == 3
    run = picker.simulate(excitation, settle=5.0, step=0.002, duration=2.0, bandwidth=20)
    found = picker.rehearse(excitation, run, seeds=1, score=0.0, perturb=0.1, **options)
    assert found.passed and found.data["durations"] == [2.0]
    assert len(found.table) == len(picker.base)
    with pytest.raises(regen.OptionError):
        picker.rehearse(excitation, seeds="many")


def test_identified_parameters_go_back_into_the_robot_file(tmp_path):
    robot = pickle.loads(pickle.dumps(regen.Robot(URDF)))
    parameters = {"bodies": {"rod": {"mass": 3.0, "com": [0.4, 0, 0], "inertia": [0.1, 0, 0, 0.25, 0, 0.3]}}}
    text = robot.export(parameters, out=tmp_path / "new.urdf")
    assert 'value="3' in text and (tmp_path / "new.urdf").read_text() == text
    (tmp_path / "old.urdf").write_text(URDF)
    assert robot.export(parameters, tmp_path / "old.urdf") == text
    assert robot.export(parameters, to="usd").startswith("#usda 1.0")
    actuators = robot.export({"joints": {"turn": {"Fv": 1.5}}}, to="isaac-lab")
    compile(actuators, "actuators.py", "exec")
    assert 'viscous_friction={"turn": 1.5}' in actuators
    again = regen.Robot(tmp_path / "new.urdf")
    assert again.nominal[again.parameters.index("m(rod)")] == 3.0
    with pytest.raises(regen.InputError, match="robot file"):
        regen.Robot(robot.description).export(parameters)


def test_predicted_efforts_are_columns_and_figures(picker, excitation):
    runs = picker.simulate_runs(excitation, noise=(1e-5, 0.01), runs=3, settle=5.0, step=0.002, bandwidth=20)
    found = picker.identify(runs[0], butterworth=(4, 20))
    checked = picker.validate(found, runs[1:], butterworth=(4, 20))
    columns = checked.predictions
    assert list(columns) == ["run", "t", "tau_q1", "predicted_q1", "tau_q3", "predicted_q3"]
    assert set(columns["run"]) == {1.0, 2.0}
    used = np.isfinite(columns["tau_q1"]) & (columns["run"] == 1)
    off = columns["tau_q1"][used] - columns["predicted_q1"][used]
    rms = checked.data["models"][0]["logs"][0]["efforts"][0]["rms"]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(rms, rel=1e-6)
    pytest.importorskip("matplotlib")
    drawn = checked.plot()
    assert len(drawn.axes) == picker.dof and len(drawn.axes[0].lines) == 3
    np.testing.assert_array_equal(drawn.axes[1].lines[1].get_ydata(), columns["predicted_q3"])
    assert len(found.plot().axes[0].get_yticks()) == len(found.labels)
    assert len(runs[0].plot("q1", "tau_q1").axes) == 2
    with pytest.raises(regen.InputError, match="no column"):
        runs[0].plot("q9")


def test_a_frame_gives_the_columns_by_name(picker, excitation):
    pandas = pytest.importorskip("pandas")
    log = picker.simulate(excitation, settle=5.0, step=0.01, bandwidth=20, exact=True)
    frame = log.to_pandas()
    q = np.column_stack([log["q1"], log["q3"]])
    shuffled = frame[frame.columns[::-1]]
    np.testing.assert_array_equal(picker.close(shuffled).q, picker.close(q).q)
    np.testing.assert_array_equal(picker.gravity(shuffled[["q3", "q1", "t"]]), picker.gravity(q))
    with pytest.raises(regen.InputError, match="columns q1, q3"):
        picker.gravity(pandas.DataFrame({"q1": [0.1]}))


def test_states_become_a_frame_that_every_function_takes(picker, excitation):
    pandas = pytest.importorskip("pandas")
    log = picker.simulate(excitation, settle=5.0, step=0.01, bandwidth=20, exact=True)
    closed = picker.close(log.to_pandas())
    tau = picker.inverse_dynamics(closed.q, closed.qd, closed.qdd)
    frame = picker.frame(log["t"], q=closed.q, qd=closed.qd, qdd=closed.qdd, tau=tau)
    assert isinstance(frame, pandas.DataFrame) and len(frame) == len(log["t"])
    np.testing.assert_array_equal(picker.inverse_dynamics(frame, frame, frame), tau)
    assert [c for c in frame if c.startswith("tau_")] == ["tau_" + q for q in picker.independent]
    assert [c for c in frame if c.startswith("qd_")] == ["qd_" + q for q in picker.coordinates]
    roles = picker.inspect(frame).to_pandas()["role"]
    assert list(roles.index) == list(frame) and roles["t"] == "time" and roles["tau_q3"] == "effort"
    with pytest.raises(regen.InputError, match="not equally long"):
        picker.frame(log["t"][:-1], q=closed.q)
    with pytest.raises(regen.InputError, match=r"shape \(3, 7\)"):
        picker.frame(q=np.zeros((3, 7)))
    with pytest.raises(regen.InputError, match="`phi` is none of"):
        picker.frame(phi=np.zeros((3, 2)))


def test_a_calibration_finds_simulated_errors(fivebar, tmp_path):
    """Encoders in all joints, two more than the mechanism needs."""
    robot = fivebar
    poses = tmp_path / "poses.csv"
    plan = {"columns": {name: name for name in ("q1", "q2", "q3", "q4")}, "calibrate": {"noise": 2e-5}}
    truth = robot.calibrate(plan, simulate=poses, poses=40, perturb=5e-4, seed=3)
    found = robot.calibrate(plan | {"runs": [{"files": [str(poses)]}]})
    assert found.data["converged"] and not found.doubts and "40 poses" in repr(found)
    if importlib.util.find_spec("pandas"):
        values = found.to_pandas()["value"].dropna()
        assert dict(values) == found.values
    sigmas = {row["name"]: row["sigma"] for row in found.data["estimates"]}
    assert set(found.values) == set(truth.values)
    assert all(abs(found.values[name] - value) < 5 * sigmas[name] for name, value in truth.values.items())
    # poses that show more than as many at random
    chosen = robot.excite_poses(12, plan, seed=2).data["choice"]
    assert len(chosen["rows"]) == 12 and chosen["columns"] == ["q1", "q2", "q3", "q4"]
    assert all(row["chosen"] > row["random"] for row in chosen["indices"] if row["name"] == "O1")
    # without runs there is nothing to find, but what could be
    assert not robot.calibrate(plan).values and len(robot.calibrate(plan).table) == len(truth.values)
    with pytest.raises(regen.InputError, match="did you mean"):
        robot.calibrate(plan, unknown=["q1.thet"])
