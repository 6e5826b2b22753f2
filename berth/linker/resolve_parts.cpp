#include "berth/linker/resolve_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "berth/base/words.hpp"
#include "berth/linker/crossing_parts.hpp"
#include "berth/linker/symbols.hpp"
#include "berth/linker/variables_parts.hpp"
#include "berth/od/names.hpp"
#include "berth/od/notation.hpp"

namespace berth::linker {
namespace {

using co::PdoKind;
using od::DataType;

std::string type_name(DataType type) {
  const auto known = od::name(type);
  return known.empty() ? fmt::format("type {:04X}h", static_cast<unsigned>(type)) : std::string(known);
}

bool may_be_name(od::NoObject::Kind kind) noexcept { return kind != od::NoObject::Kind::bare; }

/// The whole name of the object, of its sub-object, or both.
bool is_name_of(const od::Description& description, ObjectRef ref, const std::string& word) {
  const auto* const object = description.find(ref.index);
  const auto* const sub = description.find(ref);
  if (object == nullptr || sub == nullptr) return false;
  return same_word(description.name(*object), word) || same_word(description.name(*sub), word) ||
         same_word(od::full_name(description, ref), word);
}

/// An end of a link: an object of the description, or a variable.
struct Meant {
  std::size_t node = 0;
  ObjectRef object{};
  DataType type = DataType::none;
  std::size_t variable = no_variable;
};

class Resolver {
 public:
  Resolver(const LinkNetwork& network, const std::vector<DevicePdos>& devices, Findings& findings)
      : network_(network), devices_(devices), findings_(findings), variables_(network), bad_(network.links.size()) {
    from_.resize(network.links.size());
    to_.resize(network.links.size());
  }

  Resolved run(const Earlier& earlier) {
    const auto order = canonical_order(network_);
    for (const auto link : order) read(link);
    variables_.infer(order, [this](std::size_t link) { return typed_ends(link); });
    for (const auto link : order) check(link);
    for (const auto link : order) {
      if (!bad_[link]) use_variables(link);
    }
    variables_.allocate(earlier);
    for (const auto link : order) place_variables(link);
    Resolved made;
    made.linked.assign(network_.nodes.size(), false);
    for (const auto link : order) {
      if (!bad_[link]) add(link, made);
    }
    refuse_circles(made);
    finish(made);
    return made;
  }

 private:
  void refuse(std::size_t link, std::string message, std::string fix) {
    bad_[link] = true;
    findings_.push_back(refusal(network_, link, std::move(message), std::move(fix)));
  }

  void read(std::size_t link) {
    const Link& written = network_.links[link];
    const auto from = end(link, written.from, true);
    if (from) from_[link] = *from;
    for (const End& each : written.to) {
      const auto to = end(link, each, false);
      if (to) to_[link].push_back(*to);
    }
  }

  std::string at(const End& end) const { return fmt::format("{}/{}", network_.nodes[end.node].name, end.object); }

  std::optional<Meant> end(std::size_t link, const End& end, bool input) {
    const Node& node = network_.nodes[end.node];
    if (!node.file) {
      refuse(link, fmt::format("nothing is known of the device in {}", node.name), "add eds = \"FILE\" to its slot");
      return std::nullopt;
    }
    const od::Description& description = *node.file->description;
    const bool numbers = od::read_object(end.object).has_value();
    const bool dynamic_names = !node.file->dynamic_segments.empty() && !numbers;
    const auto object = od::find_object(description, end.object);
    // If any name may be a variable's, a name that only begins like an object's does not mean that object.
    if (object && (!dynamic_names || is_name_of(description, *object, end.object))) {
      const bool dynamic = is_dynamic(*node.file, object->index);
      const auto* const sub = dynamic && node.linked_before ? nullptr : description.find(*object);
      if (sub != nullptr) return Meant{end.node, *object, sub->type, no_variable};
      if (dynamic) return variable(link, end, input, numbers ? std::optional(*object) : std::nullopt);
      return gone(link, end, od::write_object(*object));
    }
    if (dynamic_names && (object || may_be_name(object.error().kind))) return variable(link, end, input, std::nullopt);
    refuse(link, fmt::format("{}: {}", at(end), object.error().why),
           node.file->dynamic_segments.empty()
               ? "name an object of its description; network variables need a device with [DynamicChannels]"
               : "name an object of its description, or a network variable");
    return std::nullopt;
  }

