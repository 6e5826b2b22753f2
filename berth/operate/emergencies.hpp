/// The EMCYs of the devices on one bus (CiA 301 §7.2.7). Each is an event and a line of the history; repeated ones are
/// counted. A slot keeps the last error of its device until the device reports that it is gone, or boots.
///
/// The first message of a code and a node is reported at once. Later ones are counted and reported together, "3 times
/// more in 10 s", at the earliest `shortest_pause` after the last report; while they continue, the pause doubles up to
/// `longest_pause`. So a device that sends a thousand EMCYs a second causes only a few lines a minute in the store.
/// `most_lines` a minute limits the whole bus, against invented node-IDs and codes; the number of omitted messages is
/// reported.
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
  /// Codes of one node that are counted separately; messages of further codes are counted together.
  static constexpr std::size_t most_codes = 8;

  static constexpr unsigned most_lines = 60;

  Emergencies(BusServices& services, SlotTable& slots) noexcept : s_(services), slots_(slots) {}

  /// A node of this bus sent it. EMCYs that a gateway forwards from a bus beneath are not reported here:
  /// `BeneathFirst::hands_on`.
  void heard(NodeId node, const co::Emcy& message);
  /// Reports counted messages that are due. Call it regularly.
  void tell_repeated();
  /// The node boots: its errors no longer count.
  void booted(NodeId node) noexcept;

 private:
  struct Counted {
    std::uint16_t code = 0;
    bool others = false;  ///< further codes, counted together
    co::Emcy last{};
    rt::Time told{};
    rt::Duration pause = shortest_pause;
    std::uint32_t more = 0;  ///< since the last report
  };
  Counted& counted(NodeId node, std::uint16_t code);
  void tell(NodeId node, const std::string& text);
  void write(NodeId node, const std::string& text);
  [[nodiscard]] std::string line(NodeId node, const co::Emcy& message) const;

  BusServices& s_;
  SlotTable& slots_;
  std::array<std::vector<Counted>, 128> counted_{};  // by node-ID
  rt::Time minute_{};                                // when the present minute began
  unsigned lines_ = 0;                               // reported in it
  std::uint64_t left_out_ = 0;                       // not reported in it
  std::bitset<128> erring_;                          // reported an error since boot-up, but no error reset
};

}  // namespace berth::operate
