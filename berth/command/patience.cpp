#include "berth/command/patience.hpp"

#include <fmt/format.h>

namespace berth::command {

void fail_silent(Reply& reply, const Error& error, const operate::Network& bus) {
  fail_with(reply, error, fmt::format("bus {}, SDO read", bus.bus().name),
            "is the device there and not stopped? `berth scan` shows what answers");
}

}  // namespace berth::command
