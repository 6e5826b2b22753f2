/// The signals of a machine's messages as JSON, for the pages of Studio: the position of each in its frame, and the
/// meaning of its value (docs/api.md, "signals").
#pragma once

#include <string>

#include "berth/design/machine.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::document {

/// {"buses":[{"bus","messages":[{"id","ext","name","sender","signals":[{"name","object","at","bits","type",...}]}]}]}:
/// all buses, messages with at least one signal. `links`: of a plan without errors, or null.
[[nodiscard]] std::string signals_json(const design::Machine& machine, const traffic::LinkPlan* links);

}  // namespace berth::document
