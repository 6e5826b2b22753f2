/// Block downloads that share a bus: their sub-blocks go out one after another, and after each the bus is left free
/// for a while: a part of the time that the sub-block took, and on while frames come that a segment outranks
/// (heartbeats), but no longer than the sub-block took. Else the segments of many transfers would take the whole bus,
/// and every device would be lost. While one device writes its flash memory, the others' sub-blocks use the bus.
///
///     co::BlockPace pace(dispatcher);
///     options.pace = &pace;                       // SdoOptions of each transfer; the pace must outlive them
#pragma once

#include "berth/can/dispatcher.hpp"

namespace berth::co {

class BlockPace final : private rt::Job, private can::Handler {
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

  /// Of the time, one part in so many is left free at least.
  static constexpr unsigned default_free_part = 16;
  explicit BlockPace(can::Dispatcher& dispatcher, unsigned free_part = default_free_part) noexcept
      : dispatcher_(&dispatcher), free_part_(free_part) {}

  /// True: it may send at once. False: `turn` is called later, unless it leaves.
  [[nodiscard]] bool take(Member& member) noexcept;
  /// Its sub-block is on the wire.
  void give(Member& member) noexcept;
  /// It does not want to send any more, whether it waits, sends or neither.
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
  rt::Duration quiet_{};  // a frame that is outranked, and the next one would have come
  unsigned free_part_;
};

}  // namespace berth::co
