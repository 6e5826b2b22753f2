/// Describes one frame in words: LSS and its feedback as in paper 4's Tables 1 and 2, negotiation as in paper 2's
/// Figure 2, RAND, AND and claiming in the terms of their papers, CiA 301's services in CiA's. `Decoder` (decoder.hpp)
/// handles what needs more than the frame: names, values, whole transfers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/can/frame.hpp"

namespace berth::decode {

enum class Service : std::uint8_t {
  nmt,
  sync,
  time,
  emcy,
  pdo,
  sdo,
  heartbeat,  ///< error control: heartbeat, boot-up, node guarding
  lss,        ///< with Fastscan and its feedback
  rand,
  and_,
  claim,
  negotiation,
  error,  ///< SocketCAN's report of an error on the bus
  other,
};
inline constexpr std::size_t services = static_cast<std::size_t>(Service::other) + 1;
[[nodiscard]] std::string_view name(Service service) noexcept;  ///< "nmt" ... "other"
[[nodiscard]] std::optional<Service> parse_service(std::string_view name) noexcept;

struct Meaning {
  Service service = Service::other;
  std::uint8_t node = 0;  ///< the frame's sender or receiver; 0: none
};

/// For frames of one bus in their order: RAND's DIS and the Fastscan feedback have the same identifiers (S1.24); the
/// last request tells which is meant.
class Interpreter {
 public:
  [[nodiscard]] std::string words(const can::Frame& frame);
  /// The same, appended to `out`.
  Meaning words(const can::Frame& frame, std::string& out);

 private:
  enum class Asked : std::uint8_t { nothing, fastscan, rand };
  Meaning extended(const can::Frame& frame, std::string& out) const;
  Meaning base(const can::Frame& frame, std::string& out) const;
  Asked asked_ = Asked::nothing;
};

/// How many first data bytes of a classic frame determine its words, together with identifier, remote flag and length:
/// frames that agree in those have the same words. Empty: the words may depend on earlier frames, or the frame on later
/// ones; an interpreter must see these frames, in their order, and no others.
[[nodiscard]] std::optional<unsigned> rests_on(const can::Frame& frame) noexcept;

/// The words for SocketCAN's error classes and details (linux/can/error.h): "error: controller: receive warning level".
void error_words(const can::Frame& frame, std::string& out);

}  // namespace berth::decode
