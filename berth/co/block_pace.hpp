/// Block downloads that share a bus. They send their sub-blocks one after another. After each sub-block the bus stays
/// free for a part of the time that the sub-block took. The pause grows while frames come that a segment outranks
/// (heartbeats), but never beyond the time of the sub-block. Without pauses, the segments of many transfers would take
/// the whole bus, and every device would be lost. While one device writes its flash memory, the others' sub-blocks use
/// the bus.
///
///     co::BlockPace pace(dispatcher);
///     options.pace = &pace;                       // SdoOptions of each transfer; the pace must outlive them
#pragma once

#include "berth/can/dispatcher.hpp"

namespace berth::co {

class BlockPace final : private rt::Job, private can::Handler {
 public:
  /// A transfer that shares the bus.
  class Member {
   public:
    /// The member may send its sub-block; it calls `give` when the sub-block is on the wire.
    virtual void turn() noexcept = 0;

   protected:
    Member() = default;
    ~Member() = default;

   private:
    friend class BlockPace;
    Member* next_ = nullptr;
    bool waits_ = false;
  };

  /// At least 1/n of the time stays free.
  static constexpr unsigned default_free_part = 16;
  explicit BlockPace(can::Dispatcher& dispatcher, unsigned free_part = default_free_part) noexcept
      : dispatcher_(&dispatcher), free_part_(free_part) {}

  /// True: `member` may send at once. False: `turn` is called later, unless the member leaves.
  [[nodiscard]] bool take(Member& member) noexcept;
  /// The member's sub-block is on the wire.
  void give(Member& member) noexcept;
  /// The member sends no more, whether it waits, sends or neither.
  void leave(Member& member) noexcept;

 private:
  void run() noexcept override;
  void received(const can::Frame& frame, rt::Time at) noexcept override;
  void next() noexcept;
  [[nodiscard]] rt::Time now() const noexcept { return dispatcher_->executor().now(); }

  can::Dispatcher* dispatcher_;
  Member* sends_ = nullptr;
  Member* first_ = nullptr;
  rt::Time began_{};
  rt::Time free_until_{};
  rt::Time longest_free_{};
  rt::Duration quiet_{};  // how much one outranked frame prolongs the pause: time for the next to come
  unsigned free_part_;
};

}  // namespace berth::co
