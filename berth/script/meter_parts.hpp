/// Counts a script's use of resources against its `Limits`: instructions, memory, and the host's processor. Inside of
/// room `script`. It provides Lua's memory and knows nothing else of Lua.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "berth/script/behaviour.hpp"

namespace berth::script {

class Meter {
 public:
  /// Why a call ends.
  enum class End : std::uint8_t { none, instructions, memory, block, processor, host };

  static constexpr std::size_t bytes_an_instruction = 256;
  static constexpr std::size_t bytes_of_text = 1024;  ///< each of them adds one to the count of an instruction
  static constexpr std::size_t bytes_of_stack = 16 * 256;
  static constexpr std::int64_t looked_after = 1000;  ///< instructions between two checks of the host

  /// `must_end` is asked during a long call; empty: never.
  Meter(const Limits& limits, std::function<bool()> must_end);

  /// Enables the limits; before, Lua makes itself and its libraries.
  void bind() noexcept { bound_ = true; }
  /// Disables the limits, for destroying Lua.
  void release() noexcept { bound_ = false; }
  /// Another call begins.
  void begin() noexcept;
  /// Counts instructions of Lua's machine; false: the call ends.
  bool run(unsigned instructions) noexcept;
  /// The compiler reads the next byte of a text: not an instruction, but the host's limit is checked. False: it ends.
  bool compile_byte() noexcept;
  /// Counts work of the host that took as long as so many instructions.
  void charge(std::size_t instructions) noexcept { left_ -= static_cast<std::int64_t>(instructions); }
  /// As `lua_Alloc`; `text`: a new block for one of Lua's strings. Null: refused, see `end`.
  void* allocate(void* old, std::size_t old_size, std::size_t size, bool text) noexcept;
  /// The block that grows until `stack_known` is Lua's stack; nothing else grows meanwhile.
  void find_stack() noexcept { finding_stack_ = true; }
  void stack_known() noexcept { finding_stack_ = false; }

  /// The call has to end: nothing in it may go on, not even `pcall`.
  [[nodiscard]] bool over() const noexcept { return left_ <= 0; }
  [[nodiscard]] End end() const noexcept { return over() && !host_ends() ? End::instructions : end_; }
  [[nodiscard]] std::size_t used() const noexcept { return used_; }
  /// How much an instruction counts.
  [[nodiscard]] std::int64_t weight() const noexcept { return weight_; }
  [[nodiscard]] std::size_t longest_text() const noexcept { return longest_text_; }

 private:
  bool refuse(End why) noexcept;
  [[nodiscard]] bool host_ends() const noexcept { return end_ == End::processor || end_ == End::host; }
  [[nodiscard]] bool may_take(std::size_t had, std::size_t size) noexcept;
  void give_back(void* old, std::size_t size) noexcept;
  void move_stack() noexcept;
  void weigh() noexcept;
  void look() noexcept;
  void ask_host() noexcept;

  Limits limits_;
  std::function<bool()> must_end_;
  std::size_t used_ = 0;
  std::size_t longest_text_ = 0;
  std::size_t stack_size_ = 0;
  const void* stack_ = nullptr;
  struct {
    const void* at;
    std::size_t size;
  } newest_{};  // block
  std::int64_t weight_ = 1;
  std::int64_t left_ = 0;
  std::int64_t look_at_ = 0;    // of `left_`
  std::uint32_t compiled_ = 0;  // bytes
  std::chrono::nanoseconds began_{0};
  End end_ = End::none;
  bool bound_ = false;
  bool finding_stack_ = false;
};

}  // namespace berth::script
