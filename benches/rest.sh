#!/usr/bin/env bash
# What a REST request costs beside other services: the same frames posted to each in turn, round after
# round, on one machine. Run it as benches/rest.sh; it needs wrk, and takes from the environment:
#
#   PYTHON       a Python with the packages of the peer in Python; without it that peer is left out
#   CEILING      the binary of the peer that only decodes; without it that peer is left out
#   PEERS        the folder of the peers' sources [../shared/peers]
#   CAMERA       whose frames: std or omni [std]
#   WORK         where the frames and the models are made [target/rest]
#   ROUNDS       of which the medians are printed [5]
#   DURATION     of one service in one round, in seconds [4]
#   CONNECTIONS  a list of numbers of connections [1 8]
#
# Of roomsight there are two: with the default model, and with FAST's threshold fixed to 20 as in the peer
# in Python, whose fewer keypoints on these frames are less work.
#
# CPU time is what the service's processes used, divided by its requests. On a machine that others use as
# well, trust it and the ratios within one run; rates and latencies are the machine's of that moment.
set -euo pipefail
cd "$(dirname "$0")/.."
PYTHON=${PYTHON:-} CEILING=${CEILING:-} PEERS=${PEERS:-../shared/peers} CAMERA=${CAMERA:-std}
WORK=${WORK:-target/rest}/$CAMERA ROUNDS=${ROUNDS:-5} DURATION=${DURATION:-4} CONNECTIONS=${CONNECTIONS:-1 8}
ROOMSIGHT=target/release/roomsight
LAB=$WORK/lab/cold-saarbruecken/part_b
export FRAMES=$LAB/seq3_cloudy2/${CAMERA}_cam

names=() urls=() pids=()
trap 'kill "${pids[@]}" 2>/dev/null || true; wait' EXIT

