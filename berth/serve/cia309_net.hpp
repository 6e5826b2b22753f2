/// One network in one CiA 309-3 conversation: what it supervises, and its indications. Internal to room `serve`.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <string>

#include "berth/co/emcy.hpp"
#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/operate/network.hpp"
#include "berth/serve/cia309_pdo.hpp"
#include "berth/serve/cia309_permits.hpp"

namespace berth::serve::cia309 {

class Net final : private co::HeartbeatConsumer::Observer,
                  private co::GuardingMaster::Observer,
                  private co::EmcyConsumer::Observer,
                  private Pdos::Ear,
                  private can::Handler {
 public:
  Net(operate::Network& of, unsigned n, std::function<void(std::string_view)>& say)
      : network(of),
        number(n),
        sdo_timeout(of.services().sdo.options().timeout),
        heartbeats(of.services().dispatcher, *this),
        guards(of.services().dispatcher, *this),
        pdos(of.services().dispatcher, *this),
        say_(&say),
        emcy_(of.services().dispatcher, *this) {
    heartbeats.hear_all_boot_ups(true);
    emcy_.hear_all();
  }

  void indicate_sync(bool on) {
    network.services().dispatcher.remove(*this);
    if (on) network.services().dispatcher.add(can::only(0x080), *this);
  }
  /// Reports changes of the port's own state.
  void look() {
    const auto now = network.services().dispatcher.port().status();
    if (now.bus_off && !bus_off_) error(network.bus().master, Code::bus_off);
    if (now.error_passive() && !now.bus_off && !passive_) error(network.bus().master, Code::error_passive);
    bus_off_ = now.bus_off;
    passive_ = now.error_passive();
  }

  /// Waits for the network's turn, for LSS; false: it was not released in time.
  rt::Task<bool> take_turn();
  /// Gives it back; devices that this conversation put into LSS configuration state are switched to waiting.
  void release() noexcept;
  /// The reply for a failed service.
  [[nodiscard]] Outcome failed(const Error& error) const;

  static constexpr rt::Duration turn_patience = std::chrono::seconds(5);  ///< for a network that the main job uses

  operate::Network& network;
  const unsigned number;
  rt::Duration sdo_timeout;
  bool sdo_block = false;
  bool boot_ups = true;
  bool has_turn = false;  ///< the network's, for LSS
  bool selected = false;  ///< a device may be in LSS configuration state because of this conversation
  co::HeartbeatConsumer heartbeats;
  co::GuardingMaster guards;
  Pdos pdos;

 private:
  void error(NodeId node, Code code) {
    (*say_)(fmt::format("{} {} ERROR {}\r\n", number, node.value(), static_cast<unsigned>(code)));
  }
  void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override {
    using Kind = co::HeartbeatEvent::Kind;
    switch (event.kind) {
      case Kind::boot_up:
        if (boot_ups) (*say_)(fmt::format("{} {} BOOT_UP\r\n", number, event.node.value()));
        break;
      case Kind::started:
      case Kind::recovered: error(event.node, Code::heartbeat_started); break;
      case Kind::lost: error(event.node, Code::heartbeat_lost); break;
      default: break;
    }
  }
  void guarding(const co::GuardingEvent& event, rt::Time) noexcept override {
    using Kind = co::GuardingEvent::Kind;
    if (event.kind == Kind::toggle_error) error(event.node, Code::guarding_message_lost);
    if (event.kind == Kind::lost) error(event.node, Code::guarding_lost);
  }
  void emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept override {
    (*say_)(fmt::format("{} {} EMCY 0x{:04X} 0x{:02X} {}\r\n", number, node.value(), message.code,
                        message.error_register, fmt::join(message.info, " ")));
  }
  void received(std::uint16_t pdo, std::span<const std::uint64_t> values) noexcept override {
    (*say_)(fmt::format("{} pdo {} {}{}\r\n", number, pdo, values.size(), pdo_values(values)));
  }
  void received(const can::Frame& frame, rt::Time) noexcept override {
    if (frame.remote) return;
    (*say_)(frame.size == 1 ? fmt::format("{} SYNC {}\r\n", number, frame.data[0])
                            : fmt::format("{} SYNC\r\n", number));
  }

 public:
  static std::string pdo_values(std::span<const std::uint64_t> values) {
    std::string text;
    for (const auto value : values) text += fmt::format(" 0x{:x}", value);
    return text;
  }

 private:
  std::function<void(std::string_view)>* say_;
  co::EmcyConsumer emcy_;
  bool bus_off_ = false;
  bool passive_ = false;
};

}  // namespace berth::serve::cia309
