// boot: runs the NMT startup of CiA 302-2 once for the devices in a bus's slots, and reports each one's error letter.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/network/managed_bus.hpp"
#include "berth/network/network_boot.hpp"
#include "berth/rt/scope.hpp"

namespace berth::command {
namespace {

using manager::BootStatus;
using network::NetworkBoot;
using network::SlavePhase;

// What is written to a slot's device before its start: its configuration (`config =`), else the heartbeat time of its
// bus.
class SlotSource final : public network::BootSource {
 public:
  /// `configures`: the slot has `config =`, or links.
  SlotSource(Network& network, const design::Slot& slot, bool configures) noexcept
      : network_(network), slot_(slot), configures_(configures) {}

  rt::Task<Result<void>> configure(network::BootTarget& target, manager::SlaveRules& rules) override {
    if (!configures_) co_return co_await set_heartbeat(target, rules);
    const auto done = co_await network_.configure(slot_.spec.name.name, true);
    if (!done) co_return fail(done.error());
    why_ = done->front().problem.empty() ? done->front().reason : done->front().problem;
    const bool good = done->front().problem.empty() && done->front().report.good();
    if (!good) co_return fail(Errc::invalid, "its file says what");
    co_return Result<void>{};
  }
  [[nodiscard]] const std::string& why() const noexcept { return why_; }

 private:
  // A device without a heartbeat is guarded, as by `berth up`.
  rt::Task<Result<void>> set_heartbeat(network::BootTarget& target, manager::SlaveRules& rules) {
    const design::Timing& timing = network_.bus().timing;
    const auto period = co::whole_ms(timing.heartbeat_period);
    const std::array<std::uint8_t, 2> bytes{static_cast<std::uint8_t>(period), static_cast<std::uint8_t>(period >> 8U)};
    auto written = co_await target.objects().write(0x1017, 0, bytes);
    if (written || written.error().code != Errc::aborted) co_return written;
    rules.heartbeat = {};
    rules.guard_time = timing.heartbeat_period;
    rules.retry_factor = static_cast<std::uint8_t>(timing.tries);
    co_return Result<void>{};
  }

  Network& network_;
  const design::Slot& slot_;
  bool configures_;
  std::string why_;
};

// The startup of one bus: its slots as a network list, and their results.
class BusBoot {
 public:
  BusBoot(Network& network, Session& session)
      : network_(network),
        session_(session),
        executor_(network.services().executor),
        bus_(network.services().dispatcher, network.services().sdo),
        boot_(executor_, bus_) {
    const design::Bus& line = network.bus();
    bus_.nmt().set_inhibit(line.startup.nmt_inhibit);
    bus_.lead_to(&boot_.error_control());
    boot_.observe([this](const network::NetworkEvent& event) { note(event); });
    plan_.startup = line.startup.rules;
    plan_.own = line.master;
    plan_.boot_time = line.startup.boot_time;
    for (const auto& slot : session.machine().slots) {
      if (slot.spec.name.bus == line.name) add(slot);
    }
  }

  /// Runs until each slave has started or failed, or until `limit` has passed.
  rt::Task<Result<void>> run(rt::Duration limit) {
    const auto begun = boot_.begin(plan_);
    if (!begun) co_return begun;
    const rt::Time deadline = executor_.now() + limit;
    while (!over() && executor_.now() < deadline) co_await rt::sleep_for(std::chrono::milliseconds(5));
    // A started device reports with its next heartbeat that it is operational.
    const rt::Time told = executor_.now() + network_.bus().timing.heartbeat_timeout;
    while (!all_told() && executor_.now() < told) co_await rt::sleep_for(std::chrono::milliseconds(5));
    co_return Result<void>{};
  }

  struct Tally {
    unsigned wrong = 0;   ///< not operational, and not optional
    unsigned silent = 0;  ///< never answered
  };
  void tell(Json& rows, std::vector<std::string>& lines, Tally& tally) const {
    for (std::size_t i = 0; i < slots_.size(); ++i) {
      const network::SlaveStatus slave = status(*slots_[i]);
      const bool good = slave.state == NmtState::operational;
      const bool needed = !slots_[i]->spec.optional;
      if (!good && needed) ++tally.wrong;
      if (letter_of(slave) == 'B') ++tally.silent;
      const std::string text = good ? std::string("operational") : trouble(i, slave);
      Json row;
      row["bus"] = network_.bus().name;
      row["id"] = slots_[i]->spec.id.value();
      row["slot"] = slots_[i]->spec.name.name;
      row["phase"] = name(slave.phase);
      if (letter_of(slave) != '\0') row["boot"] = std::string(1, letter_of(slave));
      if (slave.state) row["state"] = berth::name(*slave.state);
      if (answered_twice(i)) row["answered_twice"] = true;
      row["text"] = text;
      rows.push_back(std::move(row));
      lines.push_back(fmt::format(
          "{}  {:>3}  {}: {}{}", network_.bus().name, slots_[i]->spec.id.value(), slots_[i]->spec.name.name, text,
          answered_twice(i)
              ? "; an SDO request to it was answered twice: two devices have this node-ID; `berth bind` separates them"
              : ""));
    }
  }
  [[nodiscard]] const std::vector<std::string>& events() const noexcept { return events_; }

