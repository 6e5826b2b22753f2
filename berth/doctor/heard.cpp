#include "berth/doctor/heard.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/can/length.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/nmt.hpp"
#include "berth/lss/frames.hpp"

namespace berth::doctor {
namespace {

using namespace std::chrono_literals;

constexpr std::uint8_t fastscan = 0x51;
constexpr rt::Duration longest_guard_answer = 100ms;

template <class T>
void keep(std::vector<T>& list, const T& item, std::size_t most) {
  if (list.size() < most) list.push_back(item);
}

double share(std::uint64_t bits, rt::Duration time, std::uint32_t bit_rate) noexcept {
  const double s = std::chrono::duration<double>(time).count();
  return s <= 0 || bit_rate == 0 ? 0.0 : static_cast<double>(bits) / (s * bit_rate);
}

}  // namespace

std::size_t Heard::long_runs() const noexcept {
  return static_cast<std::size_t>(std::ranges::count_if(runs, [](const auto& r) { return r.count >= long_run; }));
}

double Heard::load(std::uint32_t bit_rate) const noexcept { return share(bits, to - from, bit_rate); }
double Heard::worst_load(std::uint32_t bit_rate) const noexcept { return share(worst_bits, 1s, bit_rate); }

Count signs_of(const HeardNode& node, bool predefined) noexcept {
  if (!predefined || node.pdos.count == 0) return node.signs;
  if (node.signs.count == 0) return node.pdos;
  return {node.signs.count + node.pdos.count, std::min(node.signs.first, node.pdos.first),
          std::max(node.signs.last, node.pdos.last)};
}

Ear::Ear(can::Dispatcher& dispatcher) : dispatcher_(&dispatcher) {
  const auto now = dispatcher.executor().now();
  heard_.from = heard_.to = second_ = looked_at_ = now;
  const auto status = dispatcher.port().status();
  errors_at_ = status.errors;
  lost_at_ = status.lost;
  attend(status, now);
  dispatcher.add(can::all_base, *this);
  dispatcher.add(can::all_extended, *this);
  dispatcher.executor().after(poll_period, *this);
}

const Heard& Ear::heard() noexcept {
  const auto now = dispatcher_->executor().now();
  look(now);
  heard_.to = now;
  if (now - second_ >= 1s) heard_.worst_bits = std::max(heard_.worst_bits, second_bits_);
  return heard_;
}

void Ear::run() noexcept {
  const auto now = dispatcher_->executor().now();
  look(now);
  dispatcher_->executor().after(poll_period, *this);
}

void Ear::look(rt::Time at) noexcept {
  const auto status = dispatcher_->port().status();
  attend(status, at);
  heard_.worst.tec = std::max(heard_.worst.tec, status.tec);
  heard_.worst.rec = std::max(heard_.worst.rec, status.rec);
  heard_.worst.bus_off = heard_.worst.bus_off || status.bus_off;
  heard_.was_passive = heard_.was_passive || status.error_passive() || status.bus_off;
  const std::uint32_t fresh = status.errors - errors_at_;
  errors_at_ = status.errors;
  if (fresh == 0) return;
  heard_.errors += fresh;
  if (!run_) run_ = ErrorRun{0, at, at};
  run_->count += fresh;
  run_->last = at;
}

void Ear::attend(const can::Status& status, rt::Time at) noexcept {
  const bool hears = status.up && !status.bus_off;
  if (hears) {
    began_ = true;
    heard_.knows_errors = status.knows_errors;
    heard_.knows_bit_rate = status.bit_rate != 0 && !status.bit_rate_is_label;
  } else if (!began_) {
    heard_.from = second_ = at;
  } else if (at > looked_at_) {
    heard_.down += at - looked_at_;
  }
  looked_at_ = std::max(looked_at_, at);
  heard_.lost += status.lost - lost_at_;
  lost_at_ = status.lost;
}

void Ear::end_run(rt::Time at) noexcept {
  if (!run_) return;
  run_->last = std::max(run_->last, at);
  keep(heard_.runs, *run_, Heard::most_runs);
  run_.reset();
}

void Ear::measure(const can::Frame& frame, rt::Time at) noexcept {
  ++heard_.frames;
  const auto bits = frame.fd ? can::worst_case_bits(frame.extended, frame.size) : can::exact_bits(frame);
  heard_.bits += bits;
  while (at - second_ >= 1s) {
    heard_.worst_bits = std::max(heard_.worst_bits, second_bits_);
    second_bits_ = 0;
    second_ += 1s;
  }
  second_bits_ += bits;
}

void Ear::own(const can::Frame& frame, rt::Time at) noexcept {
  const bool tells = !frame.extended && (frame.id == 0 || frame.id == 0x080 || (frame.id & 0x780U) == 0x700);
  return tells ? received(frame, at) : measure(frame, at);
}

void Ear::received(const can::Frame& frame, rt::Time at) noexcept {
  look(at);
  // Two different frames of one identifier, back to back after a long run: the trace of a collision
  // (docs/protocols/can-frames.md §Arbitration).
  if (run_) {
    const bool is_long = run_->count >= Heard::long_run;
    end_run(at);
    behind_run_.reset();
    if (is_long) behind_run_ = frame;
  } else if (behind_run_) {
    // A node with errors sends several EMCYs.
    const bool emergency = !frame.extended && frame.id > 0x080 && frame.id <= 0x0FF;
    if (behind_run_->key() == frame.key() && !frame.remote && !emergency && !(*behind_run_ == frame))
      heard_.collided[frame.key()].add(at);
    behind_run_.reset();
  }
  measure(frame, at);
  if (frame.extended) return;
  const NodeId node(static_cast<std::uint8_t>(frame.id & 0x7FU));
  if (frame.id == 0) return commanded(frame, at);
  if (frame.id == 0x080) return keep(heard_.syncs, at, Heard::most_beats);
  if (frame.id == lss::master_cob_id || frame.id == lss::slave_cob_id) return lss(frame, at);
  if (node.value() == 0) return;
  switch (frame.id & 0x780U) {
    case 0x080: return emergency(node, frame, at);
    case 0x180:
    case 0x280:
    case 0x380:
    case 0x480:
      if (!frame.remote) heard_.nodes[node.value()].pdos.add(at);
      return;
    case 0x580:
      if (!frame.remote) heard_.nodes[node.value()].signs.add(at);
      return;
    case 0x700: return error_control(node, frame, at);
    default: return;
  }
}

void Ear::error_control(NodeId id, const can::Frame& frame, rt::Time at) noexcept {
  auto& node = heard_.nodes[id.value()];
  auto& memory = memory_[id.value()];
  if (frame.remote) {
    ++node.guard_requests;
    memory.asked = true;
    memory.asked_at = at;
    return;
  }
  if (frame.size != 1) return;
  node.signs.add(at);
  const bool in_time = node.guard_requests > 0 && at - memory.asked_at <= longest_guard_answer;
  if (in_time && frame.data[0] != 0) ++node.guard_answers;
  memory.asked = false;
  const auto state = static_cast<NmtState>(frame.data[0] & 0x7FU);
  if (state == NmtState::initialising) {
    node.boot.add(at);
    keep(node.boots, at, Heard::most_boots);
    memory.excused = true;
    return;
  }
  node.beat.add(at);
  keep(node.beats, Beat{at, state}, Heard::most_beats);
  if (memory.state && *memory.state != state && !memory.excused) node.flips.add(at);
  memory.state = state;
  memory.excused = false;
}

void Ear::emergency(NodeId id, const can::Frame& frame, rt::Time at) noexcept {
  auto& node = heard_.nodes[id.value()];
  if (frame.remote || frame.size != 8) return;
  node.signs.add(at);
  switch (load_le<std::uint16_t>(frame.data.data())) {
    case co::emcy_code::error_passive: return node.error_passive.add(at);
    case co::emcy_code::recovered_from_bus_off: return node.bus_off.add(at);
    case co::emcy_code::can_overrun: return node.overrun.add(at);
    case co::emcy_code::id_collision: return node.collision.add(at);
    default: return;
  }
}

void Ear::commanded(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.size != 2) return;
  const unsigned target = frame.data[1];
  const auto request = co::parse_nmt(frame);
  const bool reset = request && (request->command == co::NmtCommand::reset_node ||
                                 request->command == co::NmtCommand::reset_communication);
  for (unsigned i = 1; i < memory_.size(); ++i) {
    if (target != 0 && target != i) continue;
    memory_[i].excused = true;
    if (reset) heard_.nodes[i].resets.add(at);
  }
}

