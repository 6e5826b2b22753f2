#include "berth/device/lss_habits.hpp"

namespace berth::device {
namespace {

using lss::Command;

can::Frame switch_selective(unsigned part, std::uint32_t value) noexcept {
  return lss::request32(static_cast<Command>(static_cast<unsigned>(Command::select_vendor) + part), value);
}

/// Uses the slave's own services, the only way to change its state.
void put_in_configuration(lss::Slave& slave) noexcept {
  for (unsigned part = 0; part < 4; ++part) slave.handle(switch_selective(part, slave.address().part(part)));
}

bool in_configuration(const lss::Slave& slave) noexcept { return slave.state() == lss::State::configuration; }

bool selects(Command command) noexcept {
  return command >= Command::select_vendor && command <= Command::select_serial;
}

bool identifies(Command command) noexcept {
  return command >= Command::identify_vendor && command <= Command::identify_serial_high;
}

}  // namespace

void LssHabits::reset() noexcept {
  cancel();
  waits_ = false;
  asked_for_ = {};
  part_ = 0;
  identified_ = 0;
}

lss::Answers LssHabits::handle(const can::Frame& frame, lss::Slave& slave) noexcept {
  if (!lss::is_lss(frame, lss::master_cob_id) || slave.silent()) return slave.handle(frame);
  if (habit_ == LssHabit::lely) return like_lely(frame, slave);
  if (waits_ || slave.storing()) return {};
  const bool to_main_loop = in_configuration(slave) && lss::command(frame) != Command::switch_global;
  late_ = like_canopennode(frame, slave);
  if (!to_main_loop && !late_.has_value()) return {};
  waits_ = true;
  const bool busy = random_.chance(busy_per_million);
  const auto later = busy ? random_.between(busy_min.count(), busy_max.count()) : random_.between(0, loop.count());
  executor_->after(rt::Duration(later), *this);
  return {};
}

void LssHabits::run() noexcept {
  waits_ = false;
  if (late_.has_value()) answers_->send(late_);
}

lss::Answers LssHabits::like_canopennode(const can::Frame& frame, lss::Slave& slave) noexcept {
  const auto command = lss::command(frame);
  const bool configures = in_configuration(slave);
  if (command == Command::switch_global && frame.data[1] == 0) asked_for_ = {};
  if (selects(command)) return selected(frame, slave);
  if (identifies(command) || command == Command::identify_non_configured) return {};
  if (command == Command::fastscan) {
    if (configures) return Answer(lss::answer(Command::identified));
    return slave.unconfigured() ? fastscan(frame, slave) : Answer();
  }
  if (command == Command::inquire_node_id && configures) {
    return Answer(lss::answer(Command::inquire_node_id, slave.active().node_id.value()));
  }
  return slave.handle(frame);
}

LssHabits::Answer LssHabits::selected(const can::Frame& frame, lss::Slave& slave) noexcept {
  const unsigned part = frame.data[0] - static_cast<unsigned>(Command::select_vendor);
  if (in_configuration(slave)) return part == 3 ? Answer(lss::answer(Command::selected)) : Answer();
  asked_for_.at(part) = lss::value32(frame);
  if (part != 3) return std::nullopt;
  for (unsigned i = 0; i < 4; ++i) {
    if (asked_for_.at(i) != slave.address().part(i)) return std::nullopt;
  }
  put_in_configuration(slave);
  return lss::answer(Command::selected);
}

LssHabits::Answer LssHabits::fastscan(const can::Frame& frame, lss::Slave& slave) noexcept {
  const std::uint8_t bit = frame.data[5];
  const std::uint8_t sub = frame.data[6];
  const std::uint8_t next = frame.data[7];
  if (bit > 31 && bit != 0x80) return std::nullopt;
  if (habit_ == LssHabit::canopennode && (sub > 3 || next > 3)) return std::nullopt;
  if (bit == 0x80) {
    part_ = 0;
    return lss::answer(Command::identified);
  }
  if (part_ > 3 || sub != part_) return std::nullopt;
  if (((lss::value32(frame) ^ slave.address().part(part_)) >> bit) != 0) return std::nullopt;
  part_ = next;
  if (bit == 0 && next < sub) put_in_configuration(slave);
  return lss::answer(Command::identified);
}

lss::Answers LssHabits::like_lely(const can::Frame& frame, lss::Slave& slave) noexcept {
  const auto command = lss::command(frame);
  const bool configures = in_configuration(slave);
  if (!identifies(command)) identified_ = 0;
  if (command == Command::switch_global) part_ = 0;
  if (selects(command) && configures) return {};
  if (command == Command::fastscan) return configures ? Answer() : fastscan(frame, slave);
  if (identifies(command)) return identified(frame, slave);
  if (command == Command::identify_non_configured) {
    return slave.unconfigured() ? Answer(lss::answer(Command::non_configured)) : Answer();
  }
  return slave.handle(frame);
}

LssHabits::Answer LssHabits::identified(const can::Frame& frame, const lss::Slave& slave) noexcept {
  const unsigned step = frame.data[0] - static_cast<unsigned>(Command::identify_vendor);
  const auto value = lss::value32(frame);
  const auto& own = slave.address();
  const std::array<bool, 6> fits{value == own.vendor,   value == own.product, value <= own.revision,
                                 value >= own.revision, value <= own.serial,  value >= own.serial};
  if (step == 0) identified_ = 0;
  if (step != identified_ || !fits.at(step)) {
    identified_ = 0;
    return std::nullopt;
  }
  if (++identified_ < 6) return std::nullopt;
  identified_ = 0;
  return lss::answer(Command::identified);
}

}  // namespace berth::device
