"""Motions of which position, velocity and acceleration are known at any instant.

A motion is made of pieces, within each of which it has all derivatives; at their ends it may have jumps
from the third derivative on. In a piece at rest nothing moves.
"""

import numpy as np

MARGIN = 0.1  # s before and after the log, since rows with jitter may be measured there
KINDS = ("fourier", "start", "ptp", "sweep")
HARMONICS = 5
MOVES, MOVING = 8, 0.7  # point to point: number of moves, and the part of each in which it moves


def blend(s):
    """The quintic from 0 to 1 with its first two derivatives by s."""
    s = np.clip(s, 0, 1)
    return (
        s**3 * (10 - 15 * s + 6 * s**2),
        30 * s**2 * (1 - s) ** 2,
        60 * s * (1 - s) * (1 - 2 * s),
    )


class Motion:
    """A random motion of some coordinates about `centre`, as far as `reach` from it to either side.

    `speeds` are limits of the velocities, by which single coordinates move less.
    """

    def __init__(self, kind, random, time, centre, reach, speeds):
        self.kind, self.time = kind, time
        self.centre = np.asarray(centre, float)
        n = len(self.centre)
        self.pieces = [(-MARGIN, time + MARGIN, False)]
        if kind in ("fourier", "start"):
            self.rate = 2 * np.pi * 2 / time  # two periods
            order = np.arange(1, HARMONICS + 1)
            self.orders = order[:, None]
            self.sizes = random.normal(size=(HARMONICS, n)) / self.orders**0.7
            self.phases = random.uniform(0, 2 * np.pi, (HARMONICS, n))
            if kind == "start":
                self.pieces = [(-MARGIN, 1, True), (1, 2, False), (2, time + MARGIN, False)]
        elif kind == "sweep":
            # from the first to the last frequency, Hz
            self.first = random.uniform(0.1, 0.2, n)
            self.growth = np.log(random.uniform(1.5, 3.0, n) / self.first) / time
            self.phases = random.uniform(0, 2 * np.pi, n)
        elif kind == "ptp":
            self.points = random.uniform(-1, 1, (MOVES + 1, n))
            self.points[[0, -1]] = 0
            length = time / MOVES
            ends = [-MARGIN]
            for k in range(MOVES):
                ends += [k * length, (k + MOVING) * length]
            ends += [time + MARGIN]
            self.pieces = [(a, b, k % 2 == 0) for k, (a, b) in enumerate(zip(ends, ends[1:]))]
        else:
            raise ValueError(f"no motion is called {kind}; there are {', '.join(KINDS)}")
        self.scale = np.ones(n)
        q, v, _ = self.at(np.linspace(0, time, 4000))
        widest = np.abs(q - self.centre).max(axis=0)
        size = 1.0 if kind == "ptp" else widest
        self.scale = reach / size
        fastest = np.abs(v).max(axis=0) * self.scale
        self.scale = self.scale * np.minimum(1, speeds / fastest)

    def at(self, t):
        """Positions, velocities and accelerations at these instants, one row each."""
        t = np.asarray(t, float)[:, None]
        if self.kind in ("fourier", "start"):
            angle = t[:, None] * self.rate * self.orders + self.phases
            speed = self.rate * self.orders
            q = (self.sizes * np.sin(angle)).sum(axis=1)
            v = (self.sizes * speed * np.cos(angle)).sum(axis=1)
            a = -(self.sizes * speed**2 * np.sin(angle)).sum(axis=1)
            if self.kind == "start":
                b0, b1, b2 = blend(t - 1)
                q, v, a = b0 * q, b0 * v + b1 * q, b0 * a + 2 * b1 * v + b2 * q
        elif self.kind == "sweep":
            # the amplitude falls a little less than the frequency rises
            k, fall = self.growth, 0.7 * self.growth
            rise = np.exp(k * t)
            angle = 2 * np.pi * self.first * (rise - 1) / k + self.phases
            d1 = 2 * np.pi * self.first * rise
            d2 = d1 * k
            size = np.exp(-fall * t)
            sine, cosine = np.sin(angle), np.cos(angle)
            q = size * sine
            v = size * (d1 * cosine - fall * sine)
            a = size * ((fall**2 - d1**2) * sine + (d2 - 2 * fall * d1) * cosine)
        else:
            length = self.time / MOVES
            move = np.clip((t // length).astype(int), 0, MOVES - 1)
            s = (t - move * length) / (MOVING * length)
            b0, b1, b2 = blend(s)
            start = self.points[move[:, 0]]
            way = self.points[move[:, 0] + 1] - start
            q = start + b0 * way
            v = b1 * way / (MOVING * length)
            a = b2 * way / (MOVING * length) ** 2
        return self.centre + self.scale * q, self.scale * v, self.scale * a

    def piece(self, t):
        """The number of the piece in which each instant lies."""
        starts = np.array([a for a, _, _ in self.pieces])
        return np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(self.pieces) - 1)
