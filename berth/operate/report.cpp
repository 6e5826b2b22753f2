#include "berth/operate/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <ranges>
#include <utility>

#include "berth/base/words.hpp"

namespace berth::operate {

const char* name(EventKind kind) noexcept {
  using Odd = places::OddityKind;
  switch (kind) {
    case EventKind::step: return "step";
    case EventKind::state: return "state";
    case EventKind::found: return "found";
    case EventKind::bound: return "bound";
    case EventKind::new_device: return "new device";
    case EventKind::moved: return "moved";
    case EventKind::configured: return "configured";
    case EventKind::restored: return "restored";
    case EventKind::forgotten: return "forgotten";
    case EventKind::question: return "question";
    case EventKind::duplicate: return "duplicate";
    case EventKind::power_cycle_needed: return "power cycle needed";
    case EventKind::recipe: return "recipe";
    case EventKind::emcy: return "emcy";
    case EventKind::startup: return "startup";
    case EventKind::master: return "master";
    case EventKind::milestone: return "milestone";
    case EventKind::error: return "error";
    case EventKind::surplus: return name(Odd::surplus);
    case EventKind::foreign: return name(Odd::foreign);
    case EventKind::clone: return name(Odd::clone);
    case EventKind::wrong_revision: return name(Odd::wrong_revision);
    case EventKind::fixed_mismatch: return name(Odd::fixed_mismatch);
    case EventKind::misplaced: return name(Odd::misplaced);
    case EventKind::returned: return name(Odd::returned);
    case EventKind::unfinished: return name(Odd::unfinished);
    case EventKind::lent: return name(Odd::lent);
  }
  return "?";
}

EventKind event_kind(places::OddityKind kind) noexcept {
  static_assert(static_cast<int>(EventKind::lent) - static_cast<int>(EventKind::surplus) ==
                static_cast<int>(places::OddityKind::lent));
  return static_cast<EventKind>(static_cast<int>(EventKind::surplus) + static_cast<int>(kind));
}

const char* name(Milestone milestone) noexcept {
  switch (milestone) {
    case Milestone::discovered: return "discovered";
    case Milestone::bound: return "bound";
    case Milestone::operational: return "operational";
  }
  return "?";
}
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const EmcyReport& e) {
  Json j;
  j["at_s"] = seconds(e.at);
  j["code"] = fmt::format("0x{:04X}", e.code);
  j["text"] = e.text;
  j["register"] = fmt::format("0x{:02X}", e.error_register);
  j["count"] = e.count;
  return j;
}

Json json_of(const SlotReport& s) {
  Json j;
  j["bus"] = s.bus;
  j["id"] = s.id.value();
  j["name"] = s.name;
  j["type"] = nullptr;
  if (s.unasked == 0) j["type"] = fmt::format("0x{:08X}{:08X}", s.type.vendor, s.type.product);
  if (s.device && s.device->knows(2) && s.device->knows(3)) {
    j["r_sn"] = fmt::format("0x{:016X}", s.device->r_sn().value());
  } else {
    j["r_sn"] = nullptr;
  }
  j["state"] = places::name(s.state);
  j["since_s"] = seconds(s.since);
  if (!s.reason.empty()) j["reason"] = s.reason;
  if (s.boot != manager::BootStatus::booted) j["boot"] = std::string(1, manager::letter(s.boot));
  if (s.nmt) j["nmt"] = berth::name(*s.nmt);
  if (s.heard) j["heard_s"] = seconds(*s.heard);
  if (s.emcy) j["emcy"] = json_of(*s.emcy);
  return j;
}

Json json_of(const Event& e) {
  Json j;
  j["at_s"] = seconds(e.at);
  j["bus"] = e.bus;
  j["kind"] = name(e.kind);
  if (!e.slot.empty()) j["slot"] = e.slot;
  j["text"] = e.text;
  if (!e.slots.empty()) j["slots"] = e.slots;
  if (!e.devices.empty()) j["devices"] = e.devices;
  if (e.offers_save) j["offers_save"] = true;
  return j;
}

Json json_of(const MasterReport& m) {
  Json j;
  j["bus"] = m.bus;
  j["node"] = nullptr;
  if (m.active) j["node"] = m.active->node.value();
  if (m.active) j["priority"] = m.active->priority;
  j["here"] = m.here;
  return j;
}

// Text from files and devices may hold invalid UTF-8 bytes; they are replaced, without an exception.
std::string dump(const Json& j, int indent) { return j.dump(indent, ' ', false, Json::error_handler_t::replace); }

}  // namespace

double seconds(rt::Time at) noexcept { return static_cast<double>(at.time_since_epoch().count()) / 1e9; }

std::string MasterReport::text() const {
  if (!active) return bus + ": the masters of this bus agree on the active one";
  return fmt::format("{}: node {} is the active NMT master (priority {}){}", bus, active->node.value(),
                     active->priority, here ? ", this Berth" : "");
}

namespace {

/// A JSON object written piece by piece, as `nlohmann::ordered_json::dump` would write it whole.
class Pieces {
 public:
  Pieces(int indent, const JsonSink& out) : indent_(indent), out_(out) {}

  void add(const char* name, const Json& value) {
    begin(name);
    put(value, 1);
  }
  template <class Items>
  void add_list(const char* name, const Items& items) {
    begin(name);
    text_ += '[';
    const char* separator = "";
    for (const auto& item : items) {
      text_ += std::exchange(separator, ",");
      new_line(2);
      put(json_of(item), 2);
      if (text_.size() >= usual_size) give();
    }
    if (!std::ranges::empty(items)) new_line(1);
    text_ += ']';
  }
  void end() {
    new_line(0);
    text_ += '}';
    give();
  }

 private:
  static constexpr std::size_t usual_size = 64 * 1024;

  void begin(const char* name) {
    text_ += std::exchange(separator_, ',');
    new_line(1);
    text_ += fmt::format("\"{}\":{}", name, indent_ < 0 ? "" : " ");
  }
  void new_line(int depth) {
    if (indent_ < 0) return;
    text_ += '\n';
    text_.append(static_cast<std::size_t>(depth * indent_), ' ');
  }
  void put(const Json& value, int depth) {
    for (const char c : dump(value, indent_)) {  // no line breaks except with indentation
      if (c == '\n') {
        new_line(depth);
      } else {
        text_ += c;
      }
    }
  }
  void give() {
    out_(text_);
    text_.clear();
  }

  int indent_;
  const JsonSink& out_;
  std::string text_;
  char separator_ = '{';
};

}  // namespace

void write_json(const Report& report, int indent, const JsonSink& out) {
  Pieces pieces(indent, out);
  pieces.add_list("slots", report.slots);
  Json times = Json::object();
  for (const auto& [bus, time] : report.bus_time_s) times[bus] = time;
  pieces.add("bus_time_s", times);
  pieces.add_list("events", report.events);
  if (!report.questions.empty()) pieces.add_list("questions", report.questions);
  if (!report.masters.empty()) pieces.add_list("masters", report.masters);
  pieces.end();
}

std::string to_json(const Report& report, int indent) {
  std::string text;
  write_json(report, indent, [&text](std::string_view piece) { text += piece; });
  return text;
}

std::string to_json(const Event& event) { return dump(json_of(event), -1); }
std::string to_json(const SlotReport& slot) { return dump(json_of(slot), -1); }

std::string to_line(const Event& e) {
  return fmt::format("{:9.3f} s  {}  {}{}", seconds(e.at), e.bus, e.slot.empty() ? "" : e.slot + ": ", e.text);
}

}  // namespace berth::operate
