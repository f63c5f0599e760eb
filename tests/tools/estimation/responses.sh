#!/bin/sh
# The five-bar of the guide at the setting at which other programs were tried: 5 s at 400 Hz, noise of
# 1e-5 rad and 0.01 N m, bodies and friction up to 10 % off the start. Prints for each estimator the
# error of inertias, moments and friction in percent of the truth's norm, over some seeds, and the time.
#
#     tests/tools/estimation/responses.sh [SEEDS] [target/release/regen]
set -eu
seeds=${1:-20}
regen=$(realpath "${2:-target/release/regen}")
spec=$(realpath runtime/guide/fivebar/fivebar.yaml)
cd "$(mktemp -d)"
"$regen" excite "$spec" --harmonics 5 --frequency 0.2 --starts 1 --seed 1 --out m.json > excite.txt 2>&1
same="--trajectory m.json --settle 5 --duration 5 --bandwidth 20 --step 0.0025"
for seed in $(seq "$seeds"); do
    # shellcheck disable=SC2086
    "$regen" simulate "$spec" $same --perturb 0.1 --seed "$seed" --noise 1e-5,0.01 --commands \
        --controller gains.yaml --out "log$seed.csv" > simulate.txt 2>&1
    # shellcheck disable=SC2086
    "$regen" simulate "$spec" $same --perturb 0.1 --seed "$seed" --exact --out exact.csv > simulate.txt 2>&1
    "$regen" identify "$spec" exact.csv --no-suspicion --out "truth$seed.json" > identify.txt 2>&1
done
for options in "--butterworth 4,20" "--estimator didim --controller gains.yaml" \
    "--estimator response --controller gains.yaml"; do
    start=$(date +%s.%N)
    for seed in $(seq "$seeds"); do
        # shellcheck disable=SC2086
        "$regen" identify "$spec" "log$seed.csv" $options --no-suspicion --out "found$seed.json" > identify.txt 2>&1
    done
    end=$(date +%s.%N)
    python3 - "$options" "$seeds" "$start" "$end" <<'PY'
import json, math, sys
options, seeds, start, end = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
sums, within, ratios = {"I": 0.0, "m": 0.0, "F": 0.0}, 0, []
for seed in range(1, seeds + 1):
    rows = lambda name: {p["label"]: p for p in json.load(open(f"{name}{seed}.json"))["parameters"]}
    truth, found = rows("truth"), rows("found")
    for kind in sums:
        labels = [k for k in truth if k.startswith(kind)]
        error = sum((found[k]["value"] - truth[k]["value"]) ** 2 for k in labels)
        sums[kind] += error / sum(truth[k]["value"] ** 2 for k in labels)
    own = [abs(found[k]["value"] - truth[k]["value"]) / found[k]["sigma"] for k in truth]
    ratios += own
    within += max(own) <= 3
rms = {kind: 100 * math.sqrt(x / seeds) for kind, x in sums.items()}
print(f"{options}: inertias {rms['I']:.2f} %, moments {rms['m']:.2f} %, friction {rms['F']:.2f} %; "
      f"all within 3 sigma in {within} of {seeds}; {(end - start) / seeds:.2f} s each")
PY
done
