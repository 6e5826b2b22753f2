/// Gives the devices of a network list their node-IDs by LSS. With it a master that has only its dictionary and a few
/// kilobytes of memory (`DictionaryManager`) handles new devices, devices from another machine, and replacements. It
/// works like `berth up`, with the same plan (`places::plan`) and the same steps (`places::Binding`).
///
/// The list decides which device belongs to which node-ID: vendor-ID and product code (1F85h, 1F86h) must be given and
/// agree, revision number and serial number (1F87h, 1F88h) must agree if they are not 0. Of several devices of one type
/// found by a search, the lowest serial number gets the lowest free node-ID; a device that has a node-ID of its type
/// keeps it. A device of a type that is not in the list is left alone, together with its node-ID.
///
/// A device without a serial number is known by its node-ID (`ListFound`). Blank equal ones get theirs one at a time;
/// several at once get none, and 5F0Bh reports it. A node-ID of 5F05h is set by its device: a device that answers there
/// and fits is seated, and the node-ID is never assigned.
///
///     manager::ListStore store(&memory);
///     auto& bus = manager.bus();
///     manager::NodeIdAssigner assigner({dispatcher, bus.sdo(), bus.nmt(), device.values(), store});
///     manager.assign_by(&assigner);
///
/// **A node-ID that a device may have stored belongs to that device until it was seen to have lost it**, also after a
/// power loss of the master: `ListStore` has it before the device is told. A device that was heard under its node-ID
/// and is silent now (no error control, SDO, guarding or LSS) loses its place to the next one of its type; if it
/// returns, it is asked for by its LSS address and gives the node-ID up. A node-ID that a device was told but not heard
/// under is kept for it. 5F0Bh shows it (`NodeIdReport`).
///
/// A run asks slaves that are not known to be there, and devices that booted; if a slave is missing it searches for
/// devices. A complete and quiet bus costs only three questions in eight runs (is there a device without a node-ID?).
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
  /// Ends a `DictionaryManager`'s use of it.
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
  std::bitset<128> doubled_;                  // answered twice, and not separated yet
  std::array<unsigned, 128> tries_{};         // to separate them
  std::array<rt::Time, 128> asked_at_{};      // when it was last asked which device answers under it
  std::array<rt::Time, 128> former_asked_{};  // when its previous device was last asked
  std::array<std::uint32_t, 128> surplus_{};  // SDO answers beyond one per request
  unsigned runs_ = 0;
};

}  // namespace berth::manager
