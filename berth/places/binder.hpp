/// Carries out the steps of a `Binding` on a bus. The table decides the next step (`berth/places/binding.hpp`); this
/// carries it out.
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

/// When each node-ID was last asked and did not answer. If `BootWatch` has heard no boot-up or other frame since then,
/// the node-ID is vacant without asking again.
using VacancyTable = std::array<std::optional<rt::Time>, 128>;

/// The device that used `id` gave it up: forget what was heard under it. Another device may use it too, so it is asked
/// again before it is given.
void gave_up(BootWatch& boots, VacancyTable& vacancy, NodeId id) noexcept;

/// NMT reset communication to node-ID 255. Lely core's slaves activate a pending node-ID at this command, and not at
/// `04 00` as CiA 305 says; other slaves see a reset of no node.
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
    unsigned tries = 3;                                    ///< attempts before it counts as silent
    rt::Duration boot_timeout = std::chrono::seconds(10);  ///< from reset to boot-up message
    /// How long a device may take to boot under its new node-ID before it is told to (NMT, node-ID 255), and after
    /// another device was heard to boot under its old one.
    rt::Duration own_boot = std::chrono::milliseconds(500);
    rt::Duration guard_timeout = std::chrono::milliseconds(100);
    /// Minimum time between LSS requests after a device did not answer: a single-slot receive buffer loses the second
    /// of consecutive 40h..43h. Kept for the bus if it helped.
    rt::Duration slow_inhibit = std::chrono::milliseconds(10);
    bool use_guarding = true;  ///< vacancy: also ask by a remote frame
    /// The parts that prove that the selected device is alone (`lss::parts_to_ask`); the first proof on a bus asks all.
    lss::PartMask parts = lss::all_parts;
    /// By then an earlier run's store request (17h) to a device is completed. A binding stores nothing earlier:
    /// meanwhile the device drops a second request, and its late answer to the first would count for the second.
    rt::Time stores_end{};
    BusName on{};                                     ///< for the store: where a blanking was begun
    std::function<void(const Binding&)> before_step;  ///< for displays and fault plans; may be empty
    NodeId uses;  ///< node-ID in use, if known; without a serial number nothing else shows it
    NodeId lent;  ///< its old node-ID if that is a search's loan: a failure must not leave it in the memory
    /// The device has no node-ID, and others on this bus have its LSS address and node-IDs of their own. It is selected
    /// by Fastscan, which only devices without a node-ID answer (CiA 305 §Fastscan).
    bool among_equals = false;
    /// It may still use a node-ID that it was told to give up, and report by LSS the one it will have.
    bool may_use_another = false;
    /// Shared by binders that work in parallel on one bus: only the holder may use LSS. Null: LSS belongs to this
    /// binder.
    rt::Turn* lss_turn = nullptr;
    Uncompared* uncompared = nullptr;  ///< gets the parts of its 1018h that differ from LSS; may be null
  };

  Binder(const Services& services, const Options& options) : s_(services), options_(options) {}

  /// Runs the table to its end. `binding`, `slot` (for `Kind::bind`) and `reason` must outlive the task. LSS belongs to
  /// the task meanwhile; with `lss_turn` only from the intention's row to the release, so that the next device gets its
  /// node-ID while this one boots.
  [[nodiscard]] rt::Task<void> run(Binding& binding, SlotId slot, const std::string& reason);

  /// The store's last error, when it refused or could not be written; none: it succeeded.
  [[nodiscard]] const std::optional<Error>& store_said() const noexcept { return store_said_; }

  /// Is this node-ID free for `device`? `ok`: no device answers, or `device` itself. `mismatch`: another device does;
  /// one of the same kind without a serial number counts as another.
  [[nodiscard]] rt::Task<Outcome> vacant(NodeId id, const Identity& device);

  /// Do two devices answer to this LSS address? `several`: in at least two of three tries (S1.22). Leaves the device in
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
  rt::Time watch_since_{};                   // start of the watch for vacancy
  rt::Duration window_{};                    // of the proof, before it was asked
  rt::Time moved_{};                         // from then on the device may boot under its new node-ID
  std::uint64_t unexpected_ = 0;             // unexpected answers before the 11h
  std::optional<std::uint64_t> taken_back_;  // `lss::Master::taken_back` before the 11h
  rt::Time reset_{};                         // when the reset was sent
  std::optional<rt::Held> lss_held_;
  std::optional<Error> store_said_;
  bool silent_once_ = false;
  bool woken_ = false;
  bool answers_there_ = false;  // a device of its identity uses the intended node-ID
};

/// The outcome of a step for a `Result`.
[[nodiscard]] Outcome outcome_of(const Error& error) noexcept;
/// The outcome of a step that writes into the store; `said` gets the store's error if it did not write.
[[nodiscard]] Outcome outcome_of(const Result<void>& written, std::optional<Error>& said) noexcept;
/// Why a binding failed, for users: by the store's own error if there is one (`Binder::store_said`).
[[nodiscard]] std::string words_of(Why why, const std::optional<Error>& store_said);

}  // namespace berth::places
