"""Mistakes that are planted into a log: each changes columns, rows or the spec, and knows what tells it.

A mistake is a function of a `Log` and a random generator. It returns the columns that a message about it may
name, and a pattern of words that tell its kind without them. Those of rows come last in KINDS, and are planted so.
"""

import re

import numpy as np
import yaml

TURN = 180 / np.pi


class Log:
    """A table of named columns in order, with the text of the spec that is to be identified from it."""

    def __init__(self, names, table, spec, joints):
        self.names, self.table, self.spec = list(names), np.array(table), spec
        self.joints = joints  # coordinates in order, each with its type

    def of(self, prefix):
        """The places of the columns of one kind, in the order of the joints; `` is that of positions."""
        wanted = [prefix + c for c in self.joints]
        return [self.names.index(c) for c in wanted if c in self.names]

    def write(self, path):
        rows = [",".join(self.names)]
        rows += [",".join(f"{x:.12g}" for x in row) for row in self.table]
        path.write_text("\n".join(rows) + "\n")


def some(random, places, least=1, most=None):
    """Some of these places in random order."""
    count = random.integers(least, (most or len(places)) + 1)
    return list(random.choice(places, count, replace=False))


def told_by(log, places, words):
    return [log.names[k] for k in places], words


def spread(log, k):
    return np.std(log.table[:, k])


def stretch(log, random, least, most):
    """The first and last row but one of a stretch that is not at the ends."""
    length = int(random.integers(least, most + 1))
    first = int(random.integers(20, len(log.table) - length - 20))
    return first, first + length


# columns ---------------------------------------------------------------------------------------


def unit_of_positions(log, random):
    """Degrees or millimetres: of all joints of one type, or of one."""
    places = log.of("")
    kinds = [log.joints[log.names[k]] for k in places]
    kind = random.choice(sorted(set(kinds)))
    chosen = [k for k, of in zip(places, kinds) if of == kind]
    if random.uniform() < 0.5:
        chosen = some(random, chosen, most=1)
    log.table[:, chosen] *= 1000 if kind == "prismatic" else TURN
    return told_by(log, chosen, r"degrees|in mN m or mm|`t` looks like|loops? (do|does|cannot be) (not )?closed?|are not closed")


def unit_of_an_effort(log, random):
    """One effort in mN m, kN m, kgf or cm."""
    places = log.of("tau_")
    chosen = some(random, places, most=1)
    log.table[:, chosen] *= random.choice([1000, 1e-3, 1 / 9.80665, 100])
    return told_by(log, chosen, r"gain or a unit is missing")


def unit_of_velocities(log, random):
    """Velocities in degrees/s, rpm or mm/s: of all joints of one type, or of one."""
    places = log.of("qd_")
    kinds = [log.joints[log.names[k][3:]] for k in places]
    kind = random.choice(sorted(set(kinds)))
    chosen = [k for k, of in zip(places, kinds) if of == kind]
    if random.uniform() < 0.5:
        chosen = some(random, chosen, most=1)
    log.table[:, chosen] *= 1000 if kind == "prismatic" else random.choice([TURN, 30 / np.pi])
    return told_by(log, chosen, r"velocit")


def sign_of_efforts(log, random):
    chosen = some(random, log.of("tau_"))
    log.table[:, chosen] *= -1
    return told_by(log, chosen, r"signs? .*flipped|upside down")


def sign_of_positions(log, random):
    chosen = some(random, log.of(""), most=2 if len(log.of("")) > 2 else 1)
    log.table[:, chosen] *= -1
    return told_by(log, chosen, r"signs? .*flipped|loops? (do|does|cannot be) (not )?closed?|are not closed")


def sign_of_a_velocity(log, random):
    places = log.of("qd_")
    chosen = some(random, places, most=2 if len(places) > 1 else 1)
    log.table[:, chosen] *= -1
    return told_by(log, chosen, r"velocit")


def permuted(log, random, prefix):
    places = log.of(prefix)
    chosen = some(random, places, least=2)
    shift = int(random.integers(1, len(chosen)))
    log.table[:, chosen] = log.table[:, chosen[shift:] + chosen[:shift]]
    return told_by(log, chosen, r"swapped|loops? (do|does|cannot be) (not )?closed?|are not closed")


def permutation_of_efforts(log, random):
    return permuted(log, random, "tau_")


def permutation_of_positions(log, random):
    return permuted(log, random, "")


def offset_of_an_effort(log, random):
    chosen = some(random, log.of("tau_"), most=1)
    log.table[:, chosen] += random.choice([-1, 1]) * random.uniform(0.1, 1) * spread(log, chosen[0])
    return told_by(log, chosen, r"shifted by a constant|offset|weight")


def offset_of_a_position(log, random):
    chosen = some(random, log.of(""), most=1)
    size = random.uniform(0.1, 0.6) if log.joints[log.names[chosen[0]]] == "revolute" else random.uniform(0.03, 0.2)
    log.table[:, chosen] += random.choice([-1, 1]) * size
    return told_by(log, chosen, r"offset|shifted|loops? (do|does|cannot be) (not )?closed?|are not closed")


