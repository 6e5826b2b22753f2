#include "berth/operate/network.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/operate/configuration_intake.hpp"
#include "berth/operate/manager_objects.hpp"
#include "berth/places/take_over.hpp"

namespace berth::operate {

using places::SlotState;

namespace {

// The SDO manager of the bus, while Berth may send there and no other master is active.
void give_channels(BusServices& bus, const SlotTable& slots, od::Values& values) {
  bus.channels = std::make_unique<manager::SdoRequests>(bus.dispatcher, bus.sdo, values);
  bus.channels->begin_when_asked([&bus, &slots]() -> std::optional<manager::SdoManagerOptions> {
    const bool may = !bus.only_observes() && (!bus.master || bus.master->here);
    if (!may) return std::nullopt;
    manager::SdoManagerOptions options;
    for (const auto& seat : slots.seats()) options.nodes.push_back(seat->id());
    options.heartbeat = bus.bus.timing.heartbeat_timeout;
    // Planned channels stay: the manager takes back channels with CAN-IDs of its pool.
    options.pool.last -= 2 * static_cast<std::uint32_t>(bus.bus.channels.size());
    return options;
  });
}

}  // namespace

// Requests of SDO clients to the manager by its objects. A spawned task begins after the write that requested it.
class Network::Asked final : public ManagerObjects::Requests {
 public:
  Asked(Network& network, decltype(NetworkObserver::command) carry_out)
      : network_(network),
        carry_out_(std::move(carry_out)),
        objects_(network.port_.values(), network.parts_.bus, network.parts_.slots, network.parts_.agenda, *this) {}

 private:
  void command_nmt(co::NmtCommand command, co::NmtTarget target) override {
    network_.scope_.spawn(send(network_, command, target));
  }
  void configure(NodeId node) override { network_.scope_.spawn(bring(network_, node)); }
  void upload(NodeId node) override {
    for (const auto& seat : network_.parts_.slots.seats()) {
      const bool meant = node.configured() ? seat->id() == node : seat->there();
      if (!meant) continue;
      seat->configuration.upload = Uploading::under_way;
      network_.scope_.spawn(fetch(network_, seat->name()));
    }
  }
  od::AbortCode store(NodeId node, WrittenFiles::Form form, std::span<const std::uint8_t> bytes) override {
    ConfigurationIntake intake(network_.parts_.slots, network_.parts_.configuring);
    return intake.take(*network_.parts_.slots.at(node), form, bytes).code;
  }
  bool command(std::string text) override {
    if (!carry_out_) return false;
    return carry_out_(std::move(text),
                      [this](bool good, std::string reply) { objects_.answer(good, std::move(reply)); });
  }

  static rt::Task<void> send(Network& network, co::NmtCommand command, co::NmtTarget target) {
    const auto sent = co_await network.parts_.bus.nmt.send(command, target);
    if (sent) network.commanded(command, target);
  }
  static rt::Task<void> bring(Network& network, NodeId node) {
    const Seat* const seat = node.configured() ? network.parts_.slots.at(node) : nullptr;
    const std::string slot = seat != nullptr ? seat->name() : std::string();
    const auto done = co_await network.configure(slot, true);
    if (!done) network.parts_.slots.events().tell_failure("the configuration that 1F25h asked for", done.error());
  }

  static rt::Task<void> fetch(Network& network, std::string slot) {
    const auto done = co_await upload_slot(network, slot);
    if (!done || done->problem.empty()) co_return;
    network.parts_.slots.events().tell(EventKind::error, slot, "its configuration was not read: " + done->problem);
  }

