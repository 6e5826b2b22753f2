/// Timers of a script, on its device's clock: once or repeated, until they are cancelled.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "berth/rt/executor.hpp"
#include "berth/script/lua.hpp"

namespace berth::script {

class Timers {
 public:
  static constexpr std::size_t most = 256;

  /// `call` runs a function of Lua's registry; false: the script has failed.
  Timers(rt::Executor& executor, std::function<bool(int function)> call);
  ~Timers();

  [[nodiscard]] bool full() const noexcept { return timers_.size() >= most; }
  /// Calls after `time`; with `again`, repeatedly. Returns its number, for `cancel`.
  lua_Integer add(lua_State* state, int function, rt::Duration time, bool again);
  /// False: no timer has this number any more. Frees the function's place in Lua's registry.
  bool cancel(lua_Integer number);
  /// Stops all timers.
  void silence() noexcept;
  /// Removes all, when Lua's state is destroyed too.
  void clear() noexcept;

 private:
  class Timer;
  void ring(lua_Integer number) noexcept;
  [[nodiscard]] Timer* find(lua_Integer number) const noexcept;

  rt::Executor& executor_;
  std::function<bool(int function)> call_;
  std::vector<std::unique_ptr<Timer>> timers_;
  lua_Integer next_ = 1;
};

}  // namespace berth::script
