-- The scale and its surroundings: 6401h: weight, vibration, moisture and dust, each with some noise.
-- 6411h: speed of the belt (mm/s) and coal on it (kg), as the controller tells them.

local cycle_ms = 200
local moisture = 80

device.every(cycle_ms, function()
  local speed, load = device.read("6411h:01"), device.read("6411h:02")
  moisture = math.max(60, math.min(100, moisture + math.random(-1, 1)))
  device.write("6000h:01", load > 0 and 1 or 0)
  device.write("6401h:01", math.max(0, load + math.random(-2, 2)))
  device.write("6401h:02", speed // 10 + math.random(0, 5))
  device.write("6401h:03", moisture)
  device.write("6401h:04", load // 50 + math.random(0, 3))
end)
