#!/usr/bin/env bash
# 300 robots, three services in network namespaces of their own, HAProxy before them, models in a bucket: what robots notice of a kill, a
# stop, a network that is cut, and an upgrade of program and model under load. Takes root, iproute2, haproxy, python3 with venv, and
#   ROOMSIGHT=target/release/roomsight LAB=simulated-lab FIRST=model-folder SECOND=model-folder [OLD=older-roomsight] benches/fleet.sh OUT
# FIRST serves until the upgrade, and SECOND after it. OLD is the program before the upgrade; without it the same one is started anew.
set -euo pipefail
OUT=${1:?where to write}
ROOMSIGHT=$(realpath "${ROOMSIGHT:-target/release/roomsight}") OLD=$(realpath "${OLD:-$ROOMSIGHT}") LAB=$(realpath "$LAB")
FIRST=$(realpath "$FIRST") SECOND=$(realpath "$SECOND") ROBOTS=${ROBOTS:-300} NET=10.77.0
mkdir -p "$OUT"; cd "$OUT"
export AWS_ACCESS_KEY_ID=rooms AWS_SECRET_ACCESS_KEY=rooms AWS_REGION=us-east-1 AWS_ENDPOINT_URL=http://$NET.1:5000
export ROOMSIGHT_RESUME_KEYS=0123456789abcdef0123456789abcdef

end() {
    kill $(jobs -p) 2>/dev/null || true
    for n in 1 2 3; do { ip netns pids room$n | xargs -r kill -9; ip netns del room$n; } 2>/dev/null || true; done
    ip link del rooms 2>/dev/null || true
}
trap end EXIT
end
ip link add rooms type bridge; ip addr add $NET.1/24 dev rooms; ip link set rooms up
for n in 1 2 3; do
    ip netns add room$n
    ip link add room$n type veth peer name eth0 netns room$n
    ip link set room$n master rooms up
    ip -n room$n addr add $NET.1$n/24 dev eth0; ip -n room$n link set eth0 up; ip -n room$n link set lo up
done

[ -x venv/bin/moto_server ] || { python3 -m venv venv; venv/bin/pip install -q --disable-pip-version-check 'moto[s3]' flask flask-cors; }
venv/bin/moto_server -H $NET.1 -p 5000 >bucket.log 2>&1 &
until curl -sf -o bucket.made -X PUT "$AWS_ENDPOINT_URL/rooms"; do sleep 0.2; done
"$OLD" models push "$FIRST" lab --models s3://rooms/models --models-cache cache-push -q

serve() { # NUMBER PROGRAM
    ip netns exec room$1 "$2" serve --models s3://rooms/models --listen $NET.1$1:8080 --allow-anonymous --set models_cache=cache-$1 \
        --set max_streams_per_caller=1024 --set log_level=warn >>service-$1.log 2>&1 &
    until curl -sf -o ready $NET.1$1:8080/readyz; do sleep 0.1; done
}
stop() { ip netns pids room$1 | xargs -r kill -"$2"; while [ -n "$(ip netns pids room$1)" ]; do sleep 0.1; done; }
rm -f service-*.log phases; for n in 1 2 3; do serve $n "$OLD"; done
cat >haproxy.cfg <<CFG
defaults
    mode http
    timeout connect 2s
    timeout client 60s
    timeout server 60s
frontend robots
    bind $NET.1:80
    default_backend roomsight
backend roomsight
    option httpchk GET /readyz
    balance url_param robot
    hash-type consistent
    option redispatch 1
$(for n in 1 2 3; do echo "    server service$n $NET.1$n:8080 check inter 500ms fall 2"; done)
CFG
"$(command -v haproxy || echo /usr/sbin/haproxy)" -db -f haproxy.cfg >haproxy.log 2>&1 &
until curl -sf -o ready $NET.1/readyz; do sleep 0.1; done

"$ROOMSIGHT" replay "$LAB" --url http://$NET.1 --robots "$ROBOTS" --rate 1 --mode latest --loop --duration 110 --patience 60 --json -q >replay.json 2>replay.log &
replay=$!
began=$(date +%s.%N)
phase() { echo "$(date +%s.%N) $began $*" | awk '{t = $1 - $2; $1 = $2 = ""; printf "%.1f%s\n", t, $0}' >>phases; }
phase calm; sleep 12
phase a service is killed; stop 1 KILL; sleep 5; serve 1 "$OLD"; sleep 6
phase a service is stopped and comes back; stop 2 TERM; sleep 3; serve 2 "$OLD"; sleep 8
phase a network is cut for 8 s; ip link set room3 down; sleep 8; ip link set room3 up; sleep 14
phase each is replaced by the newer program and the model is swapped
for n in 1 2 3; do
    stop $n TERM; serve $n "$ROOMSIGHT"; sleep 3
    # When all can read it that are left.
    [ $n != 3 ] || "$ROOMSIGHT" models push "$SECOND" lab --models s3://rooms/models --models-cache cache-push -q
done
sleep 8
phase calm again
wait $replay || true
for n in 1 2 3; do curl -s $NET.1$n:8080/metrics | grep -E '^roomsight_(stream_takeovers|frames_dropped)_total|^roomsight_model_info' | sed "s/^/service $n: /"; done >metrics
python3 - <<'PY'
import json, statistics
report = json.load(open("replay.json"))
phases = [(float(line.split(" ", 1)[0]), line.split(" ", 1)[1].strip()) for line in open("phases")]
print("frames:", report["frames"], "dropped:", report["dropped"], "errors:", report["errors"])
print("right:", report["accuracy_raw"]["rate"], "filtered:", report["accuracy_filtered"]["rate"], "latency:", report["latency_ms"])
ends = [start for start, _ in phases[1:]] + [1e9]
for (start, name), end in zip(phases, ends):
    seconds = [window for window in report["course"] if start <= window["from_s"] < end]
    p99 = [window["latency_ms"]["p99"] for window in seconds]
    if p99:
        answered = sum(window["results"] for window in seconds)
        print(f"{start:6.1f} s  {name}: {answered} answered in {len(seconds)} s, p99 of the middle second {statistics.median(p99):.1f} ms, of the worst {max(p99):.0f} ms, longest {max(w['latency_ms']['max'] for w in seconds):.0f} ms")
PY
cat metrics
