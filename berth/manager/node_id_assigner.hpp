/// Gives the devices of a network list their node-IDs by LSS, before the network is booted: what makes a master that
/// has nothing but its dictionary (`DictionaryManager`) work with devices that are new from the factory, and put a
/// replacement to work. Which device belongs to which node-ID the list says: vendor-ID and product code (1F85h, 1F86h)
/// have to be given and to agree, revision number and serial number (1F87h, 1F88h) where they are not 0. Of several
/// devices of one type the lowest serial number gets the lowest free node-ID. Every device that a search finds tells
/// its node-ID before the first of them is given one: a device that no entry fits is left alone, and so is one that has
/// a node-ID of the list that it fits; no node-ID is given that a device has told, or under which one was heard
/// meanwhile.
///
///     NodeIdAssigner assigner(dispatcher, manager.bus().sdo(), device.values());
///     manager.assign_by(&assigner);
///
/// A device keeps its node-ID in its own memory (LSS store): the list is all that the master has to remember.
#pragma once

#include <bitset>
#include <optional>
#include <vector>

#include "berth/co/sdo_client.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/lss/master.hpp"
#include "berth/manager/boot_rules.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/od/values.hpp"

namespace berth::manager {

class DictionaryManager;

class NodeIdAssigner final : private discovery::Assigner, private can::Handler {
 public:
  /// All must stay. Nothing else on this device is an LSS master.
  NodeIdAssigner(can::Dispatcher& dispatcher, co::SdoClient& sdo, const od::Values& values);
  /// Ends what a `DictionaryManager` does with it.
  ~NodeIdAssigner();

  /// Looks which slaves are there, and searches for devices while one is missing. `own`: the master's node-ID.
  /// `there`: slaves that need not be asked. Errors: those of `discovery::Discovery::find`.
  [[nodiscard]] rt::Task<Result<void>> run(NodeId own, std::bitset<128> there = {});

  /// Between two runs while a slave is missing.
  rt::Duration period = std::chrono::seconds(1);
  rt::Duration sdo_timeout = std::chrono::milliseconds(100);  ///< for the question whether a slave is there
  /// Slaves that answered in the last run.
  [[nodiscard]] std::bitset<128> answered() const noexcept;
  /// Node-IDs that were given so far.
  [[nodiscard]] unsigned given() const noexcept { return given_; }

 private:
  struct Wanted {
    NodeId node;
    SlaveRules rules;
    bool there = false;
    std::optional<LssAddress> device{};  // that answers under the node-ID
  };
  friend class DictionaryManager;
  rt::Task<void> ask(Wanted& wanted);
  rt::Task<Result<void>> search();
  [[nodiscard]] bool is_free(const Wanted& each, const LssAddress& device) const noexcept;
  NodeId assign(const LssAddress& device) noexcept override;
  bool keeps(const LssAddress& device, NodeId active) noexcept override;
  bool still_vacant(NodeId id) const noexcept override { return !heard_[id.value()] && !told_[id.value()]; }
  void received(const can::Frame& frame, rt::Time at) noexcept override;

  can::Dispatcher* dispatcher_;
  rt::Executor* executor_;
  co::SdoClient* sdo_;
  const od::Values* values_;
  lss::Master lss_;
  nodeid::RandMaster rand_;
  discovery::Auto methods_;
  std::vector<Wanted> list_;
  std::vector<LssAddress> met_;  // found, and nothing given to them
  std::bitset<128> heard_;       // error control messages since the list was looked at
  std::bitset<128> told_;        // by devices that have these node-IDs and are not those of the list
  DictionaryManager* user_ = nullptr;
  unsigned given_ = 0;
};

}  // namespace berth::manager
