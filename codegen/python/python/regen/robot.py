"""Robots: their description, their functions over arrays of states, and identification from logs."""

from __future__ import annotations

import json
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from . import _call
from ._call import Progress
from .errors import CheckError, InputError
from .fleet import Factors
from .functions import Functions
from .logs import Log, Logs, as_files
from .model import Path
from .results import (
    Calibration,
    Excitation,
    Explanation,
    Identified,
    Inspection,
    Page,
    Rehearsal,
    Report,
    Validation,
)

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from .options import (
        CalibrateOptions,
        EquationsOptions,
        ExciteOptions,
        GenerateOptions,
        IdentifyOptions,
        InspectOptions,
        NewOptions,
        ObserveOptions,
        RehearseOptions,
        ReportOptions,
        SimulateOptions,
        ValidateOptions,
    )


class Robot(Functions):
    """A robot, from its description.

    ``source`` is the path of a description (YAML) or of a URDF, SDF, MJCF or USD file, or the text of
    one. For robot files, ``options`` are those of ``regen import``: ``name``, ``exact``,
    ``geared``, ``base`` ('fixed' or 'floating'), ``cut``, ``actuated``, ``home``, ``ignore``.

    ``payload`` says whether the payloads of the description are carried, ``"none"`` or
    ``"carried"``; a description without payloads needs nothing.

    Coordinates are in rad or m, in the order of :attr:`coordinates`; efforts in N m or N. Where a
    method takes ``q`` (and ``qd``, ``qdd``) of shape (..., n), it also takes the independent
    coordinates alone, shape (..., dof), and closes the loops first. Of a DataFrame it takes the
    columns by their names in logs (``q1``, ``qd_q1``, ``qdd_q1``, ``tau_q1``), in the right order.

    >>> robot = Robot("name: arm\\nlimbs:\\n  - name: arm\\n    joints:\\n"
    ...               "      - {name: q1, type: revolute, body: 1, actuated: true}\\n")
    >>> robot.coordinates
    ['q1']
    >>> robot.regressor([[0.1], [0.2]], [[0.0], [0.0]], [[1.0], [2.0]]).shape
    (2, 1, 10)
    """

    def __reduce__(self) -> tuple[object, ...]:
        return _again, (self._text, self._path, self._payload, self.notes, self._robot_file)

    # -- the commands

    def check(self) -> Explanation:
        """Explains the mechanism in words: mobility, loops, what cannot be identified and why."""
        return Explanation(self._path, self._text, self._progress)

    def equations(self, **options: Unpack[EquationsOptions]) -> str:
        """The equations of the loops or of the dynamics with named terms, as text.

        ``format='sympy'`` gives a script of Python that builds them with SymPy, ``'latex'`` LaTeX.
        """
        given = {"format": "text", **options}
        return self._text_of("equations", [], given, {}, None)

    def generate(self, out: Path, /, **options: Unpack[GenerateOptions]) -> list[pathlib.Path]:
        """Writes source code of the robot into the folder ``out`` and returns its files.

        ``target`` is ``'rust'``, ``'c'``, or ``'casadi'`` for C with functions for
        ``casadi.external``. With ``check=True`` nothing is written, and files that are not up to
        date raise a :class:`CheckError`.
        """
        found = self._run("generate", [], {**options, "out": out}, {}, None)
        return [pathlib.Path(row["file"]) for row in found]

    def view(self, trajectory: Excitation | Mapping[str, Any] | Path | None = None) -> Page:
        """A page that shows the mechanism in 3D, moving along a trajectory or a sweep."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = {"trajectory": _file("trajectory.json", trajectory, texts)}
        with as_files([]) as folder:
            out = folder.path / "view.html"
            self._text_of("view", [], {**given, "out": out}, texts, None)
            return Page(out.read_text(encoding="utf-8"))

    def export(
        self,
        parameters: Identified | Mapping[str, Any] | Path,
        file: Path | None = None,
        /,
        *,
        to: Literal["same", "usd", "isaac-lab"] = "same",
        out: Path | None = None,
    ) -> str:
        """Identified physical parameters, written into a URDF, SDF, MJCF or USD file; returns its text.

        ``parameters``: of ``identify(feasible=True)``, or a dict or a file as ``regen export`` reads
        it. ``file``: the robot file, by default the one that this robot was read from. ``to``: ``"usd"``
        for a layer of USD with masses and inertias, ``"isaac-lab"`` for Isaac Lab's configuration of
        actuators, in place of the robot file. ``out``: where the new text is also written.
        """
        texts: dict[str, str] = {}
        if file is None:
            if self._robot_file is None:
                raise InputError("this robot was not read from a robot file: name the file to write into")
            file, text = self._robot_file
            if text is not None:
                texts[file] = text
        given = {
            "parameters": _file("parameters.json", parameters, texts),
            "urdf": file,
            "spec": self._path,
            "to": to,
        }
        printed = _call.call("export", [], given, {**texts, self._path: self._text}, self._progress)
        found = _call.parsed(printed)
        new = next(str(found[kind]) for kind in ("urdf", "sdf", "mjcf", "usd", "isaac_lab") if kind in found)
        if out is not None:
            pathlib.Path(out).write_text(new, encoding="utf-8")
        return new

    def excite(
        self, *, progress: Progress | bool | None = None, **options: Unpack[ExciteOptions]
    ) -> Excitation:
        """Searches for a trajectory from which the base parameters can be identified accurately."""
        return Excitation(self._run("excite", [], options, {}, progress))

    def excite_poses(
        self,
        count: int,
        experiment: Mapping[str, Any] | Path,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ExciteOptions],
    ) -> Calibration:
        """Chooses poses at rest that show the geometry well, with the deviations to expect.

        ``experiment``: an experiment file with ``calibrate``, or the dict of one. The poses are
        ``data["choice"]["rows"]``. Of the options only ``limit``, ``margin`` and ``seed`` act.
        """
        texts: dict[str, str] = {}
        with as_files(experiment, texts) as files:
            given = {**options, "calibrate": count, "measure": files.paths[0]}
            return Calibration(self._run("excite", [], given, texts, progress))

    def simulate(
        self,
        trajectory: Excitation | Mapping[str, Any] | Path | None = None,
        *,
        parameters: Identified | Mapping[str, Any] | Path | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[SimulateOptions],
    ) -> Log:
        """Simulates the controlled robot along a trajectory and returns what it would log.

        With ``runs`` there are several logs, which differ in their noise: use
        :meth:`simulate_runs`.
        """
        return self.simulate_runs(trajectory, parameters=parameters, progress=progress, **options)[0]

    def simulate_runs(
        self,
        trajectory: Excitation | Mapping[str, Any] | Path | None = None,
        *,
        parameters: Identified | Mapping[str, Any] | Path | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[SimulateOptions],
    ) -> list[Log]:
        """As :meth:`simulate`, for all ``runs``."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        given["trajectory"] = _file("trajectory.json", trajectory, texts)
        given["parameters"] = _file("parameters.json", parameters, texts)
        with as_files([]) as folder:
            given["out"] = folder.path / "log.csv"
            found = self._run("simulate", [], given, texts, progress)
            return [Log.read(run["file"], run) for run in found["runs"]]

    def rehearse(
        self,
        trajectory: Excitation | Mapping[str, Any] | Path | None = None,
        logs: Logs | None = None,
        /,
        *,
        parameters: Identified | Mapping[str, Any] | Path | None = None,
        progress: Progress | bool | None = None,
        **options: Unpack[RehearseOptions],
    ) -> Rehearsal:
        """Simulates and identifies many times, and scores how often the true parameters are found.

        ``logs``: an experiment file, or the dict of one, whose runs are rehearsed, or logs of the
        same duration and rate. A score that is too low is a result here, not an error.
        """
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        given["trajectory"] = _file("trajectory.json", trajectory, texts)
        given["parameters"] = _file("parameters.json", parameters, texts)
        with as_files([] if logs is None else logs, texts) as files:
            try:
                return Rehearsal(self._run("rehearse", files.paths, given, texts, progress))
            except CheckError as error:
                if not error.printed:
                    raise
                return Rehearsal(_call.parsed(error.printed))

    def calibrate(
        self,
        experiment: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[CalibrateOptions],
    ) -> Calibration:
        """Finds the geometry from poses at rest, or what such measurements can tell.

        ``experiment``: an experiment file with ``calibrate``, or the dict of one; without runs in it
        nothing is found, and the result says what could be.
        """
        texts: dict[str, str] = {}
        with as_files(experiment, texts) as files:
            return Calibration(self._run("calibrate", files.paths, dict(options), texts, progress))

    def inspect(
        self, logs: Logs, /, *, progress: Progress | bool | None = None, **options: Unpack[InspectOptions]
    ) -> Inspection:
        """Recognises the columns of logs, and predicts which parameters the logs can identify."""
        return inspect(logs, robot=self, progress=progress, **options)

    def identify(
        self,
        logs: Logs | Factors,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[IdentifyOptions],
    ) -> Identified:
        """Identifies the parameters from logs, an experiment file, or merged factors.

        ``logs``: an experiment file or the dict of one; paths of logs; columns as a dict of arrays,
        a DataFrame or a :class:`Log`; a list of these; or :class:`Factors`.
        """
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        _parameter_files(given, texts)
        if isinstance(logs, Factors):
            texts["factors.json"] = logs.text()
            given["from"] = ["factors.json"]
            found = self._run("identify", [], given, texts, progress)
        else:
            with as_files(logs, texts) as files:
                _against(files, given, texts)
                found = self._run("identify", files.paths, given, texts, progress)
        return Identified(found)

    def validate(
        self,
        parameters: Identified | Mapping[str, Any] | Path,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ValidateOptions],
    ) -> Validation:
        """Predicts the efforts of logs from identified parameters, and returns them with their errors."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        path = _file("parameters.json", parameters, texts)
        assert path is not None
        with as_files(logs, texts) as files:
            predicted = pathlib.Path(given.setdefault("predict", files.path / "predicted.csv"))
            found = self._run("validate", [path, *files.paths], given, texts, progress)
            return Validation(found, Log.read(predicted))

    def report(
        self,
        parameters: Identified | Mapping[str, Any] | Path,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ReportOptions],
    ) -> Report:
        """Writes the result of an identification as one HTML page, with tables and figures."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        path = _file("parameters.json", parameters, texts)
        assert path is not None
        with as_files(logs, texts) as files:
            _against(files, given, texts)
            out = files.path / "report.html"
            given["out"] = out
            self._text_of("report", [path, *files.paths], given, texts, progress)
            return Report(out.read_text(encoding="utf-8"))

    def observe(
        self,
        logs: Logs,
        /,
        *,
        progress: Progress | bool | None = None,
        **options: Unpack[ObserveOptions],
    ) -> Factors:
        """Reduces logs to factors, which suffice for least squares; see :class:`Factors`."""
        texts: dict[str, str] = {}
        given: dict[str, Any] = dict(options)
        with as_files(logs, texts) as files:
            out = files.path / "factors.json"
            given["out"] = out
            self._run("observe", files.paths, given, texts, progress)
            return Factors([out.read_text(encoding="utf-8")])

    def _text_of(
        self,
        command: str,
        rest: Sequence[str],
        given: Mapping[str, Any],
        texts: Mapping[str, str],
        progress: Progress | bool | None,
    ) -> str:
        options = dict(given)
        if self._payload is not None and "payload" in _call.options(command):
            options.setdefault("payload", self._payload)
        progress = self._progress if progress is None else progress
        all_texts = {**texts, self._path: self._text}
        return _call.call(command, [self._path, *rest], options, all_texts, progress)

    def _run(
        self,
        command: str,
        rest: Sequence[str],
        given: Mapping[str, Any],
        texts: Mapping[str, str],
        progress: Progress | bool | None,
    ) -> Any:
        return _call.parsed(self._text_of(command, rest, given, texts, progress))


