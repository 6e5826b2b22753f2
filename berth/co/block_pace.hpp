/// Block downloads that share a bus: their sub-blocks go out one after another, and behind each the bus is left free for
/// a while. Else the segments of many transfers, which outrank heartbeats, would take the whole bus, and every device
/// would be lost. While one device writes its flash memory, the others' sub-blocks use the bus.
///
///     co::BlockPace pace(executor);
///     options.pace = &pace;                       // SdoOptions of each transfer; the pace must outlive them
#pragma once

#include "berth/rt/executor.hpp"

namespace berth::co {

class BlockPace final : private rt::Job {
 public:
  /// A transfer.
  class Member {
   public:
    /// It may send its sub-block now, and calls `give` when that is on the wire.
    virtual void turn() noexcept = 0;

   protected:
    Member() = default;
    ~Member() = default;

   private:
    friend class BlockPace;
    Member* next_ = nullptr;
    bool waits_ = false;
  };

  /// Of the time, one part in so many is left free.
  static constexpr unsigned default_free_part = 16;
  explicit BlockPace(rt::Executor& executor, unsigned free_part = default_free_part) noexcept
      : executor_(&executor), free_part_(free_part) {}

  /// True: it may send at once. False: `turn` is called later, unless it leaves.
  [[nodiscard]] bool take(Member& member) noexcept;
  /// Its sub-block is on the wire.
  void give(Member& member) noexcept;
  /// It does not want to send any more, whether it waits, sends or neither.
  void leave(Member& member) noexcept;

 private:
  void run() noexcept override;

  rt::Executor* executor_;
  Member* sends_ = nullptr;
  Member* first_ = nullptr;
  rt::Time began_{};
  rt::Time free_until_{};
  unsigned free_part_;
};

}  // namespace berth::co
