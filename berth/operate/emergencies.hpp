/// The EMCYs of the devices on one bus (CiA 301 §7.2.7): each is an event and a line of the history, one that comes
/// again and again is counted, and a slot keeps the last error of its device until that is gone or the device boots.
///
/// Of one code of one node the first message is told at once. Those that follow are counted and told as one, "3 times
/// more in 10 s", no sooner than `shortest_pause` after the last; while they go on the pause doubles up to
/// `longest_pause`. So a device that sends a thousand EMCYs a second writes some lines a minute into the store. Whoever
/// invents node-IDs and codes is bounded by `most_lines` a minute for the whole bus; how many were left out is told.
#pragma once

#include <array>
#include <bitset>
#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/co/emcy.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

class Emergencies {
 public:
  static constexpr rt::Duration shortest_pause = std::chrono::seconds(10);
  static constexpr rt::Duration longest_pause = std::chrono::hours(1);
  /// Codes of one node that are told apart while they are counted; messages of further ones are counted together.
  static constexpr std::size_t most_codes = 8;

  static constexpr unsigned most_lines = 60;

  Emergencies(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}

  /// A node of this bus sent it. What a gateway hands on from beneath is not told here: `BeneathFirst::hands_on`.
  void heard(NodeId node, const co::Emcy& message);
  /// Tells what was counted and is due. Call it now and then.
  void tell_repeated();
  /// The node boots: its errors are gone.
  void booted(NodeId node) noexcept;

 private:
  struct Counted {
    std::uint16_t code = 0;
    bool others = false;  ///< further codes, counted together
    co::Emcy last{};
    rt::Time told{};
    rt::Duration pause = shortest_pause;
    std::uint32_t more = 0;  ///< since it was told
  };
  Counted& counted(NodeId node, std::uint16_t code);
  void tell(NodeId node, const std::string& text);
  void write(NodeId node, const std::string& text);
  [[nodiscard]] std::string line(NodeId node, const co::Emcy& message) const;

  BusServices& s_;
  SlotTable& slots_;
  std::array<std::vector<Counted>, 128> counted_{};  // by node-ID
  rt::Time minute_{};                                // when the present one began
  unsigned lines_ = 0;                               // told in it
  std::uint64_t left_out_ = 0;                       // not told in it
  std::bitset<128> erring_;                          // told an error since it booted, and not that all are gone
};

}  // namespace berth::operate
