#include "berth/live/foreign_watch.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "berth/co/cob_id.hpp"
#include "berth/co/nmt.hpp"
#include "berth/live/requests_parts.hpp"

namespace berth::live {

namespace {

constexpr can::IdRange flying_master{0x071, 0x076};
constexpr std::uint32_t active_master = 0x071;

constexpr std::array<const char*, sign_count> names{"nmt", "lss",  "discovery", "flying-master",
                                                    "sdo", "sync", "heartbeat", "guarding"};
constexpr std::array<const char*, sign_count> texts{
    "NMT commands", "LSS requests", "discovery requests (RAND or AND)",        "flying-master frames",
    "SDO requests", "SYNC",         "error control under Berth's own node-ID", "node guarding requests"};

double in_s(rt::Duration time) { return std::chrono::duration<double>(time).count(); }

}  // namespace

const char* name(Sign sign) noexcept { return names[static_cast<std::size_t>(sign)]; }

std::optional<Sign> sign_named(std::string_view word) noexcept {
  const auto it = std::ranges::find(names, word);
  if (it == names.end()) return std::nullopt;
  return static_cast<Sign>(it - names.begin());
}

std::optional<Sign> ForeignWatch::sign_of(const can::Frame& frame) const noexcept {
  const auto key = frame.key();
  if (co::all_error_control.contains(key)) {
    if (frame.remote) return Sign::guarding;
    if (!options_.own.configured() || key != co::error_control_id(options_.own) || frame.size == 0) return std::nullopt;
    const auto state = co::nmt_state(frame.data[0]);
    const bool boots = state == NmtState::initialising;
    if (boots || (running_ && state != NmtState::operational)) return std::nullopt;
    return Sign::heartbeat;
  }
  if (frame.remote) return std::nullopt;
  if (key == co::nmt_command_id) return Sign::nmt;
  if (key == lss_requests) return Sign::lss;
  if (key == rand_requests || key == and_requests) return Sign::discovery;
  if (flying_master.contains(key)) return Sign::flying_master;
  if (co::all_sdo_requests.contains(key)) {
    const bool to_us = options_.own.configured() && (key & 0x7FU) == options_.own.value();
    return to_us ? std::nullopt : std::optional(Sign::sdo);
  }
  if (key == co::sync_id) return Sign::sync;
  return std::nullopt;
}

std::optional<Sign> ForeignWatch::heard(const can::Frame& frame, rt::Time at) noexcept {
  if (frames_ < std::numeric_limits<std::uint32_t>::max()) ++frames_;
  const auto key = frame.key();
  if (co::all_error_control.contains(key) && !frame.remote && frame.size > 0) {
    operational_[key & 0x7FU] = co::nmt_state(frame.data[0]) == NmtState::operational;
  }
  const auto sign = sign_of(frame);
  if (!sign) return std::nullopt;
  if (*sign == Sign::sdo || *sign == Sign::guarding) asked_.set(key & 0x7FU);
  if (*sign == Sign::nmt && frame.size == 2 && frame.data[1] < 128) asked_.set(frame.data[1]);
  if (key == active_master && frame.size == 2) active_ = NodeId::make(frame.data[1]).value_or(NodeId());
  if (options_.tolerated[static_cast<std::size_t>(*sign)]) return std::nullopt;
  auto& evidence = heard_[static_cast<std::size_t>(*sign)];
  if (evidence.count == 0) {
    evidence.sign = *sign;
    evidence.first = at;
    evidence.sample = frame;
  }
  evidence.last = at;
  if (evidence.count < std::numeric_limits<std::uint32_t>::max()) ++evidence.count;
  foreign_ = foreign_ || !running_ || *sign != Sign::sdo;
  return sign;
}

std::vector<Evidence> ForeignWatch::evidence() const {
  std::vector<Evidence> all;
  std::ranges::copy_if(heard_, std::back_inserter(all), [](const Evidence& e) { return e.count > 0; });
  return all;
}

NodeId ForeignWatch::probably(std::span<const NodeId> slots) const noexcept {
  if (active_.configured()) return active_;
  if (heard_[static_cast<std::size_t>(Sign::heartbeat)].count > 0) return options_.own;
  NodeId only;
  for (std::uint8_t id = 1; id < 128; ++id) {
    if (!operational_[id] || asked_[id] || std::ranges::find(slots, NodeId(id)) != slots.end()) continue;
    if (only.configured()) return {};
    only = NodeId(id);
  }
  return only;
}

void ForeignWatch::reset() noexcept { *this = ForeignWatch(options_); }

std::vector<std::string> lines(std::span<const Evidence> evidence, rt::Time since) {
  std::vector<std::string> all;
  for (const auto& e : evidence) {
    const std::string what = texts[static_cast<std::size_t>(e.sign)];
    const std::string frame = can::to_string(e.sample);
    const double first = in_s(e.first - since);
    all.push_back(e.count == 1 ? fmt::format("{}: {} at {:.2f} s", what, frame, first)
                               : fmt::format("{}: {} times from {:.2f} s to {:.2f} s, first {}", what, e.count, first,
                                             in_s(e.last - since), frame));
  }
  return all;
}

std::string verdict(const ForeignWatch& watch, std::span<const NodeId> slots) {
  const auto id = watch.probably(slots);
  return id.configured() ? fmt::format("another master is on this bus, probably node {}", id.value())
                         : "another master is on this bus";
}

}  // namespace berth::live
