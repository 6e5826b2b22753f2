/// The bus of a network list whose master assigns node-IDs: the services, the slots made from the list's slaves, and
/// the devices found. Shared by the parts of `NodeIdAssigner`; one task at a time uses it.
#pragma once

#include <bitset>
#include <optional>
#include <vector>

#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/lss/master.hpp"
#include "berth/manager/list_found.hpp"
#include "berth/manager/list_store.hpp"
#include "berth/od/values.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/boot_watch.hpp"
#include "berth/places/plan.hpp"
#include "berth/rt/turn.hpp"

namespace berth::manager {

/// All must outlive this. Nothing else on this device is an LSS master.
struct ListServices {
  can::Dispatcher& dispatcher;
  co::SdoClient& sdo;
  co::NmtMaster& nmt;
  od::Values& values;
  ListStore& store;
};

class ListBus {
 public:
  explicit ListBus(const ListServices& services);

  /// The master has booted: forgets all except the store's content, and reads its list. Later writes to the list may be
  /// incomplete, and take effect at the next boot-up.
  void begin(NodeId own);
  /// The present slots of the list. Those in `there` need not be asked.
  void read_list(std::bitset<128> there);
  [[nodiscard]] NodeId own() const noexcept { return own_; }
  [[nodiscard]] rt::Time began() const noexcept { return began_; }

  std::vector<ListSlot> slots;
  ListFound found{slots};  ///< in this run
  /// As far as is known, no device is in LSS configuration. A binding whose frames were lost may have left one there
  /// with a node-ID pending, which the next `04 00` would activate.
  bool nobody_listens = false;
  rt::Time stores_end{};      ///< as in `places::Binder::Options`
  std::bitset<128> given_up;  ///< a device left this node-ID; what answers under it since is unknown
  /// They refused a node-ID.
  std::vector<Identity> refusing;

  /// Null: there is none.
  [[nodiscard]] ListSlot* at(NodeId id) noexcept { return slot_at(slots, id); }
  [[nodiscard]] ListSlot* of(const Identity& device) noexcept { return slot_of(slots, device); }
  void refresh(ListSlot& slot);
  /// The device fits the type of a slave in the list.
  [[nodiscard]] bool knows_type(const Identity& device) const noexcept;
  /// Devices that were to give a node-ID up and were not seen doing so.
  [[nodiscard]] std::vector<places::UnfinishedBlank> formers() const;

  struct Planned {
    places::Plan plan;
    std::vector<std::size_t> slots;  ///< maps `places::Action::slot` to an index into `ListBus::slots`
  };
  /// A device of a type that is not in the list is left alone, together with its node-ID.
  [[nodiscard]] Planned plan();

  /// LSS cannot give it a node-ID (`refusing`).
  [[nodiscard]] bool refuses(const Identity& device) const noexcept;
  /// Asked in this run, and silent since.
  [[nodiscard]] bool vacant(NodeId id) const noexcept;
  /// For asking whether a device is there: silence is the expected answer.
  [[nodiscard]] co::SdoOptions patience() const noexcept;
  [[nodiscard]] lss::PartMask parts_to_ask(const Identity& device) const;
  [[nodiscard]] places::Binder::Services binder_services() noexcept;
  [[nodiscard]] places::Binder::Options binder_options() noexcept;

  [[nodiscard]] rt::Executor& executor() noexcept { return s_.dispatcher.executor(); }
  [[nodiscard]] const ListServices& services() const noexcept { return s_; }
  [[nodiscard]] ListStore& store() noexcept { return s_.store; }
  [[nodiscard]] lss::Master& lss() noexcept { return lss_; }
  [[nodiscard]] places::BootWatch& boots() noexcept { return boots_; }
  [[nodiscard]] const places::BootWatch& boots() const noexcept { return boots_; }
  [[nodiscard]] places::VacancyTable& vacancy() noexcept { return vacancy_; }

  static constexpr rt::Duration timeout = std::chrono::milliseconds(100);  ///< of a question to one node
  static constexpr rt::Duration pause = std::chrono::milliseconds(10);     ///< for single-slot receive buffers

 private:
  ListServices s_;
  lss::Master lss_;
  places::BootWatch boots_;
  places::VacancyTable vacancy_{};
  rt::Turn lss_turn_;
  std::vector<places::SlotSpec> list_;  // as of the last boot-up
  NodeId own_;
  rt::Time began_{};
};

}  // namespace berth::manager
