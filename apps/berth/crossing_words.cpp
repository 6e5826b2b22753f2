#include "crossing_words.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "berth/od/notation.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

double in_ms(rt::Duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

Json ms_or_null(const std::optional<rt::Duration>& time) { return time ? Json(in_ms(*time)) : Json(); }

std::vector<std::string> gateways_of(const CrossingShown& shown) {
  std::vector<std::string> names;
  for (const std::size_t gateway : shown.crossing.gateways)
    names.push_back(shown.network.nodes[shown.network.gateways[gateway].above].name);
  return names;
}

}  // namespace

bool CrossingShown::kept() const { return worst && (!crossing.deadline || *worst <= *crossing.deadline); }

std::string CrossingShown::text() const {
  const std::string bound = worst ? fmt::format("worst {:.3f} ms", in_ms(*worst)) : "no bound";
  const std::string judged =
      crossing.deadline ? fmt::format(", deadline {:g} ms {}", in_ms(*crossing.deadline), kept() ? "kept" : "MISSED")
                        : "";
  return fmt::format("{}/{} -> {}/{} through {}: {}{}", network.nodes[crossing.from].name,
                     od::write_object(crossing.source), network.nodes[crossing.to].name,
                     od::write_object(crossing.target), fmt::join(gateways_of(*this), ", "), bound, judged);
}

Json CrossingShown::json() const {
  return {{"from", network.nodes[crossing.from].name},
          {"source", od::write_object(crossing.source)},
          {"to", network.nodes[crossing.to].name},
          {"target", od::write_object(crossing.target)},
          {"gateways", gateways_of(*this)},
          {"worst_ms", ms_or_null(worst)},
          {"deadline_ms", ms_or_null(crossing.deadline)},
          {"kept", kept()}};
}

}  // namespace berth::cli