  std::optional<Meant> gone(std::size_t link, const End& end, const std::string& object) {
    refuse(link, fmt::format("{}: the device in this slot has no object {}", at(end), object),
           "take the link out, or name an object of the description that the slot has now");
    return std::nullopt;
  }

  std::optional<Meant> variable(std::size_t link, const End& end, bool input, std::optional<ObjectRef> object) {
    if (!object) {
      if (const auto wrong = wrong_identifier(end.object); !wrong.empty()) {
        refuse(link,
               fmt::format("{}: no object of the description, and no name of a network variable: {}", at(end), wrong),
               "letters, digits and single underscores, a letter first (IEC 61131-3)");
        return std::nullopt;
      }
    }
    const auto made = variables_.of(end.node, object ? symbol_of(*object) : end.object, input, object);
    if (const auto other = variables_.other_direction(made)) {
      refuse(link,
             fmt::format("{}: this network variable is received by one link and sent by another; it has one direction",
                         at(end)),
             "link its consumers to the first producer, or give what is sent another name");
      return std::nullopt;
    }
    return Meant{end.node, {}, DataType::none, made};
  }

  std::vector<std::pair<std::size_t, DataType>> typed_ends(std::size_t link) const {
    std::vector<std::pair<std::size_t, DataType>> ends;
    if (network_.links[link].type) ends.emplace_back(no_variable, *network_.links[link].type);
    if (from_[link]) ends.emplace_back(from_[link]->variable, from_[link]->type);
    for (const Meant& to : to_[link]) ends.emplace_back(to.variable, to.type);
    return ends;
  }

  DataType type_of(const Meant& place) const {
    return place.variable == no_variable ? place.type : variables_.type(place.variable);
  }

  void check(std::size_t link) {
    if (bad_[link]) return;
    const Link& written = network_.links[link];
    const Meant& from = *from_[link];
    if (!check_end(link, written.from, from, PdoKind::tpdo)) return;
    for (std::size_t i = 0; i < written.to.size(); ++i) {
      if (!check_pair(link, i)) return;
    }
  }

  bool check_end(std::size_t link, const End& end, const Meant& place, PdoKind kind) {
    const Node& node = network_.nodes[place.node];
    const auto type = type_of(place);
    if (type == DataType::none && place.variable != no_variable) {
      refuse(link, fmt::format("{}: the data type of this network variable is not known", at(end)),
             "write type = \"UNSIGNED16\", or what it is, into the link");
      return false;
    }
    if (place.variable != no_variable) {
      if (variables_.has_segment(place.variable)) return true;
      refuse(link,
             fmt::format("{}: [DynamicChannels] of the device has no segment for {} {} variables", at(end),
                         type_name(type), kind == PdoKind::tpdo ? "input (sent)" : "output (received)"),
             "use a type that the device has a segment for");
      return false;
    }
    const co::PdoEntry entry{place.object, static_cast<std::uint8_t>(od::bit_length(type))};
    const std::string pdo = kind == PdoKind::tpdo ? "TPDO" : "RPDO";
    if (co::check_entry(*node.file->description, entry, kind) != od::AbortCode::none) {
      refuse(link,
             fmt::format("{}: {} {} cannot be mapped into a {}", at(end), type_name(type),
                         od::write_object(place.object), pdo),
             kind == PdoKind::tpdo ? "name an object with PDOMapping=1 that can be read"
                                   : "name an object with PDOMapping=1 that can be written");
      return false;
    }
    const auto& device = devices_[place.node];
    const bool any_variable = std::ranges::any_of(device.of(kind), [](const auto& p) { return !p.fixed_mapping; });
    if (any_variable && entry.bits % device.granularity != 0) {
      refuse(link,
             fmt::format("{}: it has {} bit, and the device maps only multiples of {}", at(end), entry.bits,
                         device.granularity),
             "link the byte that it is part of");
      return false;
    }
    return true;
  }

