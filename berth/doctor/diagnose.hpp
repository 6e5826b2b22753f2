/// Derives findings from heard frames and answers. Pure: without bus or clock.
#pragma once

#include <span>

#include "berth/doctor/diagnosis.hpp"
#include "berth/doctor/heard.hpp"

namespace berth::doctor {

/// The devices' answers to questions (questions.hpp).
struct Answers {
  std::uint64_t frames = 0;  ///< heard while asking, from any sender
  bool asked = false;        ///< identify non-configured remote slave was sent
  bool blank = false;        ///< ... and answered
  bool selective = false;    ///< devices were selected one by one; false while another LSS master works
  struct Present {           ///< a device that LSS identify found
    LssAddress device{};
    NodeId active{};    ///< the answer to inquire node-ID
    bool told = false;  ///< it answered
  };
  std::vector<Present> present{};
  bool intrusive = false;  ///< SDO was used
  struct Serials {         ///< answers to one SDO request for the serial number
    NodeId node{};
    unsigned answers = 0;
    std::vector<std::uint32_t> values{};  ///< the different ones
  };
  std::vector<Serials> serials{};
  struct Claim {  ///< a TPDO's identifier in its device
    NodeId node{};
    std::uint16_t object = 0;  ///< 1800h..
    std::uint32_t key = 0;
  };
  std::vector<Claim> claims{};
};

/// The intervals of one node-ID's heartbeats. `rate`: how many times more often they come than by `period`, or, if that
/// is 0, than by the long intervals among them.
struct Rhythm {
  std::size_t beats = 0;
  double rate = 1;
  bool interleaved = false;  ///< short and long intervals alternate: two clocks
  rt::Duration usual{};      ///< nine of ten intervals are at most this
};
[[nodiscard]] Rhythm rhythm(std::span<const rt::Time> times, rt::Duration period);

/// In the order of `Kind`, then of node-IDs. Empty: nothing wrong was heard.
[[nodiscard]] std::vector<Diagnosis> diagnose(const Heard& heard, const Expected& expected,
                                              const Answers& answers = {});

}  // namespace berth::doctor
