#include "berth/script/functions_parts.hpp"

#include <algorithm>
#include <array>
#include <string>

#include "berth/co/emcy.hpp"
#include "berth/script/machine_parts.hpp"

namespace berth::script {
namespace {

using Event = Machine::Event;

Machine& of(lua_State* state) { return Machine::of(state); }

int read(lua_State* state) {
  Objects& objects = of(state).objects();
  objects.push(state, objects.find(state, 1));
  return 1;
}

int write(lua_State* state) {
  Objects& objects = of(state).objects();
  const ObjectRef ref = objects.find(state, 1);
  luaL_checkany(state, 2);
  objects.write(state, ref);
  return 0;
}

int keep_function(lua_State* state, int argument, const char* where) {
  luaL_checktype(state, argument, LUA_TFUNCTION);
  const Machine& machine = of(state);
  if (!machine.beginning())
    luaL_error(state, "device.%s: handlers are named while the script begins, not later", where);
  if (machine.full()) luaL_error(state, "there are more than %d handlers", static_cast<int>(Machine::most_handlers));
  lua_pushvalue(state, argument);
  return luaL_ref(state, LUA_REGISTRYINDEX);
}

int on_write(lua_State* state) {
  const ObjectRef ref = of(state).objects().find(state, 1);
  of(state).add_watch(ref, keep_function(state, 2, "on_write"));
  return 0;
}
int on_state(lua_State* state) {
  of(state).add_handler(Event::state, keep_function(state, 1, "on_state"));
  return 0;
}
int on_rpdo(lua_State* state) {
  of(state).add_handler(Event::rpdo, keep_function(state, 1, "on_rpdo"));
  return 0;
}
int on_sync(lua_State* state) {
  of(state).add_handler(Event::sync, keep_function(state, 1, "on_sync"));
  return 0;
}

int add_timer(lua_State* state, bool again) {
  constexpr double shortest_ms = 0.1;
  constexpr double longest_ms = 24.0 * 3600 * 1000;
  Machine& machine = of(state);
  const auto ms = luaL_checknumber(state, 1);
  luaL_checktype(state, 2, LUA_TFUNCTION);
  if (!(ms >= shortest_ms && ms <= longest_ms)) luaL_error(state, "a timer takes 0.1 ms to 24 h");
  if (machine.timers().full()) luaL_error(state, "there are more than %d timers", static_cast<int>(Timers::most));
  lua_pushvalue(state, 2);
  const int function = luaL_ref(state, LUA_REGISTRYINDEX);
  const rt::Duration time = machine.device().timing().in_world(rt::Duration(static_cast<std::int64_t>(ms * 1e6)));
  lua_pushinteger(state, machine.timers().add(state, function, time, again));
  return 1;
}
int every(lua_State* state) { return add_timer(state, true); }
int after(lua_State* state) { return add_timer(state, false); }
int cancel(lua_State* state) {
  const auto number = luaL_checkinteger(state, 1);
  lua_pushboolean(state, of(state).timers().cancel(number) ? 1 : 0);
  return 1;
}
int now(lua_State* state) {
  lua_pushnumber(state, static_cast<double>(of(state).now().time_since_epoch().count()) / 1e6);
  return 1;
}

int node_id(lua_State* state) {
  const auto id = of(state).device().node_id();
  if (!id.configured()) return 0;
  lua_pushinteger(state, id.value());
  return 1;
}
int nmt_state(lua_State* state) {
  lua_pushstring(state, name(of(state).device().state()));
  return 1;
}

int emcy(lua_State* state) {
  const auto code = luaL_checkinteger(state, 1);
  const auto bits = luaL_optinteger(state, 2, co::error_register::generic);
  if (code < 0x1000 || code > 0xFFFF) luaL_error(state, "an EMCY error code is 0x1000 to 0xFFFF");
  if (bits < 0 || bits > 0xFF) luaL_error(state, "an error register is 0 to 0xFF");
  std::array<std::uint8_t, 5> info{};
  for (int i = 0; i < 5; ++i) {
    const auto byte = luaL_optinteger(state, 3 + i, 0);
    if (byte < 0 || byte > 0xFF) luaL_error(state, "a byte is 0 to 0xFF");
    info[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(byte);
  }
  const bool raised =
      of(state).device().errors().raise(static_cast<std::uint16_t>(code), static_cast<std::uint8_t>(bits), info);
  lua_pushboolean(state, raised ? 1 : 0);
  return 1;
}
int clear_emcy(lua_State* state) {
  const auto code = luaL_checkinteger(state, 1);
  const bool known = code >= 0x1000 && code <= 0xFFFF;
  lua_pushboolean(state, known && of(state).device().errors().clear(static_cast<std::uint16_t>(code)) ? 1 : 0);
  return 1;
}

int print(lua_State* state) {
  constexpr std::size_t longest = 1000;
  if (!Lua::of(state).count_line())
    luaL_error(state, "one call prints more than %d lines", Lua::of(state).most_lines());
  const int given = lua_gettop(state);
  std::string line;
  for (int i = 1; i <= given; ++i) {
    lua_getglobal(state, "tostring");
    lua_pushvalue(state, i);
    lua_call(state, 1, 1);
    std::size_t length = 0;
    const char* const text = lua_tolstring(state, -1, &length);
    if (text != nullptr && line.size() < longest) {
      if (i > 1) line += ' ';
      line.append(text, std::min(length, longest));
    }
    lua_pop(state, 1);
  }
  of(state).print(current_line(state), std::move(line));
  return 0;
}
}  // namespace

void give_functions(lua_State* state) {
  static constexpr luaL_Reg device[] = {{"read", &read},         {"write", &write},           {"on_write", &on_write},
                                        {"on_state", &on_state}, {"on_rpdo", &on_rpdo},       {"on_sync", &on_sync},
                                        {"every", &every},       {"after", &after},           {"cancel", &cancel},
                                        {"now", &now},           {"node_id", &node_id},       {"state", &nmt_state},
                                        {"emcy", &emcy},         {"clear_emcy", &clear_emcy}, {nullptr, nullptr}};
  lua_newtable(state);
  luaL_setfuncs(state, device, 0);
  lua_setglobal(state, "device");
  lua_pushcfunction(state, &print);
  lua_setglobal(state, "print");
}

}  // namespace berth::script
