#include "berth/multilevel/signal_gateway.hpp"

#include <algorithm>
#include <cstring>

#include "berth/od/pdo_objects.hpp"

namespace berth::multilevel {
namespace {

// The number and the parameters of the first TPDO that maps the object; number 0: none does.
std::pair<unsigned, od::PdoParameters> tpdo_that_maps(const od::Values& values, ObjectRef object, bool valid_only) {
  std::pair<unsigned, od::PdoParameters> found{};
  od::for_each_communication(values.description(), od::PdoKind::tpdo, [&](unsigned number) {
    if (found.first != 0) return;
    auto pdo = od::read_pdo(values, od::PdoKind::tpdo, number);
    if (pdo.maps(object) && (pdo.cob_id.valid() || !valid_only)) found = {number, std::move(pdo)};
  });
  return found;
}

}  // namespace

std::optional<std::uint16_t> tpdo_record_of(const od::Values& values, ObjectRef object) {
  const auto [number, pdo] = tpdo_that_maps(values, object, false);
  return number == 0 ? std::nullopt : std::optional(od::communication_index(od::PdoKind::tpdo, number));
}

std::optional<std::uint32_t> tpdo_of(const od::Values& values, ObjectRef object) {
  const auto [number, pdo] = tpdo_that_maps(values, object, true);
  return number == 0 ? std::nullopt : std::optional(pdo.cob_id.key());
}

SignalGateway::SignalGateway(rt::Executor& executor, std::vector<SignalSide> sides, std::vector<Signal> table)
    : executor_(&executor),
      sides_(std::move(sides)),
      table_(std::move(table)),
      rows_(table_.size()),
      due_(*this, executor) {
  std::vector<const od::Description*> descriptions;
  for (const auto& side : sides_) descriptions.push_back(&side.values->description());
  std::vector<bool> bad(table_.size());
  for (const auto& problem : problems(table_, descriptions)) bad[problem.signal] = true;
  for (std::uint8_t side = 0; side < sides_.size(); ++side) meters_.push_back(std::make_unique<Meter>(*this, side));
  for (std::size_t i = 0; i < table_.size(); ++i) {
    if (!bad[i]) resolve(i);
  }
}

SignalGateway::~SignalGateway() {
  for (std::size_t side = 0; side < sides_.size(); ++side) {
    if (sides_[side].port != nullptr) sides_[side].port->forget(*meters_[side]);
  }
}

void SignalGateway::resolve(std::size_t signal) {
  const Signal& what = table_[signal];
  Row& row = rows_[signal];
  auto& from = *sides_[what.from].values;
  auto& to = *sides_[what.to].values;
  row.source = std::as_const(from).scalar(*from.description().find(what.source));
  row.target = to.scalar(*to.description().find(what.target));
}

// ---- when a signal is forwarded ----

bool SignalGateway::may_go(std::size_t signal) const noexcept {
  const Signal& what = table_[signal];
  const Row& row = rows_[signal];
  const bool fresh =
      what.freshness == rt::Duration::zero() || (row.ever && executor_->now() - row.received < what.freshness);
  return row.target != nullptr && complete_ && safe_ && (what.modes >> mode_ & 1U) != 0 && fresh;
}

void SignalGateway::set_complete(bool complete) {
  complete_ = complete;
  for (std::size_t i = 0; i < rows_.size(); ++i) open_or_close(i, false);
}

void SignalGateway::set_safe(bool safe) {
  safe_ = safe;
  for (std::size_t i = 0; i < rows_.size(); ++i) open_or_close(i, false);
}

void SignalGateway::set_mode(unsigned mode) {
  mode_ = mode & 31U;
  // Signals that end come first: a target may get another source.
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    if (!may_go(i)) open_or_close(i, false);
  }
  for (std::size_t i = 0; i < rows_.size(); ++i) open_or_close(i, false);
}

void SignalGateway::refresh() {
  for (std::size_t i = 0; i < rows_.size(); ++i) open_or_close(i, true);
}

void SignalGateway::open_or_close(std::size_t signal, bool anew) {
  Row& row = rows_[signal];
  if (row.target == nullptr) return;
  const bool now = may_go(signal);
  const bool before = std::exchange(row.open, now);
  if (now == before && !anew) return;
  if (!now) return close(signal);
  const Signal& what = table_[signal];
  const auto& side = sides_[what.to];
  if (what.stopped == Signal::Stopped::silent && side.silence) side.silence(what.target, false);
  if (side.port == nullptr) return;
  row.key = tpdo_of(*side.values, what.target).value_or(0);
  if (row.key != 0) side.port->watch(row.key, *meters_[what.to]);
}

