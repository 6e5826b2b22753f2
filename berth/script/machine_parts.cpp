#include "berth/script/machine_parts.hpp"

#include <algorithm>
#include <utility>

#include "berth/co/emcy.hpp"
#include "berth/script/functions_parts.hpp"

namespace berth::script {

Machine::Machine(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
                 const Limits& limits)
    : device_(device),
      executor_(executor),
      script_(std::move(script)),
      random_(random),
      listener_(listener),
      limits_(limits),
      objects_(device),
      timers_(executor, [this](int function) { return running() && call(function, [](lua_State*) {}); }) {
  auto& on = device.on();
  on.start = [this] { start(); };
  on.state = [this](NmtState to) { fire(Event::state, [to](lua_State* s) { lua_pushstring(s, name(to)); }); };
  on.rpdo = [this](unsigned number) { fire(Event::rpdo, [number](lua_State* s) { lua_pushinteger(s, number); }); };
  on.sync = [this](std::uint8_t counter) {
    fire(Event::sync, [counter](lua_State* s) { lua_pushinteger(s, counter); });
  };
}

Machine::~Machine() { device_.on() = {}; }

void Machine::start() {
  stop();
  lua_ = std::make_unique<Lua>(limits_, random_, this, [this] { return listener_.script_must_end(); });
  if (!lua_->good()) return fail({0, "there is no memory for it"});
  if (auto wrong = lua_->run(&give_functions)) return fail(std::move(*wrong));
  if (auto wrong = lua_->compile(script_)) return fail(std::move(*wrong));
  beginning_ = true;
  auto wrong = lua_->run();
  beginning_ = false;
  if (wrong) fail(std::move(*wrong));
}

void Machine::stop() noexcept {
  forget();
  failure_.reset();
  failed_ = false;
  Job::cancel();
}

void Machine::forget() noexcept {
  timers_.clear();
  handlers_.clear();
  watches_.clear();
  lua_.reset();
}

// Reports it in a job of its own: the device may be in the middle of an operation, and is still booting when the script
// starts.
void Machine::fail(Failure failure) noexcept {
  failed_ = true;
  failure_ = std::move(failure);
  timers_.silence();
  executor_.post(*this);
}

void Machine::run() noexcept {
  if (!failure_) return;
  const auto failure = *std::exchange(failure_, std::nullopt);
  forget();
  const auto line = static_cast<std::uint16_t>(std::min(failure.line, 0xFFFF));
  const bool its_own =
      failure.kind == Message::Kind::failed;  // otherwise the run ends, which is no error of the device
  if (its_own)
    device_.errors().raise(emcy_failed, co::error_register::generic,
                           {static_cast<std::uint8_t>(line), static_cast<std::uint8_t>(line >> 8U)});
  listener_.script_told({failure.kind, script_.file, failure.line, failure.text});
}

void Machine::print(int line, std::string text) {
  listener_.script_told({Message::Kind::printed, script_.file, line, std::move(text)});
}

template <class Push>
bool Machine::call(int function, Push push) {
  auto wrong = lua_->run([&](lua_State* state) {
    lua_rawgeti(state, LUA_REGISTRYINDEX, function);
    push(state);
    lua_call(state, lua_gettop(state) - 1, 0);
  });
  if (!wrong) return true;
  fail(std::move(*wrong));
  return false;
}

template <class Push>
void Machine::fire(Event event, Push push) {
  for (std::size_t i = 0; running() && i < handlers_.size(); ++i) {
    if (handlers_[i].event == event && !call(handlers_[i].function, push)) return;
  }
}

void Machine::written(ObjectRef ref) {
  for (std::size_t i = 0; running() && i < watches_.size(); ++i) {
    if (watches_[i].ref != ref) continue;
    if (!call(watches_[i].function, [&](lua_State* s) { objects_.push(s, ref); })) return;
  }
}

void Machine::add_watch(ObjectRef ref, int function) {
  watches_.push_back({ref, function});
  if (std::ranges::find(watched_, ref) != watched_.end()) return;
  watched_.push_back(ref);
  device_.on_write(ref, [this, ref] { written(ref); });
}

}  // namespace berth::script
