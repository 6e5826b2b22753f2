/// Library functions rewritten in Lua, so that their instructions are counted and a seed always gives the same run.
/// Inside of room `script`.
#pragma once

namespace berth::script {

/// Reasons:
/// - Lua takes the seed of its string hashes from clock and addresses: the order of `next` differs from run to run, and
///   so do texts of tables and functions. `table.sort` uses the clock too.
/// - C code that copies elements one by one (`table.insert`, `table.move`) or repeats (`string.rep` of an empty text)
///   runs without instructions.
inline constexpr const char* prelude = R"lua(
local raw_next, raw_type, raw_tostring, raw_format = next, type, tostring, string.format
local raw_rep, raw_set, raw_get = string.rep, setmetatable, rawget
local unpack, pack = table.unpack, table.pack

function tostring(value)
  local kind = raw_type(value)
  if kind == "table" then
    local meta = getmetatable(value)
    local text = raw_type(meta) == "table" and raw_get(meta, "__tostring")
    return text and text(value) or "table"
  end
  if kind == "function" then return "function" end
  return raw_tostring(value)
end

function string.format(form, ...)
  if raw_type(form) ~= "string" then error("string.format: the form is not a string", 2) end
  local values = pack(...)
  for i = 1, values.n do
    local kind = raw_type(values[i])
    if kind == "table" or kind == "function" then values[i] = tostring(values[i]) end
  end
  return raw_format(form, unpack(values, 1, values.n))
end

function string.rep(text, count, between)
  if count <= 0 then return "" end
  if #text == 0 and #(between or "") == 0 then return "" end
  return raw_rep(text, count, between)
end

function setmetatable(object, meta)
  if raw_type(meta) == "table" and (raw_get(meta, "__gc") ~= nil or raw_get(meta, "__mode") ~= nil) then
    error("setmetatable: __gc and __mode depend on when memory is collected", 2)
  end
  return raw_set(object, meta)
end

local rank = { boolean = 1, number = 2, string = 3 }
local function before(a, b)
  local x, y = rank[raw_type(a)], rank[raw_type(b)]
  if x ~= y then return x < y end
  if x == 1 then return not a and b end
  return a < b
end

local function sort(list, less)
  local count = #list
  local from, to = list, {}
  local width = 1
  while width < count do
    for low = 1, count, 2 * width do
      local middle, high = math.min(low + width, count + 1), math.min(low + 2 * width, count + 1)
      local a, b = low, middle
      for at = low, high - 1 do
        if a < middle and (b >= high or not less(from[b], from[a])) then
          to[at] = from[a]
          a = a + 1
        else
          to[at] = from[b]
          b = b + 1
        end
      end
    end
    from, to = to, (from == list) and {} or from
    width = 2 * width
  end
  if from ~= list then
    for i = 1, count do list[i] = from[i] end
  end
end

function pairs(object)
  local keys = {}
  for key in raw_next, object do
    if not rank[raw_type(key)] then
      error("pairs: the order of keys that are a " .. raw_type(key) .. " differs from run to run", 2)
    end
    keys[#keys + 1] = key
  end
  sort(keys, before)
  local at = 0
  return function()
    at = at + 1
    local key = keys[at]
    if key ~= nil then return key, object[key] end
  end
end
next = nil

table = {
  pack = pack, unpack = unpack,
  sort = function(list, less) sort(list, less or function(a, b) return a < b end) end,
  insert = function(list, a, b)
    local last = #list + 1
    if b == nil then list[last] = a return end
    if a < 1 or a > last then error("table.insert: the position is out of range", 2) end
    for i = last, a + 1, -1 do list[i] = list[i - 1] end
    list[a] = b
  end,
  remove = function(list, at)
    local last = #list
    at = at or last
    local value = list[at]
    for i = at, last - 1 do list[i] = list[i + 1] end
    if last > 0 then list[last] = nil end
    return value
  end,
  concat = function(list, between, first, last)
    local text = ""
    for i = first or 1, last or #list do
      if text ~= "" or i > (first or 1) then text = text .. (between or "") end
      text = text .. list[i]
    end
    return text
  end,
}
)lua";

}  // namespace berth::script
