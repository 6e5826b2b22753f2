-- One belt of the coal conveyor: the program of its controller. Node-IDs 1 to 10 are the belts from the ship's unloader
-- to the bunker. Its four modules are the drive, the belt, the scale and the panel; what the neighbours and the desk
-- tell comes in network variables, and so goes what they are told.
--
-- A belt runs only when the next one does: a chain starts at the bunker and stops from the ship.

local cycle_ms, grab_kg, clear_ms, blocked_code = 100, 20, 8000, 0xFF01
local last_belt = 10
local most_at_once = 5000                         -- kg; more: the module has begun anew

local IDLE, STARTING, RUNNING, BLOCKED = 0, 1, 2, 3
local number, state, blocked_for = 0, IDLE, 0
local beat, starts, run_ms, energy = 0, 0, 0, 0.0
local grabbed, total, seen, flow = 0, 0, 0, 0.0

-- Images of the modules: module 1 to 4; bytes 1 and 2, words 1 to 4.
local function input_byte(module, at) return device.read(string.format("2100h:%02X", module * 2 - 2 + at)) end
local function input_word(module, at) return device.read(string.format("2101h:%02X", module * 4 - 4 + at)) end
local function output_byte(module, at, value) device.write(string.format("2200h:%02X", module * 2 - 2 + at), value) end
local function output_word(module, at, value) device.write(string.format("2201h:%02X", module * 2 - 2 + at), value) end
local drive, belt, scale, panel = 1, 2, 3, 4

local function next_state()
  local may_run = device.read("run") and (number == last_belt or device.read("next_may_feed"))
  local blocked = input_byte(belt, 1) & 2 ~= 0
  if state ~= BLOCKED and blocked then
    blocked_for = 0
    device.emcy(blocked_code, 0x81, number)
    return BLOCKED
  end
  if state == BLOCKED then
    blocked_for = blocked_for + cycle_ms
    if blocked or blocked_for < clear_ms then return BLOCKED end
    device.clear_emcy(blocked_code)
    return IDLE
  end
  if not may_run then return IDLE end
  if state == IDLE then
    starts = starts + 1
    return STARTING
  end
  if state == STARTING and input_byte(drive, 1) & 2 ~= 0 then return RUNNING end
  return state
end

local function count()
  local discharged = input_word(belt, 1)          -- kg modulo 32768
  local more = (discharged - seen) & 0x7FFF
  if more > most_at_once then more = 0 end
  seen, total = discharged, total + more
  flow = 0.8 * flow + 0.2 * more * 1000 / cycle_ms
  if number == 1 and state == RUNNING then grabbed = grabbed + grab_kg end
  if state == RUNNING then run_ms = run_ms + cycle_ms end
  energy = energy + input_word(drive, 2) * cycle_ms / 3600000.0
  beat = (beat + 1) & 0xFF
end

local function drive_modules()
  local on = (state == STARTING or state == RUNNING) and 1 or 0
  local speed, load = input_word(drive, 1), input_word(belt, 2)
  local fed = number == 1 and grabbed or device.read("prev_total")
  output_byte(drive, 1, on)
  output_word(drive, 1, on * device.read("set_speed"))
  output_word(drive, 2, load)
  output_byte(belt, 1, on)
  output_word(belt, 1, speed)
  output_word(belt, 2, fed & 0x7FFF)
  output_byte(scale, 1, on)
  output_word(scale, 1, speed)
  output_word(scale, 2, load)
  output_byte(panel, 1, 1 << state)
end

local function tell()
  local speed, load = input_word(drive, 1), input_word(belt, 2)
  device.write("running", state == RUNNING)
  device.write("speed", speed)
  device.write("state", state)
  device.write("beat", beat)

  device.write("may_feed", state == RUNNING)
  device.write("room", math.max(0, 5000 - load))
  device.write("speed_left", device.read("set_speed") - speed)

  device.write("flow", flow)
  device.write("total", total)
  device.write("moisture", input_word(scale, 3))
  device.write("batch", total // 500)

  device.write("current", input_word(drive, 2))
  device.write("motor_temperature", input_word(drive, 3))
  device.write("bearing_temperature", input_word(drive, 4))
  device.write("gear_temperature", input_word(panel, 2))
  device.write("tension", input_word(belt, 3))
  device.write("slip", math.max(-128, math.min(127, (input_word(belt, 4) - speed) // 10)))
  device.write("load", load)
  device.write("run_ms", run_ms)
  device.write("starts", starts)
  device.write("energy", energy)
  device.write("vibration", input_word(scale, 2))
  device.write("dust", input_word(scale, 4))
  device.write("oil_temperature", input_word(panel, 1))
  device.write("ambient_temperature", input_word(panel, 3))
  device.write("voltage", input_word(panel, 4))
end

device.on_state(function(nmt)
  number = device.node_id() or 0
  if nmt ~= "operational" then state = IDLE end
end)

device.every(cycle_ms, function()
  if device.state() ~= "operational" then return end
  state = next_state()
  count()
  drive_modules()
  tell()
end)
