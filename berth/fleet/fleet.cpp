#include "berth/fleet/fleet.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "berth/fleet/edge.hpp"
#include "berth/fleet/poller.hpp"
#include "berth/fleet/reporter.hpp"
#include "berth/fleet/settings.hpp"
#include "berth/mqtt/where.hpp"
#include "berth/traffic/link_network.hpp"

namespace berth::fleet {
namespace {

tl::expected<std::vector<Signal>, std::string> signals_of(const design::Machine& machine) {
  std::optional<traffic::LinkPlan> links;
  if (!machine.links.empty()) links = traffic::plan_links(machine);
  const bool good = links && !has_errors(links->findings);  // wrong links have been reported
  auto plan = plan_signals(machine, good ? &*links : nullptr);
  if (!has_errors(plan.findings)) return std::move(plan.signals);
  std::string lines;
  for (const auto& finding : plan.findings) lines += (lines.empty() ? "" : "\n") + to_string(finding);
  return tl::unexpected(std::move(lines));
}

}  // namespace

/// In the order of need: later ones use those before.
class Fleet::Impl {
 public:
  Impl(std::vector<Signal> chosen, const design::Machine& machine)
      : signals(std::move(chosen)), table(signals, machine.buses.size()) {
    for (const auto& bus : machine.buses) buses.push_back(bus.name);
  }

  void begin(tree::Session& session, const Carry& carry, const Clock& clock, const std::string& version) {
    design::BusCommands allowed;
    if (session.machine().mqtt) allowed = session.machine().mqtt->commands;
    reporter.emplace(session, signals, table, link, clock, Reporter::Options{version, allowed},
                     [this] { edge->wake(); });
    desk.emplace(session, signals, carry, link, clock, CommandDesk::Options{"mqtt, " + broker, allowed}, [this] {
      reporter->event();
      edge->wake();
    });
    poller.emplace(session, signals, table, carry);
  }

  std::vector<Signal> signals;
  SignalTable table;
  std::vector<std::string> buses;
  std::string broker;
  std::string where;
  Link link;
  std::unique_ptr<Thread> own_thread;
  std::unique_ptr<Edge> edge;
  std::optional<Reporter> reporter;
  std::optional<CommandDesk> desk;
  std::optional<Poller> poller;
};

Fleet::Fleet(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}

Fleet::~Fleet() {
  impl_->poller.reset();
  impl_->desk.reset();
  impl_->reporter->look_now();
  impl_->reporter.reset();
  impl_->edge.reset();
}

tl::expected<std::unique_ptr<Fleet>, std::string> Fleet::start(tree::Session& session, Carry carry, const Clock& clock,
                                                               Random random, const Options& options) {
  const auto& machine = session.machine();
  auto settings = edge_options(machine, options.broker, options.backlog_file);
  if (!settings) return tl::unexpected(settings.error());
  auto signals = signals_of(machine);
  if (!signals) return tl::unexpected(signals.error());
  auto impl = std::make_unique<Impl>(std::move(*signals), machine);
  Thread* thread = options.thread;
  if (thread == nullptr) {
    auto own = Thread::start();
    if (!own) return tl::unexpected(own.error());
    impl->own_thread = std::move(*own);
    thread = impl->own_thread.get();
  }
  impl->broker = mqtt::to_string(settings->connection.where);
  impl->where = fmt::format("{}, as {}/{}", impl->broker, settings->id.group, settings->id.node);
  auto edge = Edge::start(*thread, std::move(*settings), impl->link, clock, random);
  if (!edge) return tl::unexpected(edge.error());
  impl->edge = std::move(*edge);
  impl->begin(session, carry, clock, options.version);
  return std::unique_ptr<Fleet>(new Fleet(std::move(impl)));
}

void Fleet::event() noexcept { impl_->reporter->event(); }

std::optional<std::size_t> Fleet::bus(std::string_view name) const noexcept {
  const auto found = std::ranges::find(impl_->buses, name);
  if (found == impl_->buses.end()) return std::nullopt;
  return static_cast<std::size_t>(found - impl_->buses.begin());
}

void Fleet::frame(std::size_t bus, const can::Frame& frame, rt::Time at) noexcept {
  impl_->table.frame(bus, frame, at);
}

void Fleet::frame(std::string_view bus, const can::Frame& frame, rt::Time at) noexcept {
  if (const auto number = this->bus(bus)) impl_->table.frame(*number, frame, at);
}

const std::string& Fleet::where() const noexcept { return impl_->where; }

}  // namespace berth::fleet
