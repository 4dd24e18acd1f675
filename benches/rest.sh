#!/usr/bin/env bash
# What a REST request costs beside other services: the same frames posted to each in turn, round after
# round, on one machine. Run it as benches/rest.sh; it needs wrk, and takes from the environment:
#
#   PYTHON       a Python with the packages of the peer in Python; without it that peer is left out
#   CEILING      the binary of the peer that only decodes; without it that peer is left out
#   PEERS        the folder of the peers' sources [../shared/peers]
#   WORK         where the frames and the models are made [target/rest]
#   ROUNDS       of which the medians are printed [5]
#   DURATION     of one service in one round, in seconds [4]
#   CONNECTIONS  a list of numbers of connections [1 8]
#
# CPU time is what the service's processes used, divided by its requests. On a machine that others use as
# well, trust it and the ratios within one run; rates and latencies are the machine's of that moment.
set -euo pipefail
cd "$(dirname "$0")/.."
PYTHON=${PYTHON:-} CEILING=${CEILING:-} PEERS=${PEERS:-../shared/peers} WORK=${WORK:-target/rest}
ROUNDS=${ROUNDS:-5} DURATION=${DURATION:-4} CONNECTIONS=${CONNECTIONS:-1 8}
ROOMSIGHT=target/release/roomsight
LAB=$WORK/lab/cold-saarbruecken/part_b
export FRAMES=$LAB/seq3_cloudy2/std_cam

names=() urls=() pids=()
trap 'kill "${pids[@]}" 2>/dev/null || true' EXIT

main() {
    command -v wrk >/dev/null || fail "wrk is not on the PATH: install the package wrk."
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
    "$ROOMSIGHT" simulate "$WORK/lab" --illumination cloudy1,cloudy2 --camera std --frames-per-second 0.5 >&2
    rm -rf "$WORK/models"
    "$ROOMSIGHT" train "$WORK/lab" -o "$WORK/models/lab/1" >"$WORK/train.log"
    start roomsight 9180 /v1/recognize \
        "$ROOMSIGHT" serve --models "$WORK/models" --listen 127.0.0.1:9180 --set log_level=warn
}

start_python_peer() {
    [ -f "$PEERS/service.py" ] || fail "$PEERS has no service.py: set PEERS to the folder of the peers."
    local sequence folder
    {
        echo file,place,sequence,camera,split
        for sequence in seq3_cloudy1 seq3_cloudy2; do
            folder=$(realpath "$LAB/$sequence")
            sed "s|\(.*\) \(.*\)|$folder/std_cam/\1,\2,$sequence,perspective,|" "$folder/localization/places.lst"
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

# Medians over the rounds; the ratio is to the peer in Python at the same number of connections.
summarize() {
    awk -v ticks_per_second="$(getconf CLK_TCK)" '
        function median(text,    values, n, i, j, swap) {
            n = split(text, values, " ")
            for (i = 1; i <= n; i++) for (j = i + 1; j <= n; j++) if (values[j] + 0 < values[i] + 0) {
                swap = values[i]; values[i] = values[j]; values[j] = swap
            }
            return (values[int((n + 1) / 2)] + values[int(n / 2) + 1]) / 2
        }
        {
            row = $1 " " $2
            if (!(row in cpu)) rows[++n_rows] = row
            if ($4 == 0) { print $1 " answered nothing" > "/dev/stderr"; failed = 1; exit }
            cpu[row] = cpu[row] " " $3 / ticks_per_second * 1000 / $4
            errors[row] += $5; rate[row] = rate[row] " " $6; p50[row] = p50[row] " " $7; p99[row] = p99[row] " " $8
        }
        END {
            if (failed) exit 1
            format = "%-12s %11s %14s %9s %11s %8s %8s %7s\n"
            printf format, "service", "connections", "CPU ms/request", "x Python", "requests/s", "p50 ms", "p99 ms", "errors"
            for (i = 1; i <= n_rows; i++) {
                row = rows[i]; split(row, key, " "); peer = "python_orb " key[2]
                ratio = peer in cpu ? sprintf("%.2f", median(cpu[row]) / median(cpu[peer])) : "-"
                printf format, key[1], key[2], sprintf("%.2f", median(cpu[row])), ratio, \
                    sprintf("%.0f", median(rate[row])), sprintf("%.1f", median(p50[row])), \
                    sprintf("%.1f", median(p99[row])), errors[row]
            }
        }'
}

main
