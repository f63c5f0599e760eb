"""Identifies a robot from many logs: a map and a merge on Dask distributed.

    pip install distributed
    python tests/tools/fleet/fleet.py --regen target/release/regen robots/fivebar.yaml \
        logs/*.csv --reading="--fourier 0.2,5"

A worker process reduces every log to its factors by `regen observe`; the size of the factors is
small and does not depend on the log's length. `regen identify --from` merges them here,
in any order with the same result. When a worker dies, only its current logs are lost, and another
worker repeats them. With --scheduler ADDRESS the workers are those of a running cluster, which
must see the logs at the same paths and have `regen`.
"""

import argparse
import json
import pathlib
import shlex
import subprocess
import tempfile

from distributed import Client, LocalCluster, as_completed


def observe(regen, spec, log, reading):
    """Returns the text of the factor file of one log. Runs in a worker."""
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "factors.json"
        command = [regen, "observe", spec, log, "--out", str(out), *reading]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{log}: {done.stderr.strip()}")
        return out.read_text()


def identify(client, regen, spec, logs, reading, on_result=None):
    """Returns the JSON of `regen identify` from all logs; calls on_result after each log."""
    futures = client.map(
        lambda log: observe(regen, spec, log, reading), logs, pure=False, retries=3
    )
    with tempfile.TemporaryDirectory() as folder:
        files = []
        for future, text in as_completed(futures, with_results=True):
            files.append(pathlib.Path(folder) / f"{len(files)}.json")
            files[-1].write_text(text)
            if on_result is not None:
                on_result(len(files))
        command = [regen, "identify", spec, "--format", "json", "--from", *map(str, files)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return json.loads(done.stdout)


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--regen", default="regen", help="the command")
    parser.add_argument("--workers", type=int, default=2, help="processes on this machine")
    parser.add_argument("--scheduler", help="address of a cluster instead of local processes")
    parser.add_argument("--reading", default="", help="options of `regen observe`, quoted")
    parser.add_argument("spec")
    parser.add_argument("logs", nargs="+")
    args = parser.parse_args()
    regen = args.regen
    if "/" in regen:
        regen = str(pathlib.Path(regen).resolve())
    spec = str(pathlib.Path(args.spec).resolve())
    logs = [str(pathlib.Path(log).resolve()) for log in args.logs]
    if args.scheduler:
        with Client(args.scheduler) as client:
            found = identify(client, regen, spec, logs, shlex.split(args.reading))
    else:
        with (
            LocalCluster(
                n_workers=args.workers,
                threads_per_worker=1,
                processes=True,
                dashboard_address=None,
            ) as cluster,
            Client(cluster) as client,
        ):
            found = identify(client, regen, spec, logs, shlex.split(args.reading))
    for row in found["parameters"]:
        print(f"{row['label']:12} {row['value']:14.6e} {row['sigma']:10.2e} {row['unit']}")


if __name__ == "__main__":
    main()
