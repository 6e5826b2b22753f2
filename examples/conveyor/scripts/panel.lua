-- A local panel: oil, gear and ambient temperature (0.1 degrees) and the supply (0.1 V) at 6401h; lamps at 6200h. That of
-- the desk, node-ID 52, has the start button (6000h:01 bit 0), which is pressed for half a second every 14 s.

local cycle_ms, desk, press_ms, pressed_ms = 500, 52, 14000, 500
local oil, gear = 200.0, 200.0

device.every(press_ms, function()
  if device.node_id() ~= desk then return end
  device.write("6000h:01", 1)
  device.after(pressed_ms, function() device.write("6000h:01", 0) end)
end)

device.every(cycle_ms, function()
  local warm = device.read("6200h:01") & 4 ~= 0 and 400 or 200
  oil = oil + (warm - oil) * 0.02
  gear = gear + (warm - gear) * 0.01
  device.write("6401h:01", math.floor(oil))
  device.write("6401h:02", math.floor(gear))
  device.write("6401h:03", 180 + math.random(0, 3))
  device.write("6401h:04", 2300 + math.random(-4, 4))
end)
