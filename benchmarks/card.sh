#!/usr/bin/env bash
# All that is measured on a graphics card, in about ten minutes: tests, whole steps at 1, 10, 50 and 100 million
# particles, the pressure solver. What each part prints goes to a file of its own in the folder OUT.
#
#     DEVICE=cuda OUT=card bash benchmarks/card.sh [part …]
#
# Parts: tests, large, one, ten, solver, fifty; default: all, in that order. `large` is set up, on the processor, while
# the tests run, and takes 135 GB of the card's memory in single precision, `fifty` 100 GB in double.
set -u
cd "$(dirname "$0")/.."
DEVICE=${DEVICE:-cuda}
OUT=${OUT:-card}
WORKERS=${WORKERS:-$(($(nproc) * 3 / 4))}
export PYTHONPATH="$PWD/src:$PWD/benchmarks${PYTHONPATH:+:$PYTHONPATH}" SPUME_DEVICE=$DEVICE PYTHONUNBUFFERED=1
mkdir -p "$OUT"

steps() { # name, spacing [m], steps
    python3 -m spume bench dam-break-3d --spacing "$2" --steps "$3" --device "$DEVICE" --json "$OUT/$1.json" >"$OUT/$1.log" 2>&1
}

solver() { # name, rows, arrangements
    python3 benchmarks/solver_scaling.py --device "$DEVICE" --dimensions 3 --sizes "$2" --arrangements "${@:3}" \
        --json "$OUT/$1.json" >"$OUT/$1.log" 2>&1
}

part() {
    case $1 in
    tests)
        python3 -m pytest --device "$DEVICE" -n "$WORKERS" -q --maxfail=20 -p no:cacheprovider tests/pressure \
            tests/schemes tests/steps tests/bodies tests/motion tests/test_{devices,search,pairs,chunks,resume}.py \
            tests/test_{invariance,physics,moving_tanks,gravity,lanes,launch,fast_start}.py >"$OUT/tests.log" 2>&1
        ;;
    large)
        python3 benchmarks/large_run.py --spacing 0.000683 --device "$DEVICE" --precision single --steps 9 \
            >"$OUT/large.log" 2>&1
        ;;
    one) steps one 0.003 20 ;;
    ten) steps ten 0.00139 10 ;;
    fifty) steps fifty 0.000814 6 ;;
    solver)
        solver solver-1e6 1e6 column film
        solver solver-1e7 1e7 column
        ;;
    *)
        echo "no part $1" >&2
        exit 2
        ;;
    esac
    echo "$SECONDS s: $1 ended with $?"
    tail -n 25 "$OUT/$1"*.log
}

asked=("$@")
[ $# -eq 0 ] && asked=(tests large one ten solver fifty)
for name in "${asked[@]}"; do
    if [ "$name" = large ] && [[ " ${asked[*]} " == *" tests "* ]]; then
        wait # begun with the tests
        continue
    fi
    [ "$name" = tests ] && [[ " ${asked[*]} " == *" large "* ]] && part large &
    part "$name"
done
wait
