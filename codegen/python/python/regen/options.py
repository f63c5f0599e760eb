"""The keywords of the methods, by command. Written by tools/options.py; do not edit.

True stands for an option without a value; a tuple is joined by commas, a list repeats the option,
and a dict repeats it with NAME=VALUE.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict, Union

Value = Union[str, int, float, "os.PathLike[str]", tuple[Any, ...], Mapping[str, Any], Any]
Values = Union[Value, Sequence[Value]]


class NewOptions(TypedDict, total=False):
    """Of ``new``."""

    #: The table has classic rows, Rz Tz Tx Rx, instead of modified ones
    classic: bool
    #: A serial arm from a table of Denavit and Hartenberg parameters (CSV)
    from_dh: Value | None
    #: The robot that the spec describes at first
    kind: Literal["serial", "planar", "parallel", "delta", "stewart", "drives"] | None
    #: Where the spec is written [default: NAME.yaml in the current directory]
    out: Value | None


class ImportOptions(TypedDict, total=False):
    """Of ``import``."""

    #: Joints with motors [default: those of the file's transmissions or actuators, or else all that do not mimic others]
    actuated: Values | None
    #: How the root link is attached [default: as in the file; fixed in URDF]
    base: Literal["fixed", "floating"] | None
    #: Close a loop: NAME:TYPE:BODY@FRAME:BODY@FRAME (may be repeated)
    cut: Values | None
    #: Keep angles as written, also rounded multiples of pi
    exact: bool
    #: Replace the file of `out` if it exists
    force: bool
    #: Give joints with motors friction and rotor inertia, as drives with gears have, where the file states none
    geared: bool
    #: The configuration from which loops are closed, as NAME=VALUE [default: 0]
    home: Values | None
    #: Leave out all elements and attributes of these names
    ignore: Values | None
    #: Joints to lock: NAME, at 0, or NAME=VALUE in rad or m; * is any part of a name, as in 'wheel_*'
    lock: Values | None
    #: The spec's name [default: the robot's in the file]
    name: Value | None
    #: Where the spec is written [default: standard output]; an existing file is not replaced
    out: Value | None


class ExciteOptions(TypedDict, total=False):
    """Of ``excite``."""

    #: Start and end with velocities and accelerations of zero
    at_rest: bool
    #: Replace a cone of the spec: NAME=ANGLE, in rad, or in degrees as 45deg (may be repeated)
    cone: Values | None
    #: The measure that the trajectory minimises
    criterion: Literal["scaled", "condition", "determinant", "smallest"] | None
    #: The frequency of the first harmonic in Hz [default: 2/15, a period of 7.5 s]
    frequency: Value | None
    #: The number of harmonics
    harmonics: Value | None
    #: Replace a limit of the spec: COORDINATE.QUANTITY=LOWEST,HIGHEST, where QUANTITY is position, velocity, acceleration, jerk or effort (may be repeated)
    limit: Values | None
    #: The least pivot of A_e: 1 in the middle of a workspace, 0 at singularities [default: 0.05]
    margin: Value | None
    #: Whether the payloads of the spec are carried; required if it has payloads
    payload: Literal["none", "carried", "unknown"] | None
    #: The number of samples in a period
    samples: Value | None
    #: The seed of the random starts
    seed: Value | None
    #: The number of random starts, of which the best result is used
    starts: Value | None
    #: The most steps in the last of the five stages of a start; the others take up to a third
    steps: Value | None
    #: The number of threads [default: as many as the machine has]
    threads: Value | None


class SimulateOptions(TypedDict, total=False):
    """Of ``simulate``."""

    #: The bandwidth of controllers without `pid`, Hz [default: the first with which the robot follows the motion]
    bandwidth: Value | None
    #: Also log the commanded positions, as cmd_NAME
    commands: bool
    #: Write the controllers' gains here, for `Robot.identify(controller=...)`: YAML if FILE ends in .yaml, else JSON
    controller: Value | None
    #: The duration of a run in s [default: one period]
    duration: Value | None
    #: Log the true positions, velocities and accelerations of all coordinates
    exact: bool
    #: The width of the smoothed sign of Coulomb friction, rad/s or m/s [default: 0.001]
    friction_width: Value | None
    #: Time constant of the drives, s
    lag: Value | None
    #: Simulate without friction
    no_friction: bool
    #: Standard deviations of measured positions (rad or m) and efforts
    noise: Value | None
    #: Whether the payloads of the spec are carried; required if it has payloads
    payload: Literal["none", "carried", "unknown"] | None
    #: Change the parameters of each body, and all others, at random by up to this part
    perturb: Value | None
    #: Gains of all controllers, or of one: [NAME=]KP,KI,KD (may be repeated)
    pid: Values | None
    #: The resolution of measured positions and, if given, of efforts
    quantum: Value | None
    #: The number of runs, which differ in their noise
    runs: Value | None
    #: The seed of noise and perturbation: the same seed gives the same logs
    seed: Value | None
    #: The time at the start that is left out of the log, s
    settle: Value | None
    #: Time between samples of the controller and of the log, s [default: 0.01, or less if controllers need it to follow the motion]
    step: Value | None
    #: Write the true parameters here, as `parameters` reads them: YAML if FILE ends in .yaml, else JSON
    truth: Value | None


class InspectOptions(TypedDict, total=False):
    """Of ``inspect``."""

    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Write a first experiment file; an existing file is not replaced
    out: Value | None
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Write a page with tables and figures
    report: Value | None
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None


class ObserveOptions(TypedDict, total=False):
    """Of ``observe``."""

    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None


class IdentifyOptions(TypedDict, total=False):
    """Of ``identify``."""

    #: Logs to predict with every model, and to cross-validate reduce=True with
    against: Values | None
    #: Newey and West's deviations, with this number of samples over which residuals are correlated [default: from cosines of whitened scores]
    bandwidth: Value | None
    #: Write the spec with the physical values in `bodies:` and in the joints' `nominal:`; the rest of its text stays
    bodies: Value | None
    #: A parameter's limits, SI: LABEL=LOW..HIGH, either may be missing
    bound: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Write the parameters as a C header of initialisers; it includes the robot's header, and compiles with that of this model only
    c: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: The column of a joint's commanded position: NAME=COLUMN, followed by :UNIT and *FACTOR if needed (may be repeated) [default: cmd_NAME]
    command: Values | None
    #: The level of the confidence intervals
    confidence: Value | None
    #: The controllers, JSON or YAML: `q1: {kp: 40, kd: 2}` for each actuated joint; `Robot.simulate(controller=...)` writes such a file
    controller: Value | None
    #: Also write the covariance of base parameters and gains to the file of `out`
    covariance: bool
    #: Cross-validate: identify from all logs but one and predict that one, in turn
    cross: bool
    #: The date to write into the file, since regen reads no clock
    date: Value | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: The number of random draws for the intervals of constrained values, each of which takes a small fit; at least 5, or 0 for no intervals
    draws: Value | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: The estimator [default: ls, or huber where residuals have heavy tails; `huber` and iv=True choose theirs]
    estimator: Literal["ls", "huber", "iv", "didim", "response"] | None
    #: Decide whether any physical robot has the least-squares parameters, then find the physical parameters that fit best: all ten of every body
    feasible: bool
    #: Write each figure of the page as an SVG file into this folder
    figures: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Identify the nonlinear friction of the spec (atan, power, stribeck, lugre) together with all other parameters, which are physical (Eq. 29)
    friction: bool
    #: The width of the smoothed sign of Coulomb friction in `response`, rad/s or m/s, of joints; of a drive, the velocity at which its joints reach it [default: 0.001]
    friction_width: Value | None
    #: Residuals beyond K standard deviations count linearly (Huber); 1.345 is usual
    huber: Value | None
    #: Bodies that are the same, in frames that correspond: 1,4,6
    identical: Values | None
    #: Use instrumental variables, which errors of the measured motion do not bias
    iv: bool
    #: A parameter's value, SI: LABEL=VALUE, such as 'm(3)=6.05'
    known: Values | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: The bandwidth of controllers without gains in `didim`, Hz [default: that at which the motion is closest to measured positions; 3 without those]
    loop_bandwidth: Value | None
    #: The Rust path of the robot's generated module, seen from the constants, which compile with that model only [default: super::ROBOT]
    module: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Do not look for swapped columns, flipped signs, wrong units and the like
    no_suspicion: bool
    #: Write the parameters for `validate` and `export`: YAML if PARAMS ends in .yaml, else JSON
    out: Value | None
    #: Identified parameters of the robot without its load: only payloads are identified, and gains that PARAMS lacks. If PARAMS has a `covariance` (covariance=True), standard deviations include it
    parameters: Value | None
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Gains of all controllers in this simulation, or of one: [NAME=]KP,KI,KD (may be repeated) [default: from the robot's inertia, for the bandwidth at which the simulated motion is closest to the measured one]
    pid: Values | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: Use the spec's nominal values as a prior: `weighted` or `weighted:PERCENT`, with standard deviations in percent of them [default 30], or `entropic` or `entropic:WEIGHT`, with the divergence of pseudo-inertias [default 1]
    prior: Value | None
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: Write the parameters as a Python module, with a check of the model
    python: Value | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Eliminate base parameters that are zero within their errors, as long as the fit gets no worse than chance explains, and make the rest physically feasible; every step is printed
    reduce: bool
    #: The trajectory that the controllers followed, as `Robot.excite()` writes it; instruments, or the motion of `didim`, are simulated along it
    reference: Value | None
    #: Write a page with tables and figures of the result, and of the logs of `against`; see `Robot.report()`
    report: Value | None
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: Write the parameters as Rust constants for a controller
    rust: Value | None
    #: The time at the start of each log that `didim` leaves out if it follows columns of commands, s
    settle: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: Parameters to start from [default: the spec's nominal ones]
    start: Value | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: A known sum: 'm(1),m(2),m(3)=12.5'
    total: Values | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None
    #: How the efforts are weighted against each other
    weighting: Literal["per-effort", "equal"] | None
    #: Length of the windows of `response`, s, whose first states are estimated
    window: Value | None


class ValidateOptions(TypedDict, total=False):
    """Of ``validate``."""

    #: Further parameters to compare with
    beside: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: Write measured and predicted efforts of all logs here, CSV
    predict: Value | None
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None


class ReportOptions(TypedDict, total=False):
    """Of ``report``."""

    #: Logs that were not used for identification
    against: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: Write each figure as an SVG file into this folder
    figures: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None


class RehearseOptions(TypedDict, total=False):
    """Of ``rehearse``."""

    #: The bandwidth of controllers without `pid`, Hz [default: the first with which the robot follows the motion]
    bandwidth: Value | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Assign a column to a quantity: Q=COLUMN, followed by :UNIT, *FACTOR, :offset:VALUE and :late:S if needed; COLUMN is a header or a number. q3=constant:90:deg is a position that stays, tau_q3=unmeasured an effort whose equations are left out
    column: Values | None
    #: The level of the confidence intervals
    confidence: Value | None
    #: Use only every N-th state, after filtering
    decimate: Value | None
    #: The delay in s of an effort, which is logged later than its motion: NAME=S (0: none); `auto` corrects those that least squares of these logs finds [default: corrected where a filter is chosen and they are beyond chance]
    delay: Values | None
    #: The standard deviation of a measured coordinate, which weights it if more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: The number of draws for the intervals of feasible parameters
    draws: Value | None
    #: The duration of a run in s [default: one period]
    duration: Value | None
    #: Use the energy balance over windows of this length in s instead of the equations of motion, which needs no accelerations
    energy: Value | None
    #: The index of the episode to read from LeRobot files [default: the only one]
    episode: Value | None
    #: The estimator
    estimator: Literal["ls", "huber", "iv", "didim", "response"] | None
    #: Identify physically feasible parameters
    feasible: bool
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Also identify the nonlinear friction of the spec
    friction: bool
    #: The width of the smoothed sign of Coulomb friction, rad/s or m/s [default: 0.001]
    friction_width: Value | None
    #: The true gain of a drive whose gain is unknown in RUNS, N m/A or N/A: NAME=VALUE (may be repeated) [default: 1]
    gain: Values | None
    #: Residuals beyond K standard deviations count linearly [default: 1.345 with `estimator` huber]
    huber: Value | None
    #: Keep the simulated logs in this folder
    keep: Value | None
    #: Time constant of the drives, s
    lag: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Replace the robot's controllers in didim by ones of this bandwidth in Hz
    loop_bandwidth: Value | None
    #: Use no filter, but central differences of the positions as they are, for logs that were filtered before
    no_filter: bool
    #: Simulate without friction
    no_friction: bool
    #: Standard deviations of measured positions (rad or m) and efforts
    noise: Value | None
    #: Whether the payloads of the spec are carried in all logs; required if it has payloads, here or for each run of an experiment file
    payload: Literal["none", "carried", "unknown"] | None
    #: Average over the repetitions of a trajectory with this period in s
    period: Value | None
    #: Change the parameters of each body, and all others, at random by up to this part
    perturb: Value | None
    #: Gains of all controllers, or of one: [NAME=]KP,KI,KD (may be repeated)
    pid: Values | None
    #: Each row is a pose at rest, with efforts that were averaged there: no time is read, velocities and accelerations are 0
    poses: bool
    #: Use the spec's nominal values as a prior: weighted, weighted:PERCENT, entropic or entropic:WEIGHT
    prior: Value | None
    #: The treatment of faulty rows [default: fail, but short gaps and repeated rows are bridged, and long ones divide the log]
    problems: Literal["fail", "drop", "keep", "tell"] | None
    #: The resolution of measured positions and, if given, of efforts
    quantum: Value | None
    #: The rate of the rows in Hz, if no column has their time
    rate: Value | None
    #: Give iv and didim the trajectory
    reference: bool
    #: Interpolate rows with an uneven clock onto an even grid of this rate in Hz
    resample: Value | None
    #: Velocities below this, rad/s or m/s, also count as rest
    rest_speed: Value | None
    #: The number of runs per seed to identify from [default: 1]
    runs: Value | None
    #: The least score for exit code 0, percent
    score: Value | None
    #: The seed of noise and perturbation: the same seed gives the same logs
    seed: Value | None
    #: The number of seeds, beginning with `seed`
    seeds: Value | None
    #: The time at the start that is left out of the log, s
    settle: Value | None
    #: The treatment of equations of joints at rest, where friction is static: whose encoders stay within a step or their noise for 0.2 s, or whose velocity does not differ significantly from zero [default: drop]
    standstill: Literal["drop", "keep", "weigh"] | None
    #: Time between samples of the controller and of the log, s [default: 0.01, or less if controllers need it to follow the motion]
    step: Value | None
    #: The number of threads, on which the result does not depend [default: all]
    threads: Value | None
    #: The topic to read from MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: An effect that the simulated robot has and the model lacks: stribeck=PART or stribeck=PART,SPEED
    unmodelled: Value | None
    #: The velocities to use; measured ones unless the choice finds those computed from positions better. They pass the filter of the positions, and accelerations are their derivative; `fourier` uses positions only
    velocities: Literal["measured", "computed"] | None
    #: How the efforts are weighted against each other
    weighting: Literal["per-effort", "equal"] | None
    #: Length of the windows of `response`, s
    window: Value | None


class CalibrateOptions(TypedDict, total=False):
    """Of ``calibrate``."""

    #: The level of the confidence intervals [default: 0.95]
    confidence: Value | None
    #: Write the spec with the geometry that was found; its comments stay
    geometry: Value | None
    #: The folder of the logs in FILE [default: that of FILE]
    logs: Value | None
    #: The deviation of the simulated errors, rad and m; of compliances, of what the largest effort does
    perturb: Value | None
    #: The number of simulated poses
    poses: Value | None
    #: Write a page with the residuals before and after, the poses and what was found
    report: Value | None
    #: The seed of simulated errors and noise
    seed: Value | None
    #: Write simulated poses of a mechanism with errors instead, in the columns that FILE names, and print the true values
    simulate: Value | None
    #: What is unknown: names of `geometry`, errors such as q3.alpha, or what such names begin with
    unknown: Values | None


class EquationsOptions(TypedDict, total=False):
    """Of ``equations``."""

    #: The language of the result
    format: Literal["text", "latex", "sympy"] | None
    #: The equations [default: closure with loops, dynamics without]
    of: Literal["closure", "jacobian", "X", "regressor", "dynamics", "mass", "coriolis", "gravity", "frames"] | None
    #: The parameters of the regressor, the efforts and their parts [default: all]
    parameters: Literal["all", "base"] | None


class GenerateOptions(TypedDict, total=False):
    """Of ``generate``."""

    #: Write nothing; report every file that differs, is missing or is stale, and exit with 1 if there is one
    check: bool
    #: The language of the files
    target: Literal["rust", "c", "casadi"] | None
