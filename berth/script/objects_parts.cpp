#include "berth/script/objects_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "berth/od/names.hpp"

namespace berth::script {
namespace {

constexpr std::size_t most_known_words = 1000;
constexpr std::size_t longest_word = 500;
constexpr std::size_t objects_an_instruction = 8;  // that a search for a name reads

std::string range_of(od::DataType type) {
  const unsigned bits = od::bit_length(type);
  if (od::is_real(type)) return "a number that it can hold";
  if (type == od::DataType::boolean) return "false or true";
  if (!od::is_signed(type)) return fmt::format("0 to {}", ~std::uint64_t{0} >> (64U - bits));
  const auto highest = static_cast<std::int64_t>(~std::uint64_t{0} >> (65U - bits));
  return fmt::format("{} to {}", -highest - 1, highest);
}

}  // namespace

ObjectRef Objects::find(lua_State* state, int argument) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(state, argument, &length);
  const std::string_view word(text, length);
  if (const auto known = words_.find(word); known != words_.end()) return known->second;
  if (length > longest_word) luaL_error(state, "no object has a name of %d bytes", static_cast<int>(length));
  const auto& description = device_.values().description();
  Meter& meter = Lua::of(state).meter();
  meter.charge(1 + description.objects().size() / objects_an_instruction);
  const auto found = od::find_object(description, word);
  if (!found) {
    meter.charge(description.objects().size());  // it also searched for similar names
    luaL_error(state, "\"%s\": %s", text, found.error().why.c_str());
  }
  if (description.find(*found) == nullptr) luaL_error(state, "\"%s\": the device has no such object", text);
  if (words_.size() < most_known_words) words_.emplace(word, *found);
  return *found;
}

void Objects::push(lua_State* state, ObjectRef ref) const {
  const od::SubObject& object = sub(ref);
  const auto bytes = device_.values().bytes(ref);
  if (object.variable_length() || od::is_time(object.type)) {
    lua_pushlstring(state, reinterpret_cast<const char*>(bytes.data()), bytes.size());
  } else if (object.type == od::DataType::boolean) {
    lua_pushboolean(state, bytes[0] != 0 ? 1 : 0);
  } else if (od::is_real(object.type)) {
    lua_pushnumber(state, od::real_of(object.type, od::load(object.type, bytes.data())));
  } else {
    lua_pushinteger(state, static_cast<lua_Integer>(od::load(object.type, bytes.data())));
  }
}

void Objects::write(lua_State* state, ObjectRef ref) {
  if (ref.index < 0x2000) {
    luaL_error(state, "%s: 1000h to 1FFFh are the device's own; a script writes from 2000h on",
               od::write_object(ref).c_str());
  }
  const auto stored = device_.values().bytes(ref);
  const std::vector<std::uint8_t> before(stored.begin(), stored.end());
  Lua::of(state).meter().charge(1 + before.size() / Meter::bytes_an_instruction);
  store(state, ref, sub(ref));
  if (!std::ranges::equal(before, device_.values().bytes(ref))) device_.services().changed(ref);
}

void Objects::store(lua_State* state, ObjectRef ref, const od::SubObject& object) {
  if (object.variable_length() || od::is_time(object.type)) return store_bytes(state, ref);
  const bool real = od::is_real(object.type);
  const auto answer = real ? device_.values().set(ref, luaL_checknumber(state, 2)) : store_whole(state, ref, object);
  if (answer == od::AbortCode::none) return;
  luaL_error(state, "%s is %s, %s does not fit; use %s", od::write_object(ref).c_str(),
             std::string(od::name(object.type)).c_str(), luaL_tolstring(state, 2, nullptr),
             range_of(object.type).c_str());
}

void Objects::store_bytes(lua_State* state, ObjectRef ref) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(state, 2, &length);
  const auto answer = device_.values().set_bytes(ref, {reinterpret_cast<const std::uint8_t*>(text), length});
  if (answer == od::AbortCode::none) return;
  luaL_error(state, "%s: a text of this length does not fit", od::write_object(ref).c_str());
}

od::AbortCode Objects::store_whole(lua_State* state, ObjectRef ref, const od::SubObject& object) {
  const std::string shown = od::write_object(ref);
  const std::string type(od::name(object.type));
  if (lua_isboolean(state, 2)) {
    if (object.type != od::DataType::boolean) luaL_error(state, "%s is %s, not a boolean", shown.c_str(), type.c_str());
    return device_.values().set(ref, lua_toboolean(state, 2) != 0);
  }
  int whole = 0;
  const auto number = lua_tointegerx(state, 2, &whole);
  if (whole == 0) {
    luaL_error(state, "%s is %s, %s is not a whole number", shown.c_str(), type.c_str(), luaL_typename(state, 2));
  }
  const bool wide = object.type == od::DataType::unsigned64;
  return wide ? device_.values().set(ref, static_cast<std::uint64_t>(number))
              : device_.values().set(ref, std::int64_t{number});
}

}  // namespace berth::script
