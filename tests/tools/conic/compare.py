"""Solves the problems of the example `conic` again by a conic solver from PyPI, and compares.

    pip install numpy scipy clarabel
    cargo run --release -p regen-tests --features examples --example conic -- 0 1000 > problems.jsonl
    python compare.py problems.jsonl

The ignored test `problems_for_another_solver` writes problems of random combinations instead of derived
robots: RECORD.md has the command.

The problem is min ||R B phi - z||^2 with every pseudo-inertia positive semidefinite and every single
parameter non-negative, under bounds, known values and sums (and our limits of the bodies' sizes where
we report them as active). Clarabel's Python package solves it as one programme with a quadratic
objective over semidefinite cones, in other variables than ours and by another method. The constraints
of every answer are also checked with eigenvalues by numpy.

Our objective must be at most 1e-5 above theirs, our gap must be a true bound, and no verdict may be
wrong. A problem of which the fit itself says that it is not proven is counted as `no_proof`;
at most one in a hundred may be.
"""

import json
import sys

import clarabel
import numpy as np
import scipy.sparse as sp

MOST_UNPROVEN = 0.01
UPPER = [(r, c) for c in range(4) for r in range(c + 1)]


def entries():
    """Each entry of the upper triangle of a pseudo-inertia as factors of the ten parameters."""
    rows = np.zeros((10, 10))
    for k, (r, c) in enumerate(UPPER):
        if r == c == 3:
            rows[k, 9] = 1
        elif c == 3:
            rows[k, 6 + r] = 1
        elif r == c:
            rows[k, [0, 3, 5]] = 0.5
            rows[k, [0, 3, 5][r]] = -0.5
        else:
            rows[k, {(0, 1): 1, (0, 2): 2, (1, 2): 4}[(r, c)]] = -1
    return rows


ENTRIES = entries()
SCALE = np.array([1 if r == c else np.sqrt(2) for r, c in UPPER])


def pseudo(ten):
    j = np.zeros((4, 4))
    for (r, c), x in zip(UPPER, ENTRIES @ ten):
        j[r, c] = j[c, r] = x
    return j


