/// The EMCY gateway of paper 3 (Figure 6; docs/multilevel.md §EMCY), and its heartbeat gateway (Figure 4): emergencies
/// of the nodes beneath, and the loss of their heartbeats, become emergencies of the gateway's upstream side.
///
///     multilevel::EmcyGateway gateway(upper.errors().emcy(), {.layout = EmcyLayout::source_and_exit});
///     gateway.hear_all(dispatcher_beneath);
///
/// What is heard waits until it may go out: 1014h, 1015h and the NMT state of the upstream side hold for it as for the
/// device's own messages, which come first. The messages of one node keep their order; a node that sends too many loses
/// its oldest, and no other's (S3.21). None is sent twice.
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
  /// Nodes beneath whose messages have this layout, too: gateways, and devices that are made for such a machine. Of all
  /// others the manufacturer-specific bytes are no layout's and are left out (S3.18).
  std::bitset<128> speaks_layout{};
  /// Nodes whose messages go as CiA 302-7 routes them (F000h), with `network` for the bus beneath.
  std::bitset<128> routed{};
  std::uint16_t network = 1;
  std::size_t most = 16;  ///< messages of one node that wait
};

/// What the gateway must tell of itself.
struct EmcyTrouble {
  enum class Kind : std::uint8_t { lost, too_deep };
  Kind kind = Kind::lost;
  NodeId node;  ///< beneath
};

class EmcyGateway final : private co::EmcyConsumer::Observer, private co::EmcyBacklog {
 public:
  /// `above` must stay, and has no other backlog. Hears nothing yet.
  EmcyGateway(co::EmcyProducer& above, const EmcyGatewayOptions& options = {});
  ~EmcyGateway();

  /// Of what is heard or reported from now on. `more_speakers`: besides those of `EmcyGatewayOptions::speaks_layout`.
  void set_layout(EmcyLayout layout, const std::bitset<128>& more_speakers = {}) noexcept {
    options_.layout = layout;
    more_speakers_ = more_speakers;
  }
  [[nodiscard]] EmcyLayout layout() const noexcept { return options_.layout; }

  /// All nodes of a bus beneath on 081h..0FFh. A gateway with several buses beneath hears them all; who reads its
  /// messages cannot tell them apart, so let no two of them have nodes with one node-ID where that matters.
  void hear_all(can::Dispatcher& beneath) { consumer(beneath).hear_all(); }
  /// One node whose messages have another identifier: the paper's conversion table.
  void hear(can::Dispatcher& beneath, NodeId node, co::CobId id) { consumer(beneath).hear(node, id); }
  /// Each message as it was heard, with all its bytes: for a log of the gateway's own (S3.18).
  void on_heard(std::function<void(NodeId, const co::Emcy&)> call) { heard_ = std::move(call); }
  /// Once for each node and kind; it is told above, too: FF03h or FF04h of that node.
  void on_trouble(std::function<void(const EmcyTrouble&)> call) { trouble_ = std::move(call); }
  /// Everything that waited is out. All who asked are called.
  void on_drained(std::function<void()> call) { drained_.push_back(std::move(call)); }

  /// A message of the gateway about a node beneath, or about the bus (unconfigured). `exiting`: what is over.
  void report(NodeId node, std::uint16_t code, std::uint8_t error_register, std::uint16_t exiting = 0);
  /// A node beneath: its heartbeat stopped (8130h), or is back (0000h, exiting 8130h). To be told of each event; others
  /// than these are none of the gateway's (S3.12).
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
  std::array<std::uint16_t, 128> single_{};  // the one error of a plain node that is pending; 0: none, or several
  std::array<std::uint8_t, 128> pending_{};  // how many, as far as is known
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
