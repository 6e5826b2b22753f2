/// Timers of a script, on the clock of its device: once or again and again, until they are cancelled.
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
  /// After `time`, and then each time again when `again`. Its number, by which it is cancelled.
  lua_Integer add(lua_State* state, int function, rt::Duration time, bool again);
  /// False: there is none of this number any more. The function's place in Lua's registry is free again.
  bool cancel(lua_Integer number);
  /// None rings any more.
  void silence() noexcept;
  /// They are gone, and Lua's state with them.
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
