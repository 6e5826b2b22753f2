/// Moves a whole network to another bit rate by LSS bit timing (docs/protocols/cia305.md §Node-ID and bit rate).
///
/// 1. Which nodes are there: node-IDs by SDO, guarding and heartbeat, devices without one by discovery. Each must
/// answer LSS
///    under its own address, each must know the new rate, and none may be operational: otherwise nothing is changed,
///    and the node that is in the way is named.
/// 2. Each gets the pending rate (13h) by itself. One that refuses: those before it get the old one back.
/// 3. All are selected, and change together (15h): one delay until the change, one more of silence. Berth's own port
///    changes in between.
/// 4. Each must answer at the new rate. Only when all have, each stores (17h).
/// 5. One that is missing, or cannot store: the rest goes back to the old rate in the same way, and those that
///    had stored store the old one.
///
/// A device that stayed behind destroys what the others send (S4.1): the port may go bus-off and is started again until
/// the stranger is error-passive. Each step has an end: the machine file's `boot_timeout` + nodes x `tries` x
/// `lss_timeout`, plus what is under way by then; in hearing all, `tries` rounds. One that cannot be brought back
/// within it is named (`lost`), and a person has to switch the bus's power off and on.
///
/// What a crash leaves: before step 3 nothing; before step 4's stores every device comes back at the old rate when it
/// is switched off and on; between the stores some come back at the old rate and some at the new one: run it again
/// then. The machine file's `bitrate` is a person's to change.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/network.hpp"

namespace berth::operate {

struct BitRateOptions {
  std::uint32_t rate = 0;                ///< bit/s, one of CiA's table
  std::chrono::milliseconds delay{200};  ///< switch delay, 10 to 10'000 ms: longer than the longest answer
  bool confirmed = false;                ///< a person said so: without it only step 1 is done
};

struct BitRateReport {
  enum class End : std::uint8_t {
    moved,         ///< all are at the new rate and have stored it
    unconfirmed,   ///< all could be moved; nothing was changed
    refused,       ///< a node is in the way; nothing was changed
    brought_back,  ///< one was missing or could not store: all are at the old rate again
    lost,          ///< not all were heard again, at neither rate: see `nodes`
  };
  struct Node {
    NodeId id;                         ///< unconfigured: none
    std::optional<LssAddress> device;  ///< empty: it did not tell
    std::string problem;               ///< what is in the way, or went wrong; empty: nothing
    bool moved = false;                ///< heard at the new rate
    bool stored = false;               ///< has stored the new rate, or may have: it did not answer
    bool heard = true;                 ///< heard at the end, at the rate of the end
  };
  End end = End::refused;
  std::uint32_t before = 0;  ///< bit/s
  std::uint32_t rate = 0;    ///< bit/s, of the port at the end
  std::vector<Node> nodes;
  std::string reason;  ///< of what does not concern one node
};
[[nodiscard]] const char* name(BitRateReport::End end) noexcept;

/// Waits for its turn. `network` and `options` must stay.
[[nodiscard]] rt::Task<BitRateReport> move_bit_rate(Network& network, const BitRateOptions& options);

}  // namespace berth::operate
