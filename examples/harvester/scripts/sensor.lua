-- A measuring device: its field value (7100h) goes up and down, each at its own pace.

local cycle_ms = 200

device.every(cycle_ms, function()
  local pace = 3000 + 500 * (device.node_id() or 0)
  device.write("7100h", math.floor(500 + 300 * math.sin(device.now() / pace)))
end)
