#include "berth/discovery/planner_rand.hpp"

#include <span>
#include <vector>

#include "berth/discovery/by_name.hpp"
#include "berth/discovery/published_parts.hpp"
#include "berth/nodeid/rand_walk.hpp"

namespace berth::discovery {
namespace {

class PlannerRand final : public Discovery, private nodeid::WalkObserver {
 public:
  explicit PlannerRand(const Services& services)
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
    Report report = numbers_of(*done, end_of(done->end), done->dead_branches);
    for (const auto& d : done->found) report.found.push_back(one(d));
    const auto assigned = co_await assign_all(services_.lss, known, report, options);
    if (!assigned) co_return fail(assigned.error());
    co_return report;
  }

  // Uses the longest window that an answer can need, not the paper's window.
  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override {
    nodeid::DiscoveryOptions how = rand_options(options);
    how.collect = options.window.count() > 0 ? options.window : nodeid::WalkOptions{}.longest;
    const auto heard = co_await rand_.any_unknown(how);
    if (!heard) co_return fail(heard.error());
    co_return heard->anybody;
  }

 private:
  void found(const nodeid::Walked& device) noexcept override {
    if (observer_ != nullptr) observer_->found(one(device));
  }
  bool goes_on() noexcept override { return observer_ == nullptr || observer_->goes_on(); }
  static Found one(const nodeid::Walked& d) noexcept {
    return found_by(Method::planner_rand, d.address, d.at, d.possible_clone);
  }
  Services services_;
  nodeid::RandMaster rand_;
  nodeid::RandWalk walk_;
  Observer* observer_ = nullptr;
};

}  // namespace

std::unique_ptr<Discovery> make_planner_rand(const Services& services) {
  return std::make_unique<PlannerRand>(services);
}

}  // namespace berth::discovery
