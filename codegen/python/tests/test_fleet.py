"""Factors of many logs from several processes: the same bits, also when a worker dies."""

import os
import signal

import numpy as np
import pytest

import regen
from conftest import ROOT

ROBOT = str(ROOT / "runtime" / "guide" / "fivebar" / "fivebar.yaml")
#: The number of logs.
COUNT = 200 if os.environ.get("REGEN_FULL") else 12


@pytest.fixture(scope="module")
def paths(picker, tmp_path_factory):
    """Logs of one robot, which differ in their noise."""
    folder = tmp_path_factory.mktemp("fleet")
    rng = np.random.default_rng(3)
    t = np.arange(0, 5, 0.01)
    angle = 2 * np.pi * 0.2 * t[:, None, None] * np.arange(1, 4)
    out = []
    for k in range(COUNT):
        a, b = rng.uniform(-0.08, 0.08, (2, 1, 2, 3))
        w = 2 * np.pi * 0.2 * np.arange(1, 4)
        q = [2.2, 0.94] + (a * np.sin(angle) + b * np.cos(angle)).sum(2)
        qd = (w * (a * np.cos(angle) - b * np.sin(angle))).sum(2)
        qdd = (-(w**2) * (a * np.sin(angle) + b * np.cos(angle))).sum(2)
        tau = picker.inverse_dynamics(q, qd, qdd) + 0.02 * rng.normal(size=q.shape)
        columns = {"t": t, "q1": q[:, 0], "q3": q[:, 1], "tau_q1": tau[:, 0], "tau_q3": tau[:, 1]}
        out.append(str(folder / f"{k}.csv"))
        regen.Log(columns).write(out[-1])
    return out


def observed(path):
    """The map: runs in a worker."""
    return regen.observe(ROBOT, path, fourier=(0.2, 3))


def merged(factors):
    """The reduce: runs in a worker."""
    return regen.Factors.merged(factors)


@pytest.fixture(scope="module")
def here(paths):
    """The same in this process."""
    return regen.Factors.merged(map(observed, paths))


def test_processes_give_the_same_bits(paths, here):
    import concurrent.futures
    import multiprocessing

    context = multiprocessing.get_context("spawn")
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=context) as pool:
        found = regen.Factors.merged(pool.map(observed, paths[::-1]))
    assert found == here and found.digest() == here.digest()


def test_dask_gives_the_same_bits_where_a_worker_dies(paths, here, picker):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = client.run(os.getpid)
        parts = client.map(observed, paths, pure=False, retries=3)
        next(iter(distributed.as_completed(parts)))
        os.kill(next(iter(pids.values())), signal.SIGKILL)
        # a tree of merges, each in a worker
        while len(parts) > 1:
            pairs = [parts[k : k + 4] for k in range(0, len(parts), 4)]
            parts = [client.submit(merged, pair, pure=False, retries=3) for pair in pairs]
        found = parts[0].result(timeout=300)
    assert found.digest() == here.digest()
    own = picker.identify(here)
    assert picker.identify(found).data == own.data and len(own.labels) == len(picker.base)


def test_ray_gives_the_same_bits_where_a_worker_dies(paths, here):
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False)
    try:
        once = str(ROOT / "target" / f"ray-{os.getpid()}")

        def mapped(path, dies):
            if dies and not os.path.exists(once):
                with open(once, "w", encoding="utf-8"):
                    pass
                os.kill(os.getpid(), signal.SIGKILL)
            return regen.observe(ROBOT, path, fourier=(0.2, 3))

        remote = ray.remote(max_retries=3)(mapped)
        parts = [remote.remote(path, k == 3) for k, path in enumerate(paths)]
        found = regen.Factors.merged(ray.get(parts))
        assert os.path.exists(once)
        os.remove(once)
    finally:
        ray.shutdown()
    assert found.digest() == here.digest()
