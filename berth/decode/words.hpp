/// What one frame is, in words: LSS and its feedback as paper 4's Table 1 and 2 say it, negotiation as paper 2's Figure
/// 2 does, RAND, AND and claiming in the terms of their papers, CiA 301's services in CiA's. What needs more than the
/// frame (names, values, a transfer as a whole) is `Decoder`'s (decoder.hpp).
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
  std::uint8_t node = 0;  ///< whose frame it is, or which it is for; 0: none
};

/// Frames of one bus in their order: RAND's DIS and the Fastscan feedback have the same identifiers (S1.24), and what
/// asked last tells them apart.
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

/// How many of a classic frame's first data bytes its words rest on, beside identifier, remote flag and length: frames
/// that agree in those have the same words. Empty: they may rest on frames before it, or tell what later ones mean;
/// those an interpreter must see, all in their order, and no others.
[[nodiscard]] std::optional<unsigned> rests_on(const can::Frame& frame) noexcept;

/// The words for SocketCAN's error classes and details (linux/can/error.h): "error: controller: receive warning level".
void error_words(const can::Frame& frame, std::string& out);

}  // namespace berth::decode
