/// The AND slave of a device (docs/and.md): frames in, frames out. No heap, no exceptions.
///
/// | request                       | unknown                          | identified                      |
/// |-------------------------------|----------------------------------|---------------------------------|
/// | IURS p, prefix is its own     | IUS(nibble p)                    | -                               |
/// | IURS p, another prefix        | -                                | -                               |
/// | DIRS, address is its own      | DIS(nibble 11), identified       | -                               |
/// | switch global                 | as told                          | as told                         |
/// | switch selective, its own     | as told                          | as told                         |
/// | inquire part                  | -                                | its part, if it sent the last DIS |
///
/// A request contains the whole prefix. So a slave keeps no state between phases, and after a lost frame no slave
/// answers for a prefix that is not its own.
#pragma once

#include <optional>

#include "berth/research/and_frames.hpp"

namespace berth::research {

class AndSlave {
 public:
  explicit AndSlave(const LssAddress& address) noexcept : lss_address_(address), address_(address) {}

  /// Handles one frame of `and_requests`; others are ignored. Returns the answer, if any.
  std::optional<can::Frame> handle(const can::Frame& frame) noexcept;
  /// Unknown.
  void power_on() noexcept;

  [[nodiscard]] nodeid::Identification state() const noexcept { return state_; }
  [[nodiscard]] AndAddress address() const noexcept { return address_; }

 private:
  LssAddress lss_address_;
  AndAddress address_;
  nodeid::Identification state_ = nodeid::Identification::unknown;
  bool last_ = false;  // the last DIS was its own
};

}  // namespace berth::research
