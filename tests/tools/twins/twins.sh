#!/bin/sh
# Simulated twins of the machines of robots/measured, rehearsed: how often each base parameter (gain,
# value of a payload) is within 3 sigma of the truth, by estimator. Prints a line for each, and keeps all figures as JSON.
#
#     tests/tools/twins/twins.sh OUT [SEEDS] [regen] [MACHINES] [ESTIMATORS]
set -eu
out=$(mkdir -p "$1" && realpath "$1")
seeds=${2:-200}
regen=$(realpath "${3:-target/release/regen}")
machines=${4:-ur10e psm mtm}
estimators=${5:-ls iv didim}
here=$(realpath "$(dirname "$0")")
robots=$(realpath "$here/../../../robots/measured")
cd "$out"
for machine in $machines; do
    case $machine in
    ur10e)
        cp "$here/ur10e.yaml" .
        excite="--frequency 0.1"
        runs="--noise 1e-5,0.3 --step 0.01 --duration 20"
        filter="--butterworth 5,7" ;;
    ur10e_gains | ur10e_payload)
        # a load at the flange, without the constants of the description that is measured
        sed '/^home:/i\      - {type: fixed, origin: {rpy: [-pi/2, 0, 0]}, body: load, payload: true}' \
            "$here/ur10e.yaml" > "$machine.yaml"
        echo "  load: {mass: 2.805, com: [0.01, 0.02, 0.06], inertia: [0.008, 0, 0, 0.007, 0, 0.006]}" \
            >> "$machine.yaml"
        excite="--frequency 0.1 --payload carried"
        runs="--noise 1e-5,0.3 --step 0.01 --duration 20"
        case $machine in
        ur10e_gains) filter="$here/loads.yaml" ;;
        *) filter="$here/payload.yaml" ;;
        esac ;;
    psm)
        cat "$robots/psm.yaml" "$here/psm.bodies.yaml" > psm.yaml
        excite="--frequency 0.18 --limit q1.position=-1,1 --limit q2.position=-0.8,0.8 \
            --limit q3.position=0.05,0.24 --limit q4.position=-1.5,1.5 --limit q5.position=-1.2,1.2 \
            --limit q6.position=-1,1 --limit q7.position=-1,1 --limit q1.velocity=-2,2 \
            --limit q2.velocity=-2,2 --limit q3.velocity=-0.3,0.3 --limit q4.velocity=-3,3 \
            --limit q5.velocity=-3,3 --limit q6.velocity=-3,3 --limit q7.velocity=-3,3"
        runs="--parameters $here/psm.json --noise 1e-5,0.01 --step 0.005 --duration 11.1"
        filter="--butterworth 6,16.96" ;;
    mtm)
        cat "$robots/mtm.yaml" "$here/mtm.bodies.yaml" > mtm.yaml
        excite="--frequency 0.1 --limit q1.position=-1,1 --limit q2.position=-0.4,0.8 \
            --limit q3.position=-0.4,0.6 --limit q4.position=-1.5,1.5 --limit q5.position=-1.2,1.2 \
            --limit q6.position=-0.7,0.7 --limit q7.position=-2,2 --limit q1.velocity=-2,2 \
            --limit q2.velocity=-2,2 --limit q3.velocity=-2,2 --limit q4.velocity=-3,3 \
            --limit q5.velocity=-3,3 --limit q6.velocity=-3,3 --limit q7.velocity=-3,3"
        runs="--parameters $here/mtm.json --noise 1e-5,0.003 --step 0.01 --duration 20"
        filter="--butterworth 6,5.655" ;;
    esac
    # shellcheck disable=SC2086
    [ -e "$machine.motion.json" ] || "$regen" excite "$machine.yaml" $excite --harmonics 5 --samples 60 \
        --starts 1 --seed 1 --out "$machine.motion.json" > "$machine.excite.txt" 2>&1
    for estimator in $estimators; do
        start=$(date +%s)
        case $estimator in
        iv) options="$filter --estimator iv --reference" ;;
        didim)
            case $machine in
            ur10e_*)
                # simulated equations need no filter
                sed '/^process:/,/filter:/d' "$filter" > "$machine.didim.yaml"
                options="$machine.didim.yaml --estimator didim" ;;
            *) options="--estimator didim" ;;
            esac ;;
        *) options="$filter --estimator $estimator" ;;
        esac
        # shellcheck disable=SC2086
        "$regen" rehearse "$machine.yaml" --trajectory "$machine.motion.json" $runs $options --perturb 0.1 \
            --seeds "$seeds" --score 95 --format json > "$machine.$estimator.json" 2> "$machine.$estimator.txt" || true
        end=$(date +%s)
        python3 - "$machine" "$estimator" "$((end - start))" <<'PY'
import json, sys
machine, estimator, seconds = sys.argv[1:]
found = json.load(open(f"{machine}.{estimator}.json"))
rows = found["parameters"]
estimates = found["seeds"] - len(found["failed"])
low = [row["label"] for row in rows if 100 * row["within"] < 95 * found["seeds"]]
few = [row["label"] for row in rows if row["is_low"]]
share = lambda x: "-" if x is None else f"{x:.2f} %"
print(f"{machine} {estimator}: {found['seeds']} seeds, {len(found['failed'])} failed; within 3 sigma "
      f"{share(found['within'])}, least {found['least']:.1f} % ({found['lowest']}), below 95 %: {len(low)} of "
      f"{len(rows)}; in the {found['level']:g} % intervals {share(found['inside'])}, too few: {len(few)}; "
      f"{float(seconds) / max(estimates, 1):.1f} s a seed", flush=True)
if low:
    print("    " + ", ".join(f"{row['label']} {row['within']} (bias {row['bias']:.2f})" for row in rows if row["label"] in low))
PY
    done
done
