/// A metric of an edge node or one of its devices, as the application defines it.
#pragma once

#include <string>
#include <tl/expected.hpp>

#include "berth/sparkplug/payload.hpp"

namespace berth::sparkplug {

/// Nothing, or the reason as a sentence for a person.
using Said = tl::expected<void, std::string>;

struct OwnMetric {
  std::string name{};  ///< folders by slashes: "Motor/Speed"; unique, whatever the case
  DataType type = DataType::unknown;
  Value value{};  ///< now; `Null` if there is none
  Utc at{};       ///< when the value was acquired
  Quality quality = Quality::good;
  bool writable = false;     ///< commands may write it
  bool transient = false;    ///< hosts should not store it
  PropertySet properties{};  ///< in births; never "Quality", which `quality` says
};

/// Metrics that the edge node makes itself; the application may define none of these names.
constexpr const char* bd_seq_metric = "bdSeq";
constexpr const char* rebirth_metric = "Node Control/Rebirth";
/// UInt64, how many changes did not fit into the backlog or had no metric any more.
constexpr const char* lost_metric = "Backlog/Lost";

}  // namespace berth::sparkplug
