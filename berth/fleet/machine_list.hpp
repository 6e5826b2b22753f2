/// Machines for a reader that comes again and wants only what is new: each machine that changed has the next number,
/// and a reader says the last number that it has. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "berth/fleet/machines.hpp"

namespace berth::fleet {

/// The machines at one time; it does not change. Copies share the texts.
class MachineList {
 public:
  static constexpr std::size_t most_bytes = std::size_t{128} << 10U;

  struct Part {
    std::uint64_t changes = 0;  ///< the number to ask with next
    bool whole = false;         ///< it begins anew: what the reader had before is gone
    bool more = false;          ///< there is more after `changes`
    std::string machines{};     ///< a JSON array as of `machine_json`; empty: nothing is new
  };
  /// What changed after this number, the oldest change first: as many machines as `most` bytes take, at least one.
  [[nodiscard]] Part since(std::uint64_t number, std::size_t most = most_bytes) const;

  [[nodiscard]] std::size_t size() const noexcept { return lines_.size(); }

 private:
  friend class MachineLister;
  struct Line {
    std::uint64_t number = 0;
    std::shared_ptr<const std::string> json;
  };
  std::uint64_t base_ = 0;  // all numbers of this list are above it
  std::uint64_t changes_ = 0;
  std::vector<Line> lines_;  // by number
};

/// Compares and counts.
class MachineLister {
 public:
  /// Null: nothing differs. A machine that is not there any more makes the whole list begin anew.
  [[nodiscard]] std::shared_ptr<const MachineList> take(std::vector<MachineView> now);
  /// An empty list that begins anew.
  [[nodiscard]] std::shared_ptr<const MachineList> forget();

 private:
  struct Known {
    MachineView view;
    MachineList::Line line;
  };
  [[nodiscard]] std::shared_ptr<const MachineList> list() const;

  std::map<sparkplug::EdgeNodeId, Known> known_;
  std::uint64_t base_ = 0;
  std::uint64_t changes_ = 0;
};

}  // namespace berth::fleet
