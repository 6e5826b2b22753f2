/// Hears frames that only the owner of a node-ID sends, and stores for each node-ID when it last booted and was last
/// heard: so it knows whether a device came to a node-ID since some time, and whether there is any device at all. Error
/// control (CiA 301 §7.2.8.3) shows boots and states; EMCY and SDO answers on their predefined COB-IDs show that the
/// node-ID is in use.
#pragma once

#include <array>
#include <chrono>
#include <optional>

#include "berth/base/ids.hpp"
#include "berth/can/dispatcher.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/rt/task.hpp"

namespace berth::places {

class BootWatch final : private can::Handler {
 public:
  /// `sdo`: is told each boot-up, so that silence from before it does not excuse a second answer; may be null.
  explicit BootWatch(can::Dispatcher& dispatcher, co::SdoClient* sdo = nullptr);

  /// When the last boot-up message under this node-ID was heard.
  [[nodiscard]] std::optional<rt::Time> boot_up(NodeId id) const noexcept { return at(id).boot_up; }
  /// When any error control message under this node-ID was heard, and its NMT state.
  [[nodiscard]] std::optional<rt::Time> heard(NodeId id) const noexcept { return at(id).heard; }
  [[nodiscard]] NmtState state(NodeId id) const noexcept { return at(id).state; }
  /// Nothing was heard under this node-ID at or after `since`: no error control message, EMCY or SDO answer.
  [[nodiscard]] bool silent_since(NodeId id, rt::Time since) const noexcept {
    const Node& node = at(id);
    return (!node.heard || *node.heard < since) && (!node.voice || *node.voice < since);
  }
  /// An unanswered question under this node-ID at `asked` still shows that no device has it: nothing was heard there
  /// since, or in the second before. A device heard so recently may have missed the question.
  [[nodiscard]] bool vacant_since(NodeId id, rt::Time asked) const noexcept {
    return silent_since(id, asked - std::chrono::seconds(1));
  }
  /// Number of error control messages under this node-ID, without boot-ups.
  [[nodiscard]] std::uint64_t beats(NodeId id) const noexcept { return at(id).beats; }
  /// The heartbeat period, if the last two gaps were equal, whatever 1017h says.
  [[nodiscard]] std::optional<rt::Duration> steady(NodeId id) const noexcept;
  /// Number of boot-up messages.
  [[nodiscard]] std::uint64_t boot_ups(NodeId id) const noexcept { return at(id).boot_ups; }
  /// A boot-up under this node-ID was heard at or after `since`.
  [[nodiscard]] bool booted_since(NodeId id, rt::Time since) const noexcept {
    return at(id).boot_up && *at(id).boot_up >= since;
  }

  /// The node has given this node-ID up.
  void forget(NodeId id) noexcept { nodes_[place(id)] = {}; }

  /// A boot-up message under this node-ID, at or after this time.
  struct BootUp {
    NodeId id;
    rt::Time since{};
  };

  /// Waits for a boot-up under `id` at or after `since`; true if it came before `deadline`. Must not outlive the watch.
  class Wait final : public rt::Operation<Wait>, private rt::Job {
   public:
    Wait(BootWatch& watch, NodeId id, rt::Time since, rt::Time deadline, const BootUp& other) noexcept
        : watch_(&watch), id_(id), other_(other), since_(since), deadline_(deadline) {}
    ~Wait();
    bool start() noexcept;
    bool await_resume() noexcept { return watch_->booted_since(id_, since_); }

   private:
    friend class BootWatch;
    void run() noexcept override;
    void leave() noexcept;
    [[nodiscard]] bool is_over() const noexcept;
    BootWatch* watch_;
    Wait* next_ = nullptr;
    NodeId id_;
    BootUp other_;
    rt::Time since_;
    rt::Time deadline_;
  };
  [[nodiscard]] Wait wait(NodeId id, rt::Time since, rt::Time deadline) noexcept {
    return Wait(*this, id, since, deadline, BootUp{});
  }
  /// The same; `other` ends it too.
  [[nodiscard]] Wait wait(BootUp id, BootUp other, rt::Time deadline) noexcept {
    return Wait(*this, id.id, id.since, deadline, other);
  }

 private:
  struct Node {
    std::optional<rt::Time> boot_up;
    std::optional<rt::Time> heard;
    std::optional<rt::Time> voice;  // EMCY, SDO answer
    NmtState state = NmtState::initialising;
    std::optional<rt::Time> beat;        // since the last boot-up
    std::array<rt::Duration, 2> gaps{};  // the last two gaps between beats, newest first; 0: none yet
    std::uint64_t beats = 0;
    std::uint64_t boot_ups = 0;
  };
  // No node is ever heard under 0, so that place answers for "no node-ID" (FFh): nothing was heard.
  [[nodiscard]] static std::size_t place(NodeId id) noexcept { return id.configured() ? id.value() : 0U; }
  [[nodiscard]] const Node& at(NodeId id) const noexcept { return nodes_[place(id)]; }
  void received(const can::Frame& frame, rt::Time at) noexcept override;

  void error_control(Node& node, const can::Frame& frame, rt::Time at) noexcept;

  co::SdoClient* sdo_;
  std::array<Node, 128> nodes_{};
  Wait* waiters_ = nullptr;
};

}  // namespace berth::places
