"""The keywords of the methods, by command. Written by tools/options.py; do not edit.

True stands for an option without a value; a tuple is joined by commas, a list repeats the option,
and a dict repeats it with NAME=VALUE.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, Union

Value = Union[str, int, float, "os.PathLike[str]", tuple[Any, ...], Mapping[str, Any], Any]
Values = Union[Value, Sequence[Value]]


class ImportOptions(TypedDict, total=False):
    """Of ``import``."""

    #: Joints with motors [default: those of the file's transmissions or actuators, or else all that follow no other]
    actuated: Values | None
    #: What the root stands on [default: what the file says; the world in URDF]
    base: Value | None
    #: Close a loop: NAME:TYPE:BODY@FRAME:BODY@FRAME (may be repeated)
    cut: Values | None
    #: Keep angles as printed, also where they print a multiple of pi
    exact: bool
    #: Replace the file of --out where it exists
    force: bool
    #: Give joints with motors friction and a rotor's inertia, as drives with gears have, where the file states none
    geared: bool
    #: Where loops start to be closed, as NAME=VALUE [default: 0]
    home: Values | None
    #: Joints taken as rigid: NAME, at 0, or NAME=VALUE in rad or m
    lock: Values | None
    #: The spec's name [default: the robot's in the file]
    name: Value | None
    #: Where the spec is written [default: standard output]; a file that exists is left as it is
    out: Value | None


class ExciteOptions(TypedDict, total=False):
    """Of ``excite``."""

    #: Start and end with velocities and accelerations of zero
    at_rest: bool
    #: Another cone than the spec's, NAME=ANGLE in rad, or with `deg` behind it (may be repeated)
    cone: Values | None
    #: What the trajectory is optimised for
    criterion: Value | None
    #: The frequency of the first harmonic in Hz [default: 2/15, a period of 7.5 s]
    frequency: Value | None
    #: The number of harmonics
    harmonics: Value | None
    #: Another limit than the spec's, COORDINATE.QUANTITY=LOWEST,HIGHEST, where QUANTITY is position, velocity, acceleration or effort (may be repeated)
    limit: Values | None
    #: The least pivot of A_e: 1 in the middle of a workspace, 0 at singularities
    margin: Value | None
    #: Whether the payloads of the description are carried; required where it has a payload
    payload: Value | None
    #: The number of samples in a period
    samples: Value | None
    #: The seed of the random starts
    seed: Value | None
    #: The number of random starts; the best counts
    starts: Value | None
    #: The number of steps in each of the five stages of a start
    steps: Value | None
    #: The number of threads [default: as many as the machine has]
    threads: Value | None


class SimulateOptions(TypedDict, total=False):
    """Of ``simulate``."""

    #: The bandwidth of controllers without --pid, Hz
    bandwidth: Value | None
    #: Log the commanded positions too, as cmd_NAME
    commands: bool
    #: Write the controllers' gains here, for `identify --controller`: YAML if FILE ends in .yaml, else JSON
    controller: Value | None
    #: The duration of a run in s [default: one period]
    duration: Value | None
    #: Log all coordinates as they are, with velocities and accelerations
    exact: bool
    #: The speed within which friction changes its sign, rad/s or m/s
    friction_width: Value | None
    #: Time constant of the drives, s
    lag: Value | None
    #: Leave friction out
    no_friction: bool
    #: Standard deviations of measured positions (rad or m) and efforts
    noise: Value | None
    #: Whether the payloads of the description are carried; required where it has a payload
    payload: Value | None
    #: Change each body's and each other parameter by up to this part, at random
    perturb: Value | None
    #: Gains of all controllers, or of one: [NAME=]KP,KI,KD (may be repeated)
    pid: Values | None
    #: The resolution of measured positions and, if given, of efforts
    quantum: Value | None
    #: Runs that differ in their noise
    runs: Value | None
    #: The seed of noise and perturbation: the same seed gives the same logs
    seed: Value | None
    #: The time at the start that is left out of the log, s
    settle: Value | None
    #: Time between samples of the controller and of the log, s [default: 0.01]
    step: Value | None


class InspectOptions(TypedDict, total=False):
    """Of ``inspect``."""

    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: A column whose header does not say what it is: Q=COLUMN, and behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    column: Values | None
    #: Take only each N-th state, after filtering
    decimate: Value | None
    #: By how many seconds an effort is logged after the motion that it belongs to: NAME=S. Every `identify` estimates it; `auto` corrects what least squares of these logs finds
    delay: Values | None
    #: The standard deviation of a measured coordinate, where more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the balance of energy over windows of this length in s instead of the equations of motion: no accelerations are needed
    energy: Value | None
    #: The episode of Parquet files of LeRobot, by its index [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Write a first experiment file; one that exists is left as it is
    out: Value | None
    #: Whether the payloads of the description are carried in all these logs; required where it has a payload, here or for each run of an experiment file
    payload: Value | None
    #: Average the runs of a trajectory of this period in s
    period: Value | None
    #: What is done with rows that cannot be used [default: fail]
    problems: Value | None
    #: The rate of the rows in Hz, where no column has their time
    rate: Value | None
    #: Write a page with tables and figures
    report: Value | None
    #: Interpolate the rows onto an even grid of this rate in Hz, where the steps of their clock are uneven
    resample: Value | None
    #: Velocities below this, rad/s or m/s, count as rest too
    rest_speed: Value | None
    #: What is done with equations of joints at rest, which static friction holds: those whose encoders stay within a step or their noise for 0.2 s, or whose velocity is not sure to differ from zero [default: drop]
    standstill: Value | None
    #: The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: Which velocities are used. Measured ones pass the filter of the positions, and accelerations are their derivative; --fourier uses positions only
    velocities: Value | None


class ObserveOptions(TypedDict, total=False):
    """Of ``observe``."""

    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: A column whose header does not say what it is: Q=COLUMN, and behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    column: Values | None
    #: Take only each N-th state, after filtering
    decimate: Value | None
    #: By how many seconds an effort is logged after the motion that it belongs to: NAME=S. Every `identify` estimates it; `auto` corrects what least squares of these logs finds
    delay: Values | None
    #: The standard deviation of a measured coordinate, where more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the balance of energy over windows of this length in s instead of the equations of motion: no accelerations are needed
    energy: Value | None
    #: The episode of Parquet files of LeRobot, by its index [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Whether the payloads of the description are carried in all these logs; required where it has a payload, here or for each run of an experiment file
    payload: Value | None
    #: Average the runs of a trajectory of this period in s
    period: Value | None
    #: What is done with rows that cannot be used [default: fail]
    problems: Value | None
    #: The rate of the rows in Hz, where no column has their time
    rate: Value | None
    #: Interpolate the rows onto an even grid of this rate in Hz, where the steps of their clock are uneven
    resample: Value | None
    #: Velocities below this, rad/s or m/s, count as rest too
    rest_speed: Value | None
    #: What is done with equations of joints at rest, which static friction holds: those whose encoders stay within a step or their noise for 0.2 s, or whose velocity is not sure to differ from zero [default: drop]
    standstill: Value | None
    #: The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: Which velocities are used. Measured ones pass the filter of the positions, and accelerations are their derivative; --fourier uses positions only
    velocities: Value | None


class IdentifyOptions(TypedDict, total=False):
    """Of ``identify``."""

    #: Logs to predict with every model that was found, and by which --reduce is cross-validated
    against: Values | None
    #: Samples in which residuals are correlated [default: found from them]
    bandwidth: Value | None
    #: Write the spec with `bodies:` and the joints' `nominal:` filled with the physical values; all else of its text stays
    bodies: Value | None
    #: A parameter's limits, SI: LABEL=LOW..HIGH, either may be missing
    bound: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: Write the parameters as a C header of initialisers; it includes the robot's header, and compiles with that of this model only
    c: Value | None
    #: A column whose header does not say what it is: Q=COLUMN, and behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    column: Values | None
    #: The column of a joint's commanded position, NAME=COLUMN, with :UNIT and *FACTOR behind it where they are needed (may be repeated) [default: cmd_NAME]
    command: Values | None
    #: The level of the confidence intervals
    confidence: Value | None
    #: The controllers, JSON or YAML: `q1: {kp: 40, kd: 2}` for each actuated joint; `regen simulate --controller` writes such a file
    controller: Value | None
    #: Write the covariance of base parameters and gains into the file of --out too
    covariance: bool
    #: Identify from all logs but one and predict that one, each in turn
    cross: bool
    #: When this was done, for the file: nothing reads a clock
    date: Value | None
    #: Take only each N-th state, after filtering
    decimate: Value | None
    #: By how many seconds an effort is logged after the motion that it belongs to: NAME=S. Every `identify` estimates it; `auto` corrects what least squares of these logs finds
    delay: Values | None
    #: The standard deviation of a measured coordinate, where more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: The number of random logs from which the intervals of values under constraints follow, one small fit each, at least 5; 0: no intervals
    draws: Value | None
    #: Use the balance of energy over windows of this length in s instead of the equations of motion: no accelerations are needed
    energy: Value | None
    #: The episode of Parquet files of LeRobot, by its index [default: the only one]
    episode: Value | None
    #: The estimator [default: ls; --huber and --iv choose theirs]
    estimator: Value | None
    #: Judge whether the least-squares parameters are of any physical robot, then find those that fit best among the physical ones: all ten of every body
    feasible: bool
    #: Write each figure of the page as an SVG file into this folder
    figures: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Identify the nonlinear friction of the spec (atan, power, stribeck, lugre) with all other parameters, physical ones only (Eq. 29)
    friction: bool
    #: The speed within which friction changes its sign in `response`, rad/s or m/s
    friction_width: Value | None
    #: Residuals beyond K standard deviations count linearly; 1.345 is usual
    huber: Value | None
    #: Bodies that are the same, in frames that correspond: 1,4,6
    identical: Values | None
    #: Instrumental variables, which errors of the measured motion do not bias
    iv: bool
    #: A parameter's value, SI: LABEL=VALUE, such as 'm(3)=6.05'
    known: Values | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: The bandwidth of controllers without gains in `didim`, Hz [default: that with which the motion is nearest to measured positions; 3 without any]
    loop_bandwidth: Value | None
    #: The path of the robot's generated module, from where the constants will stand: they compile with that model only [default: super::ROBOT]
    module: Value | None
    #: Do not look for swapped columns, flipped signs, wrong units and the like
    no_suspicion: bool
    #: Write the parameters for `validate` and `export`: YAML if PARAMS ends in .yaml, else JSON
    out: Value | None
    #: Identified parameters of the robot without its load: payloads are identified, and gains that PARAMS lacks. With `covariance` in it (--covariance), the deviations include its own
    parameters: Value | None
    #: Whether the payloads of the description are carried in all these logs; required where it has a payload, here or for each run of an experiment file
    payload: Value | None
    #: Average the runs of a trajectory of this period in s
    period: Value | None
    #: Gains of all controllers in this simulation, or of one: [NAME=]KP,KI,KD (may be repeated) [default: by the robot's inertia, for the bandwidth with which the motion is nearest to the measured one]
    pid: Values | None
    #: Believe in the spec's nominal values: `weighted` or `weighted:PERCENT` by standard deviations in percent of them [default 30], `entropic` or `entropic:WEIGHT` by the divergence of pseudo-inertias [default 1]
    prior: Value | None
    #: What is done with rows that cannot be used [default: fail]
    problems: Value | None
    #: Write the parameters as a Python module, with a check of the model
    python: Value | None
    #: The rate of the rows in Hz, where no column has their time
    rate: Value | None
    #: Leave out base parameters until all are well identified (sigma below 15 %) and together feasible; every step is printed
    reduce: bool
    #: What the controllers followed, as `regen excite` writes it: the instruments, or the motion of `didim`, come from simulating the robot along it
    reference: Value | None
    #: Write a page with tables and figures of the result, and of the logs of --against; see `regen report`
    report: Value | None
    #: Interpolate the rows onto an even grid of this rate in Hz, where the steps of their clock are uneven
    resample: Value | None
    #: Velocities below this, rad/s or m/s, count as rest too
    rest_speed: Value | None
    #: Write the parameters as Rust constants for a controller
    rust: Value | None
    #: Seconds at the start of each log that `didim` leaves out, where it follows columns of commands
    settle: Value | None
    #: What is done with equations of joints at rest, which static friction holds: those whose encoders stay within a step or their noise for 0.2 s, or whose velocity is not sure to differ from zero [default: drop]
    standstill: Value | None
    #: Parameters to start from [default: the spec's nominal ones]
    start: Value | None
    #: The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: A known sum: 'm(1),m(2),m(3)=12.5'
    total: Values | None
    #: Which velocities are used. Measured ones pass the filter of the positions, and accelerations are their derivative; --fourier uses positions only
    velocities: Value | None
    #: How the efforts are weighted against each other
    weighting: Value | None
    #: Length of the windows of `response`, s, whose first states are estimated
    window: Value | None


class ValidateOptions(TypedDict, total=False):
    """Of ``validate``."""

    #: Further parameters to compare with
    beside: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: A column whose header does not say what it is: Q=COLUMN, and behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    column: Values | None
    #: Take only each N-th state, after filtering
    decimate: Value | None
    #: By how many seconds an effort is logged after the motion that it belongs to: NAME=S. Every `identify` estimates it; `auto` corrects what least squares of these logs finds
    delay: Values | None
    #: The standard deviation of a measured coordinate, where more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the balance of energy over windows of this length in s instead of the equations of motion: no accelerations are needed
    energy: Value | None
    #: The episode of Parquet files of LeRobot, by its index [default: the only one]
    episode: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Whether the payloads of the description are carried in all these logs; required where it has a payload, here or for each run of an experiment file
    payload: Value | None
    #: Average the runs of a trajectory of this period in s
    period: Value | None
    #: Write measured and predicted efforts of all logs here, CSV
    predict: Value | None
    #: What is done with rows that cannot be used [default: fail]
    problems: Value | None
    #: The rate of the rows in Hz, where no column has their time
    rate: Value | None
    #: Interpolate the rows onto an even grid of this rate in Hz, where the steps of their clock are uneven
    resample: Value | None
    #: Velocities below this, rad/s or m/s, count as rest too
    rest_speed: Value | None
    #: What is done with equations of joints at rest, which static friction holds: those whose encoders stay within a step or their noise for 0.2 s, or whose velocity is not sure to differ from zero [default: drop]
    standstill: Value | None
    #: The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: Which velocities are used. Measured ones pass the filter of the positions, and accelerations are their derivative; --fourier uses positions only
    velocities: Value | None


class ReportOptions(TypedDict, total=False):
    """Of ``report``."""

    #: Logs that were not used for identification
    against: Values | None
    #: Filter efforts and regressor by a zero-phase Butterworth low-pass of this order and cutoff in Hz; positions by one three times as wide, then take central differences
    butterworth: Value | None
    #: A column whose header does not say what it is: Q=COLUMN, and behind it :UNIT and *FACTOR where they are needed; COLUMN may be its number
    column: Values | None
    #: Take only each N-th state, after filtering
    decimate: Value | None
    #: By how many seconds an effort is logged after the motion that it belongs to: NAME=S. Every `identify` estimates it; `auto` corrects what least squares of these logs finds
    delay: Values | None
    #: The standard deviation of a measured coordinate, where more are measured than needed: NAME=VALUE
    deviation: Values | None
    #: Use the balance of energy over windows of this length in s instead of the equations of motion: no accelerations are needed
    energy: Value | None
    #: The episode of Parquet files of LeRobot, by its index [default: the only one]
    episode: Value | None
    #: Write each figure as an SVG file into this folder
    figures: Value | None
    #: Differentiate the finite Fourier series of this frequency in Hz and number of harmonics
    fourier: Value | None
    #: Fit cubic polynomials within this time in s on either side
    local: Value | None
    #: Where the files of an experiment file are [default: its own folder]
    logs: Value | None
    #: Whether the payloads of the description are carried in all these logs; required where it has a payload, here or for each run of an experiment file
    payload: Value | None
    #: Average the runs of a trajectory of this period in s
    period: Value | None
    #: What is done with rows that cannot be used [default: fail]
    problems: Value | None
    #: The rate of the rows in Hz, where no column has their time
    rate: Value | None
    #: Interpolate the rows onto an even grid of this rate in Hz, where the steps of their clock are uneven
    resample: Value | None
    #: Velocities below this, rad/s or m/s, count as rest too
    rest_speed: Value | None
    #: What is done with equations of joints at rest, which static friction holds: those whose encoders stay within a step or their noise for 0.2 s, or whose velocity is not sure to differ from zero [default: drop]
    standstill: Value | None
    #: The topic of MCAP files and ROS 2 bags [default: the only one with joint states]
    topic: Value | None
    #: Which velocities are used. Measured ones pass the filter of the positions, and accelerations are their derivative; --fourier uses positions only
    velocities: Value | None