void SignalGateway::close(std::size_t signal) {
  const Signal& what = table_[signal];
  const auto& side = sides_[what.to];
  Row& row = rows_[signal];
  row.waiting = row.under_way = rt::never;
  set_late(signal, false);
  // Another signal writes the target in this mode.
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    if (k != signal && table_[k].to == what.to && table_[k].target == what.target && may_go(k)) return;
  }
  if (what.stopped == Signal::Stopped::substitute) put(signal, what.substitute, true);
  if (what.stopped == Signal::Stopped::silent && side.silence) side.silence(what.target, true);
}

// ---- a value from source to target ----

void SignalGateway::received(std::size_t signal) {
  Row& row = rows_[signal];
  if (row.target == nullptr) return;
  row.received = executor_->now();
  row.ever = true;
  if (!row.open) open_or_close(signal, false);
  if (!row.open) {
    ++row.figures.refused;
    return;
  }
  ++row.figures.forwarded;
  const bool is_event = table_[signal].every || std::memcmp(row.target, row.source.data(), row.source.size()) != 0;
  if (is_event && row.key != 0 && row.waiting == rt::never) row.waiting = row.received;
  put(signal, row.source, is_event);
  watch();
}

void SignalGateway::put(std::size_t signal, std::span<const std::uint8_t> value, bool event) {
  std::memcpy(rows_[signal].target, value.data(), value.size());
  const Signal& what = table_[signal];
  if (event && sides_[what.to].changed) sides_[what.to].changed(what.target);
}

// ---- lateness ----

void SignalGateway::Meter::submitted(std::uint32_t key, rt::Time) noexcept {
  auto& gateway = *gateway_;
  for (std::size_t i = 0; i < gateway.rows_.size(); ++i) {
    Row& row = gateway.rows_[i];
    if (gateway.table_[i].to != side_ || row.key != key || row.waiting == rt::never) continue;
    row.under_way = std::min(row.under_way, row.waiting);
    row.waiting = rt::never;
  }
}

void SignalGateway::Meter::on_the_wire(std::uint32_t key, rt::Time at) noexcept {
  auto& gateway = *gateway_;
  for (std::size_t i = 0; i < gateway.rows_.size(); ++i) {
    Row& row = gateway.rows_[i];
    if (gateway.table_[i].to != side_ || row.key != key || row.under_way == rt::never) continue;
    const rt::Duration delay = at - std::exchange(row.under_way, rt::never);
    ++row.figures.measured;
    row.figures.longest = std::max(row.figures.longest, delay);
    const auto budget = gateway.table_[i].budget;
    gateway.set_late(i, budget > rt::Duration::zero() && delay > budget);
  }
}

void SignalGateway::set_late(std::size_t signal, bool late) {
  Row& row = rows_[signal];
  if (row.late == late) return;
  row.late = late;
  if (late) ++row.figures.late;
  if (late_call_) late_call_(signal, late);
}

// Sets the next time at which a signal is too late, or not fresh any more.
void SignalGateway::watch() noexcept {
  rt::Time next = rt::never;
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const Row& row = rows_[i];
    const auto since = std::min(row.waiting, row.under_way);
    const auto budget = table_[i].budget;
    if (budget > rt::Duration::zero() && since != rt::never && !row.late) next = std::min(next, since + budget);
    if (row.open && table_[i].freshness > rt::Duration::zero()) {
      next = std::min(next, row.received + table_[i].freshness);
    }
  }
  if (next == rt::never) return due_.cancel();
  if (!due_.timed() || due_.due() != next) executor_->at(next, due_);
}

void SignalGateway::due() noexcept {
  const auto now = executor_->now();
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    Row& row = rows_[i];
    const auto since = std::min(row.waiting, row.under_way);
    const auto budget = table_[i].budget;
    if (budget > rt::Duration::zero() && since != rt::never && now - since >= budget) set_late(i, true);
    if (row.open && !may_go(i)) open_or_close(i, false);
  }
  watch();
}

}  // namespace berth::multilevel
