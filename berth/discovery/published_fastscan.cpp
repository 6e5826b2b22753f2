#include <algorithm>

#include "berth/discovery/published.hpp"
#include "berth/discovery/published_parts.hpp"
#include "berth/lss/fastscan.hpp"

namespace berth::discovery {
namespace {

Report::End end_of(lss::FastscanReport::End end) noexcept {
  switch (end) {
    case lss::FastscanReport::End::complete: return Report::End::complete;
    case lss::FastscanReport::End::gave_up: return Report::End::gave_up;
    case lss::FastscanReport::End::held: return Report::End::held;
    case lss::FastscanReport::End::limit: return Report::End::limit;
    case lss::FastscanReport::End::stuck: return Report::End::stuck;
    case lss::FastscanReport::End::stopped: return Report::End::more;
  }
  return Report::End::gave_up;
}

// The device is registered, has its node-ID, and keeps answering.
bool seated(const Known& known, const lss::FastscanDevice& device) noexcept {
  const bool registered = std::ranges::find(known.registered, device.address) != known.registered.end();
  return registered && device.active.configured();
}

class PublishedFastscan final : public Discovery {
 public:
  PublishedFastscan(const Services& services, lss::Feedback feedback) : services_(services), feedback_(feedback) {}

  [[nodiscard]] Method method() const noexcept override {
    switch (feedback_) {
      case lss::Feedback::none: return Method::fastscan;
      case lss::Feedback::extended: return Method::feedback_29;
      case lss::Feedback::base: return Method::feedback_11;
    }
    return Method::fastscan;
  }

  [[nodiscard]] rt::Task<Result<Report>> find(const Known& known, const Options& options) override {
    listen();
    lss::FastscanOptions how{
        .form = lss::FastscanForm::merged, .feedback = feedback_, .confirm = options.confirm, .store = options.store};
    if (options.window.count() > 0) how.window = options.window;
    how.retries = options.retries;
    how.most_devices = options.most_devices;
    lss::Fastscan fastscan(services_.lss, how);
    Owner owner(*this, known, options);
    const auto done = co_await fastscan.discover(owner);
    if (!done) co_return fail(done.error());
    Report report = numbers_of(*done, end_of(done->end), done->restarts);
    for (const auto& d : done->found) {
      if (!seated(known, d)) report.found.push_back(found(d));
    }
    co_return report;
  }

  [[nodiscard]] rt::Task<Result<bool>> anybody(const Options& options) override {
    lss::ServiceOptions service = services_.lss.options().fastscan;
    if (options.window.count() > 0) service.timeout = options.window;
    service.full_window = false;
    const lss::FastscanRequest start{};
    const auto reply = co_await services_.lss.fastscan(start, service);
    if (!reply) co_return fail(reply.error());
    co_return reply->answers > 0;
  }

 private:
  class Owner final : public lss::FastscanOwner {
   public:
    Owner(const PublishedFastscan& method, const Known& known, const Options& options) noexcept
        : method_(method), known_(known), options_(options) {}
    NodeId assign(const lss::FastscanDevice& device) noexcept override {
      const NodeId id =
          options_.assigner == nullptr ? NodeId() : options_.assigner->assign(device.address, options_.confirm);
      if (!id.configured()) tell(device);
      return id;
    }
    void assigned(const lss::FastscanDevice& device) noexcept override { tell(device); }
    [[nodiscard]] bool still_vacant(NodeId id) const noexcept override {
      return options_.assigner == nullptr || options_.assigner->still_vacant(id);
    }
    bool goes_on() noexcept override { return options_.observer == nullptr || options_.observer->goes_on(); }

   private:
    void tell(const lss::FastscanDevice& device) noexcept {
      if (options_.observer != nullptr && !seated(known_, device)) options_.observer->found(method_.found(device));
    }
    const PublishedFastscan& method_;
    const Known& known_;
    const Options& options_;
  };

  [[nodiscard]] Found found(const lss::FastscanDevice& d) const noexcept {
    return {.address = d.address,
            .at = d.at,
            .active = d.active,
            .assigned = d.assigned,
            .possible_clone = d.possible_clone,
            .by = method()};
  }

  // If the sixteen identifiers are not configured, this method chooses them.
  void listen() {
    if (feedback_ != lss::Feedback::base || services_.lss.options().feedback_base != 0) return;
    lss::MasterOptions options = services_.lss.options();
    options.feedback_base = lss::default_feedback_base;
    services_.lss.set_options(options);
  }

  Services services_;
  lss::Feedback feedback_;
};

}  // namespace

std::unique_ptr<Discovery> make_fastscan(const Services& services, lss::Feedback feedback) {
  return std::make_unique<PublishedFastscan>(services, feedback);
}

}  // namespace berth::discovery
