#include "berth/script/timers_parts.hpp"

#include <algorithm>

namespace berth::script {

class Timers::Timer final : public rt::Job {
 public:
  Timer(Timers& all, lua_State* lua, int called, rt::Duration every, lua_Integer name)
      : timers(all), state(lua), function(called), period(every), number(name) {}
  void run() noexcept override { timers.ring(number); }

  Timers& timers;
  lua_State* state;
  int function;
  rt::Duration period;  ///< zero: once
  lua_Integer number;
};

Timers::Timers(rt::Executor& executor, std::function<bool(int function)> call)
    : executor_(executor), call_(std::move(call)) {}

Timers::~Timers() = default;

lua_Integer Timers::add(lua_State* state, int function, rt::Duration time, bool again) {
  const lua_Integer number = next_++;
  timers_.push_back(std::make_unique<Timer>(*this, state, function, again ? time : rt::Duration::zero(), number));
  executor_.after(time, *timers_.back());
  return number;
}

Timers::Timer* Timers::find(lua_Integer number) const noexcept {
  const auto it = std::ranges::find(timers_, number, [](const auto& timer) { return timer->number; });
  return it == timers_.end() ? nullptr : it->get();
}

bool Timers::cancel(lua_Integer number) {
  const Timer* const timer = find(number);
  if (timer == nullptr) return false;
  luaL_unref(timer->state, LUA_REGISTRYINDEX, timer->function);
  std::erase_if(timers_, [timer](const auto& each) { return each.get() == timer; });
  return true;
}

// The called function may cancel this timer, make others, or fail.
void Timers::ring(lua_Integer number) noexcept {
  Timer& timer = *find(number);
  const bool again = timer.period > rt::Duration::zero();
  if (again) executor_.after(timer.period, timer);
  const bool good = call_(timer.function);
  if (good && !again) cancel(number);
}

void Timers::silence() noexcept {
  for (const auto& timer : timers_) timer->cancel();
}

void Timers::clear() noexcept { timers_.clear(); }

}  // namespace berth::script
