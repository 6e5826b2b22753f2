#include "berth/io/controller_status.hpp"

#include <algorithm>

namespace berth::io {
namespace {

using Level = BusReport::Level;

Level level_of(const can::Status& s) noexcept {
  if (s.error_passive()) return Level::passive;
  return s.tec >= 96 || s.rec >= 96 ? Level::warning : Level::active;
}

}  // namespace

rt::Duration ControllerStatus::frame_time() const noexcept {
  const auto rate = status_.bit_rate_is_label ? 0 : status_.bit_rate;
  return rate == 0 ? rt::Duration(std::chrono::milliseconds(1)) : rt::Duration(130'000'000'000LL / rate);
}

bool ControllerStatus::learn(const Link& link, const Wanted& wanted, bool there) noexcept {
  const can::Status before = status_;
  if (link.state) status_.bus_off = link.state == CanState::bus_off;
  status_.up = there && link.up && (link.running || status_.bus_off);
  status_.listen_only = wanted.listen_only || link.listen_only;
  status_.bit_rate_is_label = link.bit_rate == 0;
  status_.bit_rate = link.bit_rate != 0 ? link.bit_rate : wanted.bit_rate;
  status_.knows_sent = link.echo || link.kind == "vcan" || link.kind == "vxcan";
  status_.knows_errors = !link.controller() || link.reports_errors;
  if (link.counts) {
    status_.knows_counters = true;
    status_.tec = link.tec;
    status_.rec = link.rec;
  }
  if (link.state == CanState::passive && !status_.error_passive()) status_.tec = 128;
  if (link.state == CanState::active && status_.error_passive()) clear_counters();
  return before.up != status_.up || before.bus_off != status_.bus_off || before.bit_rate != status_.bit_rate ||
         before.listen_only != status_.listen_only || level_of(before) != level_of(status_);
}

bool ControllerStatus::learn(const BusReport& report) noexcept {
  const can::Status before = status_;
  if (report.error) ++status_.errors;
  if (report.overflow) ++overflows_;
  if (report.counts) status_.knows_counters = true;
  if (report.counts || report.level) {
    status_.tec = report.tec;
    status_.rec = report.rec;
  }
  if (report.restarted) {
    status_.bus_off = false;
    clear_counters();
  }
  if (report.bus_off) status_.bus_off = true;
  return before.bus_off != status_.bus_off || level_of(before) != level_of(status_);
}

void ControllerStatus::label(std::uint32_t bit_rate) noexcept {
  status_.bus_off = false;
  clear_counters();
  status_.bit_rate = bit_rate;
}

}  // namespace berth::io
