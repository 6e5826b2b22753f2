/// The machines of a running machine's own group, for its Studio: a host at the same broker that is there only while
/// somebody asks.
///
///     GroupWatch watch({.connection = settings->connection, .id = settings->id}, random);
///     reply.json = watch.answer(since);   // again and again, on the executor's thread
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "berth/base/random.hpp"
#include "berth/fleet/machine_list.hpp"
#include "berth/mqtt/options.hpp"
#include "berth/sparkplug/topic.hpp"

namespace berth::fleet {

class GroupWatch {
 public:
  struct Options {
    /// Of the machine: broker, login, TLS. Client ID and subscriptions are the watch's own.
    mqtt::Options connection{};
    sparkplug::EdgeNodeId id{};  ///< of the machine: its group is watched; the host ID is made of both names
    /// The connection ends when nobody has asked for so long.
    std::chrono::milliseconds idle{60'000};
  };
  GroupWatch(Options options, Random random);
  /// Waits two seconds at most, if it is connected (`Watch`).
  ~GroupWatch();
  GroupWatch(const GroupWatch&) = delete;
  GroupWatch& operator=(const GroupWatch&) = delete;

  /// One JSON object (docs/api.md §The fleet). The first call begins to connect, so that it knows no machine. Never
  /// waits: all work is on a thread of its own.
  [[nodiscard]] std::string answer(std::uint64_t since);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::fleet
