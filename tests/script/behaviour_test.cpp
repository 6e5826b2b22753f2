// Scripts of simulated devices: what they see, what one seed gives, and how each ends that does not behave.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/script/behaviour.hpp"
#include "berth/sim/world.hpp"

namespace berth::script {
namespace {

using std::chrono::milliseconds;

std::shared_ptr<const od::Description> description() {
  using od::DataType;
  od::DescriptionBuilder b;
  device::add_device(b);
  device::add_sync(b);
  b.variable(0x2000, {.name = "Speed", .type = DataType::unsigned8, .mappable = true});
  b.variable(0x2001, {.name = "Level", .type = DataType::integer16, .mappable = true});
  b.variable(0x2002, {.name = "Jam", .type = DataType::boolean, .mappable = true});
  b.variable(0x2003, {.name = "Heat", .type = DataType::real32, .mappable = true});
  b.variable(0x2004, {.name = "Big", .type = DataType::unsigned64, .mappable = true});
  b.variable(0x2005, {.name = "Name", .type = DataType::visible_string, .capacity = 300});
  device::add_rpdo(b, 1, {.map = {{{0x2000, 0}, 8}}});
  device::add_tpdo(b, 1, {.map = {{{0x2001, 0}, 16}}});
  return b.build();
}

/// One device with a script on a bus, and a master's controller.
struct Scene : Behaviour::Listener {
  explicit Scene(std::string text, std::uint64_t seed = 1, const Limits& limits = {})
      : bus(world.add_bus("b", 250'000)),
        master(bus.attach({.name = "master"})),
        port(bus.attach({.name = "belt"})),
        dispatcher(world.executor(), *port),
        device(dispatcher, description(), nullptr,
               {.address = {1, 2, 3, 4}, .source = device::NodeIdSource::fixed, .node_id = NodeId(5)}),
        behaviour(device, world.executor(), {"belt.lua", std::move(text)}, Random(seed), *this, limits) {
    bus.add_tap(tap);
    device.power_on();
    run();
  }
  ~Scene() { bus.remove_tap(tap); }
  void script_told(const Message& one) noexcept override {
    told.push_back(to_string(one));
    kinds.push_back(one.kind);
  }
  bool script_must_end() noexcept override { return ends; }
  void run(rt::Duration time = milliseconds(5)) { world.run_for(time); }
  void send(std::string_view frame) {
    master->send(*can::parse_frame(frame), 0);
    run();
  }
  template <class T>
  T value(std::uint16_t index) {
    return device.values().get_or<T>({index, 0}, T{});
  }
  struct Tap final : can::Tap {
    void frame(const can::Frame& frame, rt::Time, int) noexcept override { text.push_back(can::to_string(frame)); }
    std::vector<std::string> text;
  };
  [[nodiscard]] long frames(std::string_view text) const { return std::ranges::count(tap.text, text); }

  sim::World world;
  sim::Bus& bus;
  std::unique_ptr<sim::Controller> master;
  std::unique_ptr<sim::Controller> port;
  can::Dispatcher dispatcher;
  device::Device device;
  Tap tap;
  std::vector<std::string> told;
  std::vector<Message::Kind> kinds;
  bool ends = false;
  Behaviour behaviour;
};

TEST(Behaviour, ReadsAndWritesObjectsByNumberAndByName) {
  Scene s(
      "device.write('Speed', 7) device.write('2001h:00', -300) device.write('Jam', true)"
      "device.write('Heat', 1.5) device.write('2004h', -1)"
      "print(device.read('2000h'), device.read('Level'), device.read('Jam'), device.read('Heat'), device.state())");
  EXPECT_EQ(s.told, std::vector<std::string>{"7 -300 true 1.5 initialising"});
  EXPECT_EQ(s.value<std::uint8_t>(0x2000), 7);
  EXPECT_EQ(s.value<std::int16_t>(0x2001), -300);
  EXPECT_EQ(s.value<std::uint64_t>(0x2004), 0xFFFF'FFFF'FFFF'FFFFU);
}

TEST(Behaviour, HearsRpdosWritesSyncAndStatesAndSendsTpdos) {
  Scene s(
      "device.on_write('Speed', function(v) device.write('Level', v * 2) end)\n"
      "device.on_rpdo(function(n) print('rpdo', n) end)\n"
      "device.on_sync(function(c) print('sync', c) end)\n"
      "device.on_state(function(to) print(to) end)\n");
  s.send("000#0105");
  s.send("205#15");
  s.send("080#");
  EXPECT_EQ(s.frames("185#2A00"), 1);
  const std::vector<std::string> expected{"pre-operational", "operational", "rpdo 1", "sync 0"};
  EXPECT_EQ(s.told, expected);
}

TEST(Behaviour, TimersRunOnTheClockOfTheWorldAndEnd) {
  Scene s(
      "local n = 0\n"
      "id = device.every(2, function() n = n + 1 device.write('Speed', n) if n == 4 then device.cancel(id) end end)\n"
      "device.after(3, function() print(device.now()) end)\n");
  EXPECT_EQ(s.value<std::uint8_t>(0x2000), 2);
  s.run(milliseconds(100));
  EXPECT_EQ(s.value<std::uint8_t>(0x2000), 4);
  EXPECT_EQ(s.told, std::vector<std::string>{"3.0"});
}

// The place of a cancelled timer's function is free once, not twice: else the next two functions share it.
TEST(Behaviour, ATimerThatCancelsItselfLeavesTheOthersAlone) {
  Scene s(
      "local own\n"
      "own = device.after(1, function()\n"
      "  print(device.cancel(own), device.cancel(own))\n"
      "  device.after(2, function() print('first') end)\n"
      "end)\n"
      "device.after(2, function()\n"
      "  device.after(3, function() print('second') end)\n"
      "  device.after(4, function() print('third') end)\n"
      "end)\n");
  s.run(milliseconds(20));
  const std::vector<std::string> expected{"true false", "first", "second", "third"};
  EXPECT_EQ(s.told, expected);
}

TEST(Behaviour, BeginsAnewAtResetNodeAndNotAtResetCommunication) {
  Scene s("print('begin') count = (count or 0) + 1 device.write('Speed', count)");
  s.send("000#8205");
  EXPECT_EQ(s.told.size(), 1U);
  s.send("000#8105");
  EXPECT_EQ(s.told.size(), 2U);
  EXPECT_EQ(s.value<std::uint8_t>(0x2000), 1) << "nothing is left of the first run";
}

/// The script fails, with this text, at line 2: EMCY 6200h with the line, once, and the device still answers.
void expect_end(const std::string& second_line, const std::string& why) {
  SCOPED_TRACE(second_line);
  Scene s("local x\n" + second_line);
  ASSERT_EQ(s.told.size(), 1U);
  EXPECT_EQ(s.told[0], "belt.lua:2: " + why);
  EXPECT_EQ(s.frames("085#0062010200000000"), 1);
  EXPECT_FALSE(s.behaviour.running());
  EXPECT_EQ(s.behaviour.memory(), 0U);
  s.send("605#4018100100000000");
  EXPECT_EQ(s.frames("585#4318100101000000"), 1);
}

TEST(Behaviour, AScriptThatLoopsEndsInAnEmcy) {
  const std::string why = "the call took more than 100000 instructions";
  expect_end("while true do end", why);
  expect_end("while true do pcall(function() while true do end end) end", why);
  expect_end("local function f() return f() end f()", why);
  expect_end("table.insert(setmetatable({}, {__len = function() return 1 << 60 end}), 1, 5)", why);
  expect_end("local s = string.rep('x', 900) while true do local t = s .. device.now() end", why);
}

TEST(Behaviour, AScriptThatWantsMemoryEndsInAnEmcy) {
  const std::string why = "the script wants more than 1024 KiB of memory";
  expect_end("x = {} for i = 1, 9 do x[i] = string.rep('x', 200000) .. i end", why);
  expect_end("pcall(function() x = {} for i = 1, 9 do x[i] = string.rep('x', 200000) .. i end end)", why);
}

TEST(Behaviour, AScriptThatThrowsEndsInAnEmcy) {
  expect_end("error('jammed')", "jammed");
  expect_end("error({})", "an error that is not a text but a table");
  expect_end("x.y = 1", "attempt to index a nil value (local 'x')");
  expect_end("device.write('Speed', 300)", "2000h:00 is UNSIGNED8, 300 does not fit; use 0 to 255");
  expect_end("device.write('2000h', 1.5)", "2000h:00 is UNSIGNED8, number is not a whole number");
  expect_end("device.write('1017h', 5)",
             "1017h:00: 1000h to 1FFFh are the device's own; a script writes from 2000h on");
  expect_end("device.every(0, print)", "a timer takes 0.1 ms to 24 h");
  expect_end("for k in pairs({[print] = 1}) do end",
             "pairs: the order of keys that are a function differs from run to run");
}

TEST(Behaviour, AHandlerThatFailsEndsTheScriptWithItsOwnLine) {
  Scene s(
      "device.on_write('Speed', function(v)\n\n  error('no') end)\ndevice.every(1, function() device.write('Level', 1) "
      "end)");
  s.send("000#0105");
  s.send("205#01");
  EXPECT_EQ(s.told, std::vector<std::string>{"belt.lua:3: no"});
  EXPECT_EQ(s.frames("085#0062010300000000"), 1);
}

TEST(Behaviour, NothingReachesOutOfTheWorld) {
  Scene s(
      "for _, n in ipairs({'os', 'io', 'require', 'load', 'loadfile', 'dofile', 'debug', 'package', 'coroutine',"
      "'collectgarbage', 'next', 'xpcall'}) do if _G[n] ~= nil then print(n) end end "
      "print(math.randomseed, string.gsub, string.dump, tostring({}), tostring(print), string.format('%s', {}))");
  EXPECT_EQ(s.told, std::vector<std::string>{"nil nil nil table function table"});
}

TEST(Behaviour, OneSeedIsOneRun) {
  const std::string text =
      "local t = {} for i = 1, 50 do t['k' .. math.random(1000000)] = i end "
      "local s = '' for k, v in pairs(t) do s = s .. k .. '=' .. v .. ' ' end print(s, math.random())";
  const auto run = [&](std::uint64_t seed) { return Scene(text, seed).told; };
  const auto one = run(7);
  ASSERT_EQ(one.size(), 1U);
  EXPECT_EQ(run(7), one);
  EXPECT_NE(run(8), one);
}

// --- What one instruction can cost -----------------------------------------------------------------------------------

/// `loop` runs again and again, after `setup`, until the call's instructions are over. How often it did.
std::uint64_t runs(const std::string& setup, const std::string& loop) {
  Scene s("local n = 0 local write = device.write\n" + setup + " while true do " + loop +
          " n = n + 1 write('Big', n) end");
  EXPECT_EQ(s.told.size(), 1U) << loop;
  const std::string end = s.told.empty() ? "" : s.told[0];
  EXPECT_TRUE(end.starts_with("belt.lua:2: the call took more than 100000 instructions")) << loop << ": " << end;
  return s.value<std::uint64_t>(0x2004);
}

// An instruction that walks a text of n bytes counts n / 1024 times at least: 100 MB in a call.
TEST(ScriptCosts, WhatWalksATextCountsItsLength) {
  constexpr std::uint64_t length = 32 * 1024;
  const std::string texts =
      "local a, b = string.rep('\\0', 32768), string.rep('\\0', 32767) .. '\\0' local t = {[b] = 1} local blank = "
      "string.rep(' ', 32768) local q = ''";
  for (const auto* const loop : {"local c = a < b",
                                 "local c = a <= b",
                                 "local c = a > b",
                                 "local c = a >= b",
                                 "local c = a == b",
                                 "local c = t[a]",
                                 "q = a .. 'x'",
                                 "q = a:rep(1)",
                                 "q = a:sub(2)",
                                 "q = a:upper()",
                                 "q = a:lower()",
                                 "q = a:reverse()",
                                 "q = string.format('%s', a)",
                                 "q = string.pack('s', a)",
                                 "q = table.concat({a, a})",
                                 "q = string.unpack('z', blank .. '\\0')",
                                 "q = string.packsize(blank)",
                                 "q = tonumber(blank)",
                                 "q = pcall(function() return blank + 1 end)",
                                 "q = rawequal(a, b)",
                                 "q = pcall(device.read, a)"}) {
    EXPECT_LE(runs(texts, loop) * length, 100'000U * 1024U) << loop;
  }
}

// And one that moves n values counts the square of n / 256 times, because a chain of __call moves them n times.
TEST(ScriptCosts, WhatMovesManyValuesCountsThem) {
  constexpr std::uint64_t values = 2000;
  const std::string many =
      "local t = {} for i = 1, 2000 do t[i] = i end local u, c = table.unpack, string.rep('x', 2000)";
  for (const auto* const loop : {"local x = select('#', u(t))", "local x = math.max(u(t))", "local x = c:byte(1, -1)"})
    EXPECT_LE(runs(many, loop) * values, 100'000U * 256U) << loop;
  const std::string chain = "local f = function() end for i = 1, 1000 do f = setmetatable({}, {__call = f}) end";
  EXPECT_LE(runs(chain, "f()") * 1000 * 1000 / 2, 100'000U * 2500U);
}

// At its bound Lua goes through all of its memory for each piece more.
TEST(ScriptCosts, CollectingAllMemoryCounts) {
  EXPECT_LE(runs("local t = {} for i = 1, 12500 do t[i] = {} end", "local x = string.rep('x', 20000)"), 100U);
}

// Whatever is put together, it ends by a bound, and twice in the same way.
TEST(ScriptCosts, RandomScriptsEndAlike) {
  static constexpr const char* pieces[] = {"a = a .. b",
                                           "b = a:rep(3)",
                                           "b = b:sub(1, 9000)",
                                           "c = a < b",
                                           "c = a == b .. ''",
                                           "t[#t + 1] = a",
                                           "t[a] = b",
                                           "c = pcall(string.unpack, a, b)",
                                           "c = tonumber(b)",
                                           "a = string.format('%s%q', a, n)",
                                           "a = '\\0'",
                                           "b = string.rep('\\0', 5000)",
                                           "c = select('#', table.unpack(t))",
                                           "table.sort(t, function() return true end)",
                                           "for k, v in pairs(t) do c = k end",
                                           "c = pcall(device.read, b)",
                                           "f = setmetatable({}, {__call = f})",
                                           "c = pcall(f)",
                                           "t = setmetatable({}, {__index = t})",
                                           "c = t.x",
                                           "c = a:byte(1, 200)",
                                           "t = {}",
                                           "a = table.concat({a, b}, a)",
                                           "c = string.packsize(b:gsub and '' or 'i4')"};
  Random random(20261127);
  for (int i = 0; i < 60; ++i) {
    std::string text =
        "local a, b, c, t, n = 'x', 'y', 0, {}, 0 local f = function() end while true do n = n + 1 device.write('Big', "
        "n)";
    for (int j = 0; j < 6; ++j) text += std::string(" ") + pieces[random.below(std::size(pieces))];
    text += " end";
    SCOPED_TRACE(text);
    Scene one(text);
    ASSERT_EQ(one.told.size(), 1U);
    EXPECT_EQ(one.kinds[0], Message::Kind::failed);
    Scene again(text);
    EXPECT_EQ(again.told, one.told);
    EXPECT_EQ(again.value<std::uint64_t>(0x2004), one.value<std::uint64_t>(0x2004));
  }
}

TEST(ScriptCosts, ErrorsThatAreCaughtCount) { EXPECT_LE(runs("", "pcall(error)"), 1000U); }

TEST(ScriptCosts, ASearchForANameCountsTheObjects) {
  const auto objects = description()->objects().size();
  ASSERT_GT(objects, 12U);
  EXPECT_LE(runs("", "pcall(device.read, 'nobody')"), 100'000U / (100U + objects));
}

TEST(ScriptCosts, ALongWordIsNoName) {
  expect_end("device.read(string.rep('x', 501))", "no object has a name of 501 bytes");
}

TEST(Behaviour, APieceOfMoreThanABlockEndsTheScript) {
  const std::string why = "the script wants more than 256 KiB in one piece: a shorter text or a smaller table will do";
  expect_end("x = string.rep('x', 256 * 1024)", why);
  expect_end("x = {} for i = 1, 16385 do x[i] = i end", why);
  expect_end(
      "local function f() return 1 + f() end f()",
      "the call took more than 100000 instructions (each counts 101 times because of many values or calls in each "
      "other at once; have fewer)");
}

// The value is made for the handler, before any of the script runs. How much is left when the table is full differs.
TEST(Behaviour, AValueThatFindsNoMemoryEndsTheScript) {
  for (std::size_t more = 0; more < 64; more += 8) {
    Limits limits;
    limits.memory = 64 * 1024 + more;
    Scene s(
        "local t = {}"
        "device.on_write('Speed', function() t = {t} end) device.on_write('Name', function() end)",
        1, limits);
    for (int i = 1; i < 1000 && s.behaviour.running(); ++i) {
      s.send("605#2F00200001000000");
      s.send(fmt::format("605#23052000{:08X}", i));
    }
    EXPECT_GT(s.value<std::uint8_t>(0x2000), 0);
    ASSERT_EQ(s.told.size(), 1U);
    EXPECT_NE(s.told[0].find("the script wants more than 64 KiB of memory"), std::string::npos) << s.told[0];
  }
}

TEST(Behaviour, WhatAScriptComplainsOfIsShort) {
  Scene s("error(string.rep('x', 100000))");
  ASSERT_EQ(s.told.size(), 1U);
  EXPECT_LT(s.told[0].size(), 1100U);
}

TEST(Behaviour, AnEndOfTheRunEndsACallAndIsNoFaultOfTheDevice) {
  Scene s("device.on_write('Speed', function() while true do end end)");
  s.ends = true;
  s.send("000#0105");
  s.send("205#01");
  ASSERT_EQ(s.kinds, std::vector{Message::Kind::ended});
  EXPECT_EQ(s.told[0], "belt.lua:1: it was ended with the run");
  EXPECT_EQ(s.frames("085#0062010100000000"), 0);
  EXPECT_FALSE(s.behaviour.running());
}

TEST(Behaviour, TheHostsClockIsTheLastResort) {
  Limits limits;
  limits.instructions = 1'000'000'000;
  limits.processor = milliseconds(1);
  Scene s("local x\nwhile true do pcall(function() while true do end end) end", 1, limits);
  ASSERT_EQ(s.kinds, std::vector{Message::Kind::overran});
  EXPECT_TRUE(s.told[0].starts_with("belt.lua:2: one call took more than 0.001 s of this computer's processor"));
  EXPECT_EQ(s.frames("085#0062010200000000"), 0);
}

TEST(Check, NamesLineAndColumn) {
  const auto at = [](const std::string& text) {
    const auto wrong = check({"belt.lua", text});
    return wrong ? to_string(*wrong) : std::string();
  };
  EXPECT_EQ(at("local a = 1\nif a the b() end"), "belt.lua:2:6: error: 'then' expected near 'the'");
  EXPECT_EQ(at("x = = 2"), "belt.lua:1:5: error: unexpected symbol near '='");
  EXPECT_EQ(at("local a = 1\nlocal b = 'open"), "belt.lua:2:16: error: unfinished string near <eof>");
  EXPECT_EQ(at("\x1bLua"), "belt.lua: error: attempt to load a binary chunk (mode is 't')");
  EXPECT_EQ(at("error('only when it runs')"), "");
}

}  // namespace
}  // namespace berth::script
