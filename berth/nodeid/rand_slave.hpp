/// The RAND slave of a device (paper 1 §II; S1.17, S1.23, S1.31): frames in, frames out. No heap, no exceptions.
///
/// | request                   | unknown             | selected                                  | identified |
/// |---------------------------|---------------------|-------------------------------------------|------------|
/// | IURS phase 0              | IUS(0), selected    | IUS(0), selected (master began anew)      | -          |
/// | IURS phase p, the next    | -                   | chunk(p-1) = mask: IUS(p), else unknown   | -          |
/// | IURS phase p, another     | -                   | unknown                                   | -          |
/// | DIRS after phase 7        | -                   | chunk(7) = mask: DIS, identified, else unknown | -     |
/// | DIRS earlier              | -                   | unknown                                   | -          |
/// | switch global             | as told             | as told                                   | as told    |
/// | switch selective, 4 match | as told             | as told                                   | as told    |
/// | resume 0..7, own prefix   | IUS(p)              | IUS(p), nothing changes                   | -          |
/// | resume 8, own address     | DIS, identified     | DIS, identified                           | -          |
/// | resume, another prefix    | -                   | -                                         | -          |
///
/// The resume requests are Berth's extension (docs/rand.md); without it they are ignored, as any unknown command.
#pragma once

#include <cstdint>
#include <optional>

#include "berth/nodeid/rand_frames.hpp"

namespace berth::nodeid {

struct RandSlaveOptions {
  LssAddress address{};
  /// As in the paper: RAND only in LSS configuration state (S1.31). Default: in waiting too, so that running devices
  /// need not enter configuration.
  bool literal = false;
  bool resume = false;  ///< supports the extension
};

class RandSlave {
 public:
  explicit RandSlave(const RandSlaveOptions& options) noexcept : options_(options) {}

  /// Handles one frame of `rand_requests`; others are ignored. `in_lss_configuration`: the device's present LSS state.
  /// Returns the answer, if any; the device sends it at once or after its response latency.
  std::optional<can::Frame> handle(const can::Frame& frame, bool in_lss_configuration) noexcept;

  /// Power-on: unknown. (Reset communication keeps the state; S1.31 step 2 is needed because devices may still be
  /// identified.)
  void power_on() noexcept;

  [[nodiscard]] Identification state() const noexcept { return state_; }
  /// The next phase it would answer, 1..8, while selected; 0 otherwise.
  [[nodiscard]] unsigned next_phase() const noexcept { return state_ == Identification::selected ? next_ : 0U; }
  [[nodiscard]] const LssAddress& address() const noexcept { return options_.address; }

 private:
  std::optional<can::Frame> identify(unsigned phase, std::uint16_t mask) noexcept;
  std::optional<can::Frame> resume(const RandRequest& request) noexcept;
  void select(const RandRequest& request) noexcept;

  RandSlaveOptions options_;
  Identification state_ = Identification::unknown;
  Identification target_ = Identification::identified;
  std::uint8_t next_ = 0;     // phase expected while selected
  std::uint8_t matched_ = 0;  // switch selective frames that matched in order
};

}  // namespace berth::nodeid
