/// A device's objects for its script: read and written by number or name, as Lua's numbers, booleans and strings. A
/// value that does not fit is a Lua error at the script's line.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "berth/device/device.hpp"
#include "berth/script/lua.hpp"

namespace berth::script {

class Objects {
 public:
  explicit Objects(device::Device& device) noexcept : device_(device) {}

  /// The object named by the string at stack index `argument`.
  [[nodiscard]] ObjectRef find(lua_State* state, int argument);
  void push(lua_State* state, ObjectRef ref) const;
  /// Writes the value at stack index 2. A changed value is an event for the TPDOs that map it.
  void write(lua_State* state, ObjectRef ref);

 private:
  [[nodiscard]] const od::SubObject& sub(ObjectRef ref) const { return *device_.values().description().find(ref); }
  void store(lua_State* state, ObjectRef ref, const od::SubObject& sub);
  void store_bytes(lua_State* state, ObjectRef ref);
  [[nodiscard]] od::AbortCode store_whole(lua_State* state, ObjectRef ref, const od::SubObject& sub);

  device::Device& device_;
  std::map<std::string, ObjectRef, std::less<>> words_;  // found before
};

}  // namespace berth::script
