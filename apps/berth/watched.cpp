#include "watched.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>

#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

/// The parts of a word.
struct Named {
  command::NodeArgument node;
  std::string node_word;
  command::KnownObject object;
};

// Names of nodes and objects may both have a slash ("line/left", "3/5", "Identity object/Serial number"). The first
// slash counts at which both sides are known.
tl::expected<Named, std::string> named(const design::Machine& machine, const std::string& bus,
                                       const std::string& word) {
  std::string wrong;
  for (auto slash = word.find('/'); slash != std::string::npos; slash = word.find('/', slash + 1)) {
    const std::string before = word.substr(0, slash);
    auto node = command::find_node(machine, bus, before);
    if (!node) {
      if (wrong.empty()) wrong = node.error();
      continue;
    }
    auto object = command::find_object(machine, *node, word.substr(slash + 1));
    if (object) return Named{std::move(*node), before, std::move(*object)};
    wrong = fmt::format("{}: {}", before, object.error());
  }
  if (wrong.empty()) wrong = fmt::format("{} is no SLOT/OBJECT; write left/1001h, or 5/6041h", text::quoted(word));
  return tl::unexpected(wrong);
}

std::string in_one_line(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string text_of(const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end()) return {};
  return it->is_string() ? it->get<std::string>() : it->dump();
}

// "23.5 °C", "500 ms", "2 Reverse", "12", "F4 01".
std::string value_of(const Json& json) {
  std::string value = text_of(json, "quantity");
  if (value.empty()) value = text_of(json, "time");
  if (value.empty()) value = text_of(json, "value");
  if (value.empty()) value = text_of(json, "bytes");
  const std::string meaning = text_of(json, "meaning");
  return meaning.empty() ? value : value + " " + meaning;
}

std::optional<double> number_of(const Json& json) {
  const auto it = json.find("value");
  if (it == json.end()) return std::nullopt;
  if (it->is_number()) return it->get<double>();
  if (it->is_boolean()) return it->get<bool>() ? 1 : 0;
  if (!it->is_string()) return std::nullopt;
  const auto& text = it->get_ref<const std::string&>();
  if (text == "true" || text == "false") return text == "true" ? 1 : 0;
  double number = 0;
  const auto [end, bad] = std::from_chars(text.data(), text.data() + text.size(), number);
  return bad == std::errc{} && end == text.data() + text.size() ? std::optional(number) : std::nullopt;
}

// The problem in a few words: the row has little room.
std::string trouble_of(const Json& json) {
  const auto error = json.find("error");
  if (error == json.end()) return {};
  const std::string abort = text_of(*error, "abort_code");
  if (!abort.empty()) return fmt::format("{}h {}", abort.substr(2), text_of(*error, "text"));
  if (text_of(*error, "code") == "timeout") return "no answer";
  return text_of(*error, "message");
}

}  // namespace

tl::expected<Watched, std::string> Watched::of(const design::Machine& machine, const std::string& bus,
                                               const std::vector<std::string>& words) {
  Watched watched;
  for (const auto& word : words) {
    const auto known = named(machine, bus, word);
    const auto slash = word.find('/');
    // If the machine's file is not read here, the answering process knows the names.
    if (!known && machine.buses.empty() && slash != std::string::npos) {
      watched.add_row(word, word.substr(0, slash), word.substr(slash + 1),
                      watched.request_for(bus, word.substr(0, slash), {}, {}), word.substr(slash + 1));
      continue;
    }
    if (!known) return tl::unexpected(known.error());
    const auto& [node, node_word, object] = *known;
    // The answering process knows the types in the description, but not those of network variables.
    const auto told = command::known_object(node.description.get(), object.ref).type;
    const bool says_type = told == od::DataType::none && object.type != od::DataType::none;
    const auto* const on = command::bus_of(machine, node);
    const Where where{on == nullptr ? std::string() : on->name, node.node};
    const auto request =
        watched.request_for(bus, node_word, says_type ? std::string(od::name(object.type)) : std::string(), where);
    const std::string number = od::write_object(object.ref);
    watched.add_row(word, node_word, object.name.empty() ? number : object.name, request, number);
  }
  return watched;
}

std::size_t Watched::request_for(const std::string& bus, const std::string& node, const std::string& type,
                                 const Where& where) {
  command::Request request{"sdo read", {{"node", node}}};
  if (!bus.empty()) request.arguments["bus"] = bus;
  if (!type.empty()) request.arguments["type"] = type;
  const auto asks_the_same = [&](const command::Request& other) {
    auto arguments = other.arguments;
    arguments.erase("object");
    return arguments == request.arguments;
  };
  const auto found = std::ranges::find_if(requests_, asks_the_same);
  const auto index = static_cast<std::size_t>(found - requests_.begin());
  if (found == requests_.end()) {
    requests_.push_back(std::move(request));
    rows_of_.emplace_back();
    where_.push_back(where);
  }
  return index;
}

void Watched::add_row(const std::string& word, const std::string& slot, const std::string& shown, std::size_t request,
                      const std::string& object) {
  std::string& objects = requests_[request].arguments["object"];
  objects += (objects.empty() ? "" : "\n") + object;
  rows_of_[request].push_back(rows_.size());
  words_.push_back(word);
  rows_.push_back({.slot = slot, .object = shown});
}

std::vector<Reading> Watched::take(std::size_t request, const command::Reply& reply, rt::Time at) {
  const auto& mine = rows_of_[request];
  Json json = Json::parse(reply.json, nullptr, false);
  const Json unread{{"error", {{"message", reply.error.empty() ? "no answer" : reply.error}}}};
  if (json.is_discarded() || !json.is_object()) json = unread;
  std::vector<Json> objects;
  if (const auto several = json.find("objects"); several != json.end()) {
    for (const auto& one : *several) objects.push_back(one);
  } else {
    objects.push_back(json);
  }
  std::vector<Reading> readings;
  for (std::size_t i = 0; i < mine.size(); ++i) {
    // After a missing answer, the node is not asked further: the rest has the same problem.
    const Json& one = objects.empty() ? unread : objects[std::min(i, objects.size() - 1)];
    WatchRow& row = rows_[mine[i]];
    row.trouble = trouble_of(one);
    const bool good = row.trouble.empty();
    if (good) {
      row.value = value_of(one);
      row.read_at = at;
    }
    row.past.push_back(good ? number_of(one) : std::nullopt);
    if (row.past.size() > most_past) row.past.pop_front();
    Json told{{"watched", words_[mine[i]]}};
    told.update(good || i < objects.size() ? one : Json{{"error", one.at("error")}});
    readings.push_back({mine[i], in_one_line(told)});
  }
  return readings;
}

void Watched::pass_over(std::size_t request, const std::string& why) {
  for (const std::size_t row : rows_of_[request]) {
    rows_[row].trouble = why;
    if (rows_[row].past.empty()) continue;  // no plot yet, so no gap in it
    rows_[row].past.emplace_back();
    if (rows_[row].past.size() > most_past) rows_[row].past.pop_front();
  }
}

}  // namespace berth::cli
