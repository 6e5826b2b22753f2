#include "berth/studio/desk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/command/audit.hpp"
#include "berth/command/rights.hpp"
#include "berth/command/verbs.hpp"
#include "berth/rt/scope.hpp"

namespace berth::studio {

using command::changes;
using command::words_of;

namespace {

std::string who(const Order& order) { return fmt::format("studio, client {} ({})", order.client, name(order.role)); }

}  // namespace

/// A request under way.
struct Desk::Work {
  Work(Order given, tree::Session& session)
      : order(std::move(given)), audit(session, who(order), order.request), scope(session.executor()) {}
  Order order;
  command::Audit audit;
  command::Reply reply;
  bool done = false;
  rt::Scope scope;  // last: its task uses the other members
};

namespace {

bool same(const std::optional<operate::EmcyReport>& a, const std::optional<operate::EmcyReport>& b) {
  return a.has_value() == b.has_value() && (!a || (a->code == b->code && a->at == b->at && a->count == b->count));
}

// `heard` does not count: each heartbeat would be a change.
bool same(const operate::SlotReport& a, const operate::SlotReport& b) {
  return a.bus == b.bus && a.id == b.id && a.device == b.device && a.state == b.state && a.since == b.since &&
         a.reason == b.reason && a.boot == b.boot && a.nmt == b.nmt && same(a.emcy, b.emcy);
}

// Ignores the time: a question gets the time of each look at it.
bool same_question(const operate::Event& a, const operate::Event& b) {
  return a.bus == b.bus && a.text == b.text && a.slots == b.slots && a.devices == b.devices;
}

}  // namespace

Desk::Desk(io::Loop& loop, tree::Session& session, Carry carry, Link& link)
    : loop_(&loop),
      session_(&session),
      carry_(std::move(carry)),
      link_(&link),
      stock_(session, link),
      tick_(*this, session.executor()),
      done_(*this, session.executor()) {
  for (const auto* const bus : session.machine().all_buses()) {
    if (buses_.size() < Link::most_buses) buses_.emplace(bus->name, static_cast<std::uint8_t>(buses_.size()));
  }
  errors_.resize(buses_.size());
  loop_->watch(link_->for_executor.descriptor(), *this, EPOLLIN);
  tick();
}

Desk::~Desk() { loop_->forget(link_->for_executor.descriptor()); }

void Desk::frame(std::string_view bus, const can::Frame& frame, rt::Time at, bool own) noexcept {
  const auto it = buses_.find(bus);
  if (it != buses_.end()) link_->ring.put(it->second, frame, at, own);
}

void Desk::error(std::string_view bus, const can::Frame& report, rt::Time at, std::string_view about) {
  const auto it = buses_.find(bus);
  if (it == buses_.end()) return;
  link_->health[it->second].errors.fetch_add(1, std::memory_order_relaxed);
  Errors& errors = errors_[it->second];
  const std::int64_t second = at.time_since_epoch() / std::chrono::seconds(1);
  if (errors.second != second) errors = {second, 0};
  if (++errors.count <= most_errors) link_->ring.put_error(it->second, report, at, about);
}

void Desk::look_at_ports() {
  for (const auto& [name, index] : buses_) {
    auto* const network = session_->network(name);
    if (network == nullptr) continue;
    const can::Status status = network->services().port.status();
    const auto least = [](std::uint16_t count) {
      return static_cast<std::uint8_t>(std::min<std::uint16_t>(count, 255));
    };
    const BusHealth::State state{.up = status.up,
                                 .bus_off = status.bus_off,
                                 .counts = status.knows_counters,
                                 .tec = least(status.tec),
                                 .rec = least(status.rec)};
    link_->health[index].state.store(BusHealth::packed(state), std::memory_order_relaxed);
  }
}

void Desk::event(const operate::Event& event) {
  if (events_.size() >= most_events) {
    events_.erase(events_.begin());
    ++left_out_;
  }
  events_.push_back(event);
}

// The executor's own timers stop with the simulated time.
void Desk::look() {
  const Pace pace{loop_->paused(), loop_->speed()};
  if (pace.paused)
    link_->now_ns.store(session_->executor().now().time_since_epoch().count(), std::memory_order_relaxed);
  if (pace == told_pace_ && (!pace.paused || events_.empty())) return;
  tell();
  flush();
}

void Desk::ready(std::uint32_t) noexcept {
  link_->for_executor.silence();
  while (auto order = link_->orders.take()) take(std::move(*order));
  flush();
}

void Desk::take(Order order) {
  switch (order.kind) {
    case Order::Kind::request: return begin(std::move(order));
    case Order::Kind::gone:
      std::erase_if(works_, [&](const auto& work) { return work->order.client == order.client; });
      return;
    case Order::Kind::unlock:
    case Order::Kind::lock:
      if (turned_away(order)) return;
      if (order.kind == Order::Kind::lock) return set_lock(order, std::nullopt, "real buses are read-only again");
      return set_lock(order, session_->executor().now() + std::chrono::minutes(order.minutes),
                      fmt::format("real buses may be changed for {} min", order.minutes));
  }
}

// Depends on the role: locking would interrupt the work of others.
bool Desk::turned_away(const Order& order) {
  const char* const what = order.kind == Order::Kind::lock ? "lock" : "unlock";
  const auto refused = command::why_role_refused(what, command::Role::operate, order.role);
  if (refused.empty()) return false;
  command::audit(*session_, who(order), what, "refused: " + refused);
  answer({order.client, {}, command::refusal(1, refused)});
  return true;
}

bool Desk::may_change() const {
  return !session_->careful() || (unlocked_until_ && session_->executor().now() < *unlocked_until_);
}

Lock Desk::lock() const {
  Lock lock{session_->careful(), {}};
  if (unlocked_until_ && session_->executor().now() < *unlocked_until_)
    lock.until_s = operate::seconds(*unlocked_until_);
  return lock;
}

// Simulated buses are never locked.
void Desk::set_lock(const Order& order, std::optional<rt::Time> until, const std::string& words) {
  if (!session_->careful()) return;
  unlocked_until_ = until;
  say({}, "studio: " + words);
  command::audit(*session_, who(order), until ? "unlock" : "lock", words);
  tell();
}

void Desk::say(const std::string& bus, const std::string& text) {
  const auto& machine = session_->machine();
  const auto* const known = machine.bus(bus);
  session_->tell(known != nullptr ? known->name : machine.buses.front().name, operate::EventKind::step, text);
}

void Desk::begin(Order order) {
  const auto refused =
      command::why_refused(command::Face::studio, order.request, {.changes = may_change(), .role = order.role});
  if (!refused.empty()) {
    if (changes(order.request)) {
      say({}, fmt::format("studio: {}: refused", words_of(order.request)));
      command::audit(*session_, who(order), words_of(order.request), "refused: " + refused);
    }
    return answer({order.client, std::move(order.id), command::refusal(1, refused)});
  }
  if (works_.size() >= most_requests) {
    const auto words = fmt::format("{} requests are under way already: try again when one is done", most_requests);
    return answer({order.client, std::move(order.id), command::refusal(3, words)});
  }
  works_.push_back(std::make_unique<Work>(std::move(order), *session_));
  Work& work = *works_.back();
  work.scope.spawn(rt::told(carry_(work.order.request, work.reply), work.done, session_->executor(), done_));
}

void Desk::finish() noexcept {
  for (const auto& work : works_) {
    if (!work->done) continue;
    const auto& request = work->order.request;
    work->audit.answered(work->reply);
    if (changes(request)) {
      const auto bus = request.arguments.find("bus");
      say(bus == request.arguments.end() ? std::string() : bus->second,
          fmt::format("studio: {}: {}", words_of(request), command::word_of_status(work->reply.status)));
    }
    note_written(request, work->reply);
    answer({work->order.client, work->order.id, std::move(work->reply)});
  }
  std::erase_if(works_, [](const auto& work) { return work->done; });
  flush();
}

// Another client may show or edit the same value.
void Desk::note_written(const command::Request& request, const command::Reply& reply) {
  constexpr std::size_t most = 256;
  if (request.verb != "sdo write" || reply.json.empty()) return;
  if (written_.size() == most) written_.erase(written_.begin());
  written_.push_back(reply.json);
}

void Desk::answer(Answer answer) {
  News news;
  news.time_s = operate::seconds(session_->executor().now());
  news.answer = std::move(answer);
  waiting_.push_back(std::move(news));
}

// Events come with the slots that they changed. A slot may change without an event, so all are compared once a second.
void Desk::tick() noexcept {
  const rt::Time now = session_->executor().now();
  link_->now_ns.store(now.time_since_epoch().count(), std::memory_order_relaxed);
  // In a timer the executor's time is when it was due. The first call is not by the timer.
  if (ticks_ > 0) stock_.late(std::chrono::duration<double>(loop_->clock() - now).count() / loop_->speed());
  look_at_ports();
  const bool locks = told_lock_ && *told_lock_ != lock();
  if (!events_.empty() || locks || ticks_ % 10 == 0) tell();
  ++ticks_;
  flush();
  tick_.arm(period);
}

std::vector<operate::SlotReport> Desk::changed() {
  auto slots = session_->slots();
  std::vector<operate::SlotReport> out;
  for (std::size_t i = 0; i < slots.size(); ++i) {
    if (i >= told_.size() || !same(slots[i], told_[i])) out.push_back(slots[i]);
  }
  told_ = std::move(slots);
  return out;
}

void Desk::tell() {
  // The queue does not grow: while the server's thread lags, slots and events wait here.
  if (!waiting_.empty()) return;
  News news;
  news.time_s = operate::seconds(session_->executor().now());
  news.slots = changed();
  news.events = std::exchange(events_, {});
  news.events_left_out = std::exchange(left_out_, 0);
  news.written = std::exchange(written_, {});
  if (!told_lock_ || *told_lock_ != lock()) news.lock = told_lock_ = lock();
  auto questions = tree::questions_of(*session_);
  if (!std::ranges::equal(questions, told_questions_, same_question))
    news.questions = told_questions_ = std::move(questions);
  if (const Pace pace{loop_->paused(), loop_->speed()}; pace != told_pace_) news.pace = told_pace_ = pace;
  news.figures = std::make_shared<const Figures>(stock_.take(told_));
  waiting_.push_back(std::move(news));
}

void Desk::flush() {
  bool put = false;
  while (!waiting_.empty() && link_->news.put(waiting_.front())) {
    waiting_.pop_front();
    put = true;
  }
  if (put) link_->for_server.ring();
}

}  // namespace berth::studio