class Problem:
    def __init__(self, given):
        self.given = given
        self.labels = given["labels"]
        self.place = {label: k for k, label in enumerate(self.labels)}
        r = len(given["z"])
        self.r = np.array(given["r"]).reshape(r, r).T
        self.z = np.array(given["z"])
        self.b = np.array(given["rows"])

    def squares(self, phi):
        return float(np.sum((self.r @ (self.b @ phi) - self.z) ** 2)) + self.given["rss"]

    def misses(self, phi):
        """The largest violation of a constraint by the parameters, each in its own unit."""
        worst = 0.0
        for columns in self.given["bodies"]:
            j = pseudo(phi[columns])
            worst = max(worst, -np.linalg.eigvalsh(j)[0] / max(1e-12, np.trace(j)))
        for k in self.given["single"]:
            worst = max(worst, -phi[k])
        for label, low, high in self.given["bounds"]:
            x = phi[self.place[label]]
            worst = max(worst, (low - x) / max(1e-3, abs(low)))
            if high is not None:
                worst = max(worst, (x - high) / max(1e-3, abs(high)))
        for label, value in self.given["known"]:
            worst = max(worst, abs(phi[self.place[label]] - value))
        for labels, value in self.given["totals"]:
            worst = max(worst, abs(sum(phi[self.place[x]] for x in labels) - value))
        return worst

    def cones(self, unit, n):
        """Rows of A x + s = b over parameters in units, and the cones of s."""
        rows, sides, cones = [], [], []

        def push(row, side):
            rows.append(row)
            sides.append(side)

        equal = len(rows)
        for label, value in self.given["known"]:
            row = np.zeros(n)
            row[self.place[label]] = 1
            push(row, value / unit[self.place[label]])
        for labels, value in self.given["totals"]:
            row = np.zeros(n)
            for label in labels:
                row[self.place[label]] = unit[self.place[label]]
            push(row / value, 1.0)
        if len(rows) > equal:
            cones.append(clarabel.ZeroConeT(len(rows) - equal))
        first = len(rows)
        for k in self.given["single"]:
            row = np.zeros(n)
            row[k] = -1
            push(row, 0.0)
        for label, low, high in self.given["bounds"]:
            k = self.place[label]
            row = np.zeros(n)
            row[k] = 1
            push(-row, -low / unit[k])
            if high is not None:
                push(row, high / unit[k])
        # a size limit that we report as active is part of the problem; an inactive one must not matter
        ours = self.given["ours"]
        sizes = ours["sizes"] if ours.get("limited") else []
        for columns, (mass, length) in zip(self.given["bodies"], sizes):
            row = np.zeros(n)
            row[columns[9]] = unit[columns[9]] / mass
            for k in (0, 3, 5):
                row[columns[k]] = unit[columns[k]] / (2 * length**2 * mass)
            push(row, 1.0)
        if len(rows) > first:
            cones.append(clarabel.NonnegativeConeT(len(rows) - first))
        for columns in self.given["bodies"]:
            for k in range(10):
                row = np.zeros(n)
                row[columns] = -SCALE[k] * ENTRIES[k]
                push(row, 0.0)
            cones.append(clarabel.PSDTriangleConeT(4))
        return rows, sides, cones

    def solve(self):
        p = len(self.labels)
        length = 0.3
        unit = np.ones(p)
        for columns in self.given["bodies"]:
            unit[columns] = [length**2] * 6 + [length] * 3 + [1]
        a = self.r @ self.b * unit
        whole = np.sqrt(self.z @ self.z + self.given["rss"])
        for k in self.given["single"]:
            norm = np.linalg.norm(a[:, k])
            if norm > 0:
                unit[k] = whole / norm
                a[:, k] *= unit[k]
        # residuals are variables, relative to the least-squares solution without constraints
        middle = np.linalg.lstsq(a, self.z, rcond=1e-12)[0]
        size = max(np.linalg.norm(a, axis=0).max(), 1e-12)
        a = a / size
        m = a.shape[0]
        n = p + m
        rows, sides, cones = self.cones(unit, n)
        first = np.hstack([a, -np.eye(m)])
        rows = np.vstack([first, *rows])
        sides = np.concatenate([a @ middle, sides])
        cones = [clarabel.ZeroConeT(m), *cones]
        q = sp.csc_matrix(sp.diags(np.r_[np.zeros(p), np.full(m, 1.0)]))
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
        settings.max_iter = 300
        solver = clarabel.DefaultSolver(q, np.zeros(n), sp.csc_matrix(rows), sides, cones, settings)
        solution = solver.solve()
        x = np.array(solution.x)[:p] * unit
        return str(solution.status), x

    def margin(self, beta):
        """The margin: the largest possible smallest eigenvalue with these base parameters, at most 1."""
        p = len(self.labels)
        n = p + 1
        length = 0.3
        unit = np.ones(p)
        for columns in self.given["bodies"]:
            unit[columns] = [length**2] * 6 + [length] * 3 + [1]
        rows, sides, cones = [], [], []
        for row, value in zip(self.b, beta):
            size = np.abs(row * unit).max()
            rows.append(np.r_[row * unit, 0] / size)
            sides.append(value / size)
        cones.append(clarabel.ZeroConeT(len(rows)))
        for k in self.given["single"]:
            row = np.zeros(n)
            row[k], row[p] = -1, 1e-9
            rows.append(row)
            sides.append(0.0)
        row = np.zeros(n)
        row[p] = 1
        rows.append(row)
        sides.append(1.0)
        cones.append(clarabel.NonnegativeConeT(len(self.given["single"]) + 1))
        for columns in self.given["bodies"]:
            for k, (r, c) in enumerate(UPPER):
                row = np.zeros(n)
                row[columns] = -SCALE[k] * ENTRIES[k]
                row[p] = 1 if r == c else 0
                rows.append(row)
                sides.append(0.0)
            cones.append(clarabel.PSDTriangleConeT(4))
        cost = np.zeros(n)
        cost[p] = -1
        settings = clarabel.DefaultSettings()
        settings.verbose = False
        settings.max_iter = 300
        nothing = sp.csc_matrix((n, n))
        solver = clarabel.DefaultSolver(
            nothing, cost, sp.csc_matrix(np.array(rows)), np.array(sides), cones, settings
        )
        solution = solver.solve()
        return str(solution.status), float(solution.x[p])


