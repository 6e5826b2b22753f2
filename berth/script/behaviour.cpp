#include "berth/script/behaviour.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <map>
#include <string_view>
#include <utility>
#include <vector>

#include "berth/od/names.hpp"
#include "berth/script/lua.hpp"

namespace berth::script {
namespace {

constexpr std::size_t most_timers = 256;
constexpr std::size_t most_handlers = 1000;
constexpr double shortest_ms = 0.1;
constexpr double longest_ms = 24.0 * 3600 * 1000;
constexpr std::size_t most_known_words = 1000;

using rt::Duration;

/// What a script can be called for, beside timers and writes.
enum class Event : std::uint8_t { state, rpdo, sync };

struct Handler {
  int function = LUA_NOREF;  ///< in Lua's registry
  Event event = Event::state;
};

std::string range_of(od::DataType type) {
  const unsigned bits = od::bit_length(type);
  if (type == od::DataType::boolean) return "false or true";
  if (od::is_signed(type)) return fmt::format("{} to {}", -(std::int64_t{1} << (bits - 1)), (std::int64_t{1} << (bits - 1)) - 1);
  return fmt::format("0 to {}", (std::uint64_t{1} << bits) - 1);
}

}  // namespace

class Behaviour::Machine final : private rt::Job {
 public:
  Machine(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
          const Limits& limits)
      : device_(&device),
        executor_(&executor),
        script_(std::move(script)),
        random_(random),
        listener_(&listener),
        limits_(limits) {
    auto& on = device.on();
    on.start = [this] { start(); };
    on.state = [this](NmtState to) {
      fire(Event::state, [to](lua_State* s) { lua_pushstring(s, name(to)); });
    };
    on.rpdo = [this](unsigned number) {
      fire(Event::rpdo, [number](lua_State* s) { lua_pushinteger(s, number); });
    };
    on.sync = [this](std::uint8_t counter) {
      fire(Event::sync, [counter](lua_State* s) { lua_pushinteger(s, counter); });
    };
  }
  ~Machine() { device_->on() = {}; }

  void start();
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return lua_ != nullptr && !failed_; }
  [[nodiscard]] std::size_t memory() const noexcept { return lua_ ? lua_->memory() : 0; }

 private:
  class Timer final : public rt::Job {
   public:
    Timer(Machine& all, int called, Duration every, lua_Integer name)
        : machine(&all), period(every), function(called), number(name) {}
    void run() noexcept override { machine->ring(*this); }
    Machine* machine;
    Duration period;  ///< zero: once
    int function;
    lua_Integer number;
  };
  struct Watch {
    ObjectRef ref;
    int function;
  };

  static Machine& of(lua_State* state) { return *static_cast<Machine*>(Lua::of(state).owner()); }
  void run() noexcept override;
  void ring(Timer& timer) noexcept;
  void written(ObjectRef ref);
  void watch(ObjectRef ref, int function);
  void fail(Failure failure) noexcept;
  template <class Push>
  void fire(Event event, Push push);
  template <class Push>
  bool call(int function, Push push);
  void give(const char* name, lua_CFunction function);
  void give_all();
  const od::SubObject& object(lua_State* state, int argument, ObjectRef& ref);
  void push_value(lua_State* state, ObjectRef ref, const od::SubObject& sub) const;
  void store(lua_State* state, ObjectRef ref, const od::SubObject& sub);
  int add_timer(lua_State* state, bool again);
  int add_handler(lua_State* state, Event event);
  int keep_function(lua_State* state, int argument, const char* where);

  static int read(lua_State* state);
  static int write(lua_State* state);
  static int on_write(lua_State* state);
  static int on_state(lua_State* state) { return of(state).add_handler(state, Event::state); }
  static int on_rpdo(lua_State* state) { return of(state).add_handler(state, Event::rpdo); }
  static int on_sync(lua_State* state) { return of(state).add_handler(state, Event::sync); }
  static int every(lua_State* state) { return of(state).add_timer(state, true); }
  static int after(lua_State* state) { return of(state).add_timer(state, false); }
  static int cancel(lua_State* state);
  static int now(lua_State* state);
  static int node_id(lua_State* state);
  static int nmt_state(lua_State* state);
  static int emcy(lua_State* state);
  static int clear_emcy(lua_State* state);
  static int print(lua_State* state);

  device::Device* device_;
  rt::Executor* executor_;
  Script script_;
  Random random_;
  Listener* listener_;
  Limits limits_;
  std::unique_ptr<Lua> lua_;
  std::vector<Handler> handlers_;
  std::vector<Watch> watches_;
  std::vector<ObjectRef> watched_;  ///< known to the device, for good
  std::vector<std::unique_ptr<Timer>> timers_;
  std::map<std::string, ObjectRef, std::less<>> words_;
  lua_Integer next_timer_ = 1;
  std::optional<Failure> failure_;  ///< to be told by the next job
  bool beginning_ = false;
  bool failed_ = false;
};

