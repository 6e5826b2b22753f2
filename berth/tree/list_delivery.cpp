#include "berth/tree/list_delivery.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/rt/scope.hpp"

namespace berth::tree {
namespace {

constexpr auto progress_period = std::chrono::seconds(10);
constexpr auto question_pause = std::chrono::milliseconds(50);

rt::Task<void> bring_up_one(const Deeper& deeper, std::optional<Error>& failed) {
  auto task = deeper.bring_up();
  const auto done = co_await task;
  if (!done && deeper.gateway.mandatory && !failed) failed = done.error();
}

}  // namespace

ListDelivery::ListDelivery(rt::Executor& executor, SlotsBeneath& slots, const Way& way, manager::SlotSettings settings,
                           multilevel::Routes& routes)
    : executor_(executor),
      slots_(slots),
      way_(way),
      settings_(std::move(settings)),
      routes_(routes),
      master_(routes.access({way.gateways, slots.bus().master}), slots.bus().master) {
  master_.on_progress([this](const manager::Progress& progress) { progress_ = progress; });
}

manager::Wanted ListDelivery::list(std::span<const NodeId> held_back) {
  Findings findings;
  auto made = network_list(slots_.bus(), slots_.specs(), held_back, settings_, findings);
  for (const auto& finding : findings) {
    if (finding.severity == Finding::Severity::error)
      slots_.events().tell_once(operate::EventKind::error, to_string(finding));
  }
  return made;
}

std::vector<NodeId> ListDelivery::gateways() const {
  std::vector<NodeId> nodes;
  for (const auto& deeper : deeper_) {
    const NodeId node = deeper.gateway.slot;
    if (std::ranges::find(nodes, node) == nodes.end()) nodes.push_back(node);
  }
  return nodes;
}

rt::Task<Result<void>> ListDelivery::deliver(bool& was_there) {
  const manager::Wanted whole = list();
  was_there = co_await master_.has_list(whole);
  const bool in_steps = !was_there && !deeper_.empty();
  auto task = in_steps ? put_in_steps(whole) : put(whole, slots_.needed());
  const auto done = co_await task;
  co_return done;
}

// Through many gateways, or on slow buses, this takes long.
rt::Task<void> ListDelivery::tell_progress() {
  for (;;) {
    co_await rt::sleep_for(progress_period);
    const auto& [stage, done, total] = progress_;
    slots_.events().tell(operate::EventKind::step, "",
                         total == 0 ? std::string("its network list is being brought in, in one transfer")
                                    : fmt::format("its network list is being brought in, value by value: {}, {} of {}",
                                                  manager::name(stage), done, total));
  }
}

rt::Task<Result<void>> ListDelivery::bring(const manager::Wanted& list, bool& changed) {
  progress_ = {};
  rt::Scope beside(executor_);
  beside.spawn(tell_progress());
  const auto done = co_await master_.bring(list, changed);
  co_return done;
}

// `nodes`: those that its master must know when it uses the list. The master uses a written list from its next boot-up.
// If the list is there but nodes are missing, an earlier Berth may have ended between the two; then the master is
// restarted once.
rt::Task<Result<void>> ListDelivery::put(const manager::Wanted& list, std::vector<NodeId> nodes) {
  bool changed = false;
  auto done = co_await bring(list, changed);
  if (!done) co_return done;
  // The list was undated here before, and a later step failed: it was there all the time, and is in use if the master
  // knows its nodes.
  const bool again = std::exchange(undated_, std::nullopt) == list.date;
  const bool was_there = !changed || again;
  if (was_there) {
    if (restarted_) co_return Result<void>{};
    const auto in_use = co_await master_.knows_all(nodes);
    if (!in_use) co_return fail(in_use.error());
    if (*in_use) co_return Result<void>{};
    // The list may be unsaved: write it again as if its date were different.
    if (!changed) {
      undated_ = list.date;
      done = co_await master_.undate();
      if (done) done = co_await bring(list, changed);
      if (!done) co_return done;
      undated_.reset();
    }
    slots_.events().tell(operate::EventKind::step, "",
                         "its gateway boots it again: it misses nodes of its network list");
  } else {
    slots_.events().tell(operate::EventKind::step, "", "its gateway has a new network list");
  }
  done = co_await master_.restart();
  restarted_ = restarted_ || (was_there && done);  // missing parts are tried again
  co_return done;
}

// The gateways in the list get their node-IDs with the others but are not booted: the buses beneath them come first.
rt::Task<Result<void>> ListDelivery::put_in_steps(const manager::Wanted& whole) {
  const std::vector<NodeId> waiting = gateways();
  const manager::Wanted first = list(waiting);
  auto done = co_await put(first, waiting);
  if (!done) co_return done;
  for (const NodeId node : waiting) co_await await_heard(node);
  done = co_await bring_up_deeper();
  if (!done) co_return done;
  co_return co_await let_in(first, whole);
}

// An SDO to a gateway without a node-ID would block the SDO client of the master until its timeout.
rt::Task<void> ListDelivery::await_heard(NodeId node) {
  constexpr auto hidden = std::chrono::seconds(10);  // its boot-up message may be lost
  constexpr auto longest = std::chrono::seconds(30);
  const rt::Time began = executor_.now();
  const std::vector<NodeId> one{node};
  co::SdoAccess& gateway = access(node);
  for (bool heard = false; !heard && executor_.now() < began + longest;) {
    heard = co_await master_.has_all(one);
    if (!heard && executor_.now() >= began + hidden) {
      const auto type = co_await gateway.read_u32(0x1000, 0);
      heard = type.has_value();
    }
    if (!heard) co_await rt::sleep_for(question_pause);
  }
}

rt::Task<Result<void>> ListDelivery::bring_up_deeper() {
  std::optional<Error> failed;
  {
    rt::Scope side_by_side(executor_);
    for (const auto& deeper : deeper_) side_by_side.spawn(bring_up_one(deeper, failed));
    co_await side_by_side.join();
  }
  if (failed) co_return fail(*failed);
  co_return Result<void>{};
}

// `first`: the list that the master has.
rt::Task<Result<void>> ListDelivery::let_in(const manager::Wanted& first, const manager::Wanted& whole) {
  const std::vector<NodeId> waiting = gateways();
  manager::Wanted change = whole;
  std::erase_if(change.entries, [&](const manager::Entry& entry) {
    const auto had = std::ranges::find(first.entries, entry.object, &manager::Entry::object);
    return had != first.entries.end() && had->bytes == entry.bytes;
  });
  bool changed = false;
  auto done = co_await master_.bring_objects(change, changed);
  for (std::size_t i = 0; i < waiting.size() && done; ++i) {
    const NodeId node = waiting[i];
    done = co_await master_.command(node, co::NmtCommand::reset_communication);
  }
  if (!done) co_return done;
  constexpr auto in_time = std::chrono::seconds(5);
  for (const rt::Time deadline = executor_.now() + in_time; executor_.now() < deadline;) {
    const bool run = co_await master_.all_run(waiting);
    if (run) co_return done;
    co_await rt::sleep_for(question_pause);
  }
  // This master reads its list only at its own boot-up.
  co_return co_await master_.restart();
}

rt::Task<ListDelivery::Found> ListDelivery::look() {
  const manager::Wanted whole = list();
  const bool has_it = co_await master_.has_list(whole);
  const auto nodes = slots_.nodes();
  if (has_it) {
    const bool used = co_await master_.has_any(nodes);
    co_return used ? Found::in_use : Found::unused;
  }
  const bool bare = co_await master_.is_bare(nodes);
  if (bare) co_return Found::unfinished;
  if (deeper_.empty()) co_return Found::another;
  const auto waiting = gateways();
  const manager::Wanted first = list(waiting);
  const bool begun = co_await master_.has_list(first);
  co_return begun ? Found::unfinished : Found::another;
}

rt::Task<bool> ListDelivery::is_lost() {
  const manager::Wanted whole = list();
  co_return co_await master_.has_another_list(whole);
}

}  // namespace berth::tree
