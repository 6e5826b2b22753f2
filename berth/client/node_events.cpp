#include "berth/client/node_events.hpp"

namespace berth::client {

void NodeEvents::happened(const StateEvent& event) {
  states_.push(event);
  tell(on_state_, event);
}

void NodeEvents::happened(const Emergency& event) {
  emergencies_.push(event);
  tell(on_emcy_, event);
}

void NodeEvents::close() noexcept {
  states_.close();
  emergencies_.close();
}

void NodeEvents::run() noexcept {
  const auto event = std::move(to_tell_.front());
  to_tell_.pop_front();
  if (!to_tell_.empty()) executor_->post(*this);
  event();  // may destroy the node
}

}  // namespace berth::client
