-- A drive: motor contactor (6200h:01 bit 0), set speed (6411h:01, mm/s), load of the belt (6411h:02, kg). Its speed
-- follows by a ramp. 6000h:01: contactor closed, at speed. 6401h: speed in mm/s, current in 0.1 A, two temperatures in
-- 0.1 degrees.

local cycle_ms, ramp = 50, 1000            -- mm/s in a second
local step = ramp * cycle_ms // 1000
local speed, motor, bearing = 0, 200.0, 200.0

device.every(cycle_ms, function()
  local on = device.read("6200h:01") & 1
  local wanted = on * device.read("6411h:01")
  if speed < wanted then speed = math.min(wanted, speed + step) else speed = math.max(wanted, speed - step) end
  local current = on * 200 + speed // 10 + device.read("6411h:02") // 20
  motor = motor + (200 + current - motor) * 0.002
  bearing = bearing + (200 + speed / 10 - bearing) * 0.001
  device.write("6000h:01", on | (wanted > 0 and speed == wanted and 2 or 0))
  device.write("6401h:01", speed)
  device.write("6401h:02", current)
  device.write("6401h:03", math.floor(motor))
  device.write("6401h:04", math.floor(bearing))
end)
