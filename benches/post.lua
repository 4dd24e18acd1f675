-- wrk's part of rest.sh: posts the JPEG frames of the folder $FRAMES in turn, and ends with one line:
-- requests, errors, requests/s, p50 and p99 in milliseconds.

local requests = {}

function init()
  for path in io.popen('ls "' .. os.getenv("FRAMES") .. '"/*.jp*g'):lines() do
    local file = assert(io.open(path, "rb"))
    local headers = { ["Content-Type"] = "image/jpeg" }
    requests[#requests + 1] = wrk.format("POST", nil, headers, file:read("*a"))
    file:close()
  end
end

local n_sent = 0

function request()
  n_sent = n_sent + 1
  return requests[(n_sent - 1) % #requests + 1]
end

function done(summary, latency)
  local errors = summary.errors
  local n_errors = errors.status + errors.connect + errors.read + errors.write + errors.timeout
  local rate = summary.requests / (summary.duration / 1e6)
  local p50, p99 = latency:percentile(50) / 1e3, latency:percentile(99) / 1e3
  print(string.format("%d %d %.1f %.2f %.2f", summary.requests, n_errors, rate, p50, p99))
end
