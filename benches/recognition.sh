#!/usr/bin/env bash
# What each opinion brings on real image sets: each alone, each pair, and all, or what --effort chooses.
#
#   benches/recognition.sh DATA OUT [OPTION...]
#
# DATA holds the sets tower, campus360, makerspace360, rooms6 and scenes15, each with a frames.csv. OUT gets one JSON
# file a set. Options go to `roomsight validate`: --each, --effort best, --config FILE. SETS="tower rooms6" takes some of
# the sets, ROOMSIGHT another program.
set -euo pipefail

data=${1:?where the image sets are} out=${2:?a folder for the results}
shift 2
program=${ROOMSIGHT:-target/release/roomsight}
sets=${SETS:-rooms6 few scenes15 makerspace360 campus360 tower}
mkdir -p "$out"

# measure NAME ARGUMENT...
measure() {
    local name=$1
    shift
    "$program" validate "$@" --json > "$out/$name.json"
    jq -r --arg set "$name" \
        '.[] | [$set, .test, .opinions, .rate.mean, .rate.std, .rate.best, .evaluations[0].overall.n_correct, .cost.features_ms, .cost.classify_ms, .cost.model_bytes, (.preferred // {} | tostring)] | @tsv' \
        "$out/$name.json"
}

for set in $sets; do
    case $set in
        tower) measure tower "$data/tower" --train-split gallery --test-split query "$@" ;;
        rooms6) measure rooms6 "$data/rooms6" --train-split train --test-split test "$@" ;;
        # Twelve photos a room, five draws.
        few) measure few "$data/rooms6" --train-split train --test-split test --train-frames 12 --seeds 5 "$@" ;;
        scenes15) measure scenes15 "$data/scenes15" --protocol random --train-frames 100 --seeds "${SEEDS:-10}" "$@" ;;
        campus360) measure campus360 "$data/campus360" --protocol leave-one-out "$@" ;;
        makerspace360)
            # Each year answers the others; frames of rooms that a year does not have count as wrong.
            for year in 2020 2023 2026; do
                others=$(printf '%s*\n' 2020 2023 2026 | grep -v "$year" | paste -sd,)
                measure "makerspace360-$year" "$data/makerspace360" --train "$year*" --test "$others" "$@"
            done
            ;;
        *) echo "no set is called $set" >&2; exit 1 ;;
    esac
done
