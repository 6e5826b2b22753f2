/// Gives the devices of a network list their node-IDs by LSS: what makes a master that has nothing but its dictionary
/// and a few kilobytes of memory (`DictionaryManager`) work with devices that are new from the factory or come from
/// another machine, and put a replacement to work. It works as `berth up` does, by the same plan (`places::plan`) and
/// the same steps (`places::Binding`).
///
/// Which device belongs to which node-ID the list says: vendor-ID and product code (1F85h, 1F86h) have to be given and
/// to agree, revision number and serial number (1F87h, 1F88h) where they are not 0. Of several devices of one type that
/// a search finds the lowest serial number gets the lowest free node-ID; one that has a node-ID of its type keeps it. A
/// device of a type that the list does not have is left alone, and so is the node-ID that it has.
///
/// A device without a serial number is known by its node-ID (`ListFound`). Blank equal ones get theirs one at a time;
/// several at once are told nothing, and 5F0Bh says so. A node-ID of 5F05h is its device's own: who answers there and
/// fits is seated, and nobody is given it.
///
///     manager::ListStore store(&memory);
///     auto& bus = manager.bus();
///     manager::NodeIdAssigner assigner({dispatcher, bus.sdo(), bus.nmt(), device.values(), store});
///     manager.assign_by(&assigner);
///
/// **A node-ID that may be in a device's memory belongs to that device until it was seen to have lost it**, also after
/// the master lost its power: `ListStore` has it before the device is told. A device that was heard under its node-ID
/// and is silent now (no error control, SDO, guarding nor LSS) loses its place to the next one of its type; should it
/// come back, it is asked for by its LSS address and gives the node-ID up. A node-ID that a device was told and not
/// heard under is kept for it. 5F0Bh tells which (`NodeIdReport`).
///
/// A run asks who is not known to be there, and who has booted; where a slave is missing it looks for devices. So it
/// costs nothing on a bus that is complete and quiet, but three questions in eight runs (is there a device without a
/// node-ID?).
#pragma once

#include <array>
#include <bitset>

#include "berth/manager/list_bus.hpp"
#include "berth/manager/node_id_report.hpp"
#include "berth/manager/node_id_search.hpp"
#include "berth/manager/node_id_seating.hpp"
#include "berth/manager/node_id_source.hpp"

namespace berth::manager {

class NodeIdAssigner final : public NodeIdSource {
 public:
  explicit NodeIdAssigner(const ListServices& services);
  /// Ends what a `DictionaryManager` does with it.
  ~NodeIdAssigner() { gone(); }

  void begin(NodeId own) noexcept override;
  [[nodiscard]] rt::Task<Result<void>> run(std::bitset<128> there) override;
  [[nodiscard]] std::bitset<128> answered() const noexcept override { return answered_; }
  [[nodiscard]] std::bitset<128> silent() const noexcept override { return silent_; }
  [[nodiscard]] rt::Duration pause() const noexcept override { return period; }

  /// Between two runs.
  rt::Duration period = std::chrono::seconds(1);

 private:
  rt::Task<Result<void>> open();
  rt::Task<void> ask_all();
  rt::Task<void> ask(ListSlot& slot);
  rt::Task<void> ask_stranger(NodeId node);
  rt::Task<Result<Identity>> identity_of(NodeId node);
  rt::Task<void> guard(ListSlot& slot);
  rt::Task<void> boot_who_stayed(NodeId node);
  rt::Task<void> look_for_formers();
  void settle(ListSlot& slot);
  rt::Task<void> recall(places::Found device);
  rt::Task<void> recall_surplus();
  rt::Task<Result<void>> search();
  rt::Task<Result<void>> look_for_surplus();
  [[nodiscard]] bool is_one_missing() const noexcept;
  [[nodiscard]] bool tells_apart();
  [[nodiscard]] bool booted_since_asked(NodeId node) const noexcept;
  void note_doubles();
  [[nodiscard]] bool is_clone(const std::optional<Identity>& device);
  void tell();
  bool forget(NodeId node);

  ListBus bus_;
  NodeIdSearch search_;
  NodeIdSeating seating_;
  NodeIdReport report_;
  std::bitset<128> answered_;
  std::bitset<128> silent_;
  std::bitset<128> doubled_;                  // answered twice, and not told apart yet
  std::array<unsigned, 128> tries_{};         // to tell them apart
  std::array<rt::Time, 128> asked_at_{};      // who answers under it
  std::array<rt::Time, 128> former_asked_{};  // who had it before
  std::array<std::uint32_t, 128> surplus_{};  // SDO answers beyond one each
  unsigned runs_ = 0;
};

}  // namespace berth::manager
