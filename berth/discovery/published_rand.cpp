#include <algorithm>

#include "berth/discovery/by_name.hpp"
#include "berth/discovery/published.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/nodeid/rand_walk.hpp"

namespace berth::discovery {
namespace {

Report::End end_of(nodeid::DiscoveryReport::End end) noexcept {
  switch (end) {
    case nodeid::DiscoveryReport::End::complete: return Report::End::complete;
    case nodeid::DiscoveryReport::End::gave_up: return Report::End::gave_up;
    case nodeid::DiscoveryReport::End::stuck: return Report::End::stuck;
    case nodeid::DiscoveryReport::End::limit: return Report::End::limit;
    case nodeid::DiscoveryReport::End::stopped: return Report::End::more;
  }
  return Report::End::gave_up;
}

Found one(const nodeid::Discovered& d) noexcept {
  return {.address = d.address,
          .at = d.at,
          .active = {},
          .assigned = {},
          .possible_clone = d.possible_clone,
          .by = Method::rand};
}

// Devices that sit in their slots do not answer (S1.31 step 3).
rt::Task<Result<void>> tell_who_is_known(nodeid::RandMaster& rand, const Known& known, const Options& options) {
  const rt::Duration pause = options.inhibit;
  for (std::size_t i = 0; i < known.registered.size(); ++i) {
    const LssAddress device = known.registered[i];
    const auto told = co_await rand.switch_selective(device, nodeid::Identification::identified, pause);
    if (!told) co_return fail(told.error());
  }
  co_return Result<void>{};
}

nodeid::DiscoveryOptions rand_options(const Options& options) {
  nodeid::DiscoveryOptions o;
  o.window = nodeid::DiscoveryOptions::Window::fixed;
  if (options.window.count() > 0) o.collect = options.window;
  o.inhibit = options.inhibit;
  o.retries = options.retries;
  o.most_devices = options.most_devices;
  return o;
}

class Rand final : public Discovery, private nodeid::DiscoveryObserver {
 public:
  explicit Rand(const Services& services) : services_(services), rand_(services.dispatcher) {}
  [[nodiscard]] Method method() const noexcept override { return Method::rand; }

  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override {
    const auto told = co_await tell_who_is_known(rand_, known, options);
    if (!told) co_return fail(told.error());
    const nodeid::DiscoveryOptions how = rand_options(options);
    observer_ = options.observer;
    nodeid::DiscoveryObserver* const watching = this;
    const auto done = co_await rand_.discover(how, watching);
    observer_ = nullptr;
    if (!done) co_return fail(done.error());
    Report report = report_of(*done);
    const auto assigned = co_await assign_all(services_.lss, known, report, options);
    if (!assigned) co_return fail(assigned.error());
    co_return report;
  }

  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override {
    const nodeid::DiscoveryOptions how = rand_options(options);
    const auto heard = co_await rand_.probe(how);
    if (!heard) co_return fail(heard.error());
    co_return heard->anybody;
  }

 private:
  void phase(const nodeid::PhaseEvent&) noexcept override {}
  void restarted(unsigned, rt::Time) noexcept override {}
  bool goes_on() noexcept override { return observer_ == nullptr || observer_->goes_on(); }
  void found(const nodeid::Discovered& device) noexcept override {
    if (observer_ != nullptr) observer_->found(one(device));
  }
  Services services_;
  nodeid::RandMaster rand_;
  Observer* observer_ = nullptr;
};

class RandTree final : public Discovery, private nodeid::WalkObserver {
 public:
  explicit RandTree(const Services& services)
      : services_(services), rand_(services.dispatcher), walk_(services.dispatcher) {}
  [[nodiscard]] Method method() const noexcept override { return Method::planner_rand; }

  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override {
    const auto told = co_await tell_who_is_known(rand_, known, options);
    if (!told) co_return fail(told.error());
    std::vector<nodeid::WalkKind> kinds;
    for (const auto& k : known.kinds) kinds.push_back({.type = k.type, .revision = k.revision});
    for (const auto& a : known.expected) kinds.push_back({.type = a.type(), .revision = a.revision});
    nodeid::WalkOptions how{.shortest = options.shortest,
                            .blocking = options.blocking,
                            .inhibit = options.inhibit,
                            .prove_all = options.confirm,
                            .retries = options.retries,
                            .most_devices = options.most_devices};
    if (options.window.count() > 0) how.longest = options.window;
    observer_ = options.observer;
    nodeid::WalkObserver* const watching = this;
    const std::span<const nodeid::WalkKind> types(kinds);
    const auto done = co_await walk_.discover(types, how, watching);
    observer_ = nullptr;
    if (!done) co_return fail(done.error());
    Report report;
    report.end = end_of(done->end);
    report.requests = done->requests;
    report.restarts = done->dead_branches;
    report.began = done->began;
    report.known = done->known;
    report.ended = done->ended;
    for (const auto& d : done->found) report.found.push_back(one(d));
    const auto assigned = co_await assign_all(services_.lss, known, report, options);
    if (!assigned) co_return fail(assigned.error());
    co_return report;
  }

  // With the longest window that an answer can need, not the paper's.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override {
    nodeid::DiscoveryOptions how = rand_options(options);
    how.collect = options.window.count() > 0 ? options.window : nodeid::WalkOptions{}.longest;
    const auto heard = co_await rand_.probe(how);
    if (!heard) co_return fail(heard.error());
    co_return heard->anybody;
  }

 private:
  void found(const nodeid::Walked& device) noexcept override {
    if (observer_ != nullptr) observer_->found(one(device));
  }
  bool goes_on() noexcept override { return observer_ == nullptr || observer_->goes_on(); }
  static Found one(const nodeid::Walked& d) noexcept {
    return {.address = d.address,
            .at = d.at,
            .active = {},
            .assigned = {},
            .possible_clone = d.possible_clone,
            .by = Method::planner_rand};
  }
  Services services_;
  nodeid::RandMaster rand_;
  nodeid::RandWalk walk_;
  Observer* observer_ = nullptr;
};

}  // namespace

Report report_of(const nodeid::DiscoveryReport& rand) {
  Report report;
  report.end = end_of(rand.end);
  report.requests = rand.requests;
  report.restarts = rand.restarts;
  report.began = report.known = rand.began;
  report.ended = rand.ended;
  for (const auto& d : rand.found) {
    report.found.push_back(one(d));
    report.known = std::max(report.known, d.at);
  }
  return report;
}

std::unique_ptr<Discovery> make_rand(const Services& services) { return std::make_unique<Rand>(services); }
std::unique_ptr<Discovery> make_rand_walk(const Services& services) { return std::make_unique<RandTree>(services); }

}  // namespace berth::discovery
