/// Device descriptions for tests of the linker and its benchmark, and machines of many links.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "berth/base/random.hpp"
#include "berth/linker/plan.hpp"

namespace berth::test {

struct ObjectSpec {
  unsigned index = 0;
  unsigned subs = 1;  ///< sub-indices 1 to this
  unsigned type = 5;
  const char* access = "ro";
  std::string name = "Value";
  bool mappable = true;
};

struct DeviceSpec {
  std::string name = "device";
  unsigned tpdos = 4;
  unsigned rpdos = 4;
  unsigned entries = 8;
  unsigned granularity = 8;
  bool dummies = true;
  bool bit_dummy = false;
  bool dynamic = false;  ///< [DynamicChannels] as CiA 405 has them
  unsigned mpdo = 0;     ///< entries of the scanner and the dispatching list
  bool fixed = false;    ///< mappings cannot be written
  bool timers = true;    ///< sub-indices 3 and 5 are there
  std::vector<ObjectSpec> objects = {};
  std::string mapping = {};  ///< of TPDO 1: entries in hex, separated by blanks
};

[[nodiscard]] std::string eds_text(const DeviceSpec& spec);
[[nodiscard]] std::shared_ptr<const eds::File> file_of(const DeviceSpec& spec);

/// A programmable controller with network variables and a process image of its own, and a module for inputs and
/// outputs.
[[nodiscard]] DeviceSpec controller();
[[nodiscard]] DeviceSpec io_module();

/// One bus of 500 kbit/s.
[[nodiscard]] linker::LinkNetwork network_of(
    std::vector<std::pair<std::string, std::shared_ptr<const eds::File>>> nodes);
/// `to`: "node/object". Nodes by name.
void add_link(linker::LinkNetwork& network, const std::string& from, const std::vector<std::string>& to,
              std::optional<rt::Duration> deadline = {}, linker::TransmissionType transmission = linker::at_change,
              std::optional<od::DataType> type = {});

/// 11 controllers, 44 modules, 280 network variables, 533 links (paper 5, fig. 1: the size of the coal conveyor).
[[nodiscard]] linker::LinkNetwork conveyor();

/// Controllers and modules of several kinds and random links, some of which share a source.
[[nodiscard]] linker::LinkNetwork random_network(Random& random, unsigned links);
void add_random_links(linker::LinkNetwork& network, Random& random, unsigned links);

}  // namespace berth::test
