/// Listens through the control socket to the buses of a machine that another process's `berth up` runs: one port for
/// each bus. A port hears every frame, Berth's own too, and sends none.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/design/machine.hpp"
#include "berth/io/loop.hpp"
#include "berth/trace/candump.hpp"
#include "output.hpp"

namespace berth::cli {

class FollowedBuses final : private io::Watcher, private trace::Sink {
 public:
  /// `path`: the control socket. The loop drives the ports and must outlive them.
  [[nodiscard]] static tl::expected<std::unique_ptr<FollowedBuses>, Failure> join(io::Loop& loop,
                                                                                  const std::string& path,
                                                                                  const design::Machine& machine);
  ~FollowedBuses();
  FollowedBuses(const FollowedBuses&) = delete;
  FollowedBuses& operator=(const FollowedBuses&) = delete;

  /// The port of a bus of the machine. Frames come at the intervals of the bus.
  [[nodiscard]] can::Port& port(const std::string& bus);
  /// The other process has ended, or has closed the connection.
  [[nodiscard]] bool over() const noexcept { return fd_ < 0; }
  /// Frames that were dropped because this process was too slow.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  class Port;
  FollowedBuses(int fd, const std::string& path, io::Loop& loop, const design::Machine& machine);
  void ready(std::uint32_t events) noexcept override;
  void entry(const trace::Entry& entry) override;
  void finding(Finding finding) override;
  void feed(std::string_view bytes);
  void close() noexcept;

  int fd_;
  io::Loop* loop_;
  trace::CandumpReader reader_;
  std::map<std::string, std::unique_ptr<Port>> ports_;
  std::string rest_;                    // a line that is not complete yet
  std::optional<rt::Duration> offset_;  // from the bus's time to this process's
  std::uint64_t dropped_ = 0;
};

}  // namespace berth::cli