def main():
    counts = dict.fromkeys(
        "problems compared worse above_gap misses limited no_proof theirs_unsolved refused "
        "refused_wrongly verdicts wrong_verdicts".split(),
        0,
    )
    worst, widest, notes = 0.0, 0.0, []
    with open(sys.argv[1]) as lines:
        for line in lines:
            problem = Problem(json.loads(line))
            given = problem.given
            counts["problems"] += 1
            ours = given["ours"]
            status, theirs = problem.solve()
            solved = status in ("Solved", "AlmostSolved")
            counts["theirs_unsolved"] += not solved
            if "error" in ours:
                counts["refused"] += 1
                if solved and problem.misses(theirs) < 1e-6:
                    counts["refused_wrongly"] += 1
                    notes.append((given["seed"], "refused", ours["error"]))
            else:
                phi = np.array(ours["phi"])
                mine = problem.squares(phi)
                missed = problem.misses(phi)
                if missed > 1e-9:
                    counts["misses"] += 1
                    notes.append((given["seed"], "misses", missed))
                counts["limited"] += bool(ours["limited"])
                widest = max(widest, ours["gap"])
                if ours["gap"] > 1e-4:
                    counts["no_proof"] += 1
                    notes.append((given["seed"], "gap", ours["gap"]))
                if solved:
                    counts["compared"] += 1
                    # residuals below 1e-4 of the efforts count as zero, as in our gap
                    whole = problem.z @ problem.z + given["rss"]
                    off = (mine - problem.squares(theirs)) / max(mine, 1e-8 * whole)
                    worst = max(worst, off)
                    # theirs violates constraints by its tolerance, which lowers its objective by an unknown amount
                    if off > 1e-5:
                        counts["worse"] += 1
                        notes.append((given["seed"], "worse", off, problem.misses(theirs)))
                    # a size limit may cost 1e-6 before we report it as active
                    if off > ours["gap"] + 1e-6 and problem.misses(theirs) < 1e-10:
                        counts["above_gap"] += 1
                        notes.append((given["seed"], "above its gap", off, ours["gap"]))
            judged = given["verdict"]
            if judged:
                counts["verdicts"] += 1
                status, margin = problem.margin(np.array(judged["beta"]))
                negative = status == "PrimalInfeasible" or margin < -1e-6
                says = judged["says"]
                known = status in ("Solved", "AlmostSolved", "PrimalInfeasible")
                # after a proof of infeasibility there is no margin
                positive = status != "PrimalInfeasible" and margin > 1e-6
                wrong = says == "feasible" and negative or says == "infeasible" and positive
                if known and wrong:
                    counts["wrong_verdicts"] += 1
                    notes.append((given["seed"], "verdict", says, status, margin))
    for note in notes:
        print(*note)
    print(*(f"{name} {count}" for name, count in counts.items()), sep=", ")
    print(f"ours above theirs by at most {worst:.1e}; widest gap {widest:.1e}")
    bad = "worse above_gap misses refused_wrongly wrong_verdicts".split()
    many = counts["no_proof"] > MOST_UNPROVEN * counts["problems"]
    sys.exit(many or any(counts[name] for name in bad))


main()
