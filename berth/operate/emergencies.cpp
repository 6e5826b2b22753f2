#include "berth/operate/emergencies.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/base/counted.hpp"
#include "berth/decode/emcy_words.hpp"

namespace berth::operate {

namespace {

bool tells_error(const co::Emcy& message) noexcept { return message.code >> 8U != 0; }

}  // namespace

void Emergencies::heard(NodeId node, const co::Emcy& message) {
  const rt::Time now = s_.executor.now();
  slots_.diagnosis().told(node, message, now);
  const auto& hands_on = slots_.events().beneath().hands_on;
  const bool from_beneath = hands_on && hands_on(node, message);
  if (Seat* const seat = slots_.at(node); seat != nullptr) {
    if (message.code == co::emcy_code::error_reset) {
      seat->last.emergency.reset();
    } else if (tells_error(message) && seat->last.emergency && seat->last.emergency->message == message) {
      ++seat->last.emergency->count;
    } else if (tells_error(message)) {
      seat->last.emergency = {message, now, 1};
    }
  }
  if (from_beneath) return;
  // Many devices send 0000h when they boot.
  if (!tells_error(message) && !erring_.test(node.value())) return;
  erring_.set(node.value(), message.code != co::emcy_code::error_reset);
  Counted& of = counted(node, message.code);
  of.last = message;
  const bool again = of.told != rt::Time{} && now < of.told + of.pause;
  if (again || of.more > 0) {
    ++of.more;
    return;
  }
  of.told = now;
  of.pause = shortest_pause;
  tell(node, line(node, message));
}

void Emergencies::tell_repeated() {
  const rt::Time now = s_.executor.now();
  if (now >= minute_ + std::chrono::minutes(1)) {
    minute_ = now;
    lines_ = 0;
    if (left_out_ > 0) write({}, fmt::format("{} more EMCYs were heard in a minute, and are not reported", left_out_));
    left_out_ = 0;
  }
  for (std::size_t id = 1; id < counted_.size(); ++id) {
    for (Counted& of : counted_[id]) {
      if (of.more == 0 || now < of.told + of.pause) continue;
      const NodeId node(static_cast<std::uint8_t>(id));
      const double seconds = std::chrono::duration<double>(now - of.told).count();
      const std::string what = of.others ? "EMCYs of other codes" : line(node, of.last);
      tell(node, fmt::format("{}: {} more in {:.0f} s", what, of.more == 1 ? "once" : fmt::format("{} times", of.more),
                             seconds));
      of.told = now;
      of.pause = std::min(2 * of.pause, longest_pause);
      of.more = 0;
    }
    // A code that stayed away is reported at once when it comes again, and leaves its place to another code.
    std::erase_if(counted_[id], [now](const Counted& of) { return of.more == 0 && now >= of.told + of.pause; });
  }
}

void Emergencies::booted(NodeId node) noexcept {
  erring_.reset(node.value());
  if (Seat* const seat = slots_.at(node); seat != nullptr) seat->last.emergency.reset();
}

Emergencies::Counted& Emergencies::counted(NodeId node, std::uint16_t code) {
  auto& all = counted_[node.value()];
  const auto known = std::ranges::find_if(all, [code](const Counted& of) { return !of.others && of.code == code; });
  if (known != all.end()) return *known;
  if (all.size() < most_codes) return all.emplace_back(Counted{.code = code});
  const auto others = std::ranges::find(all, true, &Counted::others);
  if (others != all.end()) return *others;
  return all.emplace_back(Counted{.others = true});
}

void Emergencies::tell(NodeId node, const std::string& text) {
  if (lines_ >= most_lines) {
    ++left_out_;
    return;
  }
  ++lines_;
  write(node, text);
}

void Emergencies::write(NodeId node, const std::string& text) {
  const Seat* const seat = slots_.at(node);
  places::HistoryEntry entry;
  entry.event = "EMCY";
  entry.id = node;
  entry.reason = text;
  entry.on = slots_.bus();
  if (seat != nullptr) entry.slot = seat->slot.record.slot;
  const auto written = slots_.store().note(entry);
  if (!written)
    slots_.events().tell_once(EventKind::error, "the history has no line of an EMCY: " + describe(written.error()));
  slots_.events().tell(EventKind::emcy, seat != nullptr ? seat->name() : "",
                       seat != nullptr || !node.configured() ? text : fmt::format("node {}: {}", node.value(), text));
}

std::string Emergencies::line(NodeId node, const co::Emcy& message) const {
  const Seat* const seat = slots_.at(node);
  return decode::emcy_line(message, seat == nullptr ? std::uint16_t{0} : seat->profile());
}

}  // namespace berth::operate
