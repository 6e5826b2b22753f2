// Any bytes from a broker, in pieces: what comes through is what came, packet after packet, each within the limit; and
// the size of the pieces changes nothing. The first byte chooses the version, the second the size of a piece.
#include <algorithm>
#include <optional>
#include <string>
#include <string_view>

#include "berth/mqtt/gate.hpp"
#include "fuzz/require.hpp"

namespace mqtt_gate_target {

struct Outcome {
  std::string passed{};
  unsigned skipped = 0;
  std::optional<berth::mqtt::Gate::Flaw> flaw{};
};

inline Outcome pass(std::string_view bytes, bool v5, std::size_t piece) {
  constexpr std::size_t most = 600;
  berth::mqtt::Gate gate(v5, most);
  Outcome outcome;
  while (!bytes.empty()) {
    gate.put(bytes.substr(0, piece));
    bytes.remove_prefix(std::min(piece, bytes.size()));
    for (;;) {
      const auto packet = gate.next();
      if (!packet) {
        outcome.flaw = packet.error();
        return outcome;
      }
      if (!*packet) break;
      const auto& [type, whole, body, skipped, id] = **packet;
      berth::fuzz::require(whole.size() <= most && whole.ends_with(body) && (skipped || id == 0));
      if (skipped) berth::fuzz::require(!v5 && whole.empty());
      if (!skipped) berth::fuzz::require(static_cast<unsigned char>(whole[0]) >> 4U == static_cast<unsigned>(type));
      outcome.skipped += skipped ? 1 : 0;
      outcome.passed += whole;
    }
  }
  return outcome;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const bool v5 = (data[0] & 1U) != 0;
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 2, size - 2);
  const auto at_once = pass(bytes, v5, size);
  const auto in_pieces = pass(bytes, v5, std::size_t{1} + data[1]);
  if (at_once.skipped == 0) berth::fuzz::require(bytes.starts_with(at_once.passed));
  berth::fuzz::require(at_once.passed == in_pieces.passed && at_once.skipped == in_pieces.skipped);
  berth::fuzz::require(at_once.flaw == in_pieces.flaw);
  return 0;
}

}  // namespace mqtt_gate_target
