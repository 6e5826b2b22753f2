/// Does the steps of a `Binding` on a bus. The table says what comes next (`berth/places/binding.hpp`); here is only
/// how.
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <string>

#include "berth/can/dispatcher.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/select_alone.hpp"
#include "berth/places/binding.hpp"
#include "berth/places/boot_watch.hpp"
#include "berth/places/identity.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/rt/turn.hpp"

namespace berth::places {

/// When each node-ID was last asked for and not answered. With `BootWatch` (nothing booted or was heard since) that
/// makes a node-ID vacant without asking again.
using VacancyTable = std::array<std::optional<rt::Time>, 128>;

/// The device that used `id` gave it up: what was heard under it is history. Another one may use it, too: before it is
/// given, it is asked for anew.
void gave_up(BootWatch& boots, VacancyTable& vacancy, NodeId id) noexcept;

/// NMT reset communication to node-ID 255. Lely core's slaves begin to use a node-ID that is pending at this command,
/// and not at `04 00` as CiA 305 has it; others take it for a reset of no node.
void wake_unconfigured(can::Dispatcher& dispatcher) noexcept;

class Binder {
 public:
  struct Services {
    can::Dispatcher& dispatcher;
    lss::Master& lss;
    co::SdoClient& sdo;
    co::NmtMaster& nmt;
    BootWatch& boots;
    SlotStore& store;
    VacancyTable& vacancy;
  };
  struct Options {
    unsigned tries = 3;                                    ///< attempts before silence counts
    rt::Duration boot_timeout = std::chrono::seconds(10);  ///< reset to boot-up message
    /// So long a device may take to boot under its new node-ID before it is told to (NMT, node-ID 255), and after
    /// another was heard to boot under its old one.
    rt::Duration own_boot = std::chrono::milliseconds(500);
    rt::Duration guard_timeout = std::chrono::milliseconds(100);
    /// Least time between LSS requests once a device did not answer: one with a single-slot receive buffer loses the
    /// second of 40h..43h when they come back to back. Kept for the bus when it helped.
    rt::Duration slow_inhibit = std::chrono::milliseconds(10);
    bool use_guarding = true;  ///< vacancy: ask by a remote frame too
    /// What proves that the selected device is alone (`lss::parts_to_ask`); the first proof on a bus asks all.
    lss::PartMask parts = lss::all_parts;
    /// What an earlier run told a device to store (17h) is stored by then. A binding stores nothing before: the device
    /// drops a second request meanwhile, and its late answer to the first would be taken for that to the second.
    rt::Time stores_end{};
    BusName on{};                                     ///< for the store: where a blanking is begun
    std::function<void(const Binding&)> before_step;  ///< for displays and fault plans; may be empty
    NodeId uses;  ///< what the device is known to use; of one without a serial number nothing else tells that it does
    NodeId lent;  ///< its old node-ID when that is a search's loan: what goes wrong must not leave it in the memory
    /// The device has no node-ID, and others on this bus have its LSS address and node-IDs of their own: it is selected
    /// by Fastscan, which is for devices without a node-ID alone (CiA 305 §Fastscan).
    bool among_equals = false;
    /// It may use a node-ID that it was told to give up, and tell by LSS what it will have.
    bool may_use_another = false;
    /// Shared by the binders that run side by side on one bus: the one that has it has LSS. Null: LSS is this binder's
    /// alone.
    rt::Turn* lss_turn = nullptr;
    Uncompared* uncompared = nullptr;  ///< gets the parts of its 1018h that are not what LSS tells; may be null
  };

  Binder(const Services& services, const Options& options) : s_(services), options_(options) {}

  /// Runs the table to its end. `binding`, `slot` (of `Kind::bind`) and `reason` must stay. LSS belongs to this task
  /// meanwhile; with `lss_turn` from the intention's row to the release only, so that the next device is told its
  /// node-ID while this one boots.
  [[nodiscard]] rt::Task<void> run(Binding& binding, SlotId slot, const std::string& reason);

  /// What the store said when it refused, or could not be written, last; none: it did what it was told.
  [[nodiscard]] const std::optional<Error>& store_said() const noexcept { return store_said_; }

  /// Is this node-ID free for `device`? `ok`: no device answers, or `device` itself does. `mismatch`: another, which
  /// one of the same kind without a serial number is.
  [[nodiscard]] rt::Task<Outcome> vacant(NodeId id, const Identity& device);

  /// Do two devices answer to this LSS address? `several`: at least twice in three looks (S1.22). Leaves the device in
  /// configuration state.
  [[nodiscard]] rt::Task<Outcome> confirm_clone(const LssAddress& device);

 private:
  rt::Task<void> take_lss();
  rt::Task<Outcome> perform(Binding& binding, SlotId slot, const std::string& reason);
  rt::Task<Outcome> select(const LssAddress& device, bool inquires);
  [[nodiscard]] Outcome unanswered(const Error& error) noexcept;
  rt::Task<Outcome> inquire(Binding& binding);
  rt::Task<Outcome> find_node_id(Binding& binding);
  rt::Task<Outcome> configure(NodeId id);
  rt::Task<Outcome> configure_alone(const Binding& binding);
  rt::Task<Outcome> await_boot_up(const Binding& binding);
  rt::Task<void> wake();
  rt::Task<Outcome> store_alone(const Binding& binding);
  rt::Task<Outcome> still_alone(const Binding& binding);
  rt::Task<Outcome> store(bool by_all);
  rt::Task<Outcome> revert(const Binding& binding);
  rt::Task<Outcome> release(const Binding& binding);
  rt::Task<Outcome> reset(const Binding& binding);
  rt::Task<Outcome> identify(const Binding& binding);
  rt::Task<Outcome> identify_blank(const Binding& binding);
  [[nodiscard]] bool is_taken(const Binding& binding) const noexcept;
  Outcome write(const Binding& binding, SlotId slot, const std::string& reason);
  rt::Task<bool> excuses(NodeId id, Identity who, Identity expected);

  Services s_;
  Options options_;
  rt::Time watch_since_{};                   // vacancy was seen then
  rt::Duration window_{};                    // of the proof, before it was asked
  rt::Time moved_{};                         // the device may boot under its new node-ID from then on
  std::uint64_t unexpected_ = 0;             // answers that nobody waited for, before the 11h
  std::optional<std::uint64_t> taken_back_;  // `lss::Master::taken_back` before the 11h
  rt::Time reset_{};                         // it was told to
  std::optional<rt::Held> lss_held_;
  std::optional<Error> store_said_;
  bool silent_once_ = false;
  bool woken_ = false;
  bool answers_there_ = false;  // a device of its identity uses the node-ID that it is to have
};

/// What the outcome of a `Result` means to the table.
[[nodiscard]] Outcome outcome_of(const Error& error) noexcept;
/// How a step that writes into the store ended; `said` gets what the store said of it when it did not write.
[[nodiscard]] Outcome outcome_of(const Result<void>& written, std::optional<Error>& said) noexcept;
/// Why a binding failed, for people: by a store that said so, in its own words (`Binder::store_said`).
[[nodiscard]] std::string words_of(Why why, const std::optional<Error>& store_said);

}  // namespace berth::places