  Network& network_;
  decltype(NetworkObserver::command) carry_out_;
  ManagerObjects objects_;
};

Network::Network(rt::Executor& executor, can::Port& port, std::string machine, const design::Bus& bus,
                 std::vector<places::SlotSpec> slots, places::SlotStore& store, const NetworkObserver& observer)
    : role_(bus.flying ? std::make_unique<RolePort>(executor, port) : nullptr),
      parts_(executor, role_ ? *role_ : port, std::move(machine), bus, std::move(slots), store, observer, relay_,
             relay_, relay_),
      port_(parts_.bus, parts_.slots, parts_.agenda, parts_.found, *this),
      job_(parts_, port_),
      scan_(parts_),
      mastership_(role_ ? std::make_unique<Mastership>(parts_.bus, parts_.slots, *role_) : nullptr),
      scope_(executor) {
  give_channels(parts_.bus, parts_.slots, port_.values());
  asked_ = std::make_unique<Asked>(*this, observer.command);
  relay_.lead_to(parts_.supervision);
  parts_.startup.set_master(port_);
  for (const auto& seat : parts_.slots.seats())
    parts_.bus.patience.times[seat->id().value()] = seat->slot.spec.watch.sdo_timeout;
}

Network::~Network() { stop(); }

Result<void> Network::open(const manager::SlotSettings& settings, const SlotDescriptions& descriptions,
                           WrittenFiles written) {
  const auto opened = parts_.slots.open();
  if (opened) parts_.configuring.load(settings, descriptions, std::move(written));
  return opened;
}

void Network::start() {
  if (running_) return;
  running_ = true;
  tell_written(parts_.slots, parts_.configuring.written());
  parts_.bus.heartbeats.hear_all_boot_ups(true);
  parts_.bus.emergencies.hear_all();
  if (mastership_) mastership_->start();
  if (port_.begin()) port_goes_on();
}

void Network::stop() noexcept {
  if (mastership_) mastership_->stop();
  port_rests();
  parts_.bus.emergencies.clear();
  port_.end();
  running_ = false;
}

void Network::port_rests() noexcept {
  parts_.bus.channels->end();
  scope_.cancel();
  parts_.startup.end();
  job_.ended();
}

void Network::port_goes_on() { scope_.spawn(job_.run()); }

void Network::commanded(co::NmtCommand command, co::NmtTarget target) {
  parts_.startup.commanded(command, target);
  if (parts_.startup.released()) parts_.agenda.wakes.push({Wake::Kind::look, {}, parts_.bus.executor.now()});
  parts_.supervision.commanded(command, target, running_);
}

void Network::try_again(NodeId slot) {
  Seat* const seat = parts_.slots.at(slot);
  if (seat == nullptr || !parts_.slots.happened(*seat, SlotEvent::tried_again)) return;
  parts_.agenda.wakes.push({Wake::Kind::look, slot, parts_.bus.executor.now()});
}

bool take_over(Network& network, const places::SlotSpec& spec) {
  Seat* const seat = network.parts_.slots.named(spec.name.name);
  if (seat == nullptr) return false;
  places::take_over(seat->slot.spec, spec);
  network.parts_.agenda.look_anew = true;
  network.parts_.agenda.wakes.push({Wake::Kind::look, seat->id(), network.parts_.bus.executor.now()});
  return true;
}

std::vector<Network::Occupancy> Network::occupancy() const {
  std::vector<Occupancy> slots;
  for (const auto& seat : parts_.slots.seats()) slots.push_back({seat->state(), seat->slot.record.device()});
  return slots;
}

Result<void> Network::replace(const std::string& slot, std::optional<Identity> device, bool used) {
  Seat* seat = parts_.slots.named(slot);
  if (seat == nullptr) return fail(Errc::not_found, "no slot of this name on this bus");
  if (used && !device) {
    const auto sits = seat->slot.record.confirmed;
    if (seat->there() && sits && parts_.slots.is_marked(places::Mark::looks_used, sits->device)) {
      parts_.slots.set_mark(places::Mark::restore, sits->device, seat->id(), "factory reset requested by operator");
      parts_.spares.make_welcome(sits->device);
      parts_.slots.happened(*seat, SlotEvent::tried_again, "it gets its factory settings");
      parts_.agenda.wakes.push({Wake::Kind::look, seat->id(), parts_.bus.executor.now()});
      return {};
    }
    const auto waits = parts_.planning.used_for(*seat);
    if (!waits) return fail(waits.error());
    device = *waits;
  }
  if (seat->life == Life::operational || (seat->there() && seat->state() == SlotState::present)) {
    return fail(
        Errc::invalid,
        "the slot's device is there; switch it off or take it off the bus first, and wait until the slot is absent");
  }
  if (device && !places::fits(seat->slot.spec, *device)) {
    return fail(Errc::invalid, "the device's vendor-ID, product code or revision is not the slot's");
  }
  const Seat* const sits = device ? parts_.slots.of(*device) : nullptr;
  if (sits != nullptr && sits != seat) return fail(places::sits_in(sits->slot.spec.name));
  const auto cleared = parts_.slots.clear(*seat, std::string(places::by_a_person));
  if (!cleared) return cleared;
  while (const auto* const loan = parts_.loans.to_another(seat->id(), device.value_or(Identity{}))) {
    const auto ended = parts_.loans.end(loan->device);
    if (!ended) return ended;
  }
  if (device) {
    parts_.spares.make_welcome(*device);
    const places::Assignment wanted{*device, seat->id()};
    const auto asked = parts_.slots.store().ask(seat->slot.record.slot, wanted, "named by the user");
    if (!asked) return asked;
    seat->slot.record.intended = wanted;
  }
  parts_.slots.events().tell_again();
  parts_.agenda.wakes.push({Wake::Kind::look, seat->id(), parts_.bus.executor.now()});
  return {};
}

Result<void> Network::forget(const Identity& device) {
  if (parts_.loans.of(device) != nullptr) {
    const auto ended = parts_.loans.end(device);
    if (!ended) return ended;
    parts_.slots.events().tell(EventKind::forgotten, "",
                               fmt::format("Berth no longer waits for {}", to_string(device)));
    return {};
  }
  if (!parts_.planning.waits_for(device)) {
    return fail(Errc::not_found, "Berth does not wait for this device on this bus");
  }
  const auto dropped =
      parts_.slots.store().drop_blank(parts_.slots.known(device), "the user said that it will not come back");
  if (!dropped) return dropped;
  parts_.planning.drop_unfinished(device);
  parts_.slots.events().tell(EventKind::forgotten, "", fmt::format("Berth no longer waits for {}", to_string(device)));
  return {};
}

rt::Task<Result<std::vector<SlotConfiguration>>> Network::configure(std::string slot, bool write) {
  co_await parts_.bus.turn.take();
  const rt::Held held(parts_.bus.turn);
  std::vector<Seat*> chosen;
  for (auto& seat : parts_.slots.seats()) {
    const bool named = slot.empty() ? seat->configuration.any() : seat->name() == slot;
    if (named) chosen.push_back(seat.get());
  }
  if (!slot.empty() && chosen.empty()) co_return fail(Errc::not_found, "no slot of this name on this bus");
  std::vector<SlotConfiguration> results(chosen.size());
  {
    rt::Scope side_by_side(parts_.bus.executor, parts_.asking.most_at_once());
    for (std::size_t i = 0; i < chosen.size(); ++i)
      side_by_side.spawn(parts_.configuring.compare(*chosen[i], write, results[i]));
    co_await side_by_side.join();
  }
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    results[i].state = chosen[i]->state();
    results[i].reason = chosen[i]->reason;
  }
  co_return results;
}

