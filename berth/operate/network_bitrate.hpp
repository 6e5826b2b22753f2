/// Moves a whole network to another bit rate by LSS bit timing (docs/protocols/cia305.md §Node-ID and bit rate).
///
/// 1. Find the nodes: node-IDs by SDO, guarding and heartbeat, devices without one by discovery. Each must answer LSS
///    under its own address and know the new rate, and none may be operational. Otherwise nothing is changed, and the
///    obstructing node is named.
/// 2. Give each the pending rate (13h) by itself. If one refuses, those before it get the old rate back.
/// 3. Select all; they change together (15h): one delay until the change, one more of silence. Berth's own port changes
///    in between.
/// 4. Each must answer at the new rate. Only when all have, each stores it (17h).
/// 5. If one is missing, or cannot store, the rest goes back to the old rate in the same way, and those that had stored
///    store the old rate.
///
/// A device at the wrong rate destroys the frames of the others (S4.1): the port may go bus-off and is restarted until
/// that device is error-passive. Each step has a limit: `boot_timeout` + nodes x `tries` x `lss_timeout` of the machine
/// file, plus requests under way by then; to hear all, `tries` rounds. A device that cannot be brought back in time is
/// named (`lost`), and a user has to switch the bus's power off and on.
///
/// After a crash: before step 3 nothing has changed. Before the stores of step 4 every device returns at the old rate
/// when it is switched off and on. Between the stores some return at the old rate and some at the new one: then run it
/// again. The user changes `bitrate` in the machine file.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "berth/operate/network.hpp"

namespace berth::operate {

struct BitRateOptions {
  std::uint32_t rate = 0;                ///< bit/s, one of CiA's table
  std::chrono::milliseconds delay{200};  ///< switch delay, 10 to 10'000 ms: longer than the longest answer
  bool confirmed = false;                ///< by a user: without it only step 1 is done
};

struct BitRateReport {
  enum class End : std::uint8_t {
    moved,         ///< all are at the new rate and have stored it
    unconfirmed,   ///< all could be moved; nothing was changed
    refused,       ///< a node prevents it; nothing was changed
    brought_back,  ///< one was missing or could not store: all are at the old rate again
    lost,          ///< not all were heard again, at either rate: see `nodes`
  };
  struct Node {
    NodeId id;                         ///< unconfigured: none
    std::optional<LssAddress> device;  ///< empty: it did not report its address
    std::string problem;               ///< what prevents the change, or went wrong; empty: nothing
    bool moved = false;                ///< heard at the new rate
    bool stored = false;               ///< has stored the new rate, or may have: it did not answer
    bool heard = true;                 ///< heard at the end, at the rate of the end
  };
  End end = End::refused;
  std::uint32_t before = 0;  ///< bit/s
  std::uint32_t rate = 0;    ///< bit/s, of the port at the end
  std::vector<Node> nodes;
  std::string reason;  ///< not specific to one node
};
[[nodiscard]] const char* name(BitRateReport::End end) noexcept;

/// Waits for the turn. `network` and `options` must outlive the task.
[[nodiscard]] rt::Task<BitRateReport> move_bit_rate(Network& network, const BitRateOptions& options);

}  // namespace berth::operate
