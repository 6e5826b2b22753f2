/// The methods besides LSS that assign a node-ID to a device and that it answers: RAND, AND. One object owned by the
/// device, which only passes frames. No heap after construction, no exceptions.
///
/// If two schemes share identifiers (S1.24), the bits of a frame show whose it is; each decodes only its own.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/can/dispatcher.hpp"
#include "berth/nodeid/rand_slave.hpp"
#include "berth/research/and_slave.hpp"

namespace berth::device {

/// When RAND requests are answered.
enum class RandMode : std::uint8_t {
  off,
  on,       ///< in every LSS state
  literal,  ///< only in LSS configuration state, as paper 1 says (S1.31)
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

  /// Power comes on, with this address: forgets everything.
  void power_on(const LssAddress& address) noexcept;
  /// Registers `ear` for the requests of the enabled methods.
  void listen(can::Dispatcher& dispatcher, can::Handler& ear) const;
  /// True for a request that `handle` would process.
  [[nodiscard]] bool hears(std::uint32_t key) const noexcept;
  /// Processes one frame for which `hears` is true and returns the answer, if any. `in_lss_configuration`: the device's
  /// LSS state.
  std::optional<can::Frame> handle(const can::Frame& frame, bool in_lss_configuration) noexcept;

  [[nodiscard]] nodeid::Identification identification() const noexcept { return rand_.state(); }
  [[nodiscard]] nodeid::Identification and_identification() const noexcept { return and_.state(); }

 private:
  Options options_;
  nodeid::RandSlave rand_;
  research::AndSlave and_;
};

}  // namespace berth::device
