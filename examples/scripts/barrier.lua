-- A light barrier over a belt. Pieces come while the belt runs (bit 0 of 6200h:01, by RPDO 1), and cover the barrier for
-- 100 ms; one in five sticks until the belt was stopped and runs again.

local covered, stuck, was_running = false, false, false

local function show(value)
  covered = value
  device.write("6000h:01", value and 1 or 0)
end

local function piece()
  if not was_running or covered then return end
  show(true)
  stuck = math.random(5) == 1
  if not stuck then device.after(100, function() show(false) end) end
end

device.every(500, function() device.after(math.random(1, 200), piece) end)

device.on_write("6200h:01", function(belt)
  local running = belt & 1 == 1
  if running and not was_running and stuck then
    stuck = false
    show(false)
  end
  was_running = running
end)
