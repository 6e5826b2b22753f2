-- A belt. Its motor is bit 0 of input 6000h:01, which TPDO 1 tells; the light barrier's state comes by RPDO 1.
-- A piece that stays in the barrier for longer than 300 ms is a jam: the belt stops, tells it, and runs on after 1 s.

local patience_ms, pause_ms, jam = 300, 1000, 0xFF01
local waiting, covered, pieces = nil, false, 0

local function motor(on)
  device.write("6000h:01", on and 1 or 0)
end

local function jammed()
  waiting = nil
  motor(false)
  device.emcy(jam, 0x81, pieces & 0xFF)
  print("jam behind piece", pieces)
  device.after(pause_ms, function()
    device.clear_emcy(jam)
    motor(true)
  end)
end

device.on_state(function(state)
  if state == "operational" then motor(true) else motor(false) end
end)

device.on_write("6200h:01", function(barrier)
  local now = barrier & 1 == 1
  if now == covered then return end  -- the same value comes again and again: the PDO has an event timer
  covered = now
  if waiting then device.cancel(waiting) waiting = nil end
  if covered then
    pieces = pieces + 1
    waiting = device.after(patience_ms, jammed)
  end
end)
