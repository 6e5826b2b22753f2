#include "berth/co/emcy.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/co/retry_parts.hpp"

namespace berth::co {

namespace {

struct CodeText {
  std::uint16_t code;
  const char* text;
};
constexpr CodeText exact_texts[] = {
    {0x0000, "error reset or no error"},
    {0x2310, "output current too high (overload)"},
    {0x2320, "short circuit at outputs"},
    {0x2330, "load dump at outputs"},
    {0x3110, "input voltage too high"},
    {0x3120, "input voltage too low"},
    {0x3210, "internal voltage too high"},
    {0x3220, "internal voltage too low"},
    {0x3310, "output voltage too high"},
    {0x3320, "output voltage too low"},
    {0x8110, "CAN overrun (objects lost)"},
    {0x8120, "CAN in error passive mode"},
    {0x8130, "life guard or heartbeat error"},
    {0x8140, "recovered from bus-off"},
    {0x8150, "CAN-ID collision"},
    {0x8210, "PDO not processed due to length error"},
    {0x8220, "PDO length exceeded"},
    {0x8230, "DAM MPDO not processed, destination object not available"},
    {0x8240, "unexpected SYNC data length"},
    {0x8250, "RPDO time-out"},
};
// By upper byte.
constexpr CodeText class_texts[] = {
    {0x00, "one of several errors is gone"},
    {0x10, "generic error"},
    {0x20, "current"},
    {0x21, "current, device input side"},
    {0x22, "current inside the device"},
    {0x23, "current, device output side"},
    {0x30, "voltage"},
    {0x31, "mains voltage"},
    {0x32, "voltage inside the device"},
    {0x33, "output voltage"},
    {0x40, "temperature"},
    {0x41, "ambient temperature"},
    {0x42, "device temperature"},
    {0x50, "device hardware"},
    {0x60, "device software"},
    {0x61, "internal software"},
    {0x62, "user software"},
    {0x63, "data set"},
    {0x70, "additional modules"},
    {0x80, "monitoring"},
    {0x81, "communication"},
    {0x82, "protocol error"},
    {0x90, "external error"},
    {0xF0, "additional functions"},
    {0xFF, "device specific"},
};

template <std::size_t N>
const char* look_up(const CodeText (&table)[N], std::uint16_t code) noexcept {
  const auto* it = std::ranges::find(table, code, &CodeText::code);
  return it == std::end(table) ? nullptr : it->text;
}

can::Frame to_frame(CobId cob_id, const Emcy& message) noexcept {
  can::Frame frame;
  frame.id = cob_id.id();
  frame.extended = cob_id.extended();
  frame.size = 8;
  store_le(frame.data.data(), message.code);
  frame.data[2] = message.error_register;
  std::ranges::copy(message.info, frame.data.begin() + 3);
  return frame;
}

}  // namespace

const char* emcy_text(std::uint16_t code) noexcept {
  if (const char* text = look_up(exact_texts, code)) return text;
  const auto upper = static_cast<std::uint16_t>(code >> 8);
  if (const char* text = look_up(class_texts, upper)) return text;
  if (const char* text = look_up(class_texts, upper & 0xF0U)) return text;
  return "unknown emergency code";
}

// ---- producer

void EmcyProducer::set_cob_id(CobId id) noexcept {
  cob_id_ = id;
  flush();
}

void EmcyProducer::enable(bool on) noexcept {
  enabled_ = on;
  flush();
}

void EmcyProducer::reset() noexcept {
  cancel();
  enabled_ = false;
  error_count_ = 0;
  first_ = waiting_ = 0;
  free_at_ = {};
}

std::uint8_t EmcyProducer::error_register() const noexcept {
  std::uint8_t bits = error_count_ > 0 ? error_register::generic : 0;
  for (std::size_t i = 0; i < error_count_; ++i) bits = static_cast<std::uint8_t>(bits | errors_[i].bits);
  return bits;
}

bool EmcyProducer::active(std::uint16_t code) const noexcept {
  const auto end = errors_.begin() + static_cast<std::ptrdiff_t>(error_count_);
  return std::find_if(errors_.begin(), end, [&](const Active& e) { return e.code == code; }) != end;
}

bool EmcyProducer::active(std::uint16_t code, std::uint8_t source) const noexcept {
  const auto end = errors_.begin() + static_cast<std::ptrdiff_t>(error_count_);
  return std::find_if(errors_.begin(), end, [&](const Active& e) { return e.code == code && e.source == source; }) !=
         end;
}

bool EmcyProducer::raise(std::uint16_t code, std::uint8_t register_bits, const std::array<std::uint8_t, 5>& info,
                         std::uint8_t source) noexcept {
  if ((code >> 8) == 0 || active(code, source) || error_count_ == most_errors) return false;
  errors_[error_count_++] = {code, register_bits, source, info};
  queue({.code = code, .error_register = error_register(), .info = info});
  return true;
}

bool EmcyProducer::clear(std::uint16_t code, const std::array<std::uint8_t, 5>& info, std::uint8_t source) noexcept {
  const auto end = errors_.begin() + static_cast<std::ptrdiff_t>(error_count_);
  const auto it =
      std::find_if(errors_.begin(), end, [&](const Active& e) { return e.code == code && e.source == source; });
  if (it == end) return false;
  std::copy(it + 1, end, it);
  --error_count_;
  Emcy message{.code = emcy_code::error_reset, .error_register = 0, .info = info};
  if (error_count_ > 0) {
    const Active& remains = errors_[error_count_ - 1];
    message = {.code = remains.code, .error_register = error_register(), .info = remains.info};
  }
  if (tells_exits_) store_le(message.info.data() + 3, code);
  queue(message);
  return true;
}

void EmcyProducer::queue(const Emcy& message) noexcept {
  if (waiting_ == queue_size) {
    first_ = (first_ + 1) % queue_size;
    --waiting_;
    ++dropped_;
  }
  queue_[(first_ + waiting_) % queue_size] = message;
  ++waiting_;
  flush();
}

void EmcyProducer::flush() noexcept {
  cancel();
  auto& executor = dispatcher_->executor();
  while (enabled_ && cob_id_.valid()) {
    const Emcy* const message = next();
    if (message == nullptr) return;
    if (executor.now() < free_at_) return executor.at(free_at_, *this);
    const auto queued = dispatcher_->send(to_frame(cob_id_, *message));
    if (queued != can::Queued::yes) {
      return executor.after(queued == can::Queued::full ? full_retry : dead_port_retry, *this);
    }
    free_at_ = executor.now() + inhibit_;
    sent();
  }
}

const Emcy* EmcyProducer::next() const noexcept {
  if (waiting_ > 0) return &queue_[first_];
  return backlog_ != nullptr ? backlog_->front() : nullptr;
}

void EmcyProducer::sent() noexcept {
  if (waiting_ == 0) return backlog_->pop();
  first_ = (first_ + 1) % queue_size;
  --waiting_;
}

// ---- pre-defined error field

void ErrorField::push(const Emcy& message) noexcept {
  if ((message.code >> 8) == 0) return;
  std::copy_backward(entries_.begin(), entries_.end() - 1, entries_.end());
  entries_[0] = message.code | (static_cast<std::uint32_t>(load_le<std::uint16_t>(message.info.data())) << 16);
  count_ = std::min(count_ + 1, size);
}

std::uint32_t ErrorField::at(std::uint8_t sub) const noexcept {
  return sub >= 1 && sub <= count_ ? entries_[sub - 1U] : 0;
}

// ---- consumer

void EmcyConsumer::hear_all() {
  if (std::exchange(all_, true)) return;
  dispatcher_->remove(*this);
  dispatcher_->add(all_emcy, *this);
  for (const Source& source : sources_) {
    if (!all_emcy.contains(source.key)) dispatcher_->add(can::only(source.key), *this);
  }
}

void EmcyConsumer::hear(NodeId node, CobId id) {
  if (!node.configured() || !id.valid()) return;
  const auto it = std::ranges::find(sources_, id.key(), &Source::key);
  if (it != sources_.end()) {
    it->node = node;
    return;
  }
  sources_.push_back({id.key(), node});
  if (!all_ || !all_emcy.contains(id.key())) dispatcher_->add(can::only(id.key()), *this);
}

void EmcyConsumer::clear() noexcept {
  dispatcher_->remove(*this);
  sources_.clear();
  all_ = false;
}

void EmcyConsumer::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.remote || frame.fd || frame.size != 8) return;
  const auto it = std::ranges::find(sources_, frame.key(), &Source::key);
  const auto node = it != sources_.end() ? it->node : NodeId(static_cast<std::uint8_t>(frame.id & 0x7FU));
  Emcy message{.code = load_le<std::uint16_t>(frame.data.data()), .error_register = frame.data[2]};
  std::copy_n(frame.data.begin() + 3, message.info.size(), message.info.begin());
  observer_->emergency(node, message, at);
}

}  // namespace berth::co
