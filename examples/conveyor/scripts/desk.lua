-- The control desk: its start button lets all belts run, and its lamps show them. What the belts tell comes in network
-- variables b01_... to b10_....

local cycle_ms, belts, full_speed = 100, 10, 2500
local started = false

device.every(cycle_ms, function()
  if device.state() ~= "operational" then return end
  if device.read("2100h:01") & 1 ~= 0 then started = true end
  if device.read("2100h:01") & 2 ~= 0 then started = false end
  local lamps, load, energy = 0, 0, 0.0
  for k = 1, belts do
    local name = string.format("b%02d_", k)
    device.write(name .. "run", started)
    device.write(name .. "set_speed", started and full_speed or 0)
    if device.read(name .. "running") then lamps = lamps | 1 << (k - 1) end
    load = load + device.read(name .. "load")
    energy = energy + device.read(name .. "energy")
  end
  device.write("2200h:01", lamps & 0xFF)
  device.write("2200h:02", lamps >> 8)
  device.write("2201h:01", math.min(load, 32767))
  device.write("2201h:02", math.min(math.floor(energy), 32767))
end)
