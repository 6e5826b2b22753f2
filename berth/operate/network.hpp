/// The main job on one bus: finds the devices, gives each the node-ID of its slot, checks it, starts it, watches it,
/// and puts a replacement to work. One `Network` is one master on one port; `Session` has one for each bus of a
/// machine.
///
/// What it does, in this order, again and again while it runs:
///   1. opening: whoever an interrupted run left in LSS configuration state is taken out of it
///   2. preparation: is the device of every bound slot there? By heartbeat, else SDO 1000h, else guarding (S1.30)
///   3. discovery: RAND, by Berth's planner, finds every device that no slot knows (S1.31); while a slot's device is
///      missing still, whatever else devices speak is tried (`discovery::Auto`). A bus with `discovery =` uses that
///      method alone; `"rand"` is RAND as published
///   4. plan and binding: `places::plan`, then the bindings, side by side as far as LSS allows: one device is told its
///      node-ID while those before it boot (S1.32, S1.33)
///   5. check, configuration and start: identity, what `config =` wants, heartbeat, NMT start; operational when the
///      device says so
///   6. watch: heartbeats and boot-ups; every `probe_period` one question whether somebody new is there
#pragma once

#include <array>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "berth/can/dispatcher.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/guarding.hpp"
#include "berth/co/heartbeat.hpp"
#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/design/machine.hpp"
#include "berth/discovery/auto.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/select_alone.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/operate/loans.hpp"
#include "berth/operate/report.hpp"
#include "berth/places/binder.hpp"
#include "berth/places/boot_watch.hpp"
#include "berth/places/planner.hpp"
#include "berth/places/recipe_binding.hpp"
#include "berth/places/slot_store.hpp"
#include "berth/rt/mailbox.hpp"
#include "berth/rt/scope.hpp"
#include "berth/rt/turn.hpp"

