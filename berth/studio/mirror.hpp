/// The machine as clients see it: the server's copy of slots and events, and the messages made from it. Each message
/// that changes it has the next sequence number. Internal to room `studio`.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "berth/design/machine.hpp"
#include "berth/studio/link.hpp"

namespace berth::studio {

class Mirror {
 public:
  static constexpr std::size_t most_events = 1000;
  static constexpr std::size_t most_event_bytes = std::size_t{1} << 20U;  ///< of all: a device's texts may be long

  /// As in `Options`.
  struct Has {
    bool simulated = false;
    std::string fleet{};
    std::string version{};
    bool open_metrics = false;
  };
  /// `token_file`: as in `TokenFiles`; empty: there is none. `signals`: as in `Options`.
  Mirror(const design::Machine& machine, Has has, std::string token_file = {}, std::string signals = {});

  /// The message for all clients; empty: it is an answer and changes nothing.
  [[nodiscard]] std::string take(const News& news);
  [[nodiscard]] std::string snapshot(double time_s, command::Role role) const;
  /// {"paused", "speed", "time_s"}; null: the machine is not simulated.
  [[nodiscard]] std::string world_json(double time_s) const;
  /// JSON: the positions of the signals in the machine's messages.
  [[nodiscard]] const std::string& signals() const noexcept { return signals_; }
  [[nodiscard]] const Pace& pace() const noexcept { return pace_; }
  /// The part of the page of metrics that the machine knows.
  [[nodiscard]] About about() const {
    return {.version = has_.version, .machine = machine_, .simulated = has_.simulated};
  }
  [[nodiscard]] bool open_metrics() const noexcept { return has_.open_metrics; }
  [[nodiscard]] const std::vector<std::string>& buses() const noexcept { return buses_; }
  [[nodiscard]] const std::vector<std::uint32_t>& bit_rates() const noexcept { return bit_rates_; }

 private:
  std::string head_;   // this start, machine, buses
  std::string verbs_;  // the table
  std::vector<std::string> buses_;
  std::vector<std::uint32_t> bit_rates_;
  std::map<std::pair<std::string, std::uint8_t>, std::size_t> index_;  // of `slots_`
  std::vector<std::string> slots_;                                     // JSON, in the machine's order
  std::deque<std::string> events_;                                     // JSON
  std::size_t event_bytes_ = 0;
  std::vector<std::string> questions_;  // JSON
  Lock lock_;
  Pace pace_;
  Has has_;
  std::string machine_;  // its name
  std::string token_file_;
  std::string signals_;
  std::uint64_t seq_ = 0;
};

/// {"type":"reply",...}; `id` empty: without "type" and "id", as `POST /api/v1/request` answers.
[[nodiscard]] std::string reply_json(const std::string& id, const command::Reply& reply);
/// {"type":"reply",...} or an error without an id: the reason why a message was refused.
[[nodiscard]] std::string error_json(const std::string& words);

}  // namespace berth::studio