 private:
  void add(const design::Slot& slot) {
    sources_.push_back(std::make_unique<SlotSource>(network_, slot, session_.configures(slot)));
    slots_.push_back(&slot);
    surplus_.push_back(network_.services().sdo.surplus(slot.spec.id));
    network::NetworkSlave slave{slot.spec.id, {}, &bus_.target(slot.spec.id), sources_.back().get()};
    slave.rules.assigned = slave.rules.boots = true;
    slave.rules.mandatory = slot.spec.mandatory;
    slave.rules.device_type = slot.spec.device_type;
    slave.rules.vendor = slot.spec.type.vendor;
    slave.rules.product = slot.spec.type.product;
    if (slot.spec.rule == places::RevisionRule::exact) slave.rules.revision = slot.spec.revision.value_or(0);
    slave.rules.expected.hardware = slot.spec.software.hardware_number;
    slave.rules.heartbeat = network_.bus().timing.heartbeat_timeout;
    plan_.slaves.push_back(slave);
  }

  void note(const network::NetworkEvent& event) {
    using Kind = network::NetworkEvent::Kind;
    session_.tell(network_.bus().name, operate::EventKind::step, network::text(event));
    if (event.kind == Kind::halted || event.kind == Kind::not_sent)
      events_.push_back(fmt::format("{}: {}", network_.bus().name, network::text(event)));
  }

  [[nodiscard]] bool answered_twice(std::size_t i) const noexcept {
    return network_.services().sdo.surplus(slots_[i]->spec.id) != surplus_[i];
  }
  // Before the startup begins, `boot_` has no status yet.
  [[nodiscard]] network::SlaveStatus status(const design::Slot& slot) const {
    const network::SlaveStatus* const found = boot_.find(slot.spec.id);
    return found == nullptr ? network::SlaveStatus{} : *found;
  }
  [[nodiscard]] bool over() const {
    const bool stands = boot_.phase() == NetworkBoot::Phase::halted;
    return std::ranges::all_of(slots_, [&](const design::Slot* slot) {
      const SlavePhase phase = status(*slot).phase;
      return phase == SlavePhase::started || phase == SlavePhase::failed || (stands && phase == SlavePhase::ready);
    });
  }
  [[nodiscard]] bool all_told() const {
    return std::ranges::all_of(slots_, [&](const design::Slot* slot) {
      const network::SlaveStatus slave = status(*slot);
      return slave.phase != SlavePhase::started || slave.state == NmtState::operational;
    });
  }

  // A slave that never answered is asked until the end; its letter is B.
  [[nodiscard]] static char letter_of(const network::SlaveStatus& slave) {
    const bool silent = slave.phase == SlavePhase::idle || slave.phase == SlavePhase::booting;
    return manager::letter(silent ? BootStatus::b : slave.result.status);
  }

  [[nodiscard]] std::string trouble(std::size_t i, const network::SlaveStatus& slave) const {
    const char letter = letter_of(slave);
    if (slave.phase == SlavePhase::ready) return "ready, and not started: the startup is halted, or waits for the user";
    if (letter == '\0') return "it was started, and no heartbeat reported operational";
    const auto status = static_cast<BootStatus>(letter);
    const bool ended = slave.result.status == status;
    const std::string said = ended ? slave.result.text() : network::BootResult{.status = status}.text();
    const std::string& why = sources_[i]->why();
    return fmt::format("{}{}; {}", said, why.empty() ? "" : ": " + why, manager::advice(status));
  }

  Network& network_;
  Session& session_;
  rt::Executor& executor_;
  network::ManagedBus bus_;
  NetworkBoot boot_;
  network::NetworkPlan plan_;
  std::vector<std::unique_ptr<SlotSource>> sources_;
  std::vector<const design::Slot*> slots_;
  std::vector<std::uint32_t> surplus_;  // second answers of each slave, before the startup
  std::vector<std::string> events_;
};

rt::Task<void> run_one(BusBoot& boot, rt::Duration limit, Result<void>& result) { result = co_await boot.run(limit); }

rt::Duration limit_of(const design::Bus& bus) {
  return bus.startup.boot_time.count() > 0 ? rt::Duration(bus.startup.boot_time)
                                           : rt::Duration(bus.timing.boot_timeout);
}

}  // namespace

rt::Task<void> boot(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::command);
  if (!networks) co_return refuse(reply, 2, networks.error());
  if (session.started()) {
    co_return refuse(reply, 2, "`berth up` boots the devices of this machine by itself",
                     "`berth nmt reset-node NODE` boots one anew, `berth status` shows how it ended");
  }
  std::vector<std::unique_ptr<BusBoot>> boots;
  for (Network* const network : *networks) boots.push_back(std::make_unique<BusBoot>(*network, session));
  std::vector<Result<void>> results(boots.size());
  {
    rt::Scope side_by_side(session.executor());
    for (std::size_t i = 0; i < boots.size(); ++i) {
      side_by_side.spawn(run_one(*boots[i], limit_of((*networks)[i]->bus()), results[i]));
    }
    co_await side_by_side.join();
  }
  Json json;
  json["slots"] = Json::array();
  std::vector<std::string> lines;
  BusBoot::Tally tally;
  for (std::size_t i = 0; i < boots.size(); ++i) {
    if (!results[i]) co_return fail_with(reply, results[i].error(), fmt::format("bus {}", (*networks)[i]->bus().name));
    boots[i]->tell(json["slots"], lines, tally);
    for (const auto& event : boots[i]->events()) lines.push_back(event);
  }
  json["wrong"] = tally.wrong;
  const bool nobody = tally.silent == json["slots"].size();
  give(reply, json, std::move(lines));
  reply.status = tally.wrong == 0 ? 0 : 1;
  if (tally.wrong == 0) co_return;
  reply.error = fmt::format("{} device{} not operational{}", tally.wrong, tally.wrong == 1 ? " is" : "s are",
                            nobody ? "; if they have no node-IDs yet, `berth bind` gives them" : "");
}

}  // namespace berth::command