// --- Its life --------------------------------------------------------------------------------------------------------

void Behaviour::Machine::start() {
  stop();
  lua_ = std::make_unique<Lua>(limits_, random_, this);
  if (!lua_->good()) return fail({0, "there is no memory for it"});
  give_all();
  if (auto wrong = lua_->compile(script_)) return fail(std::move(*wrong));
  beginning_ = true;
  auto wrong = lua_->call(0);
  beginning_ = false;
  if (wrong) fail(std::move(*wrong));
}

void Behaviour::Machine::stop() noexcept {
  timers_.clear();
  handlers_.clear();
  watches_.clear();
  lua_.reset();
  failure_.reset();
  failed_ = false;
  Job::cancel();
}

/// In a job of its own: the device may be in the middle of what it does, and boots yet when the script begins.
void Behaviour::Machine::fail(Failure failure) noexcept {
  failed_ = true;
  failure_ = std::move(failure);
  for (const auto& timer : timers_) timer->cancel();
  executor_->post(*this);
}

void Behaviour::Machine::run() noexcept {
  if (!failure_) return;
  const auto failure = *std::exchange(failure_, std::nullopt);
  timers_.clear();
  handlers_.clear();
  watches_.clear();
  lua_.reset();
  const auto line = static_cast<std::uint16_t>(std::min(failure.line, 0xFFFF));
  device_->raise(emcy_failed, co::error_register::generic,
                 {static_cast<std::uint8_t>(line), static_cast<std::uint8_t>(line >> 8U)});
  listener_->script_told({Told::Kind::failed, script_.file, failure.line, failure.text});
}

template <class Push>
bool Behaviour::Machine::call(int function, Push push) {
  lua_State* const state = lua_->state();
  lua_rawgeti(state, LUA_REGISTRYINDEX, function);
  const int before = lua_gettop(state);
  push(state);
  auto wrong = lua_->call(lua_gettop(state) - before);
  if (!wrong) return true;
  fail(std::move(*wrong));
  return false;
}

template <class Push>
void Behaviour::Machine::fire(Event event, Push push) {
  for (std::size_t i = 0; running() && i < handlers_.size(); ++i) {
    if (handlers_[i].event == event && !call(handlers_[i].function, push)) return;
  }
}

void Behaviour::Machine::ring(Timer& timer) noexcept {
  if (!running()) return;
  const int function = timer.function;
  const auto number = timer.number;
  const bool again = timer.period > Duration::zero();
  if (again) executor_->after(device_->timing().in_world(timer.period), timer);
  if (!call(function, [](lua_State*) {}) || again) return;
  std::erase_if(timers_, [number](const auto& t) { return t->number == number; });
  luaL_unref(lua_->state(), LUA_REGISTRYINDEX, function);
}

void Behaviour::Machine::written(ObjectRef ref) {
  for (std::size_t i = 0; running() && i < watches_.size(); ++i) {
    if (watches_[i].ref != ref) continue;
    const auto* sub = device_->values().description().find(ref);
    if (!call(watches_[i].function, [&](lua_State* s) { push_value(s, ref, *sub); })) return;
  }
}

void Behaviour::Machine::watch(ObjectRef ref, int function) {
  watches_.push_back({ref, function});
  if (std::ranges::find(watched_, ref) != watched_.end()) return;
  watched_.push_back(ref);
  device_->on_write(ref, [this, ref] { written(ref); });
}

// --- What it sees ----------------------------------------------------------------------------------------------------

void Behaviour::Machine::give(const char* name, lua_CFunction function) {
  lua_pushcfunction(lua_->state(), function);
  lua_setfield(lua_->state(), -2, name);
}

void Behaviour::Machine::give_all() {
  lua_State* const state = lua_->state();
  lua_newtable(state);
  give("read", &Machine::read);
  give("write", &Machine::write);
  give("on_write", &Machine::on_write);
  give("on_state", &Machine::on_state);
  give("on_rpdo", &Machine::on_rpdo);
  give("on_sync", &Machine::on_sync);
  give("every", &Machine::every);
  give("after", &Machine::after);
  give("cancel", &Machine::cancel);
  give("now", &Machine::now);
  give("node_id", &Machine::node_id);
  give("state", &Machine::nmt_state);
  give("emcy", &Machine::emcy);
  give("clear_emcy", &Machine::clear_emcy);
  lua_setglobal(state, "device");
  lua_pushcfunction(state, &Machine::print);
  lua_setglobal(state, "print");
}

