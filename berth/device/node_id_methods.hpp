/// The ways to a node-ID besides LSS that a device answers: RAND, AND. One object that the device owns, so that the
/// device itself only hands frames over. No heap after construction, no exceptions.
///
/// Where two schemes share identifiers (S1.24) each decodes only what is its own by its bits.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/can/dispatcher.hpp"
#include "berth/research/and_slave.hpp"
#include "berth/nodeid/rand_slave.hpp"

namespace berth::device {

/// How RAND requests are answered.
enum class RandMode : std::uint8_t {
  off,
  on,       ///< in every LSS state
  literal,  ///< in LSS configuration state only, as paper 1 has it (S1.31)
};

class NodeIdMethods {
 public:
  struct Options {
    LssAddress address{};
    RandMode rand = RandMode::on;
    bool rand_resume = false;   ///< RAND's extension (docs/rand.md)
    bool and_protocol = false;  ///< docs/and.md
  };
  explicit NodeIdMethods(const Options& options) noexcept;

  /// Power comes on, with this address: everything is forgotten.
  void power_on(const LssAddress& address) noexcept;
  /// Lets `ear` hear the requests of the methods that are on.
  void listen(can::Dispatcher& dispatcher, can::Handler& ear) const;
  /// True for a request that `handle` would look at.
  [[nodiscard]] bool hears(std::uint32_t key) const noexcept;
  /// One frame that `hears` is true for. The answer, if there is one. `in_lss_configuration`: the device's LSS state.
  std::optional<can::Frame> handle(const can::Frame& frame, bool in_lss_configuration) noexcept;

  [[nodiscard]] nodeid::Identification identification() const noexcept { return rand_.state(); }
  [[nodiscard]] nodeid::Identification and_identification() const noexcept { return and_.state(); }

 private:
  Options options_;
  nodeid::RandSlave rand_;
  research::AndSlave and_;
};

}  // namespace berth::device
