"""From a trajectory to a report, with logs as files, arrays and experiments."""

import json
import pickle

import numpy as np
import pytest

import regen

FOURIER = (0.2, 5)


@pytest.fixture(scope="module")
def excitation(picker):
    return picker.excite(harmonics=5, frequency=0.2, steps=2, starts=1, threads=1)


@pytest.fixture(scope="module")
def logs(picker, excitation):
    return picker.simulate_runs(excitation, noise=(1e-6, 0.01), runs=3, seed=5, settle=5.0, bandwidth=10)


@pytest.fixture(scope="module")
def identified(picker, logs):
    return picker.identify(logs[:2], fourier=FOURIER)


def test_the_identified_parameters_cover_the_simulated_ones(picker, identified):
    beta = picker.to_base()
    off = abs(identified.values - beta) / identified.sigma
    assert (off < 5).all(), off
    assert identified.labels == picker.base.labels
    assert (identified.intervals[:, 0] < identified.values).all()
    again = pickle.loads(pickle.dumps(identified))
    assert again.data == identified.data


def test_arrays_frames_and_files_give_the_same(picker, logs, identified, tmp_path):
    paths = []
    for k, log in enumerate(logs[:2]):
        paths.append(tmp_path / f"run{k}.csv")
        log.write(paths[-1])
    from_files = picker.identify(paths, fourier=FOURIER)
    np.testing.assert_array_equal(from_files.values, identified.values)
    pytest.importorskip("pandas")
    from_frames = picker.identify([log.to_pandas() for log in logs[:2]], fourier=FOURIER)
    np.testing.assert_array_equal(from_frames.values, identified.values)
    from_arrays = picker.identify([dict(log) for log in logs[:2]], fourier=FOURIER)
    np.testing.assert_array_equal(from_arrays.values, identified.values)
    experiment = {
        "process": {"filter": {"fourier": {"frequency": FOURIER[0], "harmonics": FOURIER[1]}}},
        "runs": [{"files": [str(path)]} for path in paths],
    }
    from_dict = picker.identify(experiment)
    np.testing.assert_array_equal(from_dict.values, identified.values)
    written = tmp_path / "runs.yaml"
    written.write_text(json.dumps(experiment))
    np.testing.assert_array_equal(picker.identify(written).values, identified.values)


def test_validation_and_report(picker, logs, identified):
    validation = picker.validate(identified, logs[2], fourier=FOURIER)
    assert validation.relative_absolute.shape == (1,) and validation.relative_absolute[0] < 20
    page = picker.report(identified, logs[:2], against=logs[2], fourier=FOURIER)
    assert page.html.startswith("<!") and "iframe" in page._repr_html_()


def test_every_result_is_a_frame(picker, logs, excitation, identified):
    pytest.importorskip("pandas")
    frame = identified.to_pandas()
    assert list(frame.index) == identified.labels
    np.testing.assert_array_equal(frame["value"], identified.values)
    np.testing.assert_array_equal(frame["sigma"], identified.sigma)
    errors = picker.validate(identified, [logs[1], logs[2]], fourier=FOURIER).to_pandas()
    assert len(errors) == 2 * picker.dof and errors["log"].nunique() == 2
    assert len(excitation.to_pandas()) == len(excitation.limits) > 0
    columns = regen.inspect(logs[:2]).to_pandas()
    assert len(columns) == 2 * len(logs[0]) and set(columns["column"]) == set(logs[0])
    one = regen.inspect(logs[0]).to_pandas()
    assert list(one.index) == list(logs[0]) and one.loc["t", "role"] == "time"


def test_mistakes_in_experiments_have_places(picker):
    with pytest.raises(regen.DescriptionError) as found:
        picker.identify({"runs": [{"fil": "a.csv"}]})
    assert found.value.mistakes[0].line == 1 and "fil" in str(found.value)


def test_inspection_names_the_columns(picker, logs):
    found = regen.inspect(logs[0])
    assert found.proposal and "q1" in found.proposal
    with_robot = picker.inspect(logs[0])
    assert with_robot.data["robot"] == picker.name


def test_the_mechanism_in_words(picker):
    words = picker.check()
    assert "loop" in str(words) and words.data


def test_factors_merge_in_any_order_to_the_same_bits(picker, logs, identified):
    a, b, c = (regen.observe(picker, log, fourier=FOURIER) for log in logs)
    assert (a + (b + c)).text() == ((c + a) + b).text()
    assert regen.Factors.merged([c, b, a]).digest() == (a + b + c).digest()
    assert pickle.loads(pickle.dumps(a + b)) == b + a
    merged = picker.identify(a + b)
    np.testing.assert_allclose(merged.values, identified.values, rtol=1e-6, atol=1e-8)
    assert (a + b).rows == a.rows + b.rows > 0
    with pytest.raises(regen.InputError):
        regen.Factors([]).text()


def test_a_log_checks_its_columns():
    with pytest.raises(regen.InputError, match="equally long"):
        regen.Log({"t": [0.0, 1.0], "q1": [0.0]})
