#include "berth/sim/controller.hpp"

#include <algorithm>
#include <utility>

#include "berth/can/length.hpp"
#include "berth/sim/bus.hpp"
#include "berth/sim/segment.hpp"

namespace berth::sim {

Controller::Controller(Bus& bus, int number, const ControllerOptions& options)
    : bus_(&bus),
      node_{.controller = this,
            .number = number,
            .bit_rate = options.bit_rate != 0 ? options.bit_rate : bus.bit_rate(),
            .powered = options.powered,
            .listen_only = options.listen_only,
            .transmit{options.queue, options.queue_depth, bus.fd()},
            .host{bus.executor(), *this, options.rx_depth, options.rx_service}},
      name_(options.name.empty() ? "node" + std::to_string(number) : options.name) {}

Controller::~Controller() {
  node_.host.listen(nullptr);
  bus_->detach(*this);
}

can::Queued Controller::send(const can::Frame& frame, std::uint32_t tag) noexcept {
  const auto sends_fd = [&] { return bus_->fd() && !frame.remote && can::fd_dlc(frame.size).has_value(); };
  const bool fits =
      (frame.fd ? sends_fd() : frame.size <= 8) && frame.id <= (frame.extended ? can::extended_mask : can::base_mask);
  if (!node_.powered || !fits) return can::Queued::closed;
  if (node_.listen_only) return can::Queued::listen_only;
  if (node_.errors.bus_off()) return can::Queued::bus_off;
  if (node_.transmit.full()) return can::Queued::full;
  if (node_.transmit.push(frame, tag)) node_.segment->offer(node_);
  return can::Queued::yes;
}

void Controller::withdraw(std::uint32_t tag) noexcept {
  if (tag != 0 && node_.transmit.withdraw(tag)) node_.segment->offer(node_);
}

void Controller::listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept {
  node_.host.listen(listener);
  const auto before = std::exchange(node_.accept, {});
  if (listener != nullptr) node_.accept.assign(accept.begin(), accept.end());
  std::ranges::sort(node_.accept, {}, &can::IdRange::first);
  node_.segment->medium().filters.set(node_.slot, before, node_.accept);
}

can::Status Controller::status() const noexcept {
  can::Status s;
  s.bit_rate = node_.bit_rate;
  s.tec = node_.errors.tec();
  s.rec = node_.errors.rec();
  s.queued = static_cast<std::uint16_t>(node_.transmit.size());
  s.errors = static_cast<std::uint32_t>(node_.statistics.transmit_errors + node_.statistics.receive_errors);
  s.listen_only = node_.listen_only;
  s.bus_off = node_.errors.bus_off();
  s.up = node_.powered && cable_;
  s.knows_counters = true;
  s.knows_sent = true;
  s.knows_errors = true;
  return s;
}

const NodeStatistics& Controller::statistics() const noexcept {
  auto& contenders = node_.segment->medium().contenders;
  if (contenders.contains(node_.slot)) {
    auto* self = const_cast<Controller*>(this);  // updates a counter that is kept lazily
    self->node_.statistics.arbitration_losses += contenders.take_losses(node_.slot);
  }
  return node_.statistics;
}

// The controller's node.

void Controller::preset_counters(std::uint16_t tec, std::uint16_t rec) noexcept {
  node_.set_counters(std::min<std::uint16_t>(tec, 255), std::min<std::uint16_t>(rec, 255));
  node_.segment->counters_preset(node_);
  node_.tell_if_changed();
}

bool Controller::restart(std::uint32_t bit_rate) noexcept {
  if (!node_.powered || bit_rate == 0) return false;
  node_.segment->disturb(node_);
  node_.transmit.clear();
  node_.set_counters(0, 0);
  static_cast<void>(node_.errors.level_changed());  // the host asked for it and is not informed
  node_.bit_rate = bit_rate;
  node_.segment->integrate(node_, node_.errors.bus_off() ? 128 : 1);
  return true;
}

void Controller::power(bool on) noexcept {
  if (on == node_.powered) return;
  node_.segment->disturb(node_);
  node_.transmit.clear();
  node_.host.forget();
  node_.set_counters(0, 0);
  node_.errors.set_bus_off(false);
  static_cast<void>(node_.errors.level_changed());  // part of the change that is reported below
  node_.powered = on;
  node_.segment->integrate(node_, on ? 1 : 0);
  node_.host.changed();
}

// The bit rate or listen-only mode has changed.
void Controller::integrate_anew() noexcept {
  if (node_.errors.bus_off()) {
    node_.segment->refresh();
  } else {
    node_.segment->integrate(node_, node_.powered ? 1 : 0);
  }
  node_.host.changed();
}

void Controller::set_bit_rate(std::uint32_t bit_rate) noexcept {
  if (bit_rate == 0 || bit_rate == node_.bit_rate) return;
  node_.segment->disturb(node_);
  node_.bit_rate = bit_rate;
  integrate_anew();
}

void Controller::listen_only(bool on) noexcept {
  if (on == node_.listen_only) return;
  node_.segment->disturb(node_);
  node_.listen_only = on;
  if (on) node_.transmit.clear();
  integrate_anew();
}

void Controller::silent(bool on) noexcept {
  node_.silent = on;
  node_.segment->offer(node_);
}

void Controller::cable(bool in) noexcept {
  if (in == cable_) return;
  cable_ = in;
  bus_->move(*this, in);
  node_.host.changed();
}

}  // namespace berth::sim
