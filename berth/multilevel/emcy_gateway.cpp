#include "berth/multilevel/emcy_gateway.hpp"

#include <algorithm>

#include "berth/base/bytes.hpp"

namespace berth::multilevel {

namespace {
constexpr std::uint8_t communication = co::error_register::communication | co::error_register::generic;
}

EmcyGateway::EmcyGateway(co::EmcyProducer& above, const EmcyGatewayOptions& options)
    : above_(&above), options_(options) {
  above.set_backlog(this);
}

EmcyGateway::~EmcyGateway() { above_->set_backlog(nullptr); }

co::EmcyConsumer& EmcyGateway::consumer(can::Dispatcher& beneath) {
  const auto known = std::ranges::find(buses_, &beneath, &Bus::dispatcher);
  if (known != buses_.end()) return *known->consumer;
  auto made = std::make_unique<co::EmcyConsumer>(beneath, static_cast<co::EmcyConsumer::Observer&>(*this));
  return *buses_.emplace_back(&beneath, std::move(made)).consumer;
}

void EmcyGateway::emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept {
  if (heard_) heard_(node, message);
  put(node, converted(node, message));
}

// A plain device: only its code and register are general. It reports the end of its one error by 0000h; only a listener
// knows which error that was.
co::Emcy EmcyGateway::converted(NodeId node, const co::Emcy& message) noexcept {
  const auto number = node.value();
  if (options_.routed.test(number)) return routed(message, node, options_.network, above_->error_register());
  co::Emcy made = message;
  if (!options_.speaks_layout.test(number) && !more_speakers_.test(number)) {
    EmcyDetails details;
    if (message.code == 0) {
      details.exiting = pending_[number] == 1 ? single_[number] : std::uint16_t{0};
      pending_[number] = 0;
      single_[number] = 0;
    } else if (pending_[number] == 0 || single_[number] != message.code) {
      pending_[number] = static_cast<std::uint8_t>(std::min(pending_[number] + 1, 2));
      single_[number] = message.code;
    }
    made.info = emcy_info(options_.layout, details);
  }
  if (!insert_sub_net(options_.layout, made, node)) {
    ++too_deep_;
    tell(EmcyTrouble::Kind::too_deep, node, told_deep_);
  }
  return made;
}

void EmcyGateway::put(NodeId node, const co::Emcy& message) {
  const auto is_nodes = [node](const Waiting& each) { return each.node == node; };
  if (static_cast<std::size_t>(std::ranges::count_if(queue_, is_nodes)) >= options_.most) {
    queue_.erase(std::ranges::find_if(queue_, is_nodes));
    ++lost_;
    tell(EmcyTrouble::Kind::lost, node, told_lost_);
  }
  queue_.push_back({node, message});
  above_->send_backlog();
}

void EmcyGateway::pop() noexcept {
  queue_.pop_front();
  ++forwarded_;
  if (!queue_.empty()) return;
  for (const auto& each : drained_) each();
}

void EmcyGateway::tell(EmcyTrouble::Kind kind, NodeId node, std::bitset<128>& told) noexcept {
  const auto number = node.configured() ? node.value() : 0U;
  if (told.test(number)) return;
  told.set(number);
  co::Emcy message{.code = kind == EmcyTrouble::Kind::lost ? gateway_code::emcy_lost : gateway_code::too_deep,
                   .error_register = co::error_register::manufacturer | co::error_register::generic};
  if (node.configured()) static_cast<void>(insert_sub_net(options_.layout, message, node));
  put(NodeId(), message);  // not queued with the node's own: either would push out the other
  if (trouble_) trouble_({kind, node});
}

void EmcyGateway::report(NodeId node, std::uint16_t code, std::uint8_t error_register, std::uint16_t exiting) {
  co::Emcy message{
      .code = code, .error_register = error_register, .info = emcy_info(options_.layout, {.exiting = exiting})};
  if (node.configured()) static_cast<void>(insert_sub_net(options_.layout, message, node));
  put(node, message);
}

void EmcyGateway::heartbeat(const co::HeartbeatEvent& event) {
  using Kind = co::HeartbeatEvent::Kind;
  constexpr auto code = co::emcy_code::life_guard_or_heartbeat;
  const auto number = event.node.value();
  const bool lost = event.kind == Kind::lost || event.kind == Kind::never_seen;
  const bool known = lost_heartbeats_.test(number);
  if (lost && !known) {
    lost_heartbeats_.set(number);
    report(event.node, code, communication);
  } else if (!lost && known && event.kind != Kind::boot_up) {
    lost_heartbeats_.reset(number);
    report(event.node, co::emcy_code::error_reset, 0, code);
  }
}

}  // namespace berth::multilevel