def new(name: str, /, **options: Unpack[NewOptions]) -> Robot:
    """Writes a commented description to begin with, and returns its robot.

    ``kind`` is that of the robot, or ``from_dh`` a table; the file is ``out``, or ``NAME.yaml`` in the current folder.
    """
    return Robot(_call.parsed(_call.call("new", [name], options))["written"])


def inspect(
    logs: Logs,
    /,
    *,
    robot: Robot | None = None,
    progress: Progress | bool | None = None,
    **options: Unpack[InspectOptions],
) -> Inspection:
    """Recognises the columns of logs; with a robot, also predicts what the logs can identify."""
    texts: dict[str, str] = {}
    given: dict[str, Any] = dict(options)
    if robot is not None:
        texts[robot._path] = robot._text
        given["spec"] = robot._path
        given.setdefault("payload", robot._payload)
    with as_files(logs, texts) as files:
        printed = _call.call("inspect", files.paths, given, texts, progress)
    return Inspection(_call.parsed(printed))


def observe(robot: Robot | Path, logs: Logs, /, **options: Unpack[ObserveOptions]) -> Factors:
    """Reduces one log, or several, to factors that can be merged; see :class:`Factors`."""
    own = robot if isinstance(robot, Robot) else Robot(robot)
    return own.observe(logs, **options)


