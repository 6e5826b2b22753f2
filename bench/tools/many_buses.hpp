/// The 120-slave machine as often as wanted, each on a bus of its own, brought up by the program itself.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/design/machine.hpp"
#include "berth/plant/plant_file.hpp"

namespace berth::bench {

/// What `berth up --fast --until operational` took.
struct UpCost {
  double wall = 0;  ///< seconds, files and report too
  double cpu = 0;   ///< seconds, user and system
  double peak = 0;  ///< MiB of memory that was resident at most
};

/// A machine file and a plant file in a folder that goes with this object.
class ManyBuses {
 public:
  ManyBuses(const design::Machine& one, const plant::PlantFile& plant, unsigned buses);
  ~ManyBuses();
  ManyBuses(const ManyBuses&) = delete;
  ManyBuses& operator=(const ManyBuses&) = delete;

  /// None: the program could not be run, or the machine did not become operational.
  [[nodiscard]] std::optional<UpCost> bring_up() const;
  /// The instructions of the same, counted by callgrind.
  [[nodiscard]] std::optional<std::uint64_t> count_instructions() const;

 private:
  std::string folder_;
};

}  // namespace berth::bench
