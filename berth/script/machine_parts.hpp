/// A script on its device: starts it, calls it, handles its failure and end. Inside of room `script`; `Behaviour` is
/// its interface for others.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "berth/script/behaviour.hpp"
#include "berth/script/lua.hpp"
#include "berth/script/objects_parts.hpp"
#include "berth/script/timers_parts.hpp"

namespace berth::script {

class Machine final : private rt::Job {
 public:
  /// The events for which a script can be called, besides timers and writes.
  enum class Event : std::uint8_t { state, rpdo, sync };

  using Listener = Behaviour::Listener;

  Machine(device::Device& device, rt::Executor& executor, Script script, Random random, Listener& listener,
          const Limits& limits);
  ~Machine();

  void start();
  void stop() noexcept;
  [[nodiscard]] bool running() const noexcept { return lua_ != nullptr && !failed_; }
  [[nodiscard]] std::size_t memory() const noexcept { return lua_ ? lua_->memory() : 0; }

  // For the functions that scripts call.
  static Machine& of(lua_State* state) { return *static_cast<Machine*>(Lua::of(state).owner()); }
  [[nodiscard]] device::Device& device() noexcept { return device_; }
  [[nodiscard]] rt::Time now() const noexcept { return executor_.now(); }
  [[nodiscard]] Objects& objects() noexcept { return objects_; }
  [[nodiscard]] Timers& timers() noexcept { return timers_; }
  void add_handler(Event event, int function) { handlers_.push_back({function, event}); }
  void add_watch(ObjectRef ref, int function);
  /// Handlers may be registered only while the script starts. `full`: there is no room for another.
  [[nodiscard]] bool beginning() const noexcept { return beginning_; }
  [[nodiscard]] bool full() const noexcept { return handlers_.size() + watches_.size() >= most_handlers; }
  void print(int line, std::string text);
  static constexpr std::size_t most_handlers = 1000;

 private:
  struct Handler {
    int function = LUA_NOREF;  ///< in Lua's registry
    Event event = Event::state;
  };
  struct Watch {
    ObjectRef ref;
    int function;
  };
  void run() noexcept override;
  void written(ObjectRef ref);
  void fail(Failure failure) noexcept;
  void forget() noexcept;
  template <class Push>
  void fire(Event event, Push push);
  template <class Push>
  bool call(int function, Push push);

  device::Device& device_;
  rt::Executor& executor_;
  Script script_;
  Random random_;
  Listener& listener_;
  Limits limits_;
  Objects objects_;
  Timers timers_;
  std::unique_ptr<Lua> lua_;
  std::vector<Handler> handlers_;
  std::vector<Watch> watches_;
  std::vector<ObjectRef> watched_;  ///< registered in the device, permanently
  std::optional<Failure> failure_;  ///< to be reported by the next job
  bool beginning_ = false;
  bool failed_ = false;
};

}  // namespace berth::script
