/// The functions for scripts: the table `device` and `print` (docs/scripts.md). Inside of room `script`.
#pragma once

#include "berth/script/lua.hpp"

namespace berth::script {

/// For the script of the `Behaviour::Machine` that owns the state.
void give_functions(lua_State* state);

}  // namespace berth::script
