/// What is said to a serial adapter (slcan) until its channel is open, and what its answers tell. No I/O, no clock.
/// Inside of room `io`.
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
  /// What comes next.
  struct Turn {
    std::string say{};      ///< to the adapter
    bool up = false;        ///< the channel is open; else its answer is waited for
    std::string failure{};  ///< it cannot be opened: why
  };

  /// Begins; the text that asks what is there. The answers are waited for until it is quiet.
  std::string_view begin(std::uint32_t bit_rate, const SlcanOptions& options);
  /// A line of the adapter; empty: no turn of the setup. Frames of the channel as it was before are passed over.
  std::optional<Turn> hear(const SlcanLine& line);
  /// It was waited for in vain.
  Turn silence();

  [[nodiscard]] Confirms confirms() const noexcept { return confirms_; }
  [[nodiscard]] const std::string& version() const noexcept { return version_; }

 private:
  /// A command; what to say when the adapter refuses it, nothing: it may.
  struct Step {
    std::string command;
    std::string refusal;
  };
  Turn open();
  Turn answered(bool refused);

  std::uint32_t bit_rate_ = 0;
  std::uint32_t data_bit_rate_ = 0;
  bool listen_only_ = false;
  bool opens_ = false;  // it is known what is there
  Confirms confirms_ = Confirms::nothing;
  unsigned answers_ = 0;  // to C, C and V
  std::deque<Step> steps_;
  std::string version_;
};

}  // namespace berth::io
