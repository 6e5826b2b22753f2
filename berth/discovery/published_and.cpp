#include "berth/discovery/by_name.hpp"
#include "berth/discovery/published.hpp"
#include "berth/discovery/published_parts.hpp"
#include "berth/research/and_master.hpp"

namespace berth::discovery {
namespace {

research::AndOptions and_options(const Options& options) {
  research::AndOptions how;
  how.discovery.window = nodeid::DiscoveryOptions::Window::fixed;
  if (options.window.count() > 0) how.discovery.collect = options.window;
  how.discovery.retries = options.retries;
  how.discovery.most_devices = options.most_devices;
  return how;
}

class And final : public Discovery, private research::AndObserver {
 public:
  explicit And(const Services& services) : services_(services), and_(services.dispatcher) {}
  [[nodiscard]] Method method() const noexcept override { return Method::and_protocol; }

  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override {
    // A master that ended has left its devices identified: without this they would stay silent for ever.
    const auto everybody = co_await and_.switch_global(nodeid::Identification::unknown);
    if (!everybody) co_return fail(everybody.error());
    for (std::size_t i = 0; i < known.registered.size(); ++i) {
      const research::AndAddress device(known.registered[i]);
      const auto told = co_await and_.switch_selective(device, nodeid::Identification::identified);
      if (!told) co_return fail(told.error());
    }
    const research::AndOptions how = and_options(options);
    observer_ = options.observer;
    research::AndObserver* const watching = this;
    const auto done = co_await and_.discover(how, watching);
    observer_ = nullptr;
    if (!done) co_return fail(done.error());
    Report report = numbers_of(*done, end_of(done->end), done->restarts);
    for (const auto& d : done->found) {
      if (d.address) report.found.push_back(one(d));
    }
    const auto assigned = co_await assign_all(services_.lss, known, report, options);
    if (!assigned) co_return fail(assigned.error());
    co_return report;
  }

  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override {
    const research::AndOptions how = and_options(options);
    co_return co_await and_.any_unknown(how);
  }

 private:
  void found(const research::AndFound& device) noexcept override {
    if (observer_ != nullptr && device.address) observer_->found(one(device));
  }
  bool goes_on() noexcept override { return observer_ == nullptr || observer_->goes_on(); }
  static Found one(const research::AndFound& d) noexcept {
    return found_by(Method::and_protocol, *d.address, d.at, d.ambiguous);
  }
  Services services_;
  research::AndMaster and_;
  Observer* observer_ = nullptr;
};

}  // namespace

std::unique_ptr<Discovery> make_and(const Services& services) { return std::make_unique<And>(services); }

}  // namespace berth::discovery
