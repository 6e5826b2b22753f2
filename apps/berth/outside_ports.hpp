/// The ports of buses outside this process, with their locks.
#pragma once

#include <memory>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "berth/can/port.hpp"
#include "berth/design/machine.hpp"
#include "berth/io/loop.hpp"
#include "options.hpp"
#include "output.hpp"
#include "port_lock.hpp"
#include "ports.hpp"

namespace berth::cli {

class OutsidePorts {
 public:
  /// `file`: the machine's, for messages. `rate_as_it_stands`: the port gives the bit rate. `loop` and `executor` must
  /// outlive it.
  OutsidePorts(std::string file, io::Loop& loop, rt::Executor& executor, bool rate_as_it_stands)
      : file_(std::move(file)), loop_(loop), executor_(executor), rate_as_it_stands_(rate_as_it_stands) {}

  /// Takes the bus's lock, if Berth is to send there, and opens its port, which exists as long as this. A plant's port
  /// is opened again when the plant returns; other ports recover by themselves. `bus` must outlive it.
  [[nodiscard]] tl::expected<can::Port*, Failure> open(const design::Bus& bus, const Options& options);

 private:
  [[nodiscard]] tl::expected<std::unique_ptr<can::Port>, Failure> open_one(const design::Bus& bus);
  [[nodiscard]] std::unique_ptr<can::Port> reopening(const design::Bus& bus, std::unique_ptr<can::Port> port);

  std::string file_;
  io::Loop& loop_;
  rt::Executor& executor_;
  bool rate_as_it_stands_;
  std::vector<PortLock> locks_;
  std::vector<std::unique_ptr<can::Port>> raw_;  // behind their gates
};

}  // namespace berth::cli
