// `[[link]]` of the machine file, and `watch` of [machine], which names objects in the same way: docs/machine-file.md.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

#include "berth/design/read_parts.hpp"
#include "berth/od/notation.hpp"

namespace berth::design {
namespace {

using namespace std::chrono_literals;
using std::string_view;
using text::Table;

// 1800h:03 counts 100 us in 16 bits (CiA 301).
constexpr Duration least_inhibit = 100us;
constexpr Duration most_inhibit = 6'553'500us;

// A node-ID, optionally with a dot and a gateway's port.
struct PathStep {
  unsigned node = 0;
  unsigned port = 1;
};
std::optional<PathStep> path_step(string_view text) {
  const auto number = [](string_view digits, unsigned most) -> unsigned {
    unsigned value = 0;
    const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return bad == std::errc{} && end == digits.data() + digits.size() && value <= most ? value : 0;
  };
  const auto dot = text.find('.');
  const PathStep step{number(text.substr(0, dot), 127), dot == string_view::npos ? 1 : number(text.substr(dot + 1), 8)};
  return step.node == 0 || step.port == 0 ? std::nullopt : std::optional(step);
}

// "3/5/Position": a path names the node.
std::optional<LinkEnd> end_by_path(const Machine& machine, string_view text) {
  const Bus* at = machine.top();
  std::optional<PathStep> before;
  while (at != nullptr) {
    const auto slash = text.find('/');
    const auto step = slash == string_view::npos ? std::nullopt : path_step(text.substr(0, slash));
    if (!step) break;
    if (before) at = machine.bus_beneath(*at, before->node, before->port);
    before = step;
    text.remove_prefix(slash + 1);
  }
  if (at == nullptr || !before || text.empty()) return std::nullopt;
  const auto* const slot = machine.slot(at->name, NodeId(static_cast<std::uint8_t>(before->node)));
  if (slot == nullptr) return std::nullopt;
  return LinkEnd{slot->spec.name.name, std::string(text)};
}

// "3/5" of "3/5/Position"; empty: the text does not begin with a path.
std::string path_of(string_view text) {
  std::string path;
  for (auto slash = text.find('/'); slash != string_view::npos && path_step(text.substr(0, slash));
       slash = text.find('/')) {
    path += (path.empty() ? "" : "/") + std::string(text.substr(0, slash));
    text.remove_prefix(slash + 1);
  }
  return path;
}

}  // namespace

std::optional<LinkEnd> read_end(const Machine& machine, Table& table, string_view key, const std::string& text) {
  const auto slash = text.find('/');
  if (slash == std::string::npos || slash == 0 || slash + 1 == text.size()) {
    table.error(key, fmt::format("{} names no object of a slot", text::quoted(text)),
                "write \"slot name/object\", or \"3/5/object\" of node 5 beneath gateway 3");
    return std::nullopt;
  }
  LinkEnd end{text.substr(0, slash), text.substr(slash + 1)};
  if (machine.slot(end.slot) != nullptr) return end;
  if (auto by_path = end_by_path(machine, text)) return by_path;
  if (const auto path = path_of(text); path.find('/') != std::string::npos) {
    table.error(key, fmt::format("no slot has the path {}", text::quoted(path)),
                "a path begins at the bus that is beneath no gateway, and each node on it is the slot of one "
                "(gateway = { bus, slot } of a [bus.NAME]); or name the slot");
    return std::nullopt;
  }
  std::vector<string_view> names;
  for (const auto& slot : machine.slots) names.push_back(slot.spec.name.name);
  const auto near = text::closest(end.slot, names);
  table.error(key, fmt::format("there is no slot {}", text::quoted(end.slot)),
              near.empty() ? "name a [[slot]] of this file" : fmt::format("did you mean {}?", text::quoted(near)));
  return std::nullopt;
}

namespace {

void read_targets(const Machine& machine, Table& table, Link& link) {
  const auto targets = table.strings("to");
  if (!targets) return;
  if (targets->empty()) table.error("to", "the link has no receiver", "name at least one object");
  for (const auto& target : *targets) {
    auto end = read_end(machine, table, "to", target);
    if (!end) continue;
    if (*end == link.from) table.error("to", "the link leads to itself", "name another object");
    if (std::ranges::find(link.to, *end) != link.to.end()) {
      table.error("to", fmt::format("{} appears twice", text::quoted(target)), "keep one");
    }
    link.to.push_back(std::move(*end));
  }
}

struct TransmissionWord {
  string_view word;
  std::uint8_t type;
};
constexpr std::array<TransmissionWord, 3> transmission_words{{{"event", 255}, {"sync", 1}, {"sync-acyclic", 0}}};

/// The value is a word, or the number of the transmission type.
void read_transmission(Table& table, Link& link) {
  const auto* const value = table.get("transmission");
  if (value == nullptr) return;
  if (value->kind == text::Value::Kind::integer) {
    const auto type = value->integer;
    if ((type < 0 || type > 240) && type != 254 && type != 255) {
      return table.error("transmission", fmt::format("{} is not a transmission type of a link", type),
                         "0 to 240 (at SYNC), 254 or 255 (at a change)");
    }
    link.transmission = static_cast<std::uint8_t>(type);
    return;
  }
  std::array<string_view, transmission_words.size()> words{};
  std::ranges::transform(transmission_words, words.begin(), &TransmissionWord::word);
  if (const auto found = table.word("transmission", words)) link.transmission = transmission_words.at(*found).type;
}

void read_link_type(Table& table, Link& link) {
  const auto word = table.string("type");
  if (!word) return;
  link.type = od::data_type(*word);
  if (link.type && od::bit_length(*link.type) != 0) return;
  link.type.reset();
  table.error("type", fmt::format("{} is not a data type of a network variable", text::quoted(*word)),
              "such as \"BOOLEAN\", \"UNSIGNED16\" or \"REAL32\"");
}

}  // namespace

void read_watched(Machine& machine, Table& root) {
  auto head = root.table("machine");
  const auto words = head ? head->strings("watch") : std::nullopt;
  if (!words) return;
  constexpr std::size_t most = 32;
  if (words->size() > most) {
    return head->error("watch", fmt::format("{} values are too many to look at", words->size()),
                       fmt::format("name {} at most", most));
  }
  for (const auto& word : *words) {
    if (auto end = read_end(machine, *head, "watch", word)) machine.watch.push_back(std::move(*end));
  }
}

void read_sending(Table& table, Slot& slot) {
  constexpr std::array<string_view, 3> words{"in-order", "fifo", "priority"};
  if (const auto found = table.word("queue", words))
    slot.queue = *found < 2 ? SendOrder::in_order : SendOrder::priority;
  slot.inhibit = table.duration("inhibit", least_inhibit, most_inhibit);
}

Link read_link(const Machine& machine, Table& table) {
  Link link;
  link.place = table.begin();
  if (table.require("from", "write \"slot name/object\"")) {
    const auto from = table.string("from");
    const auto end = from ? read_end(machine, table, "from", *from) : std::nullopt;
    if (end) link.from = *end;
  }
  if (table.require("to", "write [\"slot name/object\"]")) read_targets(machine, table, link);
  link.deadline = table.duration("deadline", 1us, 1h);
  read_transmission(table, link);
  read_link_type(table, link);
  link.inhibit = table.duration("inhibit", least_inhibit, most_inhibit);
  if (link.inhibit && link.transmission <= 240) {
    table.error("inhibit", "a synchronous link has no inhibit time: it is sent at SYNC",
                "leave it out, or transmission = \"event\"");
  }
  table.finish();
  return link;
}

}  // namespace berth::design
