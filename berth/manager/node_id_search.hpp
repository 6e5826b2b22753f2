/// Finds devices on the bus of a network list. Some searches must give a found device a node-ID before they find the
/// next one (CiA 305's Fastscan). Such a device gets its slot's node-ID at once, by `11h` and not stored. As in every
/// binding, the intention is in the store before; `NodeIdSeating` finishes it.
#pragma once

#include <memory>

#include "berth/discovery/auto.hpp"
#include "berth/manager/list_bus.hpp"
#include "berth/nodeid/rand_master.hpp"

namespace berth::manager {

class NodeIdSearch final : private discovery::Assigner {
 public:
  explicit NodeIdSearch(ListBus& bus);

  /// By RAND; the node-ID of each found device is read (5Eh).
  rt::Task<Result<void>> by_rand();
  /// The devices that a search by LSS looks for.
  enum class Whom : std::uint8_t {
    missing,     ///< devices without a node-ID, of the types that are missing
    all_blank,   ///< of all types
    configured,  ///< also devices of all types that have a node-ID: it takes longer
  };
  /// By Fastscan and identify ranges.
  rt::Task<Result<void>> by_lss(Whom whom);
  /// Three questions, for occasional use: does any device have no node-ID?
  rt::Task<Result<bool>> anybody();
  /// Makes devices without a place that RAND found visible to RAND again.
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
