#include "berth/operate/network.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/discovery/auto.hpp"
#include "berth/operate/master_device.hpp"
#include "berth/operate/network_seat.hpp"
#include "berth/operate/timing_options.hpp"
#include "berth/text/quantity.hpp"

namespace berth::operate {

using places::SlotState;

const char* name(Phase phase) noexcept {
  switch (phase) {
    case Phase::opening: return "opening";
    case Phase::preparation: return "preparation";
    case Phase::discovery: return "discovery";
    case Phase::binding: return "binding";
    case Phase::start: return "start";
    case Phase::watch: return "watch";
  }
  return "";
}

namespace {

// RAND has been asked before.
constexpr discovery::AutoOptions only_the_rest{.rand = false, .configured = false};

}  // namespace

Network::Network(rt::Executor& executor, can::Port& port, const design::Bus& bus, std::vector<places::SlotSpec> slots,
                 places::SlotStore& store, NetworkObserver observer)
    : executor_(&executor),
      bus_(&bus),
      port_(&port),
      restart_(*this),
      store_(&store),
      observer_(std::move(observer)),
      dispatcher_(executor, port),
      lss_(dispatcher_, lss_options(bus.timing)),
      rand_(dispatcher_),
      sdo_(dispatcher_, sdo_options(bus.timing)),
      nmt_(dispatcher_),
      heartbeats_(dispatcher_, *this),
      emergencies_(dispatcher_, *this),
      boots_(dispatcher_),
      rand_planner_(discovery::make(discovery::Method::planner_rand, {dispatcher_, lss_})),
      rest_(std::make_unique<discovery::Auto>(discovery::Services{dispatcher_, lss_}, only_the_rest)),
      device_(std::make_unique<MasterDevice>(dispatcher_, bus.master, bus.timing.heartbeat_period)),
      loans_(store, slots.empty() ? std::string() : slots.front().name.machine, bus.name),
      wakes_(executor),
      scope_(executor) {
  for (auto& spec : slots) {
    seats_.push_back(std::make_unique<Seat>());
    seats_.back()->slot.spec = std::move(spec);
  }
  sdo_.set_observer(this);
  // One that leaves between its last heartbeat before it is watched and the first after is missed too.
  heartbeats_.set_never_seen_time(bus.timing.heartbeat_timeout + bus.timing.heartbeat_period);
  // A saving may be answered long after it was given up.
  sdo_.set_late_window(std::max<rt::Duration>(std::chrono::seconds(5), 2 * bus.timing.save_timeout));
}

Network::~Network() { stop(); }

Result<void> Network::open() {
  for (auto& seat : seats_) {
    auto slot = store_->declare(seat->slot.spec.name);
    if (!slot) return fail(slot.error());
    seat->slot.record.slot = *slot;
    seat->slot.record.name = seat->slot.spec.name;
    refresh(*seat);
  }
  load_configurations();
  return {};
}

void Network::refresh(Seat& seat) {
  auto record = store_->load(seat.slot.record.slot);
  if (!record) return tell("error", seat.name(), "the slot table cannot be read: " + describe(record.error()));
  seat.slot.record = std::move(*record);
}

void Network::start() {
  if (running_) return;
  running_ = true;
  dispatcher_.on_status(this);
  heartbeats_.hear_all_boot_ups(true);
  emergencies_.hear_all();
  if (!usable(port_->status())) {
    resting_ = true;
    return;
  }
  scope_.spawn(job());
}

void Network::stop() noexcept {
  scope_.cancel();
  dispatcher_.on_status(nullptr);
  emergencies_.clear();
  restart_.cancel();
  running_ = resting_ = false;
  idle_ = false;
}

bool Network::usable(const can::Status& status) const noexcept {
  return status.up && (bus_->role == design::Role::observer || !status.listen_only);
}

// A port that was away may hang on another machine now, and devices may have been changed meanwhile: everything that
// was known of them is asked anew, as after a start.
void Network::rest_or_go_on(const can::Status& status) {
  if (!running_) return;
  if (!usable(status) && !resting_) {
    go_to_rest(status.up ? "the port takes no frame of Berth's"
                         : "the port is down; what is wrong with cable, adapter or "
                           "interface? Berth waits for it");
  } else if (usable(status) && resting_) {
    resting_ = false;
    look_anew_ = true;
    tell("step", "", "the port takes frames: looking who is there");
    scope_.spawn(job());
  }
}

void Network::go_to_rest(const std::string& why) {
  resting_ = true;
  scope_.cancel();
  idle_ = false;
  fall_silent();
  vacancy_ = {};
  found_.clear();
  told_.clear();
  for (auto& seat : seats_) {
    heartbeats_.supervise(seat->id(), rt::Duration{0});
    seat->there = seat->started = false;
    seat->checked = {};
    set_state(*seat, SlotState::unknown, why);
  }
  tell("error", "", why);
}

// The master's own messages begin when nobody else was found under its node-ID: two nodes that boot under one node-ID
// and have nobody to acknowledge them would repeat their messages against each other for ever.
void Network::speak() {
  const auto& vacant = vacancy_[bus_->master.value()];
  const bool free = vacant && boots_.silent_since(bus_->master, *vacant);
  if (speaks_ || !free || bus_->role == design::Role::observer || port_->status().error_passive()) return;
  speaks_ = true;
  device_->power_on();
}

void Network::changed(const can::Status& status, rt::Time) noexcept {
  if (status.error_passive() && speaks_) {
    // Something on the bus works against what this node sends: be silent, look who it is, and speak again after that.
    speaks_ = false;
    device_->power_off();
    vacancy_[bus_->master.value()].reset();
    look_anew_ = true;
    tell("error", "",
         "this port is error-passive: is a wire loose, or another node at a wrong bit rate or with our node-ID?");
  }
  if (status.bus_off && !restart_.timed()) way_out_of_bus_off();
  rest_or_go_on(status);
}

void Network::way_out_of_bus_off() {
  const auto& timing = bus_->timing;
  if (bus_->bus_off == design::BusOff::stay) {
    return tell_once("error",
                     "this port is bus-off and stays so (bus_off = \"stay\"); find the fault, then start anew");
  }
  const auto calm = std::max<rt::Duration>(10 * timing.bus_off_pause, std::chrono::seconds(10));
  if (restarts_ > 0 && executor_->now() - restarted_ > calm) restarts_ = 0;
  if (timing.bus_off_limit > 0 && restarts_ >= timing.bus_off_limit) {
    return tell_once("error", fmt::format("this port is bus-off again after {} restarts (bus_off_limit), and stays so; "
                                          "find the fault, then start anew",
                                          restarts_));
  }
  tell("error", "",
       fmt::format("this port is bus-off; it is started again in {}", text::write_duration(timing.bus_off_pause)));
  executor_->after(timing.bus_off_pause, restart_);
}

void Network::Restart::run() noexcept {
  network_.tell("step", "", "starting the port again after bus-off");
  ++network_.restarts_;
  network_.restarted_ = network_.executor_->now();
  // Its own: the network may have moved to another (network_bitrate.hpp).
  const auto rate = network_.port_->status().bit_rate;
  network_.port_->restart(rate != 0 ? rate : network_.bus_->bitrate);
  network_.look_anew_ = true;
}

// ---- what others see ----

std::vector<SlotReport> Network::report() const {
  std::vector<SlotReport> slots;
  for (const auto& seat : seats_) {
    slots.push_back({bus_->name, seat->id(), seat->name(), seat->slot.spec.type, seat->slot.record.device(),
                     seat->state, seat->since, seat->reason});
  }
  std::ranges::sort(slots, {}, &SlotReport::id);
  return slots;
}

std::vector<Network::Occupancy> Network::occupancy() const {
  std::vector<Occupancy> slots;
  for (const auto& seat : seats_) slots.push_back({seat->state, seat->slot.record.device()});
  return slots;
}

bool Network::operational() const noexcept {
  return std::ranges::all_of(seats_,
                             [](const auto& s) { return s->slot.spec.optional || s->state == SlotState::operational; });
}

Network::Slots Network::slots() const {
  Slots slots;
  for (const auto& seat : seats_) slots.push_back(seat->slot);
  return slots;
}

Network::Seat* Network::seat_at(NodeId id) noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->id() == id; });
  return it == seats_.end() ? nullptr : it->get();
}

