#!/usr/bin/env python3
"""Runs `regen` on measured logs of real machines and holds its figures against aims.

The logs are other people's and are not in the repository: MEASURED names the folder that holds
them; without it, ../shared/measured beside the repository is taken where it exists. REGEN names
the command, target/release/regen by default. Only the standard library is needed.

    python3 tests/measured/measured.py [NAME...]

prints one line for each figure, with its aim, and ends with 1 where one is missed. RECORD.md keeps
what came out, with the machine and the date.
"""

import csv
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
REGEN = os.environ.get("REGEN", str(ROOT / "target/release/regen"))

UR_JOINTS = [
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
]
# N m/A, of published.txt beside the logs
UR_GAINS = [10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232]
UR_COLUMNS = [
    word
    for k, (joint, gain) in enumerate(zip(UR_JOINTS, UR_GAINS), 1)
    for word in ("--column", f"tau_{joint}=i{k}:A*{gain}")
]
UR_READING = ["--butterworth", "5,7", "--problems", "drop", *UR_COLUMNS]


class Missed(Exception):
    """A command that failed."""


def regen(*words, codes=(0,)):
    """Runs the command; its output and messages."""
    ran = subprocess.run([REGEN, *map(str, words)], capture_output=True, text=True, check=False)
    if ran.returncode not in codes:
        raise Missed(f"exit {ran.returncode}: {' '.join(map(str, words))}\n{ran.stderr[-800:]}")
    return ran.stdout, ran.stderr


def identify(*words, codes=(0,)):
    """The JSON of `regen identify`."""
    return json.loads(regen("identify", *words, "--format", "json", codes=codes)[0])


def outside(result):
    """Values that lie outside their own interval."""
    rows = list(result["parameters"]) + list(result.get("physical") or [])
    count = 0
    for row in rows:
        low, high = row.get("low"), row.get("high")
        if low is not None and high is not None and not low <= row["value"] <= high:
            count += 1
    return count


def rise(result):
    """By how much the physical model's residuals are above least squares', percent of their rms."""
    text = result["models"][-1]["feasibility"]
    found = re.search(r"\+?([0-9.]+(?:e-?\d+)?) %", text)
    if not found:
        raise Missed(f"no rise in: {text}")
    return float(found.group(1))


