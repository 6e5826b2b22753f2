#include "berth/campaign/line.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>

namespace berth::campaign {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array<const char*, kinds> kind_names{"faults", "trees", "matrix", "compare"};
constexpr std::array<const char*, verdicts> verdict_names{"good", "failed", "differs", "crashed", "killed", "too long"};
constexpr std::size_t longest_reason = 8'000;  // bytes; each may become six of an escape

template <class T>
void put(Json& json, const char* name, const std::optional<T>& value) {
  if (value) json[name] = *value;
}
void put(Json& json, const char* name, const std::string& value) {
  if (!value.empty()) json[name] = value;
}

tl::unexpected<Error> wrong(const char* text) { return fail(Errc::invalid, text); }

/// False: it is there and no text.
bool take(const Json& json, const char* name, std::string& into) {
  const auto it = json.find(name);
  if (it == json.end()) return true;
  if (!it->is_string()) return false;
  into = it->get<std::string>();
  return true;
}
bool take(const Json& json, const char* name, std::optional<double>& into) {
  const auto it = json.find(name);
  if (it == json.end()) return true;
  if (!it->is_number() || !std::isfinite(it->get<double>()) || it->get<double>() < 0) return false;
  into = it->get<double>();
  return true;
}
bool take(const Json& json, const char* name, std::optional<std::uint64_t>& into) {
  const auto it = json.find(name);
  if (it == json.end()) return true;
  if (!it->is_number_unsigned()) return false;
  into = it->get<std::uint64_t>();
  return true;
}

/// A number of 64 bits is more than JSON's readers keep: it is a text of 16 digits.
bool take_hash(const Json& json, std::optional<std::uint64_t>& into) {
  std::string digits;
  if (!take(json, "hash", digits)) return false;
  if (digits.empty()) return true;
  std::uint64_t value = 0;
  const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
  if (bad != std::errc{} || end != digits.data() + digits.size() || digits.size() != 16) return false;
  into = value;
  return true;
}

std::optional<Verdict> verdict_of(std::string_view word) {
  for (std::size_t i = 0; i < verdicts; ++i) {
    if (word == verdict_names.at(i)) return static_cast<Verdict>(i);
  }
  return std::nullopt;
}

Result<Key> key_of(const Json& json) {
  Key key;
  std::string kind;
  std::optional<std::uint64_t> seed;
  const bool read = take(json, "kind", kind) && take(json, "seed", seed) && take(json, "version", key.version) &&
                    take(json, "options", key.options);
  const auto known = kind_of(kind);
  if (!read || !known || !seed || key.version.empty()) return wrong("kind, seed or version is missing");
  key.kind = *known;
  key.seed = *seed;
  return key;
}

}  // namespace

const char* name(Kind kind) noexcept { return kind_names[static_cast<std::size_t>(kind)]; }
const char* name(Verdict verdict) noexcept { return verdict_names[static_cast<std::size_t>(verdict)]; }

bool is_result(Verdict verdict) noexcept { return verdict != Verdict::killed && verdict != Verdict::too_long; }

std::optional<Kind> kind_of(std::string_view wanted) noexcept {
  for (std::size_t i = 0; i < kinds; ++i) {
    if (wanted == kind_names[i]) return static_cast<Kind>(i);
  }
  return std::nullopt;
}

std::string to_json(const Line& line) {
  Json json{{"kind", name(line.key.kind)}, {"seed", line.key.seed}, {"version", line.key.version}};
  put(json, "options", line.key.options);
  put(json, "group", line.group);
  put(json, "cell", line.cell);
  json["outcome"] = name(line.verdict);
  put(json, "operational_s", line.figures.operational_s);
  put(json, "bus_time_s", line.figures.bus_time_s);
  put(json, "frames", line.figures.frames);
  put(json, "lost", line.figures.lost);
  if (line.hash) json["hash"] = fmt::format("{:016x}", *line.hash);
  put(json, "reason", line.reason.substr(0, longest_reason));
  put(json, "replay", line.replay);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

Result<Line> parse_line(std::string_view text) {
  if (text.size() > longest_line) return wrong("it is longer than any line of a campaign");
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return wrong("it is no JSON object");
  Line line;
  const auto key = key_of(json);
  if (!key) return tl::unexpected(key.error());
  line.key = *key;
  std::string outcome;
  const bool read = take(json, "outcome", outcome) && take(json, "group", line.group) &&
                    take(json, "cell", line.cell) && take(json, "operational_s", line.figures.operational_s) &&
                    take(json, "bus_time_s", line.figures.bus_time_s) && take(json, "frames", line.figures.frames) &&
                    take(json, "lost", line.figures.lost) && take_hash(json, line.hash) &&
                    take(json, "reason", line.reason) && take(json, "replay", line.replay);
  const auto verdict = verdict_of(outcome);
  if (!read || !verdict) return wrong("a value of it is none that a campaign writes");
  line.verdict = *verdict;
  return line;
}

}  // namespace berth::campaign