def constant_column(log, random):
    chosen = some(random, range(1, len(log.names)), most=1)
    log.table[:, chosen] = random.choice([0, log.table[0, chosen[0]]])
    return told_by(log, chosen, r"same in all rows|does not (move|change)|never moves|stands? still")


def stale_column(log, random):
    """A column that holds each value for some rows."""
    chosen = some(random, range(1, len(log.names)), most=1)
    every = int(random.integers(3, 16))
    log.table[:, chosen] = log.table[np.arange(len(log.table)) // every * every][:, chosen]
    return told_by(log, chosen, r"slower|repeats?|held|new values?")


def late_column(log, random):
    """A column of positions or efforts that lags by some rows."""
    chosen = some(random, log.of("") + log.of("tau_"), most=1)
    rows = int(random.integers(2, 20))
    log.table[rows:, chosen] = log.table[:-rows, chosen]
    return told_by(log, chosen, r"delay|ms late|ms early")


def doubled_column(log, random):
    """A column that is a copy of another one."""
    prefix = random.choice(["", "tau_"])
    source, copy = some(random, log.of(prefix), 2, 2)
    log.table[:, copy] = log.table[:, source]
    return told_by(log, [copy, source], r"the same (values|as)|swapped")


def unit_of_efforts(log, random):
    """All efforts in mN m, kgf or in currents of which the constant is not given."""
    places = log.of("tau_")
    log.table[:, places] *= random.choice([1000, 1e-3, 1 / 9.80665, random.uniform(0.05, 0.3)])
    return told_by(log, places, r"gain or a unit|nominal bodies|times what")


def factor_of_a_position(log, random):
    """One position before its gear, in turns or in counts of an encoder."""
    chosen = some(random, log.of(""), most=1)
    log.table[:, chosen] *= random.choice([1 / (2 * np.pi), 100, 0.5, 2, 4096 / (2 * np.pi)])
    return told_by(log, chosen, r"gear|unit|loops? (do|does|cannot be) (not )?closed?|are not closed")


def clipped_effort(log, random):
    """One effort that its sensor cuts off."""
    chosen = some(random, log.of("tau_"), most=1)
    own = log.table[:, chosen]
    bound = random.uniform(0.3, 0.8) * np.abs(own).max()
    log.table[:, chosen] = np.clip(own, -bound, bound)
    return told_by(log, chosen, r"saturat|limit")


def coarse_effort(log, random):
    """One effort in steps of a tenth to once its spread."""
    chosen = some(random, log.of("tau_"), most=1)
    step = random.uniform(0.1, 1) * spread(log, chosen[0])
    log.table[:, chosen] = np.round(log.table[:, chosen] / step) * step
    return told_by(log, chosen, r"steps?|quanti|resolution")


def late_efforts(log, random):
    """All efforts lag by the same number of rows."""
    places = log.of("tau_")
    rows = int(random.integers(2, 20))
    log.table[rows:, places] = log.table[:-rows, places]
    return told_by(log, places, r"delay|ms late|ms early")


def drifting_effort(log, random):
    """One effort with a drift, as of a strain gauge that warms up."""
    chosen = some(random, log.of("tau_"), most=1)
    size = random.choice([-1, 1]) * random.uniform(0.3, 2) * spread(log, chosen[0])
    log.table[:, chosen[0]] += size * np.linspace(-0.5, 0.5, len(log.table))
    return told_by(log, chosen, r"drift|explain")


def rectified_effort(log, random):
    """One effort without its sign, as the current of some drives."""
    chosen = some(random, log.of("tau_"), most=1)
    log.table[:, chosen] = np.abs(log.table[:, chosen])
    return told_by(log, chosen, r"sign|explain")


def noise_alone(log, random):
    """One effort that is noise, as of a channel that is not connected."""
    chosen = some(random, log.of("tau_"), most=1)
    log.table[:, chosen[0]] = spread(log, chosen[0]) * random.normal(size=len(log.table))
    return told_by(log, chosen, r"noise|explain")


def wrapped_position(log, random):
    """One position that jumps back as if it were wrapped, though not by a turn."""
    chosen = some(random, log.of(""), most=1)[0]
    middle = np.median(log.table[:, chosen]) + 0.3 * spread(log, chosen)
    own = log.table[:, chosen] - middle
    width = 2 * spread(log, chosen)
    log.table[:, chosen] = (own + width / 2) % width - width / 2 + middle
    return told_by(log, [chosen], r"jump|wrap|outlier")


def swapped_position_and_velocity(log, random):
    """The positions are velocities."""
    places = log.of("")
    step = np.median(np.diff(log.table[:, 0]))
    log.table[:, places] = np.gradient(log.table[:, places], step, axis=0)
    return told_by(log, places, r"velocit|loops? (do|does|cannot be) (not )?closed?|are not closed")


def repeated_rows(log, random):
    """Every row twice, with its time or with times between."""
    log.table = np.repeat(log.table, 2, axis=0)
    if random.uniform() < 0.5:
        step = log.table[2, 0] - log.table[0, 0]
        log.table[1::2, 0] += step / 2
    return [], r"same as|row before|repeat|twice|double|rate|slower|new value"


# rows ------------------------------------------------------------------------------------------


def burst(log, random):
    """Some rows of one column far off."""
    chosen = some(random, range(1, len(log.names)), most=1)[0]
    first, end = stretch(log, random, 1, 50)
    size = random.uniform(2, 10) * spread(log, chosen)
    if random.uniform() < 0.5:
        log.table[first:end, chosen] += random.choice([-1, 1]) * size
    else:
        log.table[first:end, chosen] += size * random.normal(size=end - first)
    return told_by(log, [chosen], r"outlier|jumps")


def dropout(log, random):
    """Rows that are missing, or repeat the one before, in all columns but time."""
    first, end = stretch(log, random, 5, 50)
    if random.uniform() < 0.5:
        log.table = np.delete(log.table, np.arange(first, end), axis=0)
    else:
        log.table[first:end, 1:] = log.table[first - 1, 1:]
    return [], r"gap|dropout|missing|repeat|same as|stands still"


def swapped_runs(log, random):
    """The log's two parts in the wrong order, with their times or without them."""
    at = int(len(log.table) * random.uniform(0.3, 0.7))
    times = log.table[:, 0].copy()
    log.table = np.vstack([log.table[at:], log.table[:at]])
    if random.uniform() < 0.5:
        log.table[:, 0] = times
        return [], rf"gap|jump|outlier|row {len(log.table) - at}\b"
    return [], r"clock|jumps back|time|order"


def other_run(log, random):
    """The efforts of another run: here its own, a third of it off."""
    places = log.of("tau_")
    log.table[:, places] = np.roll(log.table[:, places], len(log.table) // 3, axis=0)
    return [], r"explain|another run|not those of|leaves?|belong|does not fit|do not fit|unexplained"


def clock(log, random):
    """A clock that jumps on, jumps back, or starts again."""
    row = int(random.integers(len(log.table) // 5, 4 * len(log.table) // 5))
    step = np.median(np.diff(log.table[:, 0]))
    how = random.integers(3)
    if how == 0:
        log.table[row:, 0] += random.uniform(0.2, 3)
    elif how == 1:
        log.table[row:, 0] -= random.uniform(3 * step, log.table[row, 0])
    else:
        log.table[row:, 0] -= log.table[row, 0]
    return [], r"clock|gap|jumps back|order|stretch|time"


def unit_of_time(log, random):
    """Times in ms, us or ns."""
    log.table[:, 0] *= random.choice([1e3, 1e6, 1e9])
    return [], r"`t`|unit of time|times?\b.*\b(ms|us|ns)\b|\b(ms|us|ns)\b and not s"


def rate(log, random):
    """Times of another rate, by a factor of 2 to 5."""
    factor = random.uniform(2, 5) ** random.choice([-1, 1])
    log.table[:, 0] *= factor
    return [], r"rate|clock|time|velocit|faster|slower"


# spec ------------------------------------------------------------------------------------------


def gravity(log, random):
    """The spec's gravity is upside down, along another axis, in g or missing."""
    spec = yaml.load(log.spec, Loader=yaml.BaseLoader)
    own = np.array([float(x) for x in spec["gravity"]])
    choices = [-own, np.roll(own, 1), np.zeros(3), -np.roll(own, 1), own / 9.81]
    new = choices[random.integers(len(choices))]
    log.spec = re.sub(r"(?m)^gravity:(.*\n)(- .*\n)*", f"gravity: [{', '.join(f'{x:g}' for x in new)}]\n", log.spec)
    if yaml.load(log.spec, Loader=yaml.BaseLoader)["gravity"] == spec["gravity"]:
        raise SystemExit("the spec's gravity was not changed")
    return [], r"gravity|weight|upside"


KINDS = [
    unit_of_positions, unit_of_an_effort, unit_of_velocities, sign_of_efforts, sign_of_positions, sign_of_a_velocity,
    permutation_of_efforts, permutation_of_positions, offset_of_an_effort, offset_of_a_position, constant_column,
    stale_column, late_column, doubled_column, unit_of_efforts, factor_of_a_position, clipped_effort, coarse_effort,
    late_efforts, drifting_effort, rectified_effort, noise_alone, wrapped_position, swapped_position_and_velocity,
    burst, dropout, swapped_runs, other_run, clock, unit_of_time, rate, repeated_rows, gravity,
]
VELOCITIES = (unit_of_velocities, sign_of_a_velocity)
# those that need two columns of one kind
EXCHANGES = (permutation_of_efforts, permutation_of_positions, doubled_column)
for kind in KINDS:
    kind.fits = lambda log: True
for kind in VELOCITIES:
    kind.fits = lambda log: bool(log.of("qd_"))
for kind in EXCHANGES:
    kind.fits = lambda log: len(log.of("")) > 1
