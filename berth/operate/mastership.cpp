#include "berth/operate/mastership.hpp"

#include <fmt/format.h>

namespace berth::operate {

Mastership::Mastership(BusServices& services, SlotTable& slots, RolePort& port)
    : s_(services), slots_(slots), port_(port), flying_(services.dispatcher, *this) {
  port_.on_change([this] { port_changed(); });
  s_.master = MasterReport{.bus = s_.bus.name};
}

Mastership::~Mastership() { port_.on_change({}); }

void Mastership::start() {
  started_ = true;
  port_.open(false);
  port_changed();
}

void Mastership::stop() noexcept {
  started_ = takes_part_ = false;
  flying_.end();
  note();
}

void Mastership::port_changed() {
  const bool takes_part = started_ && port_.usable();
  if (takes_part == takes_part_) return;
  takes_part_ = takes_part;
  if (takes_part) return begin();
  flying_.end();
  note();
  if (started_) port_.open(false);
}

void Mastership::begin() {
  const auto& rules = *s_.bus.flying;
  manager::FlyingOptions options;
  options.own = {rules.priority, s_.bus.master};
  options.timing = rules.timing;
  options.resets_when_cold = false;
  const auto begun = flying_.begin(options, [this](NodeId) { return s_.bus.timing.heartbeat_timeout; });
  if (!begun) slots_.events().tell(EventKind::error, "", describe(begun.error()));
}

void Mastership::note() {
  s_.master->active = flying_.active();
  s_.master->here = flying_.is_master();
}

void Mastership::role_changed() noexcept {
  note();
  port_.open(flying_.is_master());
  tell();
}

void Mastership::tell() {
  const auto active = flying_.active();
  if (!active) return;  // they are negotiating
  std::string text = fmt::format("node {} is the active NMT master (priority {}); standing by", active->node.value(),
                                 active->priority);
  if (flying_.is_master()) {
    text = fmt::format("this is the active NMT master (node {}, priority {})", active->node.value(), active->priority);
  }
  if (text == told_) return;
  told_ = text;
  slots_.events().tell(EventKind::master, "", text);
  if (flying_.is_master()) return;
  for (const auto& seat : slots_.seats()) {
    slots_.happened(*seat, SlotEvent::rests, fmt::format("node {} is the active NMT master", active->node.value()));
  }
}

}  // namespace berth::operate
