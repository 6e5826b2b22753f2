/// From what was heard, and what questions told, to findings. Pure: no bus, no time of its own.
#pragma once

#include <span>

#include "berth/doctor/diagnosis.hpp"
#include "berth/doctor/heard.hpp"

namespace berth::doctor {

/// What devices answered when they were asked (questions.hpp).
struct Answers {
  std::uint64_t frames = 0;  ///< heard while it asked, whoever sent them
  bool asked = false;        ///< identify non-configured remote slave was asked
  bool blank = false;        ///< ... and answered
  bool selective = false;    ///< devices were selected one by one; false while another LSS master works
  struct Present {           ///< a device that LSS identify found
    LssAddress device{};
    NodeId active{};    ///< what inquire node-ID told
    bool told = false;  ///< it told
  };
  std::vector<Present> present{};
  bool intrusive = false;  ///< SDO was used
  struct Serials {         ///< answers to one SDO request for the serial number
    NodeId node{};
    unsigned answers = 0;
    std::vector<std::uint32_t> values{};  ///< that differ
  };
  std::vector<Serials> serials{};
  struct Claim {  ///< a TPDO's identifier as its device has it
    NodeId node{};
    std::uint16_t object = 0;  ///< 1800h..
    std::uint32_t key = 0;
  };
  std::vector<Claim> claims{};
};

/// How heartbeats of one node-ID come. `rate` is how many times as often as `period`, or, when that is 0, as the long
/// intervals among them.
struct Rhythm {
  std::size_t beats = 0;
  double rate = 1;
  bool interleaved = false;  ///< short and long intervals take turns: two clocks
  rt::Duration usual{};      ///< nine of ten intervals are no longer
};
[[nodiscard]] Rhythm rhythm(std::span<const rt::Time> times, rt::Duration period);

/// In the order of `Kind`, then of node-IDs. Empty: nothing is wrong, as far as could be heard.
[[nodiscard]] std::vector<Diagnosis> diagnose(const Heard& heard, const Expected& expected,
                                              const Answers& answers = {});

}  // namespace berth::doctor
