#include "berth/operate/search_methods.hpp"

#include <algorithm>

namespace berth::operate {

namespace {

// RAND was asked before.
constexpr discovery::AutoOptions only_the_rest{.rand = false, .configured = false};

LssAddress with_serial(LssAddress address, std::uint32_t serial) noexcept {
  address.serial = serial;
  return address;
}

}  // namespace

SearchMethods::SearchMethods(BusServices& services, SlotTable& slots, const Agenda& agenda, const FoundDevices& found,
                             Lending& lending)
    : s_(services),
      slots_(slots),
      agenda_(agenda),
      found_(found),
      lending_(lending),
      rand_planner_(discovery::make(discovery::Method::planner_rand, {s_.dispatcher, s_.lss})),
      rest_(std::make_unique<discovery::Auto>(discovery::Services{s_.dispatcher, s_.lss}, only_the_rest)) {}

discovery::Auto& SearchMethods::rest(bool also_configured) {
  discovery::AutoOptions options = rest_->options();
  options.configured = also_configured;
  rest_->set_options(options);
  return *rest_;
}

discovery::Discovery* SearchMethods::chosen() {
  if (chosen_ != nullptr && chosen_name_ == agenda_.method()) return chosen_.get();
  const auto way = discovery::method(agenda_.method());
  if (!way) {
    slots_.events().tell_once(EventKind::error, "there is no discovery method " + agenda_.method());
    return nullptr;
  }
  chosen_ = discovery::make(*way, {s_.dispatcher, s_.lss});
  chosen_name_ = agenda_.method();
  return chosen_.get();
}

discovery::Known SearchMethods::known_devices() const {
  discovery::Known known;
  const auto add = [&](const TypeCode& type, const std::optional<std::uint32_t>& revision) {
    const discovery::Kind kind{type, revision};
    if (std::ranges::find(known.kinds, kind) == known.kinds.end()) known.kinds.push_back(kind);
  };
  for (const auto& seat : slots_.seats()) {
    const auto& spec = seat->slot.spec;
    const bool exact = spec.rule == places::RevisionRule::exact;
    const auto revision = exact ? spec.revision : std::nullopt;
    if (spec.asks.unasked == 0) add(spec.type, revision);
    for (const auto& other : spec.also) add(other.type, exact ? other.revision : std::nullopt);
    const auto device = seat->slot.record.device();
    // A device without a serial number has equals, which are searched for.
    const bool one = device && device->has_serial();
    if (one) (seat->is_accounted_for() ? known.registered : known.expected).push_back(device->address);
    if (device && !one && seat->is_accounted_for()) known.equals.push_back(device->address);
    // Also if the slot takes other revisions: asking for the named one costs one question.
    if (device || !spec.revision) continue;
    const LssAddress named{spec.type.vendor, spec.type.product, *spec.revision, 0};
    if (spec.asks.serial) known.expected.push_back(with_serial(named, *spec.asks.serial));
    for (const auto serial : spec.spares) known.expected.push_back(with_serial(named, serial));
  }
  for (const auto& f : found_.all()) {
    const bool named = std::ranges::find(known.registered, f.device.address) != known.registered.end();
    if (!named && f.device.has_serial()) known.registered.push_back(f.device.address);
    if (!f.device.has_serial() && f.active.configured() && !f.lent) known.equals.push_back(f.device.address);
  }
  return known;
}

discovery::Options SearchMethods::options(discovery::Observer* observer) const {
  discovery::Options options;
  const bool published = chosen_ != nullptr && !chosen_name_.starts_with("planner") && agenda_.method() == chosen_name_;
  if (!published) options.window = s_.bus.timing.lss_timeout;
  options.blocking = longest_frame();
  // On a slow bus a shorter window saves nothing, and a missed answer costs several frames.
  options.shortest = std::max(options.shortest, options.blocking / 3);
  options.inhibit = s_.lss.options().inhibit;
  // Missed devices are searched for again later. The machine waits meanwhile: a lost heartbeat is noticed only after
  // it.
  options.retries = 2;
  // Longer than the way down to one device if frames need pauses: after a stop it begins again.
  options.most_time = std::chrono::seconds(20);
  options.observer = observer;
  // The search gives each found device a temporary node-ID. In LSS configuration it would be silent, but some makers'
  // devices then answer everything, and Fastscan does not find the next device while this one answers.
  const bool by_requests_alone =
      agenda_.method() == "rand" || agenda_.method() == "planner-rand" || agenda_.method() == "and";
  if (!by_requests_alone) options.assigner = &lending_;
  options.confirm = published;
  return options;
}

// The longest frame of the bus: 8 bytes, 29 bits, every stuff bit there can be.
rt::Duration SearchMethods::longest_frame() const {
  return std::chrono::nanoseconds(160'000'000'000LL / s_.bus.bitrate);
}

// `rand_response` is the device's own time; its answer is received at its end: a frame without data after at most one
// heartbeat, together shorter than the longest frame.
rt::Duration SearchMethods::rand_window() const { return s_.bus.timing.rand_response + longest_frame(); }

nodeid::DiscoveryOptions SearchMethods::rand_options() const {
  nodeid::DiscoveryOptions o;
  o.t_resp = s_.bus.timing.rand_response;
  o.first = rand_window();
  o.t_proc = s_.bus.timing.rand_processing;
  o.inhibit = s_.bus.timing.rand_response;  // a small receive buffer loses back-to-back frames
  return o;
}

rt::Task<Result<discovery::Report>> SearchMethods::ask_rand_planner(discovery::Observer* observer) {
  discovery::Known known = known_devices();
  known.registered.clear();  // an answer from the address of a seated device is a second device
  discovery::Options how = options(observer);
  how.assigner = nullptr;  // a found device is identified and silent
  how.window = rand_window();
  co_return co_await rand_planner_->find(known, how);
}

rt::Task<Result<discovery::Report>> SearchMethods::ask_rand_as_published(nodeid::DiscoveryObserver* observer) {
  const nodeid::DiscoveryOptions how = rand_options();
  const auto report = co_await s_.rand.discover(how, observer);
  if (!report) co_return fail(report.error());
  co_return discovery::report_of(*report);
}

}  // namespace berth::operate
