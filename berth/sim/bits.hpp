/// One node bit by bit: the protocol controller's state machine (Bosch CAN 2.0; docs/protocols/can-frames.md §Fault
/// confinement). Internal to `sim`: the bus uses it only while something is wrong; else it takes a frame's length from
/// `can/length.hpp`.
#pragma once

#include <array>
#include <cstdint>

#include "berth/can/bus_error.hpp"
#include "berth/can/frame.hpp"

namespace berth::sim {

/// The bits of a frame on the wire, from start of frame to the last bit of end-of-frame; an FD frame ends with FDF.
struct Layout {
  static constexpr std::uint8_t recessive = 1;
  static constexpr std::uint8_t stuff = 2;
  static constexpr std::uint8_t arbitration =
      4;                                        ///< a recessive bit here may give way; a stuff bit here lies before RTR
  static constexpr std::uint8_t fd_format = 8;  ///< FDF: as far as an FD frame is played (`Bus`)
  std::array<std::uint8_t, 168> bits;
  unsigned size = 0;
};
[[nodiscard]] Layout lay_out(const can::Frame& frame) noexcept;

/// Decodes a frame as a receiver does.
class Decoder {
 public:
  enum class Outcome : std::uint8_t { more, stuff_error, complete };
  /// The start-of-frame bit was seen.
  void begin() noexcept;
  /// The next bit, up to the end of the CRC sequence and its stuff bit.
  Outcome push(bool recessive) noexcept;
  [[nodiscard]] bool crc_matches() const noexcept { return crc_ == 0; }
  /// The place of the next bit.
  [[nodiscard]] can::ErrorPlace place() const noexcept;
  [[nodiscard]] can::Frame frame() const noexcept;

 private:
  void raw(bool recessive) noexcept;
  [[nodiscard]] std::uint32_t field(unsigned from, unsigned count) const noexcept;
  std::array<std::uint8_t, 136> raw_;
  unsigned count_ = 0;
  unsigned end_ = 0;  // number of raw bits, once the DLC is known
  unsigned run_ = 0;
  bool last_ = false;
  std::uint16_t crc_ = 0;
};

class BitNode {
 public:
  enum class Activity : std::uint8_t {
    idle,
    frame,  // start of frame to the last bit of the CRC sequence
    tail,   // CRC delimiter to the last bit of end-of-frame
    active_flag,
    passive_flag,
    overload_flag,
    after_flag,  // waits for the first recessive bit
    delimiter,
    intermission,
    suspend,
    integrating,
    off,  // bus-off without a restart
  };
  /// The meaning of a sampled bit.
  struct Outcome {
    bool accepted = false;  ///< a frame is valid for the receiver
    bool sent = false;
    bool lost = false;          ///< arbitration
    bool failed = false;        ///< an error flag began
    bool fd_destroyed = false;  ///< ... because an FD frame is not simulated bit by bit beyond FDF
    bool as_transmitter = false;
    bool overload = false;   ///< an overload flag began
    bool took_part = false;  ///< integration has ended
    bool counters = false;   ///< TEC, REC or bus-off changed
    bool start = false;      ///< dominant in the third bit of intermission: a frame began
    // Details of a failure:
    bool unacknowledged = false;
    can::ErrorKind kind = can::ErrorKind::other;
    can::ErrorPlace place = can::ErrorPlace::unknown;
    [[nodiscard]] bool any() const noexcept {
      return accepted || sent || lost || failed || overload || took_part || counters || start;
    }
  };

  std::uint16_t tec = 0;
  std::uint16_t rec = 0;
  bool bus_off = false;
  bool listen_only = false;
  Activity activity = Activity::idle;
  unsigned count = 0;  ///< bits of the activity done
  unsigned runs = 0;   ///< integrating: runs of 11 recessive bits to come
  bool transmitter = false;

  void integrate(unsigned runs_to_see) noexcept;
  /// Sends from the start-of-frame bit, or from the bit after it if another node's was just seen.
  void begin_sending(const can::Frame& frame, bool behind_start) noexcept;
  /// True: dominant.
  [[nodiscard]] bool drives() const noexcept;
  Outcome sample(bool dominant) noexcept;
  [[nodiscard]] bool passive() const noexcept { return tec > 127 || rec > 127; }
  /// True if nothing happens until a node begins a frame.
  [[nodiscard]] bool quiet() const noexcept {
    return activity == Activity::idle || activity == Activity::suspend || activity == Activity::integrating ||
           activity == Activity::off;
  }
  [[nodiscard]] can::Frame frame() const noexcept { return decoder_.frame(); }
  [[nodiscard]] unsigned frame_bits() const noexcept { return layout_.size; }

 private:
  void begin_receiving() noexcept;
  void in_frame(bool dominant, Outcome& outcome) noexcept;
  void in_tail(bool dominant, Outcome& outcome) noexcept;
  void in_flag(bool dominant, Outcome& outcome) noexcept;
  void in_passive_flag(bool dominant, Outcome& outcome) noexcept;
  void after_flag(bool dominant, Outcome& outcome) noexcept;
  void in_delimiter(bool dominant, Outcome& outcome) noexcept;
  void in_intermission(bool dominant, Outcome& outcome) noexcept;
  enum class Cause : std::uint8_t { other, no_acknowledge, stuff_in_arbitration };
  void fail(Outcome& outcome, can::ErrorKind kind, Cause cause = Cause::other) noexcept;
  [[nodiscard]] can::ErrorPlace place() const noexcept;
  void begin_overload(Outcome& outcome) noexcept;
  void enter(Activity next) noexcept {
    activity = next;
    count = 0;
  }
  void more_errors(unsigned by, Outcome& outcome) noexcept;

  Layout layout_;
  unsigned position_ = 0;  // of the current bit in layout_
  Decoder decoder_;
  bool error_ = false;  // the flag was an error flag, not an overload flag
  bool crc_bad_ = false;
  bool unacknowledged_ = false;  // passive: TEC rises only if a node answers the passive flag
  bool run_level_ = false;       // passive flag: level of the run counted
  unsigned after_ = 0;           // dominant bits after the flag
};

}  // namespace berth::sim