void Ear::lss(const can::Frame& frame, rt::Time at) noexcept {
  if (lss::is_lss(frame, lss::master_cob_id)) {
    heard_.lss_requests.add(at);
    last_request_ = frame;
    return;
  }
  if (!lss::is_answer(frame)) return;
  if (frame.size < 8) {
    if (heard_.short_answers.all.count == 0) heard_.short_answers.first_frame = frame;
    heard_.short_answers.all.add(at);
  }
  const auto answer = lss::command(frame);
  if (answer == lss::Command::configure_node_id && frame.data[1] == 0) heard_.given.add(at);
  const bool scanned = last_request_.size == 8 && last_request_.data[0] == fastscan;
  const bool by_fastscan = answer == lss::Command::identified && scanned;
  if (by_fastscan) heard_.blank.by_fastscan.add(at);
  if (answer == lss::Command::non_configured || by_fastscan) heard_.blank.all.add(at);
}

Count boots_beside(const HeardNode& node, rt::Duration period) {
  Count beside;
  if (node.beats.size() < 4) return beside;
  std::vector<rt::Duration> intervals;
  for (std::size_t i = 1; i < node.beats.size(); ++i) intervals.push_back(node.beats[i].at - node.beats[i - 1].at);
  std::ranges::nth_element(intervals, intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2));
  const auto usual = period.count() > 0 ? period : intervals[intervals.size() / 2];
  for (const auto boot : node.boots) {
    const auto next = std::ranges::find_if(node.beats, [&](const Beat& b) { return b.at > boot; });
    if (next == node.beats.begin() || next == node.beats.end()) continue;
    const auto before = std::prev(next)->at;
    const bool in_the_middle = boot - before > usual / 4;
    const bool as_before = next->at - before < usual * 23 / 20 && next->state == std::prev(next)->state;
    if (in_the_middle && as_before) beside.add(boot);
  }
  return beside;
}

}  // namespace berth::doctor
