/// The dialogue with a serial adapter (slcan) until its channel is open: commands, and the meaning of its answers. No
/// I/O, no clock. Internal to room `io`.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "berth/io/slcan_codec.hpp"
#include "berth/io/slcan_port.hpp"

namespace berth::io {

class SlcanSetup {
 public:
  /// The next step.
  struct Turn {
    std::string say{};      ///< to the adapter
    bool up = false;        ///< the channel is open; if not, wait for its answer
    std::string failure{};  ///< why it cannot be opened
  };

  /// Begins; returns the text that asks for the adapter. Wait for answers until it is quiet.
  std::string_view begin(std::uint32_t bit_rate, const SlcanOptions& options);
  /// A line from the adapter; empty: it does not belong to the setup. Frames of the channel from before are skipped.
  std::optional<Turn> hear(const SlcanLine& line);
  /// The answer did not come in time.
  Turn silence();

  [[nodiscard]] Confirms confirms() const noexcept { return confirms_; }
  [[nodiscard]] const std::string& version() const noexcept { return version_; }

 private:
  /// A command, and the text for its refusal; empty: the adapter may refuse it.
  struct Step {
    std::string command;
    std::string refusal;
  };
  Turn open();
  Turn answered(bool refused);

  std::uint32_t bit_rate_ = 0;
  std::uint32_t data_bit_rate_ = 0;
  bool listen_only_ = false;
  bool opens_ = false;  // the adapter is identified
  Confirms confirms_ = Confirms::nothing;
  unsigned answers_ = 0;  // to C, C and V
  std::deque<Step> steps_;
  std::string version_;
};

}  // namespace berth::io