main() {
    command -v wrk >/dev/null || fail "wrk is not on the PATH: install the package wrk."
    [ -z "$PYTHON" ] || [ -f "$PEERS/service.py" ] ||
        fail "$PEERS has no service.py: set PEERS to the folder of the peers."
    [ -z "$CEILING" ] || [ -x "$CEILING" ] || fail "$CEILING cannot be run: set CEILING to the peer's binary."
    mkdir -p "$WORK"
    start_roomsight
    if [ -n "$PYTHON" ]; then start_python_peer; else
        echo "Without the peer in Python: set PYTHON to a Python with the packages in $PEERS/README.md." >&2
    fi
    if [ -n "$CEILING" ]; then start_ceiling; else
        echo "Without the peer that only decodes: build $PEERS/axum_ceiling, set CEILING to the binary." >&2
    fi
    local round connections service
    for round in $(seq 0 "$ROUNDS"); do
        echo "round $round of $ROUNDS" >&2
        for connections in $CONNECTIONS; do
            for service in "${!names[@]}"; do
                measure "$service" "$connections"
            done
        done
    done >"$WORK/measured"
    # The first round only warms up.
    tail -n +$((${#names[@]} * $(wc -w <<<"$CONNECTIONS") + 1)) "$WORK/measured" | summarize
}

fail() {
    echo "$1" >&2
    exit 1
}

start_roomsight() {
    cargo build --release --quiet
    "$ROOMSIGHT" simulate "$WORK/lab" --illumination cloudy1,cloudy2 --camera "$CAMERA" \
        --frames-per-second 0.5 >&2
    rm -rf "$WORK/models"
    "$ROOMSIGHT" train "$WORK/lab" -o "$WORK/models/default/1" >"$WORK/train.log"
    "$ROOMSIGHT" train "$WORK/lab" -o "$WORK/models/fast20/1" --set detector.threshold.fixed=20 \
        >>"$WORK/train.log"
    start roomsight 9180 /v1/recognize?model=default \
        "$ROOMSIGHT" serve --models "$WORK/models" --listen 127.0.0.1:9180 --set log_level=warn
    names+=(roomsight_fast20) urls+=("${urls[0]/default/fast20}") pids+=("${pids[0]}")
}

start_python_peer() {
    local sequence folder
    {
        echo file,place,sequence,camera,split
        for sequence in seq3_cloudy1 seq3_cloudy2; do
            folder=$(realpath "$LAB/$sequence")
            sed "s|\(.*\) \(.*\)|$folder/${CAMERA}_cam/\1,\2,$sequence,,|" "$folder/localization/places.lst"
        done
    } >"$WORK/frames.csv"
    local environment=(env MODE=orb "MODEL=$(realpath "$WORK")/peer_orb.pkl" PYTHONDONTWRITEBYTECODE=1)
    "${environment[@]}" "$PYTHON" "$PEERS/service.py" train "$WORK/frames.csv" >&2
    start python_orb 9102 /recognize "${environment[@]}" "$PYTHON" -m uvicorn --app-dir "$PEERS" service:app \
        --workers 2 --loop uvloop --http httptools --port 9102 --no-access-log
}

start_ceiling() {
    start decode_only 9101 /turbo_ry "$CEILING" 2
}

# start NAME PORT PATH COMMAND...: starts a service and waits until it listens.
start() {
    local name=$1 port=$2 path=$3
    shift 3
    (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && fail "port $port is taken: stop what listens there."
    "$@" >"$WORK/$name.log" 2>&1 &
    names+=("$name") urls+=("http://127.0.0.1:$port$path") pids+=($!)
    local attempt
    for attempt in $(seq 100); do
        (exec 3<>"/dev/tcp/127.0.0.1/$port") 2>/dev/null && return
        sleep 0.2
    done
    fail "$name does not start; see $WORK/$name.log"
}

# measure SERVICE CONNECTIONS: one line: name, connections, CPU ticks, and what post.lua prints.
measure() {
    local before after line
    before=$(cpu_ticks "${pids[$1]}")
    line=$(wrk -t1 -c"$2" -d"$DURATION" --timeout 20s --latency -s benches/post.lua "${urls[$1]}" | tail -n 1)
    after=$(cpu_ticks "${pids[$1]}")
    echo "${names[$1]} $2 $((after - before)) $line"
}

# User and system time of a process and its descendants.
cpu_ticks() {
    for pid in $(process_tree "$1"); do
        sed 's/.*) //' "/proc/$pid/stat"
    done | awk '{ ticks += $12 + $13 } END { print ticks }'
}

process_tree() {
    echo "$1"
    local child
    for child in $(pgrep -P "$1"); do
        process_tree "$child"
    done
}

# Medians over the rounds. The ratio is to the peer in Python in the same round, at as many connections.
summarize() {
    awk -v ticks_per_second="$(getconf CLK_TCK)" '
        function median(text,    values, n, i, j, larger) {
            n = split(text, values, " ")
            for (i = 1; i <= n; i++)
                for (j = i + 1; j <= n; j++)
                    if (values[j] + 0 < values[i] + 0) {
                        larger = values[i]; values[i] = values[j]; values[j] = larger
                    }
            return (values[int((n + 1) / 2)] + values[int(n / 2) + 1]) / 2
        }
        function ratios(row, peer,    round, text) {
            for (round = 1; round <= n_rounds[peer]; round++) text = text " " cpu[row, round] / cpu[peer, round]
            return text
        }
        $4 == 0 { print $1 " answered nothing" > "/dev/stderr"; failed = 1; exit }
        {
            row = $1 " " $2
            if (!n_rounds[row]++) rows[++n_rows] = row
            cpu[row, n_rounds[row]] = $3 / ticks_per_second * 1000 / $4
            cpus[row] = cpus[row] " " cpu[row, n_rounds[row]]
            n_errors[row] += $5
            rates[row] = rates[row] " " $6; p50s[row] = p50s[row] " " $7; p99s[row] = p99s[row] " " $8
        }
        END {
            if (failed) exit 1
            columns = "%-17s %11s %14s %8s %10s %7s %7s %6s\n"
            printf columns, "service", "connections", "CPU ms/request", "x Python", "requests/s", \
                "p50 ms", "p99 ms", "errors"
            for (i = 1; i <= n_rows; i++) {
                row = rows[i]; split(row, key, " "); peer = "python_orb " key[2]
                ratio = n_rounds[peer] ? sprintf("%.2f", median(ratios(row, peer))) : "-"
                printf columns, key[1], key[2], sprintf("%.2f", median(cpus[row])), ratio, \
                    sprintf("%.0f", median(rates[row])), sprintf("%.1f", median(p50s[row])), \
                    sprintf("%.1f", median(p99s[row])), n_errors[row]
            }
        }'
}

main
