#include "berth/research/negotiation_rules.hpp"

namespace berth::research {

const char* name(Negotiating state) noexcept {
  switch (state) {
    case Negotiating::off: return "off";
    case Negotiating::suspended: return "suspended";
    case Negotiating::listening: return "listening";
    case Negotiating::asking: return "asking";
    case Negotiating::asked: return "asked";
    case Negotiating::competing: return "competing";
    case Negotiating::waiting: return "waiting";
    case Negotiating::announcing: return "announcing";
    case Negotiating::settled: return "settled";
    case Negotiating::exhausted: return "all node-IDs in use";
  }
  return "?";
}

const char* name(IdLoss why) noexcept {
  switch (why) {
    case IdLoss::none: return "none";
    case IdLoss::defended: return "its holder defended the node-ID";
    case IdLoss::contested: return "two devices held the node-ID";
    case IdLoss::literal: return "another device announced the node-ID";
  }
  return "?";
}

}  // namespace berth::research