namespace berth::operate {

/// What a network tells its owner. Called from the executor; must not destroy the network.
struct NetworkObserver {
  std::function<void(const Event&)> event = {};
  /// "discovered": a discovery has found somebody; "bound": every slot that can be is bound, and one at least;
  /// "operational": every slot that is not optional is operational. Each once.
  std::function<void(const std::string&)> milestone = {};
  /// Before each step of a binding: for displays and fault plans. May be empty.
  std::function<void(const places::Binding&)> before_step = {};
};

/// Where the main job is.
enum class Phase : std::uint8_t { opening, preparation, discovery, binding, start, watch };
[[nodiscard]] const char* name(Phase phase) noexcept;

/// What `berth configure` did, or found, in one slot.
struct SlotConfiguration {
  std::string bus;
  std::string slot;
  NodeId id;
  std::string file;
  std::string problem;  ///< why it was not even compared; empty: see `report`
  manager::ConfigurationReport report;
  places::SlotState state = places::SlotState::unknown;
  std::string reason;
};

class MasterDevice;  // the master is a device: network.cpp

class Network final : private co::HeartbeatConsumer::Observer,
                      private co::EmcyConsumer::Observer,
                      private co::SdoClient::Observer,
                      private can::StatusHandler,
                      private nodeid::DiscoveryObserver,
                      private discovery::Assigner {
 public:
  /// `bus`, `store` and `port` must stay. `slots` are the specifications of this bus.
  Network(rt::Executor& executor, can::Port& port, const design::Bus& bus, std::vector<places::SlotSpec> slots,
          places::SlotStore& store, NetworkObserver observer);
  ~Network();
  Network(const Network&) = delete;
  Network& operator=(const Network&) = delete;

  /// Declares the slots in the store and takes over what it knows. Call once, before anything else.
  Result<void> open();
  /// Begins the main job. Without it the network only serves single commands.
  void start();
  /// Stops the main job where it stands, as if Berth had been ended.
  void stop() noexcept;
  /// The main job rests: the port is down, or takes no frame (another master, a gate that listens still). It begins
  /// anew by itself when the port takes frames again.
  [[nodiscard]] bool resting() const noexcept { return resting_; }

  [[nodiscard]] const design::Bus& bus() const noexcept { return *bus_; }
  [[nodiscard]] std::vector<SlotReport> report() const;
  /// The part of `report` that is cheap enough to be looked at on every event, in the slots' own order.
  struct Occupancy {
    places::SlotState state;
    std::optional<LssAddress> device;
    friend bool operator==(const Occupancy&, const Occupancy&) = default;
  };
  [[nodiscard]] std::vector<Occupancy> occupancy() const;
  /// Every slot that is not optional is operational.
  [[nodiscard]] bool operational() const noexcept;
  /// The main job has nothing to do now but to watch.
  [[nodiscard]] bool idle() const noexcept { return idle_; }
  [[nodiscard]] Phase phase() const noexcept { return phase_; }
  /// Devices and facts that are not as they should be, as last seen.
  [[nodiscard]] const std::vector<places::Oddity>& oddities() const noexcept { return plan_.oddities; }
  [[nodiscard]] const std::vector<places::Question>& questions() const noexcept { return plan_.questions; }
  /// The same as events, with the names of the slots.
  [[nodiscard]] std::vector<Event> question_events() const;

  // Commands of a person. They wait until the main job has nothing to do.

  /// `berth replace SLOT`: forgets who sits in the slot and looks for a new device; `device` says which one it is and
  /// so answers a question. Errors: `not_found` no such slot; `invalid` the slot's device is there and operational, or
  /// `device` is not of the slot's type.
  /// `used`: the used device that waits for this slot, or sits in it, may be used; it gets its factory settings first.
  Result<void> replace(const std::string& slot, std::optional<LssAddress> device, bool used = false);

  /// A person sent this NMT command beside the main job, which then does not work against it: a node that was stopped
  /// or made pre-operational stays so until it is started by a person or boots.
  void commanded(co::NmtCommand command, co::NmtTarget target) noexcept;

  /// The master's own device is silent until the main job, if it runs, has looked around anew (network_bitrate.hpp).
  void fall_silent() noexcept;

  /// `berth forget DEVICE`: gives up an unfinished intention to take the device's node-ID away. Errors: `not_found`
  /// there is none on this bus.
  Result<void> forget(const LssAddress& device);

  // The services, for single commands (`berth sdo`, `berth nmt`, `berth lss`). Whoever uses LSS or RAND takes the turn
  // first: the main job holds it while it works.
  [[nodiscard]] rt::Turn& turn() noexcept { return turn_; }
  [[nodiscard]] co::SdoClient& sdo() noexcept { return sdo_; }
  [[nodiscard]] co::NmtMaster& nmt() noexcept { return nmt_; }
  [[nodiscard]] lss::Master& lss() noexcept { return lss_; }
  [[nodiscard]] nodeid::RandMaster& rand() noexcept { return rand_; }
  [[nodiscard]] can::Dispatcher& dispatcher() noexcept { return dispatcher_; }
  [[nodiscard]] places::BootWatch& boots() noexcept { return boots_; }
  [[nodiscard]] rt::Executor& executor() noexcept { return *executor_; }

  /// What a scan found at one node-ID, or without one.
  struct Seen {
    NodeId id;                                 ///< unconfigured: found by RAND, without a node-ID
    std::optional<LssAddress> device;          ///< from 1018h, or from RAND
    std::optional<std::uint32_t> device_type;  ///< 1000h
    std::optional<NmtState> state;             ///< from its error control messages
    bool duplicate = false;                    ///< more than one device answered under this node-ID or address
    std::string slot;                          ///< the slot it belongs to, if any
  };
  /// Who is on this bus: node-IDs 1..127 by SDO, devices without one by RAND. Changes nothing but the devices' RAND
  /// state. Waits for its turn.
  [[nodiscard]] rt::Task<Result<std::vector<Seen>>> scan();

  /// Compares the configurations of all slots that have one, or of the slot of this name, and with `write` makes right
  /// what differs; a device that runs is compared only. Waits for its turn. Errors: `not_found` no such slot.
  [[nodiscard]] rt::Task<Result<std::vector<SlotConfiguration>>> configure(std::string slot, bool write);

  /// Discovery and binding once, without starting anything (`berth bind`), by `method` ("auto", or a name of
  /// `discovery::Method`; empty: the machine file's). Waits for its turn.
  [[nodiscard]] rt::Task<Result<void>> bind_once(std::string method = {});

  /// The same from scratch (`berth bind --from-scratch`): every device is made pre-operational, every binding is
  /// forgotten, every node-ID that LSS can change is taken away, and then all are bound anew. Fixed node-IDs stay.
  /// Errors: `invalid` no person `confirmed` it; `unsupported` Berth does not command this bus; those of `bind_once`.
  [[nodiscard]] rt::Task<Result<void>> bind_from_scratch(bool confirmed);

  /// Everybody whom no slot knows, as far as `discovery =` reaches.
  struct NewDevices {
    std::vector<discovery::Found> found;
    bool complete = true;
    std::string end;  ///< how it ended, when it is not complete
  };
  /// Changes nothing but what a search changes in the devices. The turn must be held.
  [[nodiscard]] rt::Task<Result<NewDevices>> find_new();

  /// What `locate` found and showed.
  struct Located {
    LssAddress device;
    NodeId id;                      ///< that it has
    std::optional<NmtState> state;  ///< as far as it can be known
  };
  /// Makes the device of this LSS address show itself for `time`: in LSS configuration state its two indicators flicker
  /// in turn (CiA 303-3). Then all are in LSS waiting again, also when the task is destroyed. Waits for its turn and
  /// keeps it, so that nobody is searched for meanwhile. A device that is operational, or of which that is not known,
  /// is shown `anyway` only: it goes on working, but some makers' devices do not like LSS there. Errors: `not_found` it
  /// does not answer; `invalid` operational, or not known.
  [[nodiscard]] rt::Task<Result<Located>> locate(LssAddress device, rt::Duration time, bool anyway);

 private:
  struct Seat;  // one slot at run time
  struct Wake {
    enum class Kind : std::uint8_t { boot_up, lost, recovered, state, look };
    Kind kind = Kind::look;
    NodeId node;
    rt::Time at{};
  };
  using Slots = std::vector<places::Slot>;
  struct Progress final : discovery::Observer {
    void found(const discovery::Found& device) noexcept override {
      if (device.active.configured()) told[device.active.value()] = true;
    }
    void progress(const discovery::Progress& progress) noexcept override { last = progress; }
    discovery::Progress last{};
    discovery::Progress before{};
    unsigned idle = 0;             ///< slices in a row that brought nothing
    std::array<bool, 128> told{};  ///< a device that was found has this node-ID, or will when it boots
  };

  // network_job.cpp: the main job
  rt::Task<void> job();
  rt::Task<void> work(bool first);
  rt::Task<void> handle_what_came();
  rt::Task<void> round();
  rt::Task<void> opening();
  rt::Task<void> watch();
  [[nodiscard]] rt::Duration look_period() const noexcept;
  [[nodiscard]] bool retry_due();
  rt::Task<void> take_back(const places::Found& found);
  rt::Task<void> handle(Wake wake);
  rt::Task<void> came_back(Seat& seat, rt::Time booted);
  void hurry(Seat& seat);
  // network_prepare.cpp: who is there
  [[nodiscard]] co::SdoOptions asking(unsigned retries) const;
  rt::Task<void> prepare();
  rt::Task<void> ask_seat(Seat& seat);
  rt::Task<void> look_by_lss(Seat& seat);
  rt::Task<Result<NodeId>> active_id(LssAddress device);
  rt::Task<Result<NodeId>> ask_active_id(LssAddress device);
  rt::Task<void> adopt_fixed(Seat& seat);
  [[nodiscard]] std::size_t most_at_once() const noexcept;
  [[nodiscard]] lss::MasterOptions with_pauses() const;
  rt::Task<void> verify_vacancy();
  rt::Task<void> ask_vacancy(NodeId id);
  rt::Task<bool> answers_at(NodeId id);
  rt::Task<void> scan_node(NodeId id, Seen& seen, co::SdoOptions patience);
  // network_discover.cpp: who is new, and what was found of whom
  rt::Task<void> discover();
  rt::Task<void> tell_who_is_known();
  rt::Task<void> inquire_found(bool all);
  rt::Task<void> discover_by_rand();
  rt::Task<void> discover_by_rand_once();
  rt::Task<Result<discovery::Report>> search_by_rand_planner();
  rt::Task<void> discover_by_rand_planner();
  rt::Task<void> discover_the_rest(bool also_configured);
  rt::Task<void> go_on_searching();
  void tell_progress();
  [[nodiscard]] bool gets_on();
  [[nodiscard]] discovery::Auto& rest(bool also_configured);
  rt::Task<void> discover_by(discovery::Discovery& way);
  rt::Task<bool> anybody_new();
  rt::Task<bool> anybody_blank();
  void forget_found(const LssAddress& device);
  void note_found(const places::Found& found);
  void tell_found(const LssAddress& device, bool clone);
  void take_rand(const discovery::Report& report);
  void rest_from_searching();
  void take_found(const discovery::Report& report);
  void tell_end(const discovery::Report& report);
  [[nodiscard]] bool somebody_missing() const;
  [[nodiscard]] std::string method() const { return method_.empty() ? bus_->discovery : method_; }
  [[nodiscard]] discovery::Known known_devices() const;
  [[nodiscard]] discovery::Options search_options();
  [[nodiscard]] discovery::Discovery* chosen();
  // network_loans.cpp: node-IDs that devices are lent
  rt::Task<void> prepare_loans();
  NodeId assign(const LssAddress& device) noexcept override;
  [[nodiscard]] bool may_be_lent(NodeId id) const noexcept;
  [[nodiscard]] bool spoken_for(NodeId id) const noexcept;
  [[nodiscard]] bool free_for_a_loan(const Seat& seat, const LssAddress& device) const noexcept;
  [[nodiscard]] NodeId id_to_lend(const LssAddress& device) const noexcept;
  rt::Task<Result<NodeId>> lend_id(LssAddress device);
  rt::Task<Result<void>> select_alone(LssAddress device);
  [[nodiscard]] lss::PartMask parts_to_ask(const LssAddress& device) const;
  bool lend(const LssAddress& device, NodeId id);
  void end_loan(const LssAddress& device);
  void name_loans();
  [[nodiscard]] bool may_be_asked(const Loans::Loan& loan) const noexcept;
  rt::Task<void> end_or_keep(Loans::Loan loan);
  rt::Task<void> make_pending(Loans::Loan loan, NodeId own);
  rt::Task<void> take_back_what_is_in_the_way();
  rt::Task<void> take_ids_back();
  rt::Task<bool> tell_pending(LssAddress device, NodeId id);
  rt::Task<bool> take_id_back(LssAddress device, NodeId id);
  // network_probe.cpp: the place, read from the device
  void forget_readings(const LssAddress& device);
  rt::Task<bool> read_probes(LssAddress device, NodeId id);
  rt::Task<bool> read_places();
  void note_puzzling();
  rt::Task<bool> read_place(LssAddress device);
  rt::Task<bool> stays_in_place(Seat& seat);
  // network_bind.cpp: binding, start
  rt::Task<void> carry_out();
  rt::Task<void> carry_out_actions(bool& inquired_all);
  rt::Task<bool> act(const places::Action& action);
  rt::Task<void> act_aside(const places::Action& action, std::vector<LssAddress>& failed);
  rt::Task<void> bind_side_by_side(const std::vector<places::Action>& actions, std::vector<LssAddress>& failed);
  [[nodiscard]] bool is_avoided(const LssAddress& device) const noexcept;
  [[nodiscard]] bool uses(const LssAddress& device, NodeId id) const noexcept;
  rt::Task<bool> bind_seat(Seat& seat, LssAddress device, std::string reason);
  rt::Task<bool> blank(LssAddress device, std::string reason);
  rt::Task<void> check_and_start();
  rt::Task<void> start_seat(Seat& seat);
  rt::Task<bool> set_heartbeat(Seat& seat);
  rt::Task<void> send_start(Seat& seat);
  rt::Task<void> await_operational();
  rt::Task<void> start_again();
  void bound(Seat& seat, const places::Binding& binding);
  void not_bound(Seat& seat, const places::Binding& binding);
  void free_absent_slots();

  // network_sources.cpp: where node-IDs come from
  [[nodiscard]] bool never_by_lss(const LssAddress& device) const;
  void respect_fixed();
  void tell_mismatch(const LssAddress& device, NodeId active);
  void learn_fixed(const places::Binding& binding);
  [[nodiscard]] std::vector<NodeId> ids_to_ask(bool everybody);
  rt::Task<void> ask_own_ids();
  rt::Task<bool> take_where_it_is(Seat& seat, LssAddress device);
  rt::Task<bool> find_configured(bool everybody);
  [[nodiscard]] bool everywhere_due();
  rt::Task<void> ask_everywhere();
  rt::Task<void> knock(NodeId id);
  rt::Task<void> identity_at(NodeId id, std::vector<places::Found>& into);
  // network_doubles.cpp: two devices under one node-ID
  struct Shared {
    NodeId id;
    std::array<std::vector<std::uint32_t>, 4> parts;  // of the LSS addresses that were heard under it
  };
  static constexpr unsigned most_tries_apart = 3;
  void note_shared(const can::Frame& frame);
  rt::Task<void> hear_parts(NodeId id);
  [[nodiscard]] static std::vector<LssAddress> addresses_of(const Shared& shared);
  rt::Task<void> ask_addresses(NodeId id, std::vector<LssAddress> addresses, bool slowly);
  rt::Task<bool> tell_apart(NodeId id);
  rt::Task<bool> tell_all_apart(std::vector<NodeId> ids);
  rt::Task<void> tell_seats_apart();
  // network_recipe.cpp: node-IDs that are objects
  [[nodiscard]] Seat* recipe_seat(const places::Found& found);
  rt::Task<void> bind_by_recipe();
  rt::Task<void> bind_recipe(Seat& seat, LssAddress device, NodeId now);
  void not_bound_by_recipe(Seat& seat, const places::RecipeBinding& binding);
  // network_spares.cpp: listed and used spares, devices that return
  struct Used {
    places::Found found;
    places::FormerSeat sat;
  };
  [[nodiscard]] bool is_marked(places::Mark mark, const LssAddress& device) const;
  void set_mark(places::Mark mark, const LssAddress& device, NodeId id, const std::string& reason);
  void take_mark(places::Mark mark, const LssAddress& device, const std::string& reason);
  [[nodiscard]] std::optional<places::FormerSeat> former_seat_of(const LssAddress& device) const;
  [[nodiscard]] std::string place_of(const places::FormerSeat& seat) const;
  [[nodiscard]] std::string text_of_return(const LssAddress& device, const places::FormerSeat& sat) const;
  void free_for_spares();
  void send_home();
  [[nodiscard]] std::vector<places::Found> without_used();
  void ask_about_used();
  void keep_off(const places::Found& f);
  void name_returned();
  [[nodiscard]] std::vector<LssAddress> formers_of(const Seat& seat);
  rt::Task<bool> isolate_former(Seat& seat);
  rt::Task<bool> clear_past(Seat& seat);
  [[nodiscard]] bool had_another(const Seat& seat, const LssAddress& device) const;
  rt::Task<Result<bool>> foreign_date(Seat& seat);
  rt::Task<bool> restore_seat(Seat& seat);
  [[nodiscard]] Result<std::optional<LssAddress>> used_for(const Seat& seat) const;
  void make_welcome(const LssAddress& device);
  // network_unfinished.cpp: what an earlier run, or an earlier try, left unfinished
  [[nodiscard]] std::string machine_name() const;
  [[nodiscard]] std::vector<places::UnfinishedBlank> unfinished_here() const;
  [[nodiscard]] std::vector<LssAddress> blanks_to_finish() const;
  rt::Task<void> look_for_unfinished();
  rt::Task<bool> answers_by_lss(LssAddress device);
  rt::Task<bool> waits_for_its_power_cycle(Seat& seat);
  void keep_for_its_device(Seat& seat);
  void name_unfinished();
  // network_configure.cpp: configuration before start
  void load_configurations();
  rt::Task<bool> configure_seat(Seat& seat, manager::ConfigurationReport& report);
  rt::Task<bool> configure_once(Seat& seat, const manager::Wanted& wanted, manager::ConfiguratorOptions& options,
                                manager::ConfigurationReport& report);
  rt::Task<Result<manager::Wanted>> wanted_of(Seat& seat);
  rt::Task<bool> waits_for_power(Seat& seat, manager::Configurator& configurator, const manager::Wanted& wanted);
  rt::Task<bool> reset_and_wait(Seat& seat);
  rt::Task<void> wait_for_power(Seat& seat, manager::Configurator& configurator, const manager::Wanted& wanted,
                                const std::string& reason);
  void forgot(Seat& seat, const manager::ConfigurationReport& report, const manager::Wanted& wanted);
  rt::Task<void> look_at_running(Seat& seat);
  rt::Task<void> compare_seat(Seat& seat, bool write, SlotConfiguration& into);
  bool note_configured(Seat& seat, places::Configured::Stage stage, const manager::Wanted& wanted);
  [[nodiscard]] bool rebooted(const Seat& seat) const noexcept;
  // network.cpp: state and reports
  void heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept override;
  void emergency(NodeId node, const co::Emcy& message, rt::Time at) noexcept override;
  void surplus(NodeId node, const can::Frame& frame, rt::Time at) noexcept override;
  void changed(const can::Status& status, rt::Time at) noexcept override;
  void phase(const nodeid::PhaseEvent&) noexcept override {}
  void found(const nodeid::Discovered& device) noexcept override;
  void restarted(unsigned, rt::Time) noexcept override {}
  void speak();
  void make_plan();
  void set_state(Seat& seat, places::SlotState state, std::string reason = {});
  Result<void> clear_seat(Seat& seat, const std::string& reason);
  void refresh(Seat& seat);
  void check_rates();
  void report_plan();
  void reach(const char* milestone);
  void tell(std::string kind, std::string slot, std::string text);
  void tell_once(const std::string& kind, const std::string& text);
  [[nodiscard]] Seat* seat_at(NodeId id) noexcept;
  [[nodiscard]] Seat* seat_named(const std::string& name) noexcept;
  [[nodiscard]] Seat* seat_of(const LssAddress& device) noexcept;
  [[nodiscard]] Slots slots() const;
  [[nodiscard]] nodeid::DiscoveryOptions discovery_options() const;
  [[nodiscard]] places::Binder::Services services() noexcept;
  [[nodiscard]] places::Binder::Options binder_options();
  [[nodiscard]] bool may_command() const noexcept { return bus_->role == design::Role::master; }

  rt::Executor* executor_;
  /// The way out of bus-off.
  class Restart final : public rt::Job {
   public:
    explicit Restart(Network& network) noexcept : network_(network) {}
    void run() noexcept override;

   private:
    Network& network_;
  };
  void rest_or_go_on(const can::Status& status);
  void go_to_rest(const std::string& why);
  void way_out_of_bus_off();
  [[nodiscard]] bool usable(const can::Status& status) const noexcept;

  const design::Bus* bus_;
  can::Port* port_;
  Restart restart_;
  rt::Time restarted_{};        // after bus-off, last
  std::uint32_t restarts_ = 0;  // in a row
  bool speaks_ = false;         // the master's own device is on
  places::SlotStore* store_;
  NetworkObserver observer_;
  can::Dispatcher dispatcher_;
  lss::Master lss_;
  nodeid::RandMaster rand_;
  co::SdoClient sdo_;
  co::NmtMaster nmt_;
  co::HeartbeatConsumer heartbeats_;
  co::EmcyConsumer emergencies_;
  places::BootWatch boots_;
  std::unique_ptr<discovery::Discovery> rand_planner_;
  std::unique_ptr<discovery::Auto> rest_;         // whoever RAND does not find
  std::unique_ptr<discovery::Discovery> chosen_;  // by `discovery =`
  std::string chosen_name_;
  std::string method_;  // of `bind_once`, while it runs
  std::unique_ptr<MasterDevice> device_;
  std::vector<std::unique_ptr<Seat>> seats_;
  places::VacancyTable vacancy_;
  std::vector<places::Found> found_;
  std::map<LssAddress, rt::Time> first_seen_;  // of `found_`
  std::vector<places::Reading> readings_;      // of devices without a seat
  Loans loans_;
  std::optional<Shared> shared_;          // while two devices are told apart
  std::vector<NodeId> doubled_;           // node-IDs that were answered as by two devices, in this round
  std::array<rt::Time, 128> apart_at_{};  // they are not told apart again before
  places::Plan plan_;
  std::vector<LssAddress> avoid_;          // devices whose action failed in this round
  std::vector<Used> used_;                 // found, and sat somewhere before
  std::vector<LssAddress> welcome_;        // a person named them, or said that they may be used
  std::array<rt::Time, 128> asked_at_{};   // who answers at a node-ID of nobody was asked then
  std::array<bool, 128> look_again_at_{};  // a device was there that waits for its place
  rt::Time sweep_at_{};                    // the slots' own node-IDs are not asked again before
  rt::Time everywhere_at_{};               // nor all the others, for a slot without a device
  std::uint8_t everywhere_from_ = 1;       // node-ID at which the questions go on that a boot-up interrupted
  bool asked_everywhere_ = false;
  std::vector<places::Oddity> returned_;  // sat in a slot, came back, and gave its node-ID up
  std::vector<LssAddress> clones_;        // two devices had this address when it was asked last
  std::vector<LssAddress> heard_of_;      // found by the last discovery
  std::vector<LssAddress> known_before_;
  std::vector<LssAddress> by_rest_;   // found otherwise than by RAND
  bool news_ = false;                 // the last discovery found somebody who was not told
  std::vector<std::string> told_;     // oddities and questions already told
  std::vector<std::string> reached_;  // milestones
  rt::Mailbox<Wake, 512> wakes_;
  Phase phase_ = Phase::opening;
  rt::Time retry_at_{};
  bool retries_ = false;        // the round that begins is one of those
  rt::Time anew_at_{};          // the whole bus is not asked again before
  unsigned unread_rounds_ = 0;  // in a row in which a device was found and did not answer when its place was asked
  std::vector<LssAddress> puzzling_;  // devices whose probes did not tell their places when they were read last
  bool rest_wanted_ = false;      // somebody without a node-ID answered LSS: whoever RAND does not find is looked for
  rt::Time blank_at_{};           // such an answer is no news before
  rt::Time scanned_at_{};         // nor one to Fastscan's first question before
  bool by_fastscan_ = false;      // it was to that
  rt::Time rest_at_{};            // a slot without a device alone is no reason to look for them before
  bool search_open_ = false;      // the last search had no end yet
  bool open_configured_ = false;  // it looks for devices with a node-ID too
  Progress progress_;
  rt::Time progress_at_{};  // it is told again then
  bool alone_ = false;      // nobody acknowledged the opening: no node-ID is asked before a search got through
  bool once_ = false;       // `bind_once` runs: there is no later look
  unsigned looks_ = 0;
  bool idle_ = false;
  bool running_ = false;
  bool resting_ = false;
  bool look_anew_ = true;  // the next look asks everybody, not only who is unknown
  rt::Turn turn_;
  rt::Turn lss_turn_;  // of the bindings that run side by side, under the other
  rt::Scope scope_;  // last: its tasks use everything above
};

}  // namespace berth::operate