Network::Seat* Network::seat_named(const std::string& name) noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->name() == name; });
  return it == seats_.end() ? nullptr : it->get();
}

Network::Seat* Network::seat_of(const LssAddress& device) noexcept {
  const auto it = std::ranges::find_if(seats_, [&](const auto& s) { return s->slot.record.device() == device; });
  return it == seats_.end() ? nullptr : it->get();
}

// ---- what is told ----

void Network::tell(std::string kind, std::string slot, std::string text) {
  if (observer_.event)
    observer_.event({executor_->now(), bus_->name, std::move(kind), std::move(slot), std::move(text)});
}

void Network::set_state(Seat& seat, SlotState state, std::string reason) {
  if (seat.state == state && seat.reason == reason) return;
  if (seat.state != state) seat.since = executor_->now();
  seat.state = state;
  seat.reason = std::move(reason);
  tell("state", seat.name(),
       seat.reason.empty() ? places::name(state) : fmt::format("{}: {}", places::name(state), seat.reason));
}

void Network::reach(const char* milestone) {
  if (std::ranges::find(reached_, milestone) != reached_.end()) return;
  reached_.emplace_back(milestone);
  tell("milestone", "", milestone);
  if (observer_.milestone) observer_.milestone(milestone);
}

void Network::tell_once(const std::string& kind, const std::string& text) {
  if (std::ranges::find(told_, text) != told_.end()) return;
  told_.push_back(text);
  tell(kind, "", text);
}