  bool check_pair(std::size_t link, std::size_t i) {
    const Link& written = network_.links[link];
    const Meant& from = *from_[link];
    const Meant& to = to_[link][i];
    if (!check_end(link, written.to[i], to, PdoKind::rpdo)) return false;
    if (from.node == to.node) {
      refuse(link, fmt::format("{} and {} are objects of one device", at(written.from), at(written.to[i])),
             "a device connects its own objects by its program");
      return false;
    }
    const auto bus = network_.nodes[from.node].bus;
    if (bus != network_.nodes[to.node].bus) {
      const auto object = [](const Meant& end) { return end.variable == no_variable ? end.object : ObjectRef{}; };
      const auto wrong =
          cannot_cross(network_, written, {from.node, object(from)}, {to.node, object(to)}, type_of(from));
      if (wrong) {
        refuse(link, fmt::format("{} to {}: {}", at(written.from), at(written.to[i]), wrong->why), wrong->fix);
        return false;
      }
    }
    const auto a = type_of(from);
    const auto b = type_of(to);
    if (a == b && (!written.type || *written.type == a)) return true;
    if (a == b) {
      refuse(link, fmt::format("it says {}, {} is {}", type_name(*written.type), at(written.from), type_name(a)),
             "leave type out, or make both the same");
    } else {
      refuse(link,
             fmt::format("types differ: {} is {}, {} is {}", at(written.from), type_name(a), at(written.to[i]),
                         type_name(b)),
             "link objects of one type; a network variable takes the type of what it is linked to");
    }
    return false;
  }

  void use_variables(std::size_t link) {
    if (from_[link]->variable != no_variable) variables_.use(from_[link]->variable);
    for (const Meant& to : to_[link]) {
      if (to.variable != no_variable) variables_.use(to.variable);
    }
  }

  void place_variables(std::size_t link) {
    if (bad_[link]) return;
    const auto place = [&](Meant& end, const End& written) {
      if (end.variable == no_variable || bad_[link]) return;
      const auto object = variables_.object(end.variable);
      if (object) {
        end.object = *object;
        return;
      }
      refuse(link,
             fmt::format("{}: the device has no room for another {} variable", at(written), type_name(type_of(end))),
             "use fewer variables of this type and direction, or free the place that another one is pinned to");
    };
    place(*from_[link], network_.links[link].from);
    for (std::size_t i = 0; i < to_[link].size(); ++i) place(to_[link][i], network_.links[link].to[i]);
  }

  /// Two links may have the same object as their source; no object may get its value from two.
  void add(std::size_t link, Resolved& made) {
    const Meant& from = *from_[link];
    const Source source{from.node, from.object};
    for (std::size_t i = 0; i < to_[link].size(); ++i) {
      const Consumer consumer{to_[link][i].node, to_[link][i].object};
      const auto [found, fresh] = sources_.try_emplace(consumer, source, link);
      if (fresh) continue;
      refuse(link,
             fmt::format("{} gets its value from {} already ({})", at(network_.links[link].to[i]),
                         at(network_.links[found->second.second].from), name_of(network_, found->second.second)),
             "keep one of the two");
      return;
    }
    const Link& written = network_.links[link];
    if (const auto twice = received_twice(link)) {
      refuse(link, fmt::format("{} is to be received twice by {}", at(written.from), network_.nodes[*twice].name),
             "link it to one object of the device; its program can copy it");
      return;
    }
    const auto transmission = one_of_kind(written.transmission);
    auto& signal = signals_[{source.first, source.second, transmission}];
    signal.producer = from.node;
    signal.object = from.object;
    signal.bits = static_cast<std::uint8_t>(od::bit_length(type_of(from)));
    signal.transmission = transmission;
    if (written.deadline) signal.deadline = std::min(signal.deadline.value_or(*written.deadline), *written.deadline);
    signal.links.push_back(link);
    made.linked[from.node] = true;
    for (const Meant& to : to_[link]) {
      signal.consumers.push_back({to.node, to.object});
      made.linked[to.node] = true;
    }
  }