const od::SubObject& Behaviour::Machine::object(lua_State* state, int argument, ObjectRef& ref) {
  std::size_t length = 0;
  const char* const text = luaL_checklstring(state, argument, &length);
  const std::string_view word(text, length);
  const auto& description = device_->values().description();
  if (const auto known = words_.find(word); known != words_.end()) {
    ref = known->second;
  } else {
    const auto found = od::find_object(description, word);
    if (!found) luaL_error(state, "\"%s\": %s", text, found.error().why.c_str());
    ref = *found;
    if (words_.size() < most_known_words) words_.emplace(word, ref);
  }
  const auto* const sub = description.find(ref);
  if (sub == nullptr) luaL_error(state, "\"%s\": the device has no such object", text);
  return *sub;
}

void Behaviour::Machine::push_value(lua_State* state, ObjectRef ref, const od::SubObject& sub) const {
  const auto bytes = device_->values().bytes(ref);
  if (sub.variable_length() || od::is_time(sub.type)) {
    lua_pushlstring(state, reinterpret_cast<const char*>(bytes.data()), bytes.size());
  } else if (sub.type == od::DataType::boolean) {
    lua_pushboolean(state, bytes[0] != 0 ? 1 : 0);
  } else if (od::is_real(sub.type)) {
    lua_pushnumber(state, od::real_of(sub.type, od::load(sub.type, bytes.data())));
  } else {
    lua_pushinteger(state, static_cast<lua_Integer>(od::load(sub.type, bytes.data())));
  }
}

void Behaviour::Machine::store(lua_State* state, ObjectRef ref, const od::SubObject& sub) {
  auto& values = device_->values();
  const auto shown = od::write_object(ref);
  const auto type = std::string(od::name(sub.type));
  od::AbortCode answer = od::AbortCode::none;
  if (sub.variable_length() || od::is_time(sub.type)) {
    std::size_t length = 0;
    const char* const text = luaL_checklstring(state, 2, &length);
    answer = values.set_bytes(ref, {reinterpret_cast<const std::uint8_t*>(text), length});
    if (answer != od::AbortCode::none) luaL_error(state, "%s: a text of this length does not fit", shown.c_str());
    return;
  }
  if (od::is_real(sub.type)) {
    answer = values.set(ref, luaL_checknumber(state, 2));
  } else if (lua_isboolean(state, 2)) {
    if (sub.type != od::DataType::boolean) luaL_error(state, "%s is %s, not a boolean", shown.c_str(), type.c_str());
    answer = values.set(ref, lua_toboolean(state, 2) != 0);
  } else {
    int whole = 0;
    const auto number = lua_tointegerx(state, 2, &whole);
    if (whole == 0) luaL_error(state, "%s is %s, %s is no whole number", shown.c_str(), type.c_str(), luaL_typename(state, 2));
    const bool wide = sub.type == od::DataType::unsigned64;
    answer = wide ? values.set(ref, static_cast<std::uint64_t>(number)) : values.set(ref, std::int64_t{number});
  }
  if (answer == od::AbortCode::none) return;
  const auto range = od::is_real(sub.type) ? std::string("a number that it can hold") : range_of(sub.type);
  luaL_error(state, "%s is %s, %s does not fit; use %s", shown.c_str(), type.c_str(), luaL_tolstring(state, 2, nullptr),
             range.c_str());
}

int Behaviour::Machine::read(lua_State* state) {
  ObjectRef ref;
  const auto& sub = of(state).object(state, 1, ref);
  of(state).push_value(state, ref, sub);
  return 1;
}

int Behaviour::Machine::write(lua_State* state) {
  Machine& self = of(state);
  ObjectRef ref;
  const auto& sub = self.object(state, 1, ref);
  luaL_checkany(state, 2);
  if (ref.index < 0x2000) {
    luaL_error(state, "%s: 1000h to 1FFFh are the device's own; a script writes from 2000h on",
               od::write_object(ref).c_str());
  }
  const auto stored = self.device_->values().bytes(ref);
  const std::vector<std::uint8_t> before(stored.begin(), stored.end());
  self.store(state, ref, sub);
  if (!std::ranges::equal(before, self.device_->values().bytes(ref))) self.device_->value_changed(ref);
  return 0;
}

int Behaviour::Machine::keep_function(lua_State* state, int argument, const char* where) {
  luaL_checktype(state, argument, LUA_TFUNCTION);
  if (!beginning_) luaL_error(state, "device.%s: handlers are named while the script begins, not later", where);
  if (handlers_.size() + watches_.size() >= most_handlers) luaL_error(state, "there are more than 1000 handlers");
  lua_pushvalue(state, argument);
  return luaL_ref(state, LUA_REGISTRYINDEX);
}

