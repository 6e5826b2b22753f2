#include "berth/nodeid/rand_walk.hpp"

#include <algorithm>
#include <utility>

#include "berth/nodeid/rand_walk_parts.hpp"

namespace berth::nodeid {
namespace {

constexpr std::size_t most_chunks = 1024;  // distinct chunks kept of one window
constexpr std::size_t most_nodes = 20'000;
constexpr std::size_t most_roots = 3;  // unanswered requests allowed if no slave resumes
constexpr unsigned enough_heard = 12;  // answers needed before learnt times shorten a window
constexpr const char* walk_busy = "another walk is under way";

}  // namespace

struct RandWalk::Lease {
  explicit Lease(RandWalk& walk) noexcept : walk_(walk) { walk_.busy_ = true; }
  ~Lease() { walk_.busy_ = false; }
  Lease(const Lease&) = delete;
  Lease& operator=(const Lease&) = delete;
  RandWalk& walk_;
};

RandWalk::RandWalk(can::Dispatcher& dispatcher) : exchanges_(dispatcher) {
  heard_.reserve(most_chunks);
  expected_.reserve(most_chunks);
  late_.reserve(most_chunks);
  extra_dis_.reserve(most_chunks);
  dispatcher.add(ius_answers, *this);
  dispatcher.add(dis_answers, *this);
}

void RandWalk::received(const can::Frame& frame, rt::Time at) noexcept {
  if (!busy_) return;
  const auto answer = decode_rand_answer(frame);
  if (!answer) return;
  const bool mine = exchanges_.open() && answer->direct == direct_;
  if (!answer->direct || mine) {
    slowest_ = std::max(slowest_, at - exchanges_.opened());
    ++answers_;
  }
  if (!mine) {
    auto& list = answer->direct ? extra_dis_ : late_;
    if ((answer->direct || !exchanges_.open()) && list.size() < most_chunks) list.push_back(answer->chunk);
    exchanges_.delayed(at);
    return;
  }
  note(answer->chunk, at);
  std::erase(expected_, answer->chunk);
  exchanges_.heard(at);
  if (early_ && expected_.empty()) exchanges_.close();
}

bool RandWalk::is_heard(std::uint16_t chunk) const noexcept {
  return std::ranges::find(heard_, chunk, &Heard::chunk) != heard_.end();
}

void RandWalk::note(std::uint16_t chunk, rt::Time at) noexcept {
  const auto place = std::ranges::lower_bound(heard_, chunk, {}, &Heard::chunk);
  if (place != heard_.end() && place->chunk == chunk) {
    ++place->times;
  } else if (heard_.size() < most_chunks) {
    heard_.insert(place, Heard{.chunk = chunk, .times = 1, .at = at});
  }
}

// How late an answer may still come. The waiting time of an answer that waited for others counts, so many answers make
// this longer and never shorter.
rt::Duration RandWalk::response(const WalkOptions& o) const noexcept {
  if (answers_ < enough_heard) return o.longest;
  return std::clamp(slowest_ + slowest_ / 2, std::min(o.shortest, o.longest), o.longest);
}

// ---- one request ----------------------------------------------------------------------------------------------------

// True: a slave answered. Late answers to the previous request are then in `late_`, until the next call.
rt::Task<Result<bool>> RandWalk::ask(Run& run, const can::Frame& frame, Wait wait) {
  const auto& o = run.options;
  const auto inhibit = o.inhibit;
  if (inhibit.count() > 0) co_await rt::sleep_for(inhibit);
  heard_.clear();
  direct_ = wait.direct;
  early_ = wait.early;
  WindowTimes times{.first = wait.first, .send_timeout = o.send_timeout};
  if (wait.first.count() > 0) {
    const bool given = o.after_last.count() > 0;
    times.after_last =
        std::max(run.factor() * (given ? o.after_last : std::max(o.shortest, o.blocking)), wait.after_last);
    if (!given) times.least = run.factor() * response(o);
    times.most = std::max(run.factor() * o.most, wait.first);
  }
  ++run.report.requests;
  const auto sent = co_await exchanges_.request(frame, times);
  if (!sent) co_return fail(sent.error());
  run.last_sent = *sent;
  co_return !heard_.empty();
}

rt::Task<Result<void>> RandWalk::tell(Run& run, LssAddress address, Identification target) {
  const WindowTimes times{.first = run.options.inhibit, .send_timeout = run.options.send_timeout};
  for (unsigned part = 0; part < 4; ++part) {
    const auto frame = switch_identification_selective(address, part, target);
    ++run.report.switches;
    const auto sent = co_await exchanges_.request(frame, times);
    if (!sent) co_return fail(sent.error());
    run.last_sent = *sent;
  }
  co_return Result<void>{};
}

// ---- resuming slaves ------------------------------------------------------------------------------------------------

// Walks all resuming slaves. Returns the number of addresses heard.
rt::Task<Result<unsigned>> RandWalk::resuming(Run& run) {
  std::vector<Prefix> roots;
  if (run.guess) {
    for (const auto& kind : run.kinds) {
      const LssAddress guess{kind.type.vendor, kind.type.product, kind.revision.value_or(0), 0};
      Prefix root{.depth = kind.revision ? 6U : 4U};
      for (unsigned i = 0; i < root.depth; ++i) root.chunks[i] = guess.chunk(i);
      if (std::ranges::find(roots, root) == roots.end()) roots.push_back(root);
    }
  }
  if (roots.empty()) roots.push_back({});
  if (roots.size() > most_roots) roots.assign(1, Prefix{});
  for (const auto& root : roots) {
    const auto walked = co_await subtree(run, root);
    if (!walked) co_return fail(walked.error());
    if (run.stopped) break;
  }
  unsigned count = 0;
  for (const auto& entry : run.entries) count += entry.now ? 1U : 0U;
  co_return count;
}

// Depth first, one request per node.
rt::Task<Result<void>> RandWalk::subtree(Run& run, const Prefix& root) {
  std::vector<Prefix> todo{root};
  const auto enter = [&](const Prefix& node, std::uint16_t chunk, rt::Time at, unsigned times) {
    if (node.depth == 7) {
      run.enter(node, chunk, at, true).doubled |= times > 1;
    } else if (todo.size() < most_nodes) {
      todo.push_back(node);
      todo.back().chunks[todo.back().depth++] = chunk;
    }
  };
  std::vector<std::uint16_t> before;  // heard in the last window
  Prefix last = root;
  late_.clear();
  while (!todo.empty() && run.entries.size() < run.options.most_devices && !run.stops()) {
    const Prefix node = todo.back();
    todo.pop_back();
    const auto frame = resume_request(node.depth, address_of(node.chunks));
    const Wait wait{.first = run.longest()};
    const auto answered = co_await ask(run, frame, wait);
    if (!answered) co_return fail(answered.error());
    if (!*answered && node.depth > root.depth) ++run.report.dead_branches;
    for (const auto chunk : std::exchange(late_, {})) {  // heard before this request was sent
      if (std::ranges::find(before, chunk) == before.end()) enter(last, chunk, now(), 1);
    }
    for (auto it = heard_.rbegin(); it != heard_.rend(); ++it) enter(node, it->chunk, it->at, it->times);
    if (node.depth == 7 && *answered) run.report.known = now();
    before.clear();
    for (const auto& h : heard_) before.push_back(h.chunk);
    last = node;
  }
  co_return Result<void>{};
}

// ---- paper slaves ---------------------------------------------------------------------------------------------------

// Phase 0 was answered by `first`.
rt::Task<Result<void>> RandWalk::paper(Run& run, const std::vector<std::uint16_t>& first) {
  run.tree.clear();
  if (run.guess) {
    for (const auto& kind : run.kinds) {
      const LssAddress guess{kind.type.vendor, kind.type.product, kind.revision.value_or(0), 0};
      const unsigned depth = kind.revision ? 6U : 4U;
      Prefix node;
      for (; node.depth < depth; ++node.depth) {
        run.tree[node].state = Node::State::guessed;
        run.tree[node].open.insert(guess.chunk(node.depth));
        node.chunks[node.depth] = guess.chunk(node.depth);
      }
    }
  }
  auto& root = run.tree[Prefix{}];
  if (root.state == Node::State::guessed) {
    std::erase_if(root.open, [&](std::uint16_t c) { return std::ranges::find(first, c) == first.end(); });
  }
  if (root.open.empty()) root.open.insert(first.begin(), first.end());  // no kinds, or all guesses wrong
  root.all.insert(first.begin(), first.end());
  root.state = Node::State::visited;
  for (bool began = true; !run.tree[Prefix{}].open.empty(); began = false) {
    const auto led = co_await descend(run, began);
    if (!led) co_return fail(led.error());
    if (run.stopped || run.entries.size() >= run.options.most_devices || run.tree.size() >= most_nodes) break;
  }
  co_return Result<void>{};
}

// From phase 0 to one leaf: by the lowest open chunk at each node. `root_heard`: phase 0 was just answered.
rt::Task<Result<void>> RandWalk::descend(Run& run, bool root_heard) {
  using State = Node::State;
  Prefix p;
  Prefix parent;
  bool hurried = false;
  bool parent_new = false;  // only known from its parent's window
  late_.clear();
  for (unsigned phase = root_heard ? 1 : 0; phase < 8; ++phase) {
    if (run.stops()) break;
    parent = p;
    if (phase > 0) p.chunks[p.depth++] = *run.tree[p].open.begin();
    const auto was = run.tree[p].state;
    const auto guess = run.guessed(p);
    if (guess) {
      const auto tried = co_await try_serial(run, p, *guess);
      co_return tried;
    }
    const bool early = expect(run, p);
    if (phase == 7) {
      const auto fence = run.last_sent + run.longest();
      if (now() < fence) co_await rt::sleep_until(fence);
    }
    const auto frame = iurs(phase, phase == 0 ? std::uint16_t{0} : p.chunks[phase - 1]);
    // Parts that were walked before need no pause: their answers are known.
    const bool hurry = run.hurry && early && was == State::visited;
    hurried |= hurry;
    const Wait wait{.first = hurry ? rt::Duration{0} : run.longest(), .early = early};
    const auto answered = co_await ask(run, frame, wait);
    if (!answered) co_return fail(answered.error());
    if (hurry) continue;
    auto& open = run.tree[p].open;
    if (parent_new) run.add(parent, late_, hurried);
    late_.clear();
    parent_new = was == State::fresh && phase < 7;
    if (phase == 7 && !heard_.empty()) {
      co_return co_await leaf(run, p);
    }
    run.tree[p].state = State::visited;
    for (const auto& h : heard_) run.tree[p].all.insert(h.chunk);
    if (was == State::fresh) {
      std::vector<std::uint16_t> chunks;
      for (const auto& h : heard_) chunks.push_back(h.chunk);
      run.add(p, chunks, hurried);
    } else if (was == State::guessed) {
      std::erase_if(open, [this](std::uint16_t c) { return !is_heard(c); });
    } else if (!is_heard(*open.begin())) {
      if (!run.too_fast(hurried)) run.prune(p, *open.begin());
      co_return Result<void>{};
    }
    if (!open.empty()) continue;
    if (run.too_fast(hurried)) {
      run.tree[p].state = State::fresh;  // nothing is known of it yet
    } else {
      run.prune(p);
    }
    co_return Result<void>{};
  }
  co_return Result<void>{};
}

// Phase 7 and DIRS at once: DIS proves the whole address, so no window is needed. Any other slave under this prefix is
// then unknown and answers the closing phase 0. A wrong guess costs this way once; after two wrong guesses none is
// made.
rt::Task<Result<void>> RandWalk::try_serial(Run& run, const Prefix& prefix, std::uint16_t chunk) {
  const auto last = iurs(7, prefix.chunks[6]);
  const Wait none{};
  expected_.clear();
  const auto led = co_await ask(run, last, none);
  if (!led) co_return fail(led.error());
  expected_.assign(1, chunk);
  const auto direct = dirs(chunk);
  const Wait wait{.first = run.longest(), .direct = true, .early = true};
  const auto answered = co_await ask(run, direct, wait);
  if (!answered) co_return fail(answered.error());
  late_.clear();
  if (!is_heard(chunk)) {
    run.wrong_step();
    // Its DIS may have been late: it would be identified but unknown to the master, and never found.
    const auto address = run.address_under(prefix, chunk);
    const auto told = co_await tell(run, address, Identification::unknown);
    co_return told;
  }
  run.report.known = now();
  auto& entry = run.enter(prefix, chunk, now(), false);
  entry.device.proven = true;
  entry.now = false;
  run.prune(prefix);
  co_return Result<void>{};
}

// Puts the known answers under this prefix into `expected_`. True: the next request is for a known prefix, too: then no
// late answer can be mistaken, and the window closes early.
bool RandWalk::expect(Run& run, const Prefix& prefix) {
  const auto& node = run.tree[prefix];
  expected_.clear();
  if (node.state == Node::State::visited) expected_.push_back(*node.open.begin());
  if (node.state == Node::State::guessed) expected_.assign(node.open.begin(), node.open.end());
  return !expected_.empty() && std::ranges::all_of(expected_, [&](std::uint16_t chunk) {
    Prefix next = prefix;
    next.chunks[next.depth++] = chunk;
    if (run.guessed(next)) return true;
    const auto it = run.tree.find(next);
    return it != run.tree.end() && it->second.state != Node::State::fresh;
  });
}

// The answers to phase 7 give whole addresses.
rt::Task<Result<void>> RandWalk::leaf(Run& run, const Prefix& prefix) {
  run.prune(prefix);
  run.report.known = now();
  std::optional<LssAddress> asked;
  for (const auto& h : heard_) {
    auto& entry = run.enter(prefix, h.chunk, h.at, false);
    entry.doubled |= h.times > 1;
    entry.doubtful |= run.options.prove_all || run.may_be_stray(prefix, h.chunk);
    if (!asked || (entry.doubtful && !run.find(*asked)->doubtful)) asked = entry.device.address;
  }
  // A DIS after this way only proves what was heard since the slave joined it: a deaf slave may have joined late, when
  // an answer of its own came late too. Addresses to be proven are led once more through the whole way (`settle`).
  if (run.options.prove_all) co_return Result<void>{};
  // One of them can be asked directly at once; this returns all others to unknown, which they have to become anyway.
  const LssAddress address = *asked;
  const auto frame = dirs(address.chunk(7));
  const Wait wait{.first = run.longest(), .direct = true, .early = true};
  expected_.assign(1, address.chunk(7));
  const auto answered = co_await ask(run, frame, wait);
  if (!answered) co_return fail(answered.error());
  auto& entry = *run.find(address);
  if (is_heard(address.chunk(7))) {
    entry.device.proven = true;
    entry.now = false;
    co_return Result<void>{};
  }
  entry.doubtful = true;
  ++run.silent;
  const auto told = co_await tell(run, address, Identification::unknown);
  co_return told;
}

// Leads all slaves with the address's chunks to the end of phase 7. False: none answered on the way.
rt::Task<Result<bool>> RandWalk::lead(Run& run, LssAddress address) {
  for (unsigned phase = 0; phase < 8; ++phase) {
    const auto frame = iurs(phase, phase == 0 ? std::uint16_t{0} : address.chunk(phase - 1));
    expected_.assign(1, address.chunk(phase));
    const Wait wait{.first = run.longest(), .early = true};
    const auto answered = co_await ask(run, frame, wait);
    if (!answered) co_return fail(answered.error());
    if (!is_heard(address.chunk(phase))) co_return false;
  }
  co_return true;
}

// ---- both -----------------------------------------------------------------------------------------------------------

// Asks one address directly: its slave is then identified. `whole_window`: waits for a second DIS.
rt::Task<Result<RandWalk::Proof>> RandWalk::prove(Run& run, LssAddress address, bool resumes, bool whole_window) {
  if (!resumes) {
    const auto led = co_await lead(run, address);
    if (!led) co_return fail(led.error());
    if (!*led) co_return Proof::none;
  }
  const auto frame = resumes ? resume_request(direct_phase, address) : dirs(address.chunk(7));
  expected_.assign(1, address.chunk(7));
  const Wait wait{.first = run.longest(),
                  .after_last = whole_window ? run.longest() : rt::Duration{0},
                  .direct = true,
                  .early = !whole_window};
  const auto answered = co_await ask(run, frame, wait);
  if (!answered) co_return fail(answered.error());
  const auto place = std::ranges::find(heard_, address.chunk(7), &Heard::chunk);
  if (place == heard_.end()) co_return Proof::none;
  co_return place->times > 1 ? Proof::twice : Proof::once;
}

// The addresses heard in this round: proven or dropped, and silenced.
rt::Task<Result<void>> RandWalk::settle(Run& run) {
  for (std::size_t i = 0; i < run.entries.size(); ++i) {
    if (!run.entries[i].now) continue;
    const auto address = run.entries[i].device.address;
    const bool resumes = run.entries[i].device.resumes;
    if (!resumes && !run.entries[i].doubtful) {
      const auto told = co_await tell(run, address, Identification::identified);
      if (!told) co_return fail(told.error());
      run.entries[i].now = false;
      continue;
    }
    const auto proof = co_await prove(run, address, resumes, false);
    if (!proof) co_return fail(proof.error());
    auto& entry = run.entries[i];
    if (*proof != Proof::none) {
      entry.device.proven = true;
      entry.now = false;
      continue;
    }
    ++run.silent;
    // No slave, or its DIS was lost: without this it would never answer again.
    const auto told = co_await tell(run, address, Identification::unknown);
    if (!told) co_return fail(told.error());
  }
  const auto doubtful = [](const Run::Entry& e) { return e.now && !e.device.proven && e.device.times_found == 1; };
  run.report.dropped += static_cast<unsigned>(std::erase_if(run.entries, doubtful));
  for (auto& entry : run.entries) {
    entry.now = false;
    if (run.observer != nullptr && !std::exchange(entry.told, true)) run.observer->found(entry.device);
  }
  co_return Result<void>{};
}

// DIS after the end of their window, and addresses heard twice: two devices, or a frame that CAN delivered twice? They
// are asked again, with the whole window.
rt::Task<Result<void>> RandWalk::clones(Run& run) {
  for (std::size_t i = 0; i < run.entries.size(); ++i) {
    const auto address = run.entries[i].device.address;
    const bool extra = std::ranges::find(extra_dis_, address.chunk(7)) != extra_dis_.end();
    if (run.entries[i].device.possible_clone || (!extra && !run.entries[i].doubled)) continue;
    run.entries[i].doubled = false;
    const auto woken = co_await tell(run, address, Identification::unknown);
    if (!woken) co_return fail(woken.error());
    const bool resumes = run.entries[i].device.resumes;
    const auto proof = co_await prove(run, address, resumes, true);
    if (!proof) co_return fail(proof.error());
    run.entries[i].device.possible_clone = *proof == Proof::twice;
    if (*proof == Proof::twice && run.observer != nullptr) run.observer->found(run.entries[i].device);
    if (*proof != Proof::none) continue;
    const auto left = co_await tell(run, address, Identification::identified);
    if (!left) co_return fail(left.error());
  }
  extra_dis_.clear();
  co_return Result<void>{};
}

// Phase 0: is a slave left?
rt::Task<Result<bool>> RandWalk::closing(Run& run) {
  const auto fence = run.last_sent + run.longest();
  if (run.report.requests > 0 && now() < fence) co_await rt::sleep_until(fence);
  const auto frame = iurs(0, 0);
  expected_.clear();
  const Wait wait{.first = run.longest()};
  co_return co_await ask(run, frame, wait);
}

// One way through all slaves that answer. False: phase 0 stayed unanswered.
rt::Task<Result<bool>> RandWalk::look(Run& run) {
  const auto anybody = co_await closing(run);
  if (!anybody) co_return fail(anybody.error());
  ++run.report.rounds;
  if (!*anybody) co_return false;
  std::vector<std::uint16_t> first;
  for (const auto& h : heard_) first.push_back(h.chunk);
  if (run.resume) {
    const auto heard = co_await resuming(run);
    if (!heard) co_return fail(heard.error());
    run.resume = *heard > 0;
  }
  const bool walked = run.resume || run.stopped;
  if (walked) co_return true;
  const auto led = co_await paper(run, first);
  if (!led) co_return fail(led.error());
  co_return true;
}

rt::Task<Result<WalkReport>> RandWalk::discover(std::span<const WalkKind> kinds, const WalkOptions& options,
                                                WalkObserver* observer) {
  using End = DiscoveryReport::End;
  if (busy_) co_return fail(Errc::invalid, walk_busy);
  const Lease lease(*this);
  Run run{.kinds = kinds, .options = options, .observer = observer};
  auto& report = run.report;
  report.began = report.known = report.silenced = now();
  extra_dis_.clear();
  slowest_ = {};
  answers_ = 0;
  // Resuming slaves answer the closing phase 0 too: they are asked first, if any.
  run.resume = options.resume;
  bool walked = false;
  if (run.resume) {
    const auto heard = co_await resuming(run);
    if (!heard) co_return fail(heard.error());
    run.resume = walked = *heard > 0;
  }
  for (bool more = true; more;) {
    const auto before = run.known_before;
    const bool looks = !walked && !run.stopped;
    if (looks) {
      const auto anybody = co_await look(run);
      if (!anybody) co_return fail(anybody.error());
      if (!*anybody) break;
    }
    walked = false;
    run.guess = run.hurry = false;
    const auto settled = co_await settle(run);
    if (!settled) co_return fail(settled.error());
    const auto looked = co_await clones(run);
    if (!looked) co_return fail(looked.error());
    report.silenced = now();
    run.streak = run.entries.size() > before ? 0 : run.streak + 1;
    run.known_before = run.entries.size();
    const auto often = [](const Run::Entry& e) { return e.device.times_found >= most_times_found; };
    if (run.streak > options.retries) report.end = End::gave_up;
    if (std::ranges::any_of(run.entries, often)) report.end = End::stuck;
    if (run.entries.size() >= options.most_devices) report.end = End::limit;
    if (run.stopped && report.end == End::complete) report.end = End::stopped;
    more = report.end == End::complete;
  }
  report.ended = now();
  for (const auto& entry : run.entries) report.found.push_back(entry.device);
  co_return std::move(report);
}

}  // namespace berth::nodeid
