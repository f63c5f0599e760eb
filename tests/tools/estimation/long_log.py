"""Writes a long log of the 3-RPS as CSV; the arguments are the number of rows and the file.

    python tests/tools/estimation/long_log.py 10000000 long.csv
    /usr/bin/time -v regen observe robots/3rps.yaml long.csv --out long.json --local 0.01

For measuring memory and time only: the forces are arbitrary, so the parameters are meaningless.
Measured with these two commands on two virtual cores of an AMD EPYC (Zen 4): 81 MB at most, of
which 64 MiB are the first rows, kept until they are too many; 24 s of CPU.
"""

import math
import sys


def main():
    """Writes the file."""
    rows, name = int(sys.argv[1]), sys.argv[2]
    # one period of 10 s at 1 kHz, repeated
    period = []
    for k in range(10_000):
        w = 2 * math.pi * k / 10_000
        legs = [
            0.6 + 0.03 * math.sin(w + 2 * i) + 0.01 * math.sin(5 * w + i) for i in range(3)
        ]
        forces = [60 + 20 * math.cos(3 * w + i) + math.sin(40 * w * (i + 1)) for i in range(3)]
        period.append(",".join(f"{x:.9f}" for x in legs + forces))
    with open(name, "w", encoding="ascii") as out:
        out.write("t,q2,q7,q9,tau_q2,tau_q7,tau_q9\n")
        for start in range(0, rows, 10_000):
            count = min(10_000, rows - start)
            out.write(
                "".join(f"{(start + k) * 1e-3:.3f},{period[k]}\n" for k in range(count))
            )


if __name__ == "__main__":
    main()