void Network::report_plan() {
  for (const auto& oddity : plan_.oddities) {
    tell_once(oddity.kind, oddity.text);
    for (auto& seat : seats_) {
      const bool waits = oddity.kind == "fixed mismatch" && !seat->slot.record.device();
      if (waits && places::fits(seat->slot.spec, oddity.device)) set_state(*seat, SlotState::empty, oddity.text);
    }
    if (oddity.kind != "clone") continue;
    for (auto& seat : seats_) {
      const auto device = seat->slot.record.device();
      const bool own = device == oddity.device;
      const bool waits = !device && places::fits(seat->slot.spec, oddity.device);
      if (own || waits) set_state(*seat, SlotState::duplicate, oddity.text);
    }
  }
  if (search_open_) return;  // who is missing may be found yet
  for (const auto& event : question_events()) {
    if (std::ranges::find(told_, event.text) != told_.end()) continue;
    told_.push_back(event.text);
    if (observer_.event) observer_.event(event);
  }
  std::vector<const Seat*> asked;
  for (const auto& question : plan_.questions) {
    for (const auto i : question.slots) {
      set_state(*seats_[i], SlotState::question, question.text);
      asked.push_back(seats_[i].get());
    }
  }
  // Its devices left, or sit elsewhere by now.
  for (auto& seat : seats_) {
    const bool over = seat->state == SlotState::question && !seat->slot.record.device() &&
                      std::ranges::find(asked, seat.get()) == asked.end();
    if (over) set_state(*seat, SlotState::empty, "no device of its type was found");
  }
}

std::vector<Event> Network::question_events() const {
  std::vector<Event> events;
  for (const auto& question : plan_.questions) {
    Event event{executor_->now(), bus_->name, "question", {}, question.text};
    for (const auto i : question.slots) event.slots.push_back(seats_[i]->name());
    for (const auto& device : question.devices) event.devices.push_back(to_string(device));
    events.push_back(std::move(event));
  }
  return events;
}

void Network::make_plan() {
  send_home();
  for (auto& f : found_) {
    const auto* const loan = loans_.of(f.device);
    f.lent = loan != nullptr && loan->id == f.active;
  }
  const std::vector<places::Found> found = without_used();
  plan_ = places::plan(slots(), found, blanks_to_finish(), bus_->master, readings_);
  name_unfinished();
  name_loans();
  ask_about_used();
  name_returned();
  respect_fixed();
}

// ---- what the bus tells ----

// The last one of a device since its boot-up, while it has an error.
void Network::emergency(NodeId node, const co::Emcy& message, rt::Time) noexcept {
  Seat* seat = seat_at(node);
  if (seat == nullptr) return;
  if (message.code == co::emcy_code::error_reset) {
    seat->emergency.reset();
  } else if ((message.code >> 8U) != 0) {
    seat->emergency = message;
  }
}

void Network::heartbeat(const co::HeartbeatEvent& event, rt::Time at) noexcept {
  using Kind = co::HeartbeatEvent::Kind;
  Wake wake{Wake::Kind::look, event.node, at};
  switch (event.kind) {
    case Kind::boot_up: wake.kind = Wake::Kind::boot_up; break;
    case Kind::lost:
    case Kind::never_seen: wake.kind = Wake::Kind::lost; break;
    case Kind::recovered: wake.kind = Wake::Kind::recovered; break;
    case Kind::started:
    case Kind::state_changed: wake.kind = Wake::Kind::state; break;
  }
  Seat* seat = seat_at(event.node);
  if (seat != nullptr && event.kind == Kind::boot_up) seat->emergency.reset();
  if (seat != nullptr && seat->there && seat->started && event.state == NmtState::operational &&
      wake.kind == Wake::Kind::state && seat->state != SlotState::duplicate) {
    set_state(*seat, SlotState::operational);
    if (operational()) reach("operational");
    return;
  }
  wakes_.push(wake);
}