int Behaviour::Machine::on_write(lua_State* state) {
  Machine& self = of(state);
  ObjectRef ref;
  self.object(state, 1, ref);
  self.watch(ref, self.keep_function(state, 2, "on_write"));
  return 0;
}

int Behaviour::Machine::add_handler(lua_State* state, Event event) {
  constexpr std::array names{"on_state", "on_rpdo", "on_sync"};
  handlers_.push_back({keep_function(state, 1, names[static_cast<std::size_t>(event)]), event});
  return 0;
}

int Behaviour::Machine::add_timer(lua_State* state, bool again) {
  const auto ms = luaL_checknumber(state, 1);
  luaL_checktype(state, 2, LUA_TFUNCTION);
  if (!(ms >= shortest_ms && ms <= longest_ms)) luaL_error(state, "a timer takes 0.1 ms to 24 h");
  if (timers_.size() >= most_timers) luaL_error(state, "there are more than 256 timers");
  lua_pushvalue(state, 2);
  const Duration period(static_cast<std::int64_t>(ms * 1e6));
  const int function = luaL_ref(state, LUA_REGISTRYINDEX);
  timers_.push_back(std::make_unique<Timer>(*this, function, again ? period : Duration::zero(), next_timer_++));
  executor_->after(device_->timing().in_world(period), *timers_.back());
  lua_pushinteger(state, timers_.back()->number);
  return 1;
}

int Behaviour::Machine::cancel(lua_State* state) {
  Machine& self = of(state);
  const auto number = luaL_checkinteger(state, 1);
  const auto it = std::ranges::find(self.timers_, number, [](const auto& timer) { return timer->number; });
  lua_pushboolean(state, it != self.timers_.end() ? 1 : 0);
  if (it == self.timers_.end()) return 1;
  luaL_unref(state, LUA_REGISTRYINDEX, (*it)->function);
  self.timers_.erase(it);
  return 1;
}

int Behaviour::Machine::now(lua_State* state) {
  lua_pushnumber(state, static_cast<double>(of(state).executor_->now().time_since_epoch().count()) / 1e6);
  return 1;
}

int Behaviour::Machine::node_id(lua_State* state) {
  const auto id = of(state).device_->node_id();
  if (!id.configured()) return 0;
  lua_pushinteger(state, id.value());
  return 1;
}

int Behaviour::Machine::nmt_state(lua_State* state) {
  lua_pushstring(state, name(of(state).device_->state()));
  return 1;
}

int Behaviour::Machine::emcy(lua_State* state) {
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
      of(state).device_->raise(static_cast<std::uint16_t>(code), static_cast<std::uint8_t>(bits), info);
  lua_pushboolean(state, raised ? 1 : 0);
  return 1;
}

int Behaviour::Machine::clear_emcy(lua_State* state) {
  const auto code = luaL_checkinteger(state, 1);
  const bool cleared = code >= 0x1000 && code <= 0xFFFF && of(state).device_->clear(static_cast<std::uint16_t>(code));
  lua_pushboolean(state, cleared ? 1 : 0);
  return 1;
}

int Behaviour::Machine::print(lua_State* state) {
  Machine& self = of(state);
  if (!self.lua_->count_line()) luaL_error(state, "one call prints at most %d lines", static_cast<int>(self.limits_.lines));
  const int given = lua_gettop(state);
  std::string line;
  for (int i = 1; i <= given; ++i) {
    lua_getglobal(state, "tostring");
    lua_pushvalue(state, i);
    lua_call(state, 1, 1);
    std::size_t length = 0;
    const char* const text = lua_tolstring(state, -1, &length);
    if (text != nullptr && line.size() < 1000) line += (i > 1 ? " " : "") + std::string(text, std::min<std::size_t>(length, 1000));
    lua_pop(state, 1);
  }
  self.listener_->script_told({Told::Kind::printed, self.script_.file, current_line(state), std::move(line)});
  return 0;
}

// --- Behaviour -------------------------------------------------------------------------------------------------------

Behaviour::Behaviour(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
                     const Limits& limits)
    : machine_(std::make_unique<Machine>(device, executor, std::move(script), random, listener, limits)) {}

Behaviour::~Behaviour() = default;

void Behaviour::stop() noexcept { machine_->stop(); }
bool Behaviour::running() const noexcept { return machine_->running(); }
std::size_t Behaviour::memory() const noexcept { return machine_->memory(); }

}  // namespace berth::script
