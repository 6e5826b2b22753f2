-- A belt of 5 m with coal on it. 6411h:01: its speed in mm/s; 6411h:02: coal that has come onto it, in kg modulo 32768.
-- 6401h: coal that has left it (kg modulo 32768), coal on it (kg), tension, and the speed that its own wheel sees.
-- 6000h:01 bit 0: rotation pulse; bit 1: the chute at its end is blocked. It blocks once, when 2000h kg have left (0:
-- never), and is free when the belt has stood for 3 s.

local cycle_ms, length, wheel, stands_ms = 50, 5000, 500, 3000
local most_at_once = 5000                  -- kg; more: who counts has begun anew
local parcels, first, last = {}, 1, 0       -- coal and where it is, in the order in which it came
local way, came, left, on_belt = 0, 0, 0, 0
local blocked, was_blocked, stood = false, false, 0

local function take()
  local told = device.read("6411h:02")
  local more = (told - came) & 0x7FFF
  came = told
  if more == 0 or more > most_at_once then return end
  last = last + 1
  parcels[last] = { kg = more, at = way }
  on_belt = on_belt + more
end

local function give()
  while first <= last and way - parcels[first].at >= length do
    local kg = parcels[first].kg
    parcels[first] = nil
    first = first + 1
    on_belt = on_belt - kg
    left = left + kg
    local most = device.read("2000h:00")
    if most > 0 and left >= most and not was_blocked then
      blocked, was_blocked = true, true
      return
    end
  end
end

local function chute(speed)
  stood = speed == 0 and stood + cycle_ms or 0
  if blocked and stood >= stands_ms then blocked = false end
end

device.every(cycle_ms, function()
  if device.state() ~= "operational" then return end
  local speed = device.read("6411h:01")
  take()
  way = way + speed * cycle_ms // 1000
  if not blocked then give() end
  chute(speed)
  device.write("6000h:01", (way // wheel & 1) | (blocked and 2 or 0))
  device.write("6401h:01", left & 0x7FFF)
  device.write("6401h:02", math.min(on_belt, 32767))
  device.write("6401h:03", 500 + on_belt // 10)
  device.write("6401h:04", speed - speed // 50)
end)
