-- A wheel that turns: its position (6004h) counts on, 4096 steps a turn, as fast as its node-ID says.

local cycle_ms, steps = 200, 4096
local position = 0

device.every(cycle_ms, function()
  if device.state() ~= "operational" then return end
  position = (position + 100 + 10 * device.node_id()) % (16 * steps)
  device.write("6004h", position)
end)
