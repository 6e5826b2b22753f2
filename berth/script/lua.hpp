/// A Lua state with limits, in which a script's text and functions run. Inside of room `script`. It is Lua compiled as
/// C++, whose errors are exceptions: destructors run.
#pragma once

#include <cstdint>
#include <functional>
#include <lua5.4/lua.hpp>
#include <memory>
#include <optional>
#include <string>

#include "berth/base/random.hpp"
#include "berth/script/behaviour.hpp"
#include "berth/script/meter_parts.hpp"

namespace berth::script {

/// What went wrong in a call.
struct Failure {
  int line = 0;
  std::string text;
  Message::Kind kind = Message::Kind::failed;
};

class Lua {
 public:
  /// With the libraries that a script may use. `owner_of` returns `owner`; `must_end` as in `Meter`.
  Lua(const Limits& limits, Random random, void* owner, std::function<bool()> must_end = {});
  ~Lua();
  Lua(const Lua&) = delete;
  Lua& operator=(const Lua&) = delete;

  /// The libraries are loaded; false if the limits leave no room for them.
  [[nodiscard]] bool good() const noexcept { return good_; }
  /// Compiles, and leaves the function on the stack.
  [[nodiscard]] std::optional<Failure> compile(const Script& script);
  /// The column at which the last `compile` failed, from 1.
  [[nodiscard]] int column() const noexcept { return column_; }
  /// Calls the function that `compile` left.
  [[nodiscard]] std::optional<Failure> run();
  /// Runs `work` protected and within the limits, with an empty stack. Outside of such a call, a failed allocation
  /// would end the process.
  using Work = std::function<void(lua_State*)>;
  [[nodiscard]] std::optional<Failure> run(const Work& work);

  [[nodiscard]] lua_State* state() noexcept { return state_.get(); }
  [[nodiscard]] std::size_t memory() const noexcept { return meter_.used(); }
  [[nodiscard]] Meter& meter() noexcept { return meter_; }
  [[nodiscard]] static Lua& of(lua_State* state) noexcept { return **static_cast<Lua**>(lua_getextraspace(state)); }
  [[nodiscard]] void* owner() noexcept { return owner_; }
  [[nodiscard]] int most_lines() const noexcept { return static_cast<int>(limits_.lines); }
  /// Counts a line; false if the call has printed enough.
  [[nodiscard]] bool count_line() noexcept { return lines_++ < limits_.lines; }

 private:
  struct Close {
    void operator()(lua_State* state) const noexcept { lua_close(state); }
  };
  static void* allocate(void* self, void* old, std::size_t old_size, std::size_t size) noexcept;
  static void count(lua_State* state, lua_Debug* record);
  static int explain(lua_State* state);
  static int protect(lua_State* state);
  static int draw(lua_State* state);
  static int open(lua_State* state);
  static int work(lua_State* state);
  [[nodiscard]] std::optional<Failure> call(int arguments);
  [[nodiscard]] Failure failure(int status);
  [[nodiscard]] std::string why_so_few() const;
  [[nodiscard]] std::string why(Meter::End end) const;
  void begin() noexcept;
  void note_line() noexcept;

  Limits limits_;
  Meter meter_;
  Random random_;
  void* owner_;
  std::uint32_t lines_ = 0;
  int line_ = 0;
  int column_ = 0;
  bool good_ = false;
  std::unique_ptr<lua_State, Close> state_;
};

/// The line of a script that is running; 0 if none is.
[[nodiscard]] int current_line(lua_State* state);

}  // namespace berth::script