class Cases:
    """All figures, by machine."""

    def __init__(self, folder, scratch):
        self.folder, self.scratch = folder, scratch
        self.failed = 0

    def figure(self, name, value, aim, holds):
        mark = "ok" if holds else "MISSED"
        self.failed += not holds
        print(f"{mark:7} {name}: {value} (aim {aim})", flush=True)

    def within(self, name, value, aim, by):
        self.figure(name, f"{value:.3f}", f"{aim} +-{by}", abs(value - aim) <= by)

    # UR10e -------------------------------------------------------------------------------------

    def ur10e(self):
        folder = self.folder / "ur10e"
        spec, log = folder / "ur10e_off.yaml", folder / "id50_l.csv"
        out = self.scratch / "ur10e.json"
        fit = identify(spec, log, *UR_READING, "--out", out)
        self.figure("UR10e least squares: values outside", outside(fit), 0, outside(fit) == 0)
        told = fit.get("suspicions", [])
        self.figure("UR10e suspicions", told, "none", not told)
        checked = regen("validate", spec, out, folder / "id40_l.csv", *UR_READING, "--format", "json")
        on40 = json.loads(checked[0])["models"][0]["logs"][0]["relative_rms"]
        self.figure("UR10e id40, rms of all efforts in percent", f"{on40:.2f}", "<= 4.00", on40 <= 4.0)
        self.rests(spec, fit)

    def rests(self, spec, cropped):
        """The log with its rests gives the parameters of the one without, within its intervals."""
        raw = self.folder / "ur10e" / "ur-20_02_12-50sec_12harm.csv"
        whole = self.scratch / "whole.csv"
        resampled(raw, whole)
        fit = identify(spec, whole, *UR_READING)
        rows = zip(cropped["parameters"], fit["parameters"])
        off = [a["label"] for a, b in rows if not a["low"] <= b["value"] <= a["high"]]
        self.figure("UR10e with rests: outside the cropped log's intervals", off, "none", not off)

    def ur10e_intervals(self):
        folder = self.folder / "ur10e"
        log = folder / "id50_l.csv"
        text = (folder / "ur10e_off.yaml").read_text()
        for law in ("atan", "power", "stribeck"):
            spec = self.scratch / f"ur10e_{law}.yaml"
            spec.write_text(text.replace("friction: coulomb_asymmetric", f"friction: {law}"))
            fit = identify(spec, log, *UR_READING, "--friction")
            self.figure(f"UR10e --friction {law}: values outside", outside(fit), 0, outside(fit) == 0)
        for option in ("--reduce", "--feasible"):
            fit = identify(folder / "ur10e_off.yaml", log, *UR_READING, option)
            self.figure(f"UR10e {option}: values outside", outside(fit), 0, outside(fit) == 0)

    # dVRK --------------------------------------------------------------------------------------

    def dvrk(self):
        folder = self.folder / "dvrk"
        bounds = {
            "m(1)": "0.5..20",
            "m(2)": "0.5..15",
            "m(30)": "0.3..5",
            "m(31)": "0.5..10",
            "m(32)": "0.05..2",
            "m(4)": "0.05..2",
            "m(5)": "0.05..1",
            "m(6)": "0.05..0.5",
            "m(7)": "0.02..0.5",
        }
        nine = [word for label, limits in bounds.items() for word in ("--bound", f"{label}={limits}")]
        cases = [
            ("MTM", "mtm.yaml", "mtm_one_filtered.csv", [], 7.53),
            ("MTM, nine bounds", "mtm.yaml", "mtm_one_filtered.csv", nine, 7.60),
            ("MTM with spring and offsets", "mtm_full.yaml", "mtm_one_filtered.csv", [], 4.10),
            ("PSM with spring and offsets", "psm_full.yaml", "psm_one_filtered.csv", [], 5.16),
            ("PSM", "psm.yaml", "psm_one_filtered.csv", [], 14.90),
        ]
        for name, spec, log, more, aim in cases:
            words = [folder / spec, folder / log, "--problems", "drop", "--standstill", "keep"]
            fit = identify(*words, "--feasible", *more)
            self.within(f"{name}: rise of the rms in percent", rise(fit), aim, 0.05)
            gap = fit["models"][-1]["gap"]
            self.figure(f"{name}: gap", f"{gap:.1e}", "<= 1e-4", gap <= 1e-4)
            self.figure(f"{name}: values outside", outside(fit), 0, outside(fit) == 0)

    # small -------------------------------------------------------------------------------------

    def small(self):
        folder = self.folder / "small"
        column = ["--column", "q1=q1:rad*0.022222222222222223", "--butterworth", "4,100"]
        for name in ("still2_0.3", "still2_1.234567", "still2_-70.686"):
            words = [folder / "still2.yaml", folder / "still2.json", folder / f"{name}.csv", *column]
            words += ["--standstill", "keep", "--format", "json"]
            found = json.loads(regen("validate", *words)[0])
            rms = found["models"][0]["logs"][0]["efforts"][0]["rms"]
            self.figure(f"{name}: rms at rest, N m", f"{rms:.1e}", "<= 1e-3", rms <= 1e-3)


def resampled(raw, out):
    """Writes the UR10e's raw file, whose steps are 10 and 12 ms, at 100 Hz with a header."""
    rows = []
    with open(raw, newline="") as file:
        for line in csv.reader(file):
            row = [float(x) for x in line]
            if not rows or row[0] > rows[-1][0]:
                rows.append(row)
    columns = [*range(1, 7), *range(13, 19)]
    start, at, k = rows[0][0], 0, 0
    with open(out, "w", newline="") as file:
        file.write(",".join(["t", *UR_JOINTS, *(f"i{n}" for n in range(1, 7))]) + "\n")
        while start + 0.01 * k <= rows[-1][0]:
            t = start + 0.01 * k
            while at + 2 < len(rows) and rows[at + 1][0] <= t:
                at += 1
            a, b = rows[at], rows[at + 1]
            part = (t - a[0]) / (b[0] - a[0])
            values = [a[c] + part * (b[c] - a[c]) for c in columns]
            file.write(",".join(f"{x:.9f}" for x in [0.01 * k, *values]) + "\n")
            k += 1


def main():
    folder = Path(os.environ.get("MEASURED", ROOT.parent / "shared/measured"))
    if not folder.is_dir():
        print(f"left out: no folder {folder}; name one in MEASURED")
        return 0
    wanted = sys.argv[1:] or ["small", "ur10e", "ur10e_intervals", "dvrk"]
    with tempfile.TemporaryDirectory() as scratch:
        cases = Cases(folder, Path(scratch))
        for name in wanted:
            try:
                getattr(cases, name)()
            except Missed as why:
                cases.failed += 1
                print(f"MISSED  {name}: {why}", flush=True)
    return 1 if cases.failed else 0


if __name__ == "__main__":
    sys.exit(main())
