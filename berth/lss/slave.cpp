#include "berth/lss/slave.hpp"

#include <utility>

namespace berth::lss {

Slave::Slave(rt::Executor& executor, SlaveOwner& owner, const SlaveOptions& options,
             const Settings& persistent) noexcept
    : executor_(&executor), owner_(&owner), options_(options), persistent_(persistent), pending_(persistent) {
  active_.bit_rate = persistent.bit_rate;
}

void Slave::power_on(const Settings& persistent) noexcept {
  cancel();
  persistent_ = persistent;
  pending_ = persistent;
  state_ = State::waiting;
  phase_ = BitTiming::idle;
  selected_ = 0;
  identified_ = 0;
  part_ = 0;
  storing_ = false;
  reset_communication();
}

void Slave::reset_communication() noexcept { active_ = pending_; }

Answers Slave::handle(const can::Frame& frame) noexcept {
  if (!is_lss(frame, master_cob_id) || silent()) return {};
  const auto cs = frame.data[0];
  // The frames of one sequence must follow each other: any other request breaks the sequence.
  if (cs < 0x40 || cs > 0x43) selected_ = 0;
  if (cs < 0x46 || cs > 0x4B) identified_ = 0;
  switch (command(frame)) {
    case Command::switch_global: return switch_global(frame.data[1]);
    case Command::select_vendor:
    case Command::select_product:
    case Command::select_revision:
    case Command::select_serial: return select(cs - 0x40U, value32(frame));
    case Command::identify_vendor:
    case Command::identify_product:
    case Command::identify_revision_low:
    case Command::identify_revision_high:
    case Command::identify_serial_low:
    case Command::identify_serial_high: return identify(cs - 0x46U, value32(frame));
    case Command::identify_non_configured:
      return unconfigured() ? Answer(answer(Command::non_configured)) : std::nullopt;
    case Command::fastscan: return fastscan(frame);
    default: return state_ == State::configuration ? in_configuration(frame) : std::nullopt;
  }
}

Slave::Answer Slave::switch_global(std::uint8_t mode) noexcept {
  if (mode == static_cast<std::uint8_t>(State::configuration)) {
    state_ = State::configuration;
  } else if (mode == static_cast<std::uint8_t>(State::waiting)) {
    const bool left = std::exchange(state_, State::waiting) == State::configuration;
    const bool changed = pending_.node_id != active_.node_id;
    if (left && changed && pending_.node_id.configured() && (initialising() || options_.change_at_waiting)) {
      owner_->wants_reset_communication();
    }
  }
  return std::nullopt;
}

// CiA 305 serves this in waiting only: a slave in configuration stays there and does not answer.
Slave::Answer Slave::select(unsigned i, std::uint32_t value) noexcept {
  if (state_ != State::waiting) return std::nullopt;
  if (i == 0) selected_ = 0;
  if (i != selected_ || value != options_.address.part(i)) {
    selected_ = 0;
    return std::nullopt;
  }
  if (++selected_ < 4) return std::nullopt;
  selected_ = 0;
  state_ = State::configuration;
  return answer(Command::selected);
}

Slave::Answer Slave::identify(unsigned i, std::uint32_t value) noexcept {
  if (i == 0) identified_ = 0;
  const auto& a = options_.address;
  const std::array<bool, 6> fits{value == a.vendor,   value == a.product, value <= a.revision,
                                 value >= a.revision, value <= a.serial,  value >= a.serial};
  if (i != identified_ || !fits[i]) {
    identified_ = 0;
    return std::nullopt;
  }
  if (++identified_ < 6) return std::nullopt;
  identified_ = 0;
  return answer(Command::identified);
}

Answers Slave::fastscan(const can::Frame& frame) noexcept {
  if (!options_.fastscan || state_ != State::waiting || !unconfigured()) return {};
  const auto request = decode_fastscan(frame);
  if (!request) return {};
  if (request->starts()) {
    part_ = 0;
  } else {
    if (request->sub != part_ || !request->matches(options_.address.part(part_))) return {};
    const bool whole = request->bit_checked == 0;
    // Not `next < sub`: that would end a scan at a partial match (HC3.1).
    if (whole && request->sub == 3 && (request->next == 0 || request->next > 3)) state_ = State::configuration;
    part_ = whole && request->next > 3 ? std::uint8_t{0} : request->next;
  }
  if (const auto feedback = feedback_after(*request)) {
    return {feedback_frame(*feedback, options_.feedback_base), answer(Command::identified)};
  }
  return Answer(answer(Command::identified));
}

std::optional<FeedbackValue> Slave::feedback_after(const FastscanRequest& request) const noexcept {
  if (options_.feedback == Feedback::none || state_ != State::waiting) return std::nullopt;
  const unsigned width = options_.feedback == Feedback::extended ? 16 : 4;
  const bool first = request.starts() || request.bit_checked == 0;  // the feedback is then about the next part
  if (!first && request.bit_checked % width != 0) return std::nullopt;
  const unsigned part = first ? part_ : request.sub;
  if (part > 3) return std::nullopt;
  const unsigned shift = (first ? 32U : request.bit_checked) - width;
  const auto value = static_cast<std::uint16_t>((options_.address.part(part) >> shift) & ((1U << width) - 1U));
  return FeedbackValue{options_.feedback, width == 16 && shift == 0, value};
}

Slave::Answer Slave::in_configuration(const can::Frame& frame) noexcept {
  switch (command(frame)) {
    case Command::configure_node_id: return configure_node_id(frame.data[1]);
    case Command::configure_bit_timing: return configure_bit_timing(frame.data[1], frame.data[2]);
    case Command::activate_bit_timing: return activate_bit_timing(load_le<std::uint16_t>(frame.data.data() + 1));
    case Command::store: return store();
    case Command::inquire_vendor:
    case Command::inquire_product:
    case Command::inquire_revision:
    case Command::inquire_serial: return answer32(command(frame), options_.address.part(frame.data[0] - 0x5AU));
    case Command::inquire_node_id: {
      const auto id = initialising() ? pending_.node_id : active_.node_id;
      return answer(Command::inquire_node_id, id.value());
    }
    default: return std::nullopt;
  }
}

Slave::Answer Slave::configure_node_id(std::uint8_t value) noexcept {
  const auto id = NodeId::make(value);
  if (!id) return answer(Command::configure_node_id, error::out_of_range);
  pending_.node_id = *id;
  return answer(Command::configure_node_id, error::ok);
}

Slave::Answer Slave::configure_bit_timing(std::uint8_t selector, std::uint8_t index) noexcept {
  if (selector != 0 || !contains(options_.bit_rates, index)) {
    return answer(Command::configure_bit_timing, error::not_supported);
  }
  pending_.bit_rate = static_cast<BitRateIndex>(index);
  return answer(Command::configure_bit_timing, error::ok);
}

Slave::Answer Slave::activate_bit_timing(std::uint16_t delay_ms) noexcept {
  if (phase_ != BitTiming::idle) return std::nullopt;
  switch_delay_ = std::chrono::milliseconds(delay_ms);
  phase_ = BitTiming::delay;
  executor_->after(switch_delay_, *this);
  return std::nullopt;
}

void Slave::run() noexcept {
  if (phase_ == BitTiming::delay) {
    phase_ = BitTiming::silent;
    active_.bit_rate = pending_.bit_rate;
    executor_->after(switch_delay_, *this);
    owner_->switch_bit_rate(active_.bit_rate);
  } else if (phase_ == BitTiming::silent) {
    phase_ = BitTiming::idle;
    owner_->silence_over();
  }
}

Slave::Answer Slave::store() noexcept {
  if (!options_.can_store) return answer(Command::store, error::not_supported);
  if (storing_) return std::nullopt;  // one service at a time; the answer to the running one is still to come
  storing_ = true;
  being_stored_ = pending_;
  const auto result = owner_->store(being_stored_);
  return result ? stored(*result) : std::nullopt;
}

Slave::Answer Slave::stored(const StoreResult& result) noexcept {
  if (!std::exchange(storing_, false)) return std::nullopt;
  if (result.code == error::ok) persistent_ = being_stored_;
  if (state_ != State::configuration || silent()) return std::nullopt;
  return answer(Command::store, result.code, result.code == error::specific ? result.specific : std::uint8_t{0});
}

}  // namespace berth::lss
