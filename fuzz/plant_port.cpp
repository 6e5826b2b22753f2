// Any packets at both readers of the plant protocol: what is taken for a message encodes to one that reads back equal.
//
// Input: packets, each a length byte and so many bytes; a length of 255 takes the rest.
#include <algorithm>
#include <cstdlib>

#include "berth/io/plant_protocol.hpp"

namespace plant_port_target {

namespace {

using namespace berth;

void check(std::span<const std::uint8_t> packet) {
  const auto message = io::decode(packet);
  if (!message) return;
  if (message->ranges.size() > io::most_ranges || message->text.size() > io::most_text) std::abort();
  const auto bytes = io::encode(*message);
  if (bytes.size() > packet.size() || bytes.size() > io::longest_message) std::abort();
  const auto again = io::decode(bytes);
  if (!again || again->kind != message->kind || again->tag != message->tag || again->text != message->text ||
      again->number != message->number || !(again->frame == message->frame) || again->reason != message->reason ||
      again->ranges != message->ranges || again->status.bit_rate != message->status.bit_rate) {
    std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::span<const std::uint8_t> rest(data, size);
  while (!rest.empty()) {
    const std::size_t told = rest.front();
    rest = rest.subspan(1);
    const std::size_t length = told == 255 ? rest.size() : std::min(told, rest.size());
    check(rest.first(length));
    rest = rest.subspan(length);
  }
  return 0;
}

}  // namespace plant_port_target
