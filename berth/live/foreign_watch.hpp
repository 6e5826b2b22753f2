/// Detects another master on this bus from the frames of others. Pure: no port, no clock.
///
/// Signs of a master (CiA 301, CiA 302-2, CiA 305; RAND and AND are Berth's own discovery services):
///
///     nmt            000h                  NMT commands, and what is none: that identifier is the master's alone
///     lss            7E5h                  LSS requests, Fastscan
///     discovery      1F940000h, 7C2h       requests of RAND and AND
///     flying master  071h..076h            master detection and negotiation; 071h names the active master
///     sdo            600h + n              requests to the server of node n; those to Berth's own are a client's
///     sync           080h                  SYNC
///     heartbeat      700h + own node-ID    error control of another node under Berth's own node-ID
///     guarding       700h + n, remote      node guarding requests
///
/// Other devices may send some of them: a drive may produce SYNC, a panel may read objects by SDO. The machine file
/// names those (`WatchOptions::tolerated`). Own frames must not be passed to this class.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::live {

enum class Sign : std::uint8_t { nmt, lss, discovery, flying_master, sdo, sync, heartbeat, guarding };
inline constexpr std::size_t sign_count = 8;
/// "nmt", "lss", "discovery", "flying-master", "sdo", "sync", "heartbeat", "guarding": the words of the machine file.
[[nodiscard]] const char* name(Sign sign) noexcept;
[[nodiscard]] std::optional<Sign> sign_named(std::string_view word) noexcept;
using Signs = std::bitset<sign_count>;

/// What was heard of one sign.
struct Evidence {
  Sign sign = Sign::nmt;
  std::uint32_t count = 0;  ///< frames; saturates
  rt::Time first{};
  rt::Time last{};
  can::Frame sample{};  ///< the first of them
};

struct WatchOptions {
  NodeId own;         ///< Berth's node-ID on this bus; unconfigured: no heartbeat is a sign
  Signs tolerated{};  ///< what devices of this machine send, so no sign
};

class ForeignWatch {
 public:
  explicit ForeignWatch(const WatchOptions& options = {}) noexcept : options_(options) {}

  /// Call it for a frame of another node. Returns its sign; nothing if that is tolerated.
  std::optional<Sign> heard(const can::Frame& frame, rt::Time at) noexcept;
  /// The frame's sign, without counting it.
  [[nodiscard]] std::optional<Sign> sign_of(const can::Frame& frame) const noexcept;
  /// From now on a heartbeat under Berth's own node-ID is a sign only if its sender is operational: a device that boots
  /// or waits under that node-ID is not yet a master. SDO requests then come from a client, not a master: `heard` still
  /// returns them.
  void running() noexcept { running_ = true; }

  [[nodiscard]] bool foreign() const noexcept { return foreign_; }
  /// The signs heard, in the order of `Sign`.
  [[nodiscard]] std::vector<Evidence> evidence() const;
  /// The other master's node-ID, if it can be determined: what an active flying master reported (071h); Berth's own
  /// node-ID when another node sends under it; else the only node that has an operational heartbeat and is asked
  /// nothing. `slots`: node-IDs that the machine file gives to devices.
  [[nodiscard]] NodeId probably(std::span<const NodeId> slots = {}) const noexcept;
  [[nodiscard]] std::uint32_t frames() const noexcept { return frames_; }
  void reset() noexcept;

 private:
  WatchOptions options_;
  std::array<Evidence, sign_count> heard_{};
  std::bitset<128> asked_;        // by SDO, guarding or a single NMT command
  std::bitset<128> operational_;  // by their last heartbeats
  NodeId active_;                 // of 071h
  std::uint32_t frames_ = 0;
  bool foreign_ = false;
  bool running_ = false;
};

/// "NMT commands 3 times from 0.2 s to 1.4 s (000#0100), SDO requests to node 5 ...": one line for each sign, times
/// counted from `since`.
[[nodiscard]] std::vector<std::string> lines(std::span<const Evidence> evidence, rt::Time since);
/// "another master is on this bus, probably node 1"
[[nodiscard]] std::string verdict(const ForeignWatch& watch, std::span<const NodeId> slots = {});

}  // namespace berth::live
