#include <algorithm>

#include "berth/discovery/by_name.hpp"
#include "berth/discovery/published.hpp"
#include "berth/discovery/published_parts.hpp"

namespace berth::discovery {

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

namespace {

Found one(const nodeid::Discovered& d) noexcept { return found_by(Method::rand, d.address, d.at, d.possible_clone); }

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
    const auto heard = co_await rand_.any_unknown(how);
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

}  // namespace berth::discovery
