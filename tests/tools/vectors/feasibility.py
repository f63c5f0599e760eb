"""Constrained identification problems and their solutions by CVXOPT.

    pip install numpy cvxopt
    python tests/tools/vectors/feasibility.py > tests/fixtures/computed/feasibility.json

min ||R B phi - z||^2 + ||(phi - cad) / 0.5||^2 with every pseudo-inertia and single parameter
non-negative, is solved by the dense interior-point method coneqp of CVXOPT, which shares no code with
the solver under test. The second term, priors at the values of a wrong CAD model with a standard
deviation of 0.1, makes phi unique and well determined, so that all of it can be compared to 1e-6.
"""

import json

import numpy as np
from cvxopt import matrix, solvers, spmatrix

solvers.options.update(show_progress=False, abstol=1e-10, reltol=1e-10, feastol=1e-10, maxiters=100)
DEVIATION = 0.1
SYMBOLS = "Ixx Ixy Ixz Iyy Iyz Izz mx my mz m".split()


def pseudo(ten):
    xx, xy, xz, yy, yz, zz, mx, my, mz, m = ten
    i = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    j = np.zeros((4, 4))
    j[:3, :3] = np.trace(i) / 2 * np.eye(3) - i
    j[:3, 3] = j[3, :3] = mx, my, mz
    j[3, 3] = m
    return j


def body(rng):
    j = np.diag([0.01, 0.01, 0.01, 0.0])
    for _ in range(4):
        r = np.append(rng.uniform(-0.5, 0.5, 3), 1.0)
        j += rng.uniform(0.05, 1.5) * np.outer(r, r)
    i = np.trace(j[:3, :3]) * np.eye(3) - j[:3, :3]
    return [i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2], *j[:3, 3], j[3, 3]]


def problem(seed, bodies, dropped, noise):
    rng = np.random.default_rng(seed)
    labels = [f"{s}({b})" for b in range(1, bodies + 1) for s in SYMBOLS]
    labels += [f"Fv(q{b})" for b in range(1, bodies + 1)]
    p = len(labels)
    phi = np.array(sum((body(rng) for _ in range(bodies)), []) + list(rng.uniform(0.1, 5.0, bodies)))
    out = sorted(rng.choice(10 * bodies, dropped, replace=False).tolist())
    kept = [k for k in range(p) if k not in out]
    b = np.zeros((len(kept), p))
    for row, k in enumerate(kept):
        b[row, k] = 1.0
    for k in out:
        b[rng.integers(len(kept) - bodies), k] = rng.uniform(-1, 1)
    w = rng.normal(size=(200, len(kept)))
    tau = w @ b @ phi + noise * rng.normal(size=200)
    r = np.linalg.qr(np.column_stack([w, tau]), mode="r")
    r *= np.where(np.diag(r) < 0, -1.0, 1.0)[:, None]
    n = len(kept)
    z, rss = r[:n, n], r[n, n] ** 2
    r = r[:n, :n]
    a = r @ b
    cad = phi + rng.normal(scale=0.05, size=p)
    quadratic = a.T @ a + np.eye(p) / DEVIATION**2
    blocks = []
    for k in range(bodies):
        g = np.zeros((16, p))
        for j in range(10):
            unit = np.zeros(10)
            unit[j] = 1.0
            g[:, 10 * k + j] = -pseudo(unit).reshape(16, order="F")
        blocks.append(g)
    single = spmatrix([-1.0] * bodies, range(bodies), range(10 * bodies, p), (bodies, p))
    g = matrix([matrix(single)] + [matrix(block) for block in blocks])
    # relative to the minimum without constraints, where the objective is small
    middle = np.linalg.solve(quadratic, a.T @ z + cad / DEVIATION**2)
    h = -g * matrix(middle)
    dims = {"l": bodies, "q": [], "s": [4] * bodies}
    solution = solvers.coneqp(matrix(quadratic), matrix(0.0, (p, 1)), g, h, dims)
    assert solution["gap"] < 1e-9 and solution["primal infeasibility"] < 1e-9, solution
    found = middle + np.array(solution["x"]).ravel()
    free = np.linalg.solve(r, z)
    return {
        "labels": labels,
        "kept": [labels[k] for k in kept],
        "combinations": b.tolist(),
        "r": r.flatten(order="F").tolist(),
        "z": z.tolist(),
        "rss": rss,
        "rows": 200,
        "cad": cad.tolist(),
        "deviation": DEVIATION,
        "phi": found.tolist(),
        "beta": (b @ found).tolist(),
        "squared_residual": float(np.sum((a @ found - z) ** 2) + rss),
        "least_squares": free.tolist(),
    }


print(json.dumps([problem(1, 1, 0, 3.0), problem(2, 2, 6, 3.0), problem(3, 3, 9, 2.0), problem(4, 4, 15, 1.0)]))
