#include "berth/fleet/reporter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "berth/fleet/commands.hpp"

namespace berth::fleet {
namespace {

using sparkplug::DataType;
using sparkplug::Null;
using sparkplug::Quality;
using sparkplug::Value;

}  // namespace

Reporter::Reporter(tree::Session& session, const std::vector<Signal>& signals, SignalTable& table, Link& link,
                   const Clock& clock, Options options, std::function<void()> wake)
    : session_(&session),
      signals_(&signals),
      table_(&table),
      link_(&link),
      clock_(&clock),
      options_(std::move(options)),
      wake_(std::move(wake)),
      slots_(session.machine().slots.size()),
      told_(signals.size()),
      loads_(session.machine().buses.size()),
      tick_(*this, session.executor()) {
  for (std::size_t i = 0; i < signals.size(); ++i) slots_[signals[i].slot].signals.push_back(i);
  figures_at_ = session.executor().now();
  tick_.post();
}

// ---- handing over

bool Reporter::put(News news) {
  if (!link_->news.put(news)) return false;
  put_ = true;
  return true;
}

sparkplug::Utc Reporter::utc_of(rt::Time at) const {
  const auto now = clock_->now().utc.ms;
  const auto age = std::chrono::duration_cast<std::chrono::milliseconds>(session_->executor().now() - at).count();
  return {age <= 0 ? now : now - std::min(now, static_cast<std::uint64_t>(age))};
}

void Reporter::tick() noexcept {
  look_now();
  tick_.arm(period);
}

void Reporter::look_now() {
  const rt::Time now = session_->executor().now();
  if (!node_told_) tell_node();
  if (node_told_) {
    if (look_ || now - looked_ >= slow_period) tell_slots();
    tell_signals();
    if (now - figures_at_ >= figures_period) tell_buses();
  }
  if (std::exchange(put_, false)) wake_();
}

// ---- the node

BusFigures Reporter::figures_of(std::size_t bus) {
  const auto& line = session_->machine().buses[bus];
  BusFigures figures{.name = line.name, .load_percent = loads_[bus]};
  auto* const network = session_->network(line.name);
  if (network == nullptr) return figures;
  const auto& services = network->services();
  figures.port = services.port.status();
  if (services.master) {
    figures.master = services.master->text();
  } else if (line.role == design::Role::master) {
    figures.master = fmt::format("node {}, this Berth", line.master.value());
  } else {
    figures.master = "not this Berth";
  }
  return figures;
}

Facts Reporter::node_facts() {
  Facts facts{{"Machine/Operational", DataType::boolean, session_->operational()}};
  for (std::size_t i = 0; i < session_->machine().buses.size(); ++i) {
    auto of_bus = facts_of_bus(figures_of(i));
    std::ranges::move(of_bus, std::back_inserter(facts));
  }
  return facts;
}

void Reporter::tell_node() {
  const auto at = clock_->now().utc;
  Facts facts = node_facts();
  News news{.kind = News::Kind::node};
  news.metrics.push_back({.name = "Berth/Version", .type = DataType::string, .value = options_.version, .at = at});
  news.metrics.push_back({.name = done_metric, .type = DataType::data_set, .value = Null{}, .at = at});
  news.metrics.push_back({.name = refused_metric, .type = DataType::data_set, .value = Null{}, .at = at});
  const auto add = [&](std::vector<sparkplug::OwnMetric> metrics) {
    std::ranges::move(metrics, std::back_inserter(news.metrics));
  };
  add(metrics_of(facts, at));
  const auto slots = session_->slots();
  for (const auto& slot : slots) add(metrics_of(facts_of_slot(slot), at));
  add(node_commands(session_->machine(), options_.allowed, at));
  if (!put(std::move(news))) return;
  told_node_ = std::move(facts);
  for (const auto& slot : slots) {
    if (ToldSlot* const told = slot_of(slot)) told->of_slot = facts_of_slot(slot);
  }
  node_told_ = true;
}

void Reporter::tell_buses() {
  const rt::Time now = session_->executor().now();
  const double seconds = std::chrono::duration<double>(now - figures_at_).count();
  figures_at_ = now;
  constexpr double coarse = 5;  // percent: less is no news
  for (std::size_t i = 0; i < loads_.size(); ++i) {
    const auto bits = static_cast<double>(table_->take_bits(i));
    const double load = 100 * bits / (seconds * session_->machine().buses[i].bitrate);
    if (std::abs(load - loads_[i]) >= coarse || load < 1) loads_[i] = load < 1 ? 0 : load;
  }
  static_cast<void>(tell_facts("", node_facts(), told_node_));
}

// False: the queue is full; the rest is told later.
bool Reporter::tell_facts(const std::string& device, const Facts& now, Facts& told) {
  const auto at = clock_->now().utc;
  for (std::size_t i = 0; i < std::min(now.size(), told.size()); ++i) {
    if (sparkplug::same(now[i].value, told[i].value)) continue;
    if (!put({.device = device, .metric = now[i].name, .value = now[i].value, .at = at})) return false;
    told[i].value = now[i].value;
  }
  return true;
}

// ---- slots

void Reporter::tell_slots() {
  look_ = false;
  looked_ = session_->executor().now();
  // What a person looks at first is told at once; figures of buses have their own pace.
  Facts first{{"Machine/Operational", DataType::boolean, session_->operational()}};
  const std::span<Fact> told(told_node_.data(), 1);
  if (!sparkplug::same(first[0].value, told[0].value)) {
    if (!put({.metric = first[0].name, .value = first[0].value, .at = clock_->now().utc})) return;
    told[0].value = first[0].value;
  }
  for (const auto& slot : session_->slots()) {
    ToldSlot* const told_slot = slot_of(slot);
    if (told_slot == nullptr || (told_slot->slot && same(slot, *told_slot->slot))) continue;
    if (!tell_slot(static_cast<std::size_t>(told_slot - slots_.data()), slot)) {
      look_ = true;
      return;
    }
    told_slot->slot = slot;
  }
}

ToldSlot* Reporter::slot_of(const operate::SlotReport& slot) {
  const auto& all = session_->machine().slots;
  const auto* const place = session_->machine().slot(slot.bus, slot.id);
  return place == nullptr ? nullptr : &slots_[static_cast<std::size_t>(place - all.data())];
}

bool Reporter::tell_slot(std::size_t index, const operate::SlotReport& now) {
  ToldSlot& told = slots_[index];
  const auto& slot = session_->machine().slots[index];
  const auto& name = slot.spec.name.name;
  if (!tell_facts("", facts_of_slot(now), told.of_slot)) return false;
  const bool there = is_there(now, told.born);
  const bool another = told.born && there && told.slot && told.slot->device != now.device;
  if (told.born && (!there || another)) {
    if (!put({.kind = News::Kind::died, .device = name})) return false;
    told.born = false;
    for (const auto signal : told.signals) table_->forget(signal);
  }
  if (!there) return true;
  const auto& software = slot.spec.software;
  const Facts facts = facts_of_device(now, {.configuration = session_->configures(slot),
                                            .programs = !software.programs.empty() || !software.version.empty()});
  return told.born ? tell_facts(name, facts, told.of_device) : tell_birth(index, facts);
}

bool Reporter::tell_birth(std::size_t index, const Facts& facts) {
  ToldSlot& told = slots_[index];
  const auto at = clock_->now().utc;
  News news{.kind = News::Kind::born, .device = session_->machine().slots[index].spec.name.name};
  news.metrics = metrics_of(facts, at);
  for (const auto& more : {device_commands(options_.allowed, at), signal_metrics(index)})
    news.metrics.insert(news.metrics.end(), more.begin(), more.end());
  if (!put(std::move(news))) return false;
  told.born = true;
  told.of_device = facts;
  for (const auto signal : told.signals) note_told(signal);
  return true;
}

// ---- chosen values

Value Reporter::value_of(std::size_t index) const {
  const auto& state = table_->state(index);
  if (!state.known) return Null{};
  if ((*signals_)[index].data_type() == DataType::string) return state.text;
  return (*signals_)[index].value(state.raw);
}

Quality Reporter::quality_of(std::size_t index) const {
  const auto& state = table_->state(index);
  const auto& signal = (*signals_)[index];
  if (state.failed) return Quality::bad;
  if (!state.known) return Quality::stale;
  const auto& slot = slots_[signal.slot].slot;
  const bool sends = slot && slot->state == places::SlotState::operational;
  const bool old = signal.timeout.count() > 0 && session_->executor().now() - state.at > signal.timeout;
  return sends && !old ? Quality::good : Quality::stale;
}

std::vector<sparkplug::OwnMetric> Reporter::signal_metrics(std::size_t slot) {
  std::vector<sparkplug::OwnMetric> metrics;
  for (const auto index : slots_[slot].signals) {
    const auto& signal = (*signals_)[index];
    const auto& state = table_->state(index);
    sparkplug::OwnMetric metric{.name = signal.metric,
                                .type = signal.data_type(),
                                .value = value_of(index),
                                .at = state.known ? utc_of(state.at) : clock_->now().utc,
                                .quality = quality_of(index),
                                .writable = signal.wanted.writable};
    if (!signal.unit.empty()) metric.properties.properties.push_back({"engUnit", DataType::string, signal.unit});
    metrics.push_back(std::move(metric));
  }
  return metrics;
}

void Reporter::tell_signals() {
  for (std::size_t i = 0; i < signals_->size(); ++i) {
    if (slots_[(*signals_)[i].slot].born && !tell_signal(i)) return;
  }
}

bool Reporter::tell_signal(std::size_t index) {
  const ToldValue& told = told_[index];
  const auto& state = table_->state(index);
  const auto& signal = (*signals_)[index];
  const Quality quality = quality_of(index);
  const bool changed = quality != told.quality;
  const bool early = session_->executor().now() - told.at < signal.wanted.every;
  if (!changed && (early || !has_moved(told, state, signal))) return true;
  // A value has the time at which it was on the bus; that it is stale, or good again, has the time of now.
  const bool fresh = quality == Quality::good && state.at >= told.at;
  const auto at = fresh ? utc_of(state.at) : clock_->now().utc;
  const auto& name = session_->machine().slots[signal.slot].spec.name.name;
  if (!put({.device = name, .metric = signal.metric, .value = value_of(index), .at = at, .quality = quality}))
    return false;
  note_told(index);
  return true;
}

void Reporter::note_told(std::size_t signal) {
  const auto& state = table_->state(signal);
  told_[signal] = {.raw = state.raw,
                   .text = state.text,
                   .known = state.known,
                   .quality = quality_of(signal),
                   .at = session_->executor().now()};
}

}  // namespace berth::fleet
