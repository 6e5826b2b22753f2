/// The EMCY gateway of paper 3 (Figure 6; docs/multilevel.md §EMCY), and its heartbeat gateway (Figure 4). Emergencies
/// of the nodes beneath, and the loss of their heartbeats, become emergencies of the gateway's upstream side.
///
///     multilevel::EmcyGateway gateway(upper.errors().emcy(), {.layout = EmcyLayout::source_and_exit});
///     gateway.hear_all(dispatcher_beneath);
///
/// Messages wait until they may be sent: 1014h, 1015h and the NMT state of the upstream side apply to them as to the
/// device's own messages, which go first. The messages of one node keep their order; a node that sends too many loses
/// its own oldest ones only (S3.21). None is sent twice.
#pragma once

#include <bitset>
#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/multilevel/emcy_layout.hpp"

namespace berth::multilevel {

struct EmcyGatewayOptions {
  EmcyLayout layout = EmcyLayout::source_and_exit;
  /// Nodes beneath whose messages also have this layout: gateways, and devices made for such a machine. For all others
  /// the manufacturer-specific bytes do not follow the layout and are left out (S3.18).
  std::bitset<128> speaks_layout{};
  /// Nodes whose messages are routed as in CiA 302-7 (F000h), with `network` for the bus beneath.
  std::bitset<128> routed{};
  std::uint16_t network = 1;
  std::size_t most = 16;  ///< waiting messages of one node
};

/// Trouble of the gateway itself.
struct EmcyTrouble {
  enum class Kind : std::uint8_t { lost, too_deep };
  Kind kind = Kind::lost;
  NodeId node;  ///< beneath
};

class EmcyGateway final : private co::EmcyConsumer::Observer, private co::EmcyBacklog {
 public:
  /// `above` must outlive it and have no other backlog. Hears nothing yet.
  EmcyGateway(co::EmcyProducer& above, const EmcyGatewayOptions& options = {});
  ~EmcyGateway();

  /// For messages from now on. `more_speakers`: in addition to `EmcyGatewayOptions::speaks_layout`.
  void set_layout(EmcyLayout layout, const std::bitset<128>& more_speakers = {}) noexcept {
    options_.layout = layout;
    more_speakers_ = more_speakers;
  }
  [[nodiscard]] EmcyLayout layout() const noexcept { return options_.layout; }

  /// Hears all nodes of a bus beneath on 081h..0FFh. A gateway hears all its buses beneath, and readers of its messages
  /// cannot tell these buses apart. If that matters, use no node-ID on two of them.
  void hear_all(can::Dispatcher& beneath) { consumer(beneath).hear_all(); }
  /// Hears one node whose messages have another identifier: the paper's conversion table.
  void hear(can::Dispatcher& beneath, NodeId node, co::CobId id) { consumer(beneath).hear(node, id); }
  /// Gets each message as heard, with all its bytes: for a log of the gateway's own (S3.18).
  void on_heard(std::function<void(NodeId, const co::Emcy&)> call) { heard_ = std::move(call); }
  /// Called once for each node and kind. The trouble is also reported above: FF03h or FF04h of that node.
  void on_trouble(std::function<void(const EmcyTrouble&)> call) { trouble_ = std::move(call); }
  /// Called when all waiting messages are sent; may be set by several.
  void on_drained(std::function<void()> call) { drained_.push_back(std::move(call)); }

  /// Sends the gateway's message about a node beneath, or about the bus (unconfigured). `exiting`: the error that is
  /// over.
  void report(NodeId node, std::uint16_t code, std::uint8_t error_register, std::uint16_t exiting = 0);
  /// The heartbeat of a node beneath stopped (8130h), or is back (0000h, exiting 8130h). Call it for each event; the
  /// gateway ignores all others (S3.12).
  void heartbeat(const co::HeartbeatEvent& event);

  [[nodiscard]] std::size_t waiting() const noexcept { return queue_.size(); }
  [[nodiscard]] std::uint64_t forwarded() const noexcept { return forwarded_; }
  [[nodiscard]] std::uint64_t lost() const noexcept { return lost_; }
  [[nodiscard]] std::uint64_t too_deep() const noexcept { return too_deep_; }

 private:
  struct Waiting {
    NodeId node;
    co::Emcy message;
  };
  struct Bus {
    can::Dispatcher* dispatcher;
    std::unique_ptr<co::EmcyConsumer> consumer;
  };
  co::EmcyConsumer& consumer(can::Dispatcher& beneath);
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override;
  [[nodiscard]] const co::Emcy* front() const noexcept override {
    return queue_.empty() ? nullptr : &queue_.front().message;
  }
  void pop() noexcept override;
  [[nodiscard]] co::Emcy converted(NodeId node, const co::Emcy& message) noexcept;
  void put(NodeId node, const co::Emcy& message);
  void tell(EmcyTrouble::Kind kind, NodeId node, std::bitset<128>& told) noexcept;

  co::EmcyProducer* above_;
  EmcyGatewayOptions options_;
  std::bitset<128> more_speakers_;
  std::vector<Bus> buses_;
  std::deque<Waiting> queue_;
  std::bitset<128> lost_heartbeats_;
  std::array<std::uint16_t, 128> single_{};  // the only pending error of a plain node; 0: none, or several
  std::array<std::uint8_t, 128> pending_{};  // number of pending errors, as far as known
  std::function<void(NodeId, const co::Emcy&)> heard_;
  std::function<void(const EmcyTrouble&)> trouble_;
  std::vector<std::function<void()>> drained_;
  std::bitset<128> told_lost_;
  std::bitset<128> told_deep_;
  std::uint64_t forwarded_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t too_deep_ = 0;
};

}  // namespace berth::multilevel