// A second answer to one SDO request: two devices hold this node-ID, or another SDO client is at work.
void Network::surplus(NodeId node, const can::Frame& frame, rt::Time) noexcept {
  if (shared_ && shared_->id == node) return note_shared(frame);
  look_anew_ = true;
  if (Seat* const seat = seat_at(node)) {
    seat->suspect = true;
    seat->shared = most_tries_apart;
  }
  const std::string text = fmt::format(
      "node {} answered one SDO request twice: two devices hold this node-ID, or another "
      "SDO client is on the bus",
      node.value());
  tell_once("duplicate", text);
}

// Two devices with one identity that once fell into one frame drift apart: their heartbeats then come twice as often.
void Network::check_rates() {
  for (auto& seat : seats_) {
    const auto beats = boots_.beats(seat->id());
    const auto elapsed = executor_->now() - seat->beats_at;
    const auto period = bus_->timing.heartbeat_period;
    if (seat->state != SlotState::operational || period.count() == 0 || elapsed < 4 * period) {
      if (seat->state != SlotState::operational) {
        seat->beats = beats;
        seat->beats_at = executor_->now();
      }
      continue;
    }
    const auto expected = elapsed / period + 1;
    seat->fast = static_cast<std::int64_t>(beats - seat->beats) * 2 > expected * 3 ? seat->fast + 1 : 0;
    seat->beats = beats;
    seat->beats_at = executor_->now();
    if (seat->fast >= 2) {
      seat->suspect = true;
      seat->shared = most_tries_apart;
      look_anew_ = true;
      set_state(*seat, SlotState::duplicate,
                "its heartbeat comes too often: a second device holds this node-ID; take one of them off the bus");
    }
  }
}

// ---- commands ----

void Network::commanded(co::NmtCommand command, co::NmtTarget target) noexcept {
  for (auto& seat : seats_) {
    if (!target.includes(seat->id())) continue;
    seat->held = command == co::NmtCommand::stop || command == co::NmtCommand::enter_pre_operational;
  }
}

Result<void> Network::clear_seat(Seat& seat, const std::string& reason) {
  const auto cleared = store_->clear(seat.slot.record.slot, reason);
  if (!cleared) return cleared;
  heartbeats_.supervise(seat.id(), rt::Duration{0});
  seat.slot.record.asked.reset();
  seat.slot.record.confirmed.reset();
  seat.there = seat.started = false;
  seat.slot.record.configured.reset();
  seat.waiting.reset();
  seat.waits_since.reset();
  seat.stuck = false;
  seat.failed_savings = 0;
  set_state(seat, SlotState::empty, reason);
  return {};
}

Result<void> Network::replace(const std::string& slot, std::optional<LssAddress> device, bool used) {
  Seat* seat = seat_named(slot);
  if (seat == nullptr) return fail(Errc::not_found, "no slot of this name on this bus");
  if (used && !device) {
    const auto sits = seat->slot.record.confirmed;
    if (seat->there && sits && is_marked(places::Mark::looks_used, sits->device)) {
      set_mark(places::Mark::restore, sits->device, seat->id(), "a person said that it may be used");
      make_welcome(sits->device);
      set_state(*seat, SlotState::present, "it gets its factory settings");
      wakes_.push({Wake::Kind::look, seat->id(), executor_->now()});
      return {};
    }
    const auto waits = used_for(*seat);
    if (!waits) return fail(waits.error());
    device = *waits;
  }
  if (seat->state == SlotState::operational || (seat->there && seat->state == SlotState::present)) {
    return fail(Errc::invalid, "the slot's device is there and answers; switch it off or take it off the bus first");
  }
  if (device && !places::fits(seat->slot.spec, *device)) {
    return fail(Errc::invalid, "the device's vendor-ID, product code or revision is not the slot's");
  }
  const auto cleared = clear_seat(*seat, std::string(places::by_a_person));
  if (!cleared) return cleared;
  while (const auto* const loan = loans_.to_another(seat->id(), device.value_or(LssAddress{}))) {
    const auto ended = loans_.end(loan->device);
    if (!ended) return ended;
  }
  if (device) {
    make_welcome(*device);
    const places::Seat wanted{*device, seat->id()};
    const auto asked = store_->ask(seat->slot.record.slot, wanted, "named by a person");
    if (!asked) return asked;
    seat->slot.record.asked = wanted;
  }
  told_.clear();
  wakes_.push({Wake::Kind::look, seat->id(), executor_->now()});
  return {};
}

}  // namespace berth::operate
