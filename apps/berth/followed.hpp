/// The buses of a machine that a `berth up` of another process runs, listened to through its control socket: a port
/// for each, which hears every frame, Berth's own too, and sends none.
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
  /// `path`: the control socket. The loop must stay, and drives the ports.
  [[nodiscard]] static tl::expected<std::unique_ptr<FollowedBuses>, Failure> join(io::Loop& loop,
                                                                                  const std::string& path,
                                                                                  const design::Machine& machine);
  ~FollowedBuses();
  FollowedBuses(const FollowedBuses&) = delete;
  FollowedBuses& operator=(const FollowedBuses&) = delete;

  /// Of a bus of the machine. Its frames come at the bus's own intervals.
  [[nodiscard]] can::Port& port(const std::string& bus);
  /// The other process has ended, or let this one go.
  [[nodiscard]] bool over() const noexcept { return fd_ < 0; }
  /// Frames that were left out because this process was too slow.
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
  std::string rest_;                    // of a line that is not whole yet
  std::optional<rt::Duration> offset_;  // from the bus's time to this process's
  std::uint64_t dropped_ = 0;
};

}  // namespace berth::cli
