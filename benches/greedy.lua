-- For wrk: posts the frame of the environment's FRAME, and tells what came of all requests.
local file = assert(io.open(os.getenv("FRAME"), "rb"))
local frame = file:read("*a")
file:close()
wrk.method, wrk.body = "POST", frame
wrk.headers["Content-Type"] = "image/jpeg"

local threads = {}

function setup(thread)
    table.insert(threads, thread)
end

function init()
    answered, refused, other = 0, 0, 0
end

function response(status)
    if status == 200 then
        answered = answered + 1
    elseif status == 429 then
        refused = refused + 1
    else
        other = other + 1
    end
end

function done()
    local sum = { answered = 0, refused = 0, other = 0 }
    for _, thread in ipairs(threads) do
        for name, before in pairs(sum) do
            sum[name] = before + thread:get(name)
        end
    end
    io.write(string.format("answered %d refused %d other %d\n", sum.answered, sum.refused, sum.other))
end
