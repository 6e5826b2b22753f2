/// The ports of a machine's buses that are outside this process, with their locks.
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
  /// `file`: the machine's, for what is said. `rate_as_it_stands`: the port tells the bit rate. `loop` and `executor`
  /// must stay.
  OutsidePorts(std::string file, io::Loop& loop, rt::Executor& executor, bool rate_as_it_stands)
      : file_(std::move(file)), loop_(loop), executor_(executor), rate_as_it_stands_(rate_as_it_stands) {}

  /// Takes the bus's lock, when Berth is to send there, and opens its port, which stays as long as this. A plant's port
  /// is opened again when the plant comes back; other kinds come back by themselves. `bus` must stay.
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
