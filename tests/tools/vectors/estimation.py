"""Writes tests/fixtures/computed/estimation.json: results of numpy and scipy for comparison with the
runtime.

Run with numpy and scipy installed:  python tests/tools/vectors/estimation.py
The inputs are formulas or seeded random numbers, so every run writes the same file.
"""

import json
import pathlib

import numpy as np
from scipy import signal, stats


def least_squares():
    rng = np.random.default_rng(6)
    rows, columns = 300, 7
    w = rng.normal(size=(rows, columns)) * np.logspace(-3, 3, columns)
    x = rng.normal(size=columns) / np.logspace(-3, 3, columns)
    # autocorrelated residuals, so that Newey and West's covariance differs from the white one
    noise = signal.lfilter([1.0], [1.0, -0.6], rng.normal(size=rows))
    tau = w @ x + 0.3 * noise
    solution = np.linalg.lstsq(w, tau, rcond=None)[0]
    e = tau - w @ solution
    bread = np.linalg.inv(w.T @ w)
    variance = e @ e / (rows - columns)
    bandwidth = 6
    scores = w * e[:, None]
    meat = scores.T @ scores
    for lag in range(1, bandwidth):
        product = scores[lag:].T @ scores[:-lag]
        meat += (1 - lag / bandwidth) * (product + product.T)
    newey_west = bread @ meat @ bread * rows / (rows - columns)
    scale = np.linalg.norm(w, axis=0)
    lags = 10
    rho = [float(e[lag:] @ e[:-lag] / (e @ e)) for lag in range(1, lags + 1)]
    q = rows * (rows + 2) * sum(r * r / (rows - k) for k, r in enumerate(rho, 1))
    return {
        "w": w.T.ravel().tolist(),
        "tau": tau.tolist(),
        "solution": solution.tolist(),
        "covariance": (variance * bread).ravel().tolist(),
        "singular_values": np.linalg.svd(w, compute_uv=False).tolist(),
        "scaled_singular_values": np.linalg.svd(w / scale, compute_uv=False).tolist(),
        "bandwidth": bandwidth,
        "newey_west": newey_west.ravel().tolist(),
        "autocorrelation": rho,
        "white": float(stats.chi2.sf(q, lags)),
        "quantile": float(stats.t.ppf(0.975, rows - columns)),
        "relative_absolute": float(
            100 * np.abs(e).sum() / np.abs(tau - tau.mean()).sum()
        ),
    }


def weighted():
    rng = np.random.default_rng(7)
    rows, columns = 120, 4
    sigmas = [0.1, 2.0]
    x = rng.normal(size=columns)
    ws = [rng.normal(size=(rows, columns)) for _ in sigmas]
    taus = [w @ x + s * rng.normal(size=rows) for w, s in zip(ws, sigmas)]
    share = 1 - columns / (rows * len(sigmas))
    weights = np.ones(len(sigmas))
    for _ in range(200):
        a = np.vstack([w * k for w, k in zip(ws, weights)])
        b = np.concatenate([t * k for t, k in zip(taus, weights)])
        solution = np.linalg.lstsq(a, b, rcond=None)[0]
        weights = np.array(
            [1 / np.sqrt(np.mean((t - w @ solution) ** 2) / share) for w, t in zip(ws, taus)]
        )
    return {
        "w": [w.T.ravel().tolist() for w in ws],
        "tau": [t.tolist() for t in taus],
        "solution": solution.tolist(),
        "sigmas": (1 / weights).tolist(),
    }


def filters():
    t = np.arange(400) * 0.004
    x = 0.3 * np.sin(2 * t) + 0.02 * np.sin(300 * t) + 0.1 * t * t
    rows = []
    for order, cutoff in [(1, 12.0), (2, 8.0), (4, 20.0), (5, 5.0), (8, 40.0)]:
        sos = signal.butter(order, cutoff, fs=250.0, output="sos")
        y = signal.sosfiltfilt(sos, x)
        rows.append({"order": order, "cutoff": cutoff, "y": y.tolist()})
    b, a = signal.butter(2, 8.0, fs=250.0)
    return {
        "t": t.tolist(),
        "x": x.tolist(),
        "filtered": rows,
        # by the transfer function itself instead of second-order sections
        "filtfilt_2_8": signal.filtfilt(b, a, x).tolist(),
    }


def fits():
    t = np.sort(np.random.default_rng(8).uniform(0, 3, 200))
    x = np.exp(-t) * np.sin(7 * t)
    frequency, harmonics = 1 / 3.3, 4
    basis = [np.ones_like(t)]
    for j in range(1, harmonics + 1):
        basis += [np.cos(2 * np.pi * frequency * j * t), np.sin(2 * np.pi * frequency * j * t)]
    c = np.linalg.lstsq(np.stack(basis, axis=1), x, rcond=None)[0]
    value, rate, acceleration = c[0] + 0 * t, 0 * t, 0 * t
    for j in range(1, harmonics + 1):
        w = 2 * np.pi * frequency * j
        a, b = c[2 * j - 1], c[2 * j]
        value += a * np.cos(w * t) + b * np.sin(w * t)
        rate += w * (b * np.cos(w * t) - a * np.sin(w * t))
        acceleration -= w * w * (a * np.cos(w * t) + b * np.sin(w * t))
    half = 0.4
    local = []
    for tk in t:
        if tk - half < t[0] or tk + half > t[-1]:
            local.append(None)
            continue
        s = t - tk
        # polyfit multiplies residuals, not their squares, by w
        weight = np.sqrt(np.clip(1 - np.abs(s / half) ** 3, 0, None) ** 3)
        p = np.polyfit(s, x, 3, w=weight)
        local.append([p[3], p[2], 2 * p[1]])
    return {
        "t": t.tolist(),
        "x": x.tolist(),
        "frequency": frequency,
        "harmonics": harmonics,
        "fourier": [value.tolist(), rate.tolist(), acceleration.tolist()],
        "half_width": half,
        "local": local,
    }


vectors = {
    "least_squares": least_squares(),
    "weighted": weighted(),
    "filters": filters(),
    "fits": fits(),
}
out = pathlib.Path(__file__).resolve().parents[2] / "fixtures/computed/estimation.json"
out.write_text(json.dumps(vectors) + "\n")
