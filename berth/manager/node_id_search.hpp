/// Finds devices on the bus of a network list. Those that a search must give a node-ID so that it finds the next one
/// (CiA 305's Fastscan) are told that of their slot at once, by `11h` and not stored: the intention is in the store
/// before, as of every binding, and `NodeIdSeating` finishes it.
#pragma once

#include <memory>

#include "berth/discovery/auto.hpp"
#include "berth/manager/list_bus.hpp"
#include "berth/nodeid/rand_master.hpp"

namespace berth::manager {

class NodeIdSearch final : private discovery::Assigner {
 public:
  explicit NodeIdSearch(ListBus& bus);

  /// By RAND, and each that was found tells its node-ID (5Eh).
  rt::Task<Result<void>> by_rand();
  /// What a search by LSS looks for.
  enum class Whom : std::uint8_t {
    missing,     ///< devices without a node-ID, of the types that are missing
    all_blank,   ///< of all types
    configured,  ///< devices of all types that have a node-ID too: it takes longer
  };
  /// By Fastscan and identify ranges.
  rt::Task<Result<void>> by_lss(Whom whom);
  /// Three questions, for now and then: somebody has no node-ID.
  rt::Task<Result<bool>> anybody();
  /// Those that RAND has found and that have no place are to be found again.
  rt::Task<Result<void>> release_found();

 private:
  NodeId assign(const LssAddress& device, bool says_none) noexcept override;
  bool still_vacant(NodeId id) const noexcept override { return bus_.vacant(id); }
  [[nodiscard]] discovery::Known known(bool all_types);
  rt::Task<Result<void>> look_among_equals(Identity device);

  ListBus& bus_;
  nodeid::RandMaster rand_;
  std::unique_ptr<discovery::Discovery> rand_planner_;
  discovery::Auto rest_;
  std::vector<Identity> by_rand_;   // in this run
  std::vector<LssAddress> shared_;  // of several devices without serial numbers
};

}  // namespace berth::manager