def _again(
    text: str,
    path: str,
    payload: str | None,
    notes: list[str],
    robot_file: tuple[str, str | None] | None,
) -> Robot:
    """Restores a pickled robot."""
    robot = Robot.__new__(Robot)
    text = text if "\n" in text else text + "\n"
    Robot.__init__(robot, text, payload=payload)
    robot._path = path
    robot.notes = notes
    robot._robot_file = robot_file
    return robot


def _file(name: str, value: Any, texts: dict[str, str]) -> str | None:
    """The path of a file, or a name under which its text is given."""
    if value is None or isinstance(value, (str, os.PathLike)):
        return None if value is None else os.fspath(value)
    data = value.data if hasattr(value, "data") else value
    texts[name] = json.dumps(data)
    return name


def _parameter_files(given: dict[str, Any], texts: dict[str, str]) -> None:
    for key in ("parameters", "start"):
        if key in given and not isinstance(given[key], (str, os.PathLike)):
            given[key] = _file(f"{key}.json", given[key], texts)
    if "reference" in given:
        given["reference"] = _file("reference.json", given["reference"], texts)
    if "controller" in given:
        given["controller"] = _file("controller.json", given["controller"], texts)


def _against(files: Any, given: dict[str, Any], texts: dict[str, str]) -> None:
    if given.get("against") is not None:
        given["against"] = files.more(given["against"], texts)
