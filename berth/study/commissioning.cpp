#include "berth/study/commissioning.hpp"

#include "berth/rt/scope.hpp"

namespace berth::study {
namespace {

// The machine file's defaults (`operate::Network::asking`): a silent node-ID costs three windows of 100 ms.
co::SdoOptions patience() {
  co::SdoOptions options;
  options.timeout = std::chrono::milliseconds(100);
  options.abort_on_timeout = false;
  return options;
}

}  // namespace

Commissioning::Commissioning(Stage& stage)
    : dispatcher_(&stage.master()),
      lss_(stage.master()),
      sdo_(stage.master(), patience()),
      nmt_(stage.master()),
      boots_(stage.master()) {}

places::Binder::Services Commissioning::services() noexcept {
  return {*dispatcher_, lss_, sdo_, nmt_, boots_, store_, vacancy_};
}

rt::Task<void> Commissioning::bind(std::vector<places::Assignment> seats) {
  rt::Scope asked(dispatcher_->executor());
  for (const auto& seat : seats) asked.spawn(ask(seat));
  co_await asked.join();
  others_.clear();
  for (const auto& seat : seats) others_.push_back(seat.device.address);
  for (const auto& seat : seats) co_await bind_one(seat);
}

rt::Task<void> Commissioning::ask(places::Assignment seat) {
  const places::Binder::Options options;
  places::Binder binder(services(), options);
  const auto vacant = co_await binder.vacant(seat.id, seat.device);
  static_cast<void>(vacant);  // the binding looks it up
}

rt::Task<void> Commissioning::bind_one(places::Assignment seat) {
  const auto slot = store_.declare({"study", std::string(bus_name), std::to_string(seat.id.value())});
  if (!slot) co_return;
  const places::SlotId place = *slot;
  const std::string reason = "found";
  places::Binder::Options options;
  options.parts = lss::parts_to_ask(seat.device.address, others_);  // as the main job does
  places::Binder binder(services(), options);
  places::Binding binding(places::Binding::Kind::bind, seat, options.tries);
  co_await binder.run(binding, place, reason);
  if (binding.step() == places::Step::done) ++bound_;
}

}  // namespace berth::study
