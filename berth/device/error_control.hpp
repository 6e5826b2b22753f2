/// A device's error control (CiA 301 §7.2.8.2.2; docs/protocols/cia301.md §Error control): the heartbeat that it
/// sends (1017h), the nodes whose heartbeat it supervises (1016h), and guarding (100Ch, 100Dh), which its own heartbeat
/// switches off. A lost node, or a master that stopped guarding, raises 8130h and an error of 1029h:01. Each node is an
/// error of its own, so that the return of one is reported while another is still lost.
///
/// No heap after construction.
#pragma once

#include <memory>

#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/device/errors.hpp"
#include "berth/device/host.hpp"
#include "berth/od/values.hpp"

namespace berth::device {

class ErrorControl final : private co::GuardingSlave::Observer,
                           private co::HeartbeatConsumer::Observer,
                           private od::Hook {
 public:
  /// `never_seen`: by the device's clock, how long a node of 1016h may have no heartbeat before that is reported; 0 =
  /// for ever. `observer` receives events of the nodes of 1016h. All must outlive it.
  ErrorControl(can::Dispatcher& dispatcher, od::Values& values, Errors& errors, const Host& host,
               rt::Duration never_seen, co::HeartbeatConsumer::Observer& observer);

  /// Initialising is over, with this (configured) node-ID: uses the objects' current values.
  void start(NodeId id, NmtState state) noexcept;
  void set_state(NmtState state) noexcept;
  /// Sends, asks and supervises nothing.
  void stop() noexcept;
  /// A bit rate is being changed: no heartbeats until `speak`.
  void hush() noexcept { producer_.stop(); }
  void speak(NodeId id, NmtState state) noexcept { producer_.start(id, state); }

  /// Bytes held outside the object.
  [[nodiscard]] std::size_t memory() const noexcept { return consumer_size_; }

 private:
  void life_guarding(bool lost, rt::Time at) noexcept override;
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  od::AbortCode writing(const od::Values& values, ObjectRef ref, std::span<const std::uint8_t> value) noexcept override;
  void written(od::Values& values, ObjectRef ref) noexcept override;
  void apply_period() noexcept;
  void apply_life_time() noexcept;
  void apply_entries() noexcept;
  void forget_errors() noexcept;
  [[nodiscard]] rt::Duration milliseconds(std::uint16_t index) const noexcept;

  od::Values* values_;
  Errors* errors_;
  const Host* host_;
  co::HeartbeatConsumer::Observer* observer_;
  co::HeartbeatProducer producer_;
  co::GuardingSlave guarding_;
  std::unique_ptr<co::HeartbeatConsumer> consumer_;  // only with object 1016h
  std::size_t consumer_size_ = 0;
};

}  // namespace berth::device
