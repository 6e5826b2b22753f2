#include "berth/lss/select_alone.hpp"

#include <algorithm>

namespace berth::lss {
namespace {

constexpr rt::Duration shortest_window = std::chrono::milliseconds(5);
constexpr unsigned most_looks = 3;      // at one part that stays silent, or is answered twice
constexpr unsigned most_rows = 4;       // rows of questions
constexpr unsigned enough_answers = 4;  // to know how slow a bus is
constexpr unsigned serial = 3;          // the last part
constexpr Lackable identity = Lackable::inquire_identity;

bool of_the_bus(const Error& error) noexcept { return error.code == Errc::bus || error.code == Errc::cancelled; }

rt::Duration longest_of(const Master& master, const AloneOptions& options) noexcept {
  return options.longest.count() > 0 ? options.longest : master.options().service.timeout;
}

// The result of a row of questions. Woken: a device that receives again may be in configuration, too.
enum class Seen : std::uint8_t { alone, absent, not_alone, clones, woken };

Selection doubted(Seen seen) noexcept {
  if (seen == Seen::absent) return Selection::absent;
  return seen == Seen::clones ? Selection::clones : Selection::not_alone;
}

// Asks for one part until exactly one device answers. Not `whole`: the next question follows the first answer.
rt::Task<Result<Seen>> look(Master& master, LssAddress device, unsigned part, bool whole, AloneOptions options) {
  unsigned doubled = 0;
  unsigned silent = 0;
  const unsigned most_silent = master.lacks().likely(device, identity) ? 1 : most_looks;
  while (silent < most_silent) {
    const ServiceOptions service{.timeout = window_of(master, options), .retries = 0, .full_window = whole};
    const auto reply = co_await master.inquire(part, service);
    if (!reply && of_the_bus(reply.error())) co_return fail(reply.error());
    if (!reply) {
      master.suspect_strangers();
      ++silent;
      continue;
    }
    if (reply->differ || reply->value() != device.part(part)) co_return Seen::not_alone;
    if (!suspicious(*reply)) co_return doubled == 0 ? Seen::alone : Seen::woken;
    master.suspect_strangers();
    if (reply->answers == 1) co_return Seen::woken;
    if (++doubled == most_looks) co_return Seen::clones;
  }
  co_return Seen::absent;
}

// One part was answered twice, again and again. If the other parts are the device's, two devices have this address. If
// a part has no answer, two devices answer at the same instant and differ there.
rt::Task<Result<Seen>> look_at_the_others(Master& master, LssAddress device, unsigned parts, unsigned doubled,
                                          AloneOptions options) {
  for (unsigned part = 0; part <= serial; ++part) {
    if (part == doubled || (parts >> part & 1U) == 0) continue;
    const auto seen = co_await look(master, device, part, true, options);
    if (!seen || *seen == Seen::not_alone) co_return seen;
    if (*seen == Seen::absent) co_return Seen::not_alone;
  }
  co_return Seen::clones;
}

// A device that is deaf while it stores answers 17h when it receives again. If the master has listened for as long as
// the questions one by one would take, the questions need not wait for that.
bool calm(const Master& master, const AloneOptions& options) noexcept {
  return master.now() - master.answer_times().calm_since >= 4 * longest_of(master, options);
}

// One question after the other, the serial number last. A late answer to any of them comes within the window of the
// last one, or of the question that the caller asks at once.
rt::Task<Result<Seen>> look_in_a_row(Master& master, LssAddress device, unsigned parts, AloneOptions options) {
  const rt::Time calm_since = master.answer_times().calm_since;
  for (unsigned part = 0; part <= serial; ++part) {
    if (part != serial && (parts >> part & 1U) == 0) continue;
    const bool whole = part == serial && !options.followed;
    const auto seen = co_await look(master, device, part, whole, options);
    const bool clones = seen && *seen == Seen::clones;
    if (clones) co_return co_await look_at_the_others(master, device, parts, part, options);
    if (!seen || *seen != Seen::alone) co_return seen;
  }
  co_return master.answer_times().calm_since == calm_since ? Seen::alone : Seen::woken;
}

rt::Task<Result<Seen>> look_at_all(Master& master, LssAddress device, AloneOptions options, bool in_a_row) {
  const unsigned parts = master.answer_times().strangers ? all_parts : options.parts;
  if (in_a_row) co_return co_await look_in_a_row(master, device, parts, options);
  for (unsigned i = 0; i < 4; ++i) {
    const unsigned part = serial - i;
    if (part != serial && (parts >> part & 1U) == 0) continue;
    const auto seen = co_await look(master, device, part, true, options);
    const bool clones = seen && *seen == Seen::clones;
    if (clones) co_return co_await look_at_the_others(master, device, parts, part, options);
    if (!seen || *seen != Seen::alone) co_return seen;
  }
  co_return Seen::alone;
}

rt::Task<Result<void>> leave_unchanged(Master& master) {
  master.suspect_strangers();
  const auto waiting = co_await master.switch_global(State::waiting);
  if (!waiting) co_return fail(waiting.error());
  co_return Result<void>{};
}

}  // namespace

rt::Duration window_of(const Master& master, const AloneOptions& options) noexcept {
  const AnswerTimes& times = master.answer_times();
  const rt::Duration longest = longest_of(master, options);
  if (times.strangers || times.heard < enough_answers) return longest;
  return std::clamp(3 * times.slowest, std::min(shortest_window, longest), longest);
}

const char* name(Selection selection) noexcept {
  switch (selection) {
    case Selection::alone: return "alone";
    case Selection::absent: return "absent";
    case Selection::not_alone: return "not alone";
    case Selection::clones: return "clones";
  }
  return "?";
}

bool suspicious(const Reply& reply) noexcept {
  return reply.answers > 1 || reply.differ || reply.others > 0 || reply.stale > 0;
}

PartMask parts_to_ask(const LssAddress& device, std::span<const LssAddress> others) noexcept {
  PartMask parts = serial_part;
  for (const LssAddress& other : others) {
    if (other == device) continue;
    PartMask differ = 0;
    for (unsigned i = 0; i < 4; ++i) {
      if (other.part(i) != device.part(i)) differ = static_cast<PartMask>(differ | 1U << i);
    }
    if ((differ & parts) == 0) parts = static_cast<PartMask>(parts | (differ & -differ));
  }
  return parts;
}

namespace {

// A frame that no question asked for comes from a device that receives again and missed the questions before. So all
// parts are asked once more, from the first: the part that was just asked may be the same in both devices.
rt::Task<Result<Seen>> look_in_rows(Master& master, LssAddress device, AloneOptions options) {
  for (unsigned row = 0; row < most_rows; ++row) {
    const bool in_a_row = row == 0 && calm(master, options);
    const auto seen = co_await look_at_all(master, device, options, in_a_row);
    if (!seen) co_return fail(seen.error());
    if (*seen == Seen::alone) master.no_strangers();
    if (*seen != Seen::woken) co_return *seen;
  }
  co_return Seen::alone;
}

// The last match of Fastscan brings the device into configuration.
rt::Task<Result<Reply>> match(Master& master, LssAddress device, ServiceOptions service) {
  const FastscanRequest anybody;
  auto reply = co_await master.fastscan(anybody, service);
  for (std::uint8_t sub = 0; sub < 4 && reply && reply->answers > 0; ++sub) {
    const FastscanRequest part{
        .id = device.part(sub), .bit_checked = 0, .sub = sub, .next = static_cast<std::uint8_t>((sub + 1U) & 3U)};
    reply = co_await master.fastscan(part, service);
  }
  if (reply && reply->answers == 0) co_return fail(Errc::timeout, "no device without a node-ID has this address");
  co_return reply;
}

rt::Task<Result<Reply>> select(Master& master, LssAddress device, ServiceOptions service, bool without_node_id) {
  if (without_node_id) co_return co_await match(master, device, service);
  const bool lacks = master.lacks().has(device, Lackable::select);
  if (lacks) {
    const auto matched = co_await match(master, device, service);
    const bool ends = matched || of_the_bus(matched.error());
    if (ends) co_return matched;
  }
  const auto selected = co_await master.switch_selective(device, service);
  const bool scans = !selected && selected.error().code == Errc::timeout && !lacks && master.lacks().is_scanned(device);
  if (!scans) co_return selected;
  const auto matched = co_await match(master, device, service);
  if (matched) master.lacks().note(device, Lackable::select);
  co_return matched;
}

}  // namespace

rt::Task<Result<bool>> any_without_node_id(Master& master, LssAddress device) {
  const auto waiting = co_await master.switch_global(State::waiting);
  if (!waiting) co_return fail(waiting.error());
  const ServiceOptions service{.timeout = master.options().service.timeout, .retries = 1, .full_window = false};
  const auto matched = co_await match(master, device, service);
  if (!matched && of_the_bus(matched.error())) co_return fail(matched.error());
  bool any = matched.has_value();
  if (any) {
    // Lely core's slaves answer Fastscan with a node-ID, too. A device that does not report one is believed to have
    // none.
    const ServiceOptions whole{.timeout = service.timeout, .retries = 0, .full_window = true};
    const auto told = co_await master.inquire_node_id(whole);
    if (!told && of_the_bus(told.error())) co_return fail(told.error());
    any = !told || told->differ || told->byte() == NodeId::unconfigured_value;
  }
  const auto left = co_await master.switch_global(State::waiting);
  if (!left) co_return fail(left.error());
  co_return any;
}

rt::Task<Result<Selection>> still_alone(Master& master, LssAddress device, AloneOptions options) {
  if (master.lacks().has(device, identity)) co_return Selection::not_alone;
  const auto seen = co_await look_in_rows(master, device, options);
  if (!seen) co_return fail(seen.error());
  if (*seen == Seen::alone) co_return Selection::alone;
  master.lost_one();
  co_return doubted(*seen);
}

namespace {

rt::Task<Result<Selection>> leave(Master& master, Selection why) {
  const auto left = co_await leave_unchanged(master);
  if (!left) co_return fail(left.error());
  co_return why;
}

// False: a device is in configuration.
rt::Task<Result<bool>> nobody_configures(Master& master, AloneOptions options) {
  const unsigned looks = master.answer_times().strangers ? 2 : 1;
  for (unsigned look = 0; look < looks; ++look) {
    const ServiceOptions whole{.timeout = window_of(master, options), .retries = 0, .full_window = true};
    const auto reply = co_await Exchange::anybody_configuring(master, whole);
    if (!reply) co_return fail(reply.error());
    if (reply->answers > 0 || suspicious(*reply)) co_return false;
  }
  co_return true;
}

// For a device that does not report its address: no device is in configuration before it is selected, so none is there
// beside it.
rt::Task<Result<Selection>> select_from_nobody(Master& master, LssAddress device, AloneOptions options) {
  unsigned occupied = 0;
  unsigned silent = 0;
  unsigned doubled = 0;
  for (;;) {
    const auto quiet = co_await master.switch_global(State::waiting);
    if (!quiet) co_return fail(quiet.error());
    const auto nobody = co_await nobody_configures(master, options);
    if (!nobody) co_return fail(nobody.error());
    if (!*nobody) {
      master.suspect_strangers();
      if (++occupied < most_looks) continue;
      master.lost_one();
      co_return co_await leave(master, Selection::not_alone);
    }
    const rt::Duration window = window_of(master, options);
    const ServiceOptions once{
        .timeout = longest_of(master, options), .retries = 0, .full_window = false, .listen = window};
    const auto selected = co_await select(master, device, once, options.without_node_id);
    if (!selected && of_the_bus(selected.error())) co_return fail(selected.error());
    if (!selected) {
      if (++silent < options.attempts) continue;
      co_return co_await leave(master, Selection::absent);
    }
    if (!suspicious(*selected)) break;
    const bool clones = selected->answers > 1 && ++doubled == most_looks;
    if (clones) co_return co_await leave(master, Selection::clones);
    const bool others = selected->answers == 1 && ++occupied == most_looks;
    if (others) co_return co_await leave(master, Selection::not_alone);
  }
  master.no_strangers();
  co_return Selection::alone;
}

// Asks once more. An inquiry of the address counts as answered if every part is answered.
rt::Task<Result<bool>> tells(Master& master, Lackable inquiry) {
  const ServiceOptions service{.timeout = master.options().service.timeout, .retries = 0, .full_window = false};
  const unsigned inquiries = inquiry == identity ? 4 : 1;
  for (unsigned i = 0; i < inquiries; ++i) {
    Result<Reply> reply;
    if (inquiry == identity) {
      reply = co_await master.inquire(i, service);
    } else {
      reply = co_await master.inquire_node_id(service);
    }
    if (!reply && reply.error().code == Errc::timeout) co_return false;
    if (!reply) co_return fail(reply.error());
  }
  co_return true;
}

// Does the device in configuration lack an inquiry that it did not answer? It answers a service that every slave has,
// and the inquiry between two such answers stays silent again. If another device of its type lacks the inquiry, one
// such answer suffices.
rt::Task<Result<bool>> learn_lack(Master& master, LssAddress device, Lackable inquiry) {
  const ServiceOptions service{.timeout = master.options().service.timeout, .retries = 1, .full_window = false};
  const unsigned looks = master.lacks().likely(device, inquiry) ? 1 : 2;
  for (unsigned look = 0; look < looks; ++look) {
    if (look > 0) {
      const auto told = co_await tells(master, inquiry);
      if (!told) co_return fail(told.error());
      if (*told) co_return false;
    }
    const auto there = co_await Exchange::anybody_configuring(master, service);
    if (!there) co_return fail(there.error());
    if (there->answers == 0) co_return false;
  }
  master.lacks().note(device, inquiry);
  co_return true;
}

}  // namespace

namespace {

rt::Task<Result<Selection>> prove(Master& master, LssAddress device, AloneOptions options) {
  bool lacks = master.lacks().has(device, identity);
  if (!lacks) {
    const auto seen = co_await look_in_rows(master, device, options);
    if (!seen) co_return fail(seen.error());
    if (*seen == Seen::alone) co_return Selection::alone;
    if (*seen == Seen::absent) {
      const auto learnt = co_await learn_lack(master, device, identity);
      if (!learnt) co_return fail(learnt.error());
      lacks = *learnt;
    }
    if (!lacks) {
      master.lost_one();
      co_return co_await leave(master, doubted(*seen));
    }
  }
  co_return co_await select_from_nobody(master, device, options);
}

}  // namespace

rt::Task<Result<Selection>> prove_alone(Master& master, LssAddress device, AloneOptions options) {
  master.lacks().scanned(device);
  co_return co_await prove(master, device, options);
}

rt::Task<Result<std::optional<Reply>>> ask_node_id(Master& master, LssAddress device, ServiceOptions service) {
  constexpr Lackable inquiry = Lackable::inquire_node_id;
  if (master.lacks().has(device, inquiry)) co_return std::nullopt;
  if (master.lacks().likely(device, inquiry)) service.retries = 0;
  const auto reply = co_await master.inquire_node_id(service);
  if (reply) co_return *reply;
  if (reply.error().code != Errc::timeout) co_return fail(reply.error());
  const auto lacks = co_await learn_lack(master, device, inquiry);
  if (!lacks) co_return fail(lacks.error());
  if (!*lacks) co_return fail(reply.error());
  co_return std::nullopt;
}

rt::Task<Result<Selection>> select_alone(Master& master, LssAddress device, AloneOptions options) {
  if (master.lacks().has(device, identity)) co_return co_await select_from_nobody(master, device, options);
  const unsigned attempts = options.guess ? 1U : options.attempts;
  for (unsigned attempt = 0; attempt < attempts; ++attempt) {
    const auto waiting = co_await master.switch_global(State::waiting);
    if (!waiting) co_return fail(waiting.error());
    const auto window = options.guess ? window_of(master, options) : longest_of(master, options);
    const ServiceOptions once{.timeout = window, .retries = 0, .full_window = false};
    const auto selected = co_await select(master, device, once, options.without_node_id);
    if (selected) co_return co_await prove(master, device, options);
    if (of_the_bus(selected.error())) co_return fail(selected.error());
    if (!options.guess) master.suspect_strangers();  // a device may have been selected unheard
  }
  const auto left = co_await master.switch_global(State::waiting);
  if (!left) co_return fail(left.error());
  co_return Selection::absent;
}

namespace {

Given::Outcome outcome_of(const Result<Reply>& reply) noexcept {
  if (reply) return reply->differ ? Given::Outcome::not_alone : Given::Outcome::taken;
  return reply.error().code == Errc::aborted ? Given::Outcome::refused : Given::Outcome::silent;
}

}  // namespace

rt::Task<Result<Given>> configure_alone(Master& master, LssAddress device, NodeId id, bool store,
                                        AloneOptions options) {
  const bool lost = master.answer_times().lost;
  const ServiceOptions service{
      .timeout = longest_of(master, options), .retries = 1, .full_window = lost, .listen = window_of(master, options)};
  const auto set = co_await master.configure_node_id(id, service);
  if (!set && of_the_bus(set.error())) co_return fail(set.error());
  Given given{.outcome = outcome_of(set)};
  const bool doubtful = set && (suspicious(*set) || set->attempts > 1);
  const bool proves = store && !master.lacks().has(device, identity);
  if (given.outcome == Given::Outcome::taken && (proves || doubtful)) {
    if (doubtful) master.suspect_strangers();
    const auto again = co_await still_alone(master, device, options);
    if (!again) co_return fail(again.error());
    if (*again == Selection::absent) given.outcome = Given::Outcome::silent;
    if (*again == Selection::not_alone || *again == Selection::clones) given.outcome = Given::Outcome::not_alone;
  }
  const auto occupied = [&] { return options.vacancy != nullptr && !options.vacancy->still_vacant(id); };
  if (given.outcome == Given::Outcome::taken && occupied()) given.outcome = Given::Outcome::occupied;
  if (given.outcome == Given::Outcome::taken && store) {
    const auto stored = co_await master.store();
    if (!stored && of_the_bus(stored.error())) co_return fail(stored.error());
    if (!stored && stored.error().code == Errc::timeout) master.suspect_strangers();
    given.stored = stored.has_value();
  }
  if (given.outcome == Given::Outcome::silent) master.lost_one();
  if (given.outcome != Given::Outcome::taken) {
    master.suspect_strangers();
    if (given.outcome == Given::Outcome::not_alone) master.took_back();
    const NodeId none;
    const auto back = co_await master.configure_node_id(none, service);
    if (!back && of_the_bus(back.error())) co_return fail(back.error());
  }
  // Twice: a device that misses it stays in configuration and takes the next device's node-ID, too. If it is slow, it
  // does not answer the questions in time.
  for (int time = 0; time < 2; ++time) {
    const auto waiting = co_await master.switch_global(State::waiting);
    if (!waiting) co_return fail(waiting.error());
  }
  co_return given;
}

}  // namespace berth::lss