  /// One device on which two ends of one value lie: an RPDO puts its bits into only one object.
  std::optional<std::size_t> received_twice(std::size_t link) const {
    const auto known =
        signals_.find({from_[link]->node, from_[link]->object, one_of_kind(network_.links[link].transmission)});
    std::set<std::size_t> nodes;
    if (known != signals_.end()) {
      for (const Consumer& each : known->second.consumers) nodes.insert(each.node);
    }
    for (const Meant& to : to_[link]) {
      if (!nodes.insert(to.node).second) return to.node;
    }
    return std::nullopt;
  }

  /// A value in a loop would be sent forever.
  void refuse_circles(const Resolved&) {
    std::map<Source, std::vector<std::pair<Source, std::size_t>>> next;
    for (const auto& [consumer, source] : sources_) {
      next[source.first].push_back({{consumer.node, consumer.object}, source.second});
    }
    std::set<Source> done;
    for (const auto& [start, ignored] : next) {
      // Each object has at most one source, so a loop is found by going back from it.
      std::set<Source> seen;
      Source at_now = start;
      std::vector<std::size_t> links;
      while (seen.insert(at_now).second && !done.contains(at_now)) {
        const auto source = sources_.find({at_now.first, at_now.second});
        if (source == sources_.end()) break;
        links.push_back(source->second.second);
        at_now = source->second.first;
        if (at_now == start) break;
      }
      done.insert(seen.begin(), seen.end());
      if (links.empty() || at_now != start) continue;
      std::ranges::sort(links);
      std::string names;
      for (const auto link : links) names += (names.empty() ? "" : ", ") + name_of(network_, link);
      for (const auto link : links) {
        refuse(link, fmt::format("these links form a loop: {}", names), "take one of them out");
      }
    }
  }

  void finish(Resolved& made) {
    for (auto& [key, signal] : signals_) {
      if (std::ranges::any_of(signal.links, [this](auto link) { return bad_[link]; })) continue;
      std::ranges::sort(signal.consumers);
      std::ranges::sort(signal.links);
      made.signals.push_back(std::move(signal));
    }
    made.variables = variables_.all();
  }

  using Source = std::pair<std::size_t, ObjectRef>;
  const LinkNetwork& network_;
  const std::vector<DevicePdos>& devices_;
  Findings& findings_;
  Variables variables_;
  std::vector<bool> bad_;
  std::vector<std::optional<Meant>> from_;
  std::vector<std::vector<Meant>> to_;
  std::map<Consumer, std::pair<Source, std::size_t>> sources_;
  std::map<std::tuple<std::size_t, ObjectRef, TransmissionType>, Signal> signals_;
};

}  // namespace

std::string name_of(const LinkNetwork& network, std::size_t link) {
  const End& from = network.links[link].from;
  return fmt::format("link[{}] from {}/{}", link + 1, network.nodes[from.node].name, from.object);
}

Finding refusal(const LinkNetwork& network, std::size_t link, std::string message, std::string fix) {
  const Place place = network.links[link].place;
  return {Finding::Severity::error,          network.file,       place.line,    place.column,
          fmt::format("link[{}]", link + 1), std::move(message), std::move(fix)};
}

std::vector<std::size_t> canonical_order(const LinkNetwork& network) {
  std::vector<std::size_t> order(network.links.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
    const Link& x = network.links[a];
    const Link& y = network.links[b];
    const auto key = [](const Link& l) { return std::tie(l.from.node, l.from.object, l.transmission); };
    if (key(x) != key(y)) return key(x) < key(y);
    return std::ranges::lexicographical_compare(
        x.to, y.to, [](const End& p, const End& q) { return std::tie(p.node, p.object) < std::tie(q.node, q.object); });
  });
  return order;
}

Resolved resolve(const LinkNetwork& network, const std::vector<DevicePdos>& devices, const Earlier& earlier,
                 Findings& findings) {
  return Resolver(network, devices, findings).run(earlier);
}

}  // namespace berth::linker
