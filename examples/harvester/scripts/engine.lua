-- An engine at work: its speed (2001h, 1/min) falls when the crop is thick, and its torque (2002h) rises.

local cycle_ms = 200

device.every(cycle_ms, function()
  local thick = math.sin(device.now() / 4000)
  device.write("2001h", math.floor(1950 - 60 * thick))
  device.write("2002h", math.floor(700 + 200 * thick))
end)