bool is_configured(const Network& network, const std::string& slot) {
  const Seat* const seat = network.parts_.slots.named(slot);
  return seat != nullptr && seat->configuration.any();
}

tl::expected<std::string, std::string> give_configuration(Network& network, const std::string& slot,
                                                          WrittenFiles::Form form, std::span<const std::uint8_t> bytes,
                                                          const std::string& file) {
  NetworkParts& parts = network.parts_;
  Seat* const seat = parts.slots.named(slot);
  if (seat == nullptr) return tl::unexpected<std::string>("no slot of this name on this bus");
  ConfigurationIntake intake(parts.slots, parts.configuring);
  auto answer = intake.take(*seat, form, bytes, file);
  if (answer.code != od::AbortCode::none) return tl::unexpected(std::move(answer.words));
  return std::move(answer.words);
}

rt::Task<Result<SlotUpload>> upload_slot(Network& network, std::string slot) {
  NetworkParts& parts = network.parts_;
  co_await parts.bus.turn.take();
  const rt::Held held(parts.bus.turn);
  Seat* const seat = parts.slots.named(slot);
  if (seat == nullptr) co_return fail(Errc::not_found, "no slot of this name on this bus");
  SlotUpload upload;
  co_await parts.configuring.upload(*seat, upload);
  co_return upload;
}

Result<void> poll_slot(Network& network, const std::string& slot, bool on) {
  NetworkParts& parts = network.parts_;
  Seat* const seat = parts.slots.named(slot);
  if (seat == nullptr) return fail(Errc::not_found, "no slot of this name on this bus");
  if (!on && !seat->slot.spec.optional) {
    return fail(Errc::invalid, "the slot is not optional: its device is asked for until it is found");
  }
  if (!on && seat->is_accounted_for()) return fail(Errc::invalid, "the slot's device is there");
  if (seat->polled == on) return {};
  seat->polled = on;
  if (!on) {
    seat->ask_again = false;
    parts.slots.events().tell(EventKind::step, slot, "it is not asked for any more, until it is heard or polled again");
    return {};
  }
  parts.slots.events().tell(EventKind::step, slot, "it is asked for again");
  parts.agenda.look_anew = true;
  parts.agenda.anew_at = parts.agenda.retry_at = parts.bus.executor.now();
  parts.finding.configured.look_again_at(seat->id());
  parts.agenda.wakes.push({Wake::Kind::look, seat->id(), parts.bus.executor.now()});
  return {};
}

}  // namespace berth::operate
