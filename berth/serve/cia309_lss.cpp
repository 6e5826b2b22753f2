#include "berth/serve/cia309_lss.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/lss/fastscan.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration usual_window = 100ms;  // of a Fastscan request, as in CANopenNode

std::string address_text(const LssAddress& a) {
  return fmt::format("0x{:08X} 0x{:08X} 0x{:08X} 0x{:08X}", a.vendor, a.product, a.revision, a.serial);
}

lss::IdentifyRanges ranges_of(const Request& request) {
  const auto& n = request.numbers;
  return {n[0], n[1], n[2], n[3], n[4], n[5]};
}

/// Value and mask of each part, from `first` on.
void take_known(lss::FastscanOptions& options, const Request& request, std::size_t first) {
  const auto* const n = request.numbers.data() + first;
  options.known = {n[0], n[2], n[4], n[6]};
  options.known_bits = {n[1], n[3], n[5], n[7]};
}

}  // namespace

rt::Task<Outcome> LssCommands::run(const Request& request, Net& net) {
  if (!permits_->may_send(net, false)) co_return Outcome::refused(Code::internal_state);
  const bool ours = co_await net.take_turn();
  if (!ours) {
    permits_->tell(
        fmt::format("bus {}: the main job, or another client, uses LSS; try again later", net.network.bus().name));
    co_return Outcome::refused(Code::internal_state);
  }
  const bool selected_before = net.selected;
  Outcome outcome = co_await service(request, net);
  if (!net.selected || (outcome.failed() && !selected_before)) net.release();
  co_return outcome;
}

rt::Task<Outcome> LssCommands::service(const Request& request, Net& net) {
  switch (request.verb) {
    case Verb::lss_slowscan: co_return co_await slowscan(request, net);
    case Verb::lss_fastscan: co_return co_await fastscan(request, net);
    case Verb::lss_allnodes: co_return co_await allnodes(request, net);
    case Verb::lss_switch_selective: co_return co_await select(request, net);
    case Verb::lss_switch_global: co_return co_await switch_global(request, net);
    default: co_return co_await requests_.run(request, net);
  }
}

// From the first frame on, a device may be in configuration state. A request that Berth refuses sends no frame.
rt::Task<Outcome> LssCommands::select(const Request& request, Net& net) {
  const bool before = std::exchange(net.selected, true);
  Outcome outcome = co_await requests_.run(request, net);
  if (outcome.code == Code::internal_state) net.selected = before;
  co_return outcome;
}

rt::Task<Outcome> LssCommands::switch_global(const Request& request, Net& net) {
  const bool configuration = request.numbers[0] == 1;
  if (configuration) co_return co_await select(request, net);
  Outcome outcome = co_await requests_.run(request, net);
  if (!outcome.failed()) net.selected = false;
  co_return outcome;
}

// ---- searches ----

rt::Task<Result<bool>> LssCommands::anybody_in(lss::IdentifyRanges ranges, Net& net) {
  const auto heard = co_await net.network.services().lss.identify_remote(ranges);
  if (!heard) co_return fail(heard.error());
  co_return heard->answers > 0;
}

// Finds the lowest revision number, then the lowest serial number, each by halving the range.
rt::Task<Outcome> LssCommands::slowscan(const Request& request, Net& net) {
  lss::IdentifyRanges ranges = ranges_of(request);
  const auto first = co_await anybody_in(ranges, net);
  if (!first) co_return net.failed(first.error());
  if (!*first) co_return Outcome::refused(Code::timeout);
  for (const bool serial : {false, true}) {
    std::uint32_t& low = serial ? ranges.serial_low : ranges.revision_low;
    std::uint32_t& high = serial ? ranges.serial_high : ranges.revision_high;
    while (low < high) {
      const std::uint32_t top = high;
      high = low + (high - low) / 2;
      const auto below = co_await anybody_in(ranges, net);
      if (!below) co_return net.failed(below.error());
      if (*below) continue;
      low = high + 1;
      high = top;
    }
  }
  const LssAddress address{ranges.vendor, ranges.product, ranges.revision_low, ranges.serial_low};
  Request found = request;
  found.verb = Verb::lss_switch_selective;
  found.numbers = {address.vendor, address.product, address.revision, address.serial};
  const Outcome selected = co_await select(found, net);
  co_return selected.failed() ? selected : Outcome::value(address_text(address));
}

rt::Task<Outcome> LssCommands::fastscan(const Request& request, Net& net) {
  lss::FastscanOptions options;
  options.window = request.count > 0 && request.numbers[0] > 0 ? request.numbers[0] * 1ms : usual_window;
  if (request.count == 9) take_known(options, request, 1);
  const auto waiting = co_await net.network.services().lss.switch_global(lss::State::waiting);
  if (!waiting) co_return net.failed(waiting.error());
  lss::Fastscan scan(net.network.services().lss, options);
  net.selected = true;
  const auto found = co_await scan.scan();
  if (!found) co_return net.failed(found.error());
  if (!*found) co_return Outcome::refused(Code::timeout);
  co_return Outcome::value(address_text((*found)->address));
}

namespace {

bool heard_lately(NodeId id, const Net& net) {
  return id == net.network.bus().master || net.network.services().boots.heard(id).has_value();
}

/// Assigns node-IDs in ascending order and skips those in use.
class Ids final : public lss::FastscanOwner {
 public:
  Ids(Net& net, std::uint8_t first) : net_(&net), next_(first) {}
  NodeId assign(const lss::FastscanDevice&) noexcept override {
    while (next_ <= 127 && heard_lately(NodeId(next_), *net_)) ++next_;
    return next_ <= 127 ? NodeId(next_++) : NodeId();
  }
  void assigned(const lss::FastscanDevice& device) noexcept override {
    text += fmt::format("# Node-ID {} assigned to: {}\r\n", device.assigned.value(), address_text(device.address));
  }
  std::string text;

 private:
  Net* net_;
  std::uint8_t next_;
};

}  // namespace

rt::Task<Outcome> LssCommands::allnodes(const Request& request, Net& net) {
  lss::FastscanOptions options;
  options.window = request.count > 0 && request.numbers[0] > 0 ? request.numbers[0] * 1ms : usual_window;
  options.store = request.count < 3 || request.numbers[2] == 1;
  if (request.count == 11) take_known(options, request, 3);
  const bool partial = options.known_bits != LssAddress{};
  Ids ids(net, request.count >= 2 ? static_cast<std::uint8_t>(request.numbers[1]) : std::uint8_t{2});
  lss::Fastscan scan(net.network.services().lss, options);
  net.selected = true;
  const auto report = co_await scan.discover(ids);
  if (!report) co_return net.failed(report.error());
  net.selected = report->end == lss::FastscanReport::End::gave_up;
  using End = lss::FastscanReport::End;
  const bool others_only = partial && report->end == End::gave_up;  // another device than the wanted ones answers
  const bool whole = report->end == End::complete || others_only;
  Outcome outcome;
  const auto count = std::ranges::count_if(report->found, [](const auto& d) { return d.assigned.configured(); });
  outcome.text = ids.text + (whole ? fmt::format("# Found {} nodes, search finished.\r\n", count)
                                   : std::string("# Not all nodes scanned!\r\n"));
  net.release();
  co_return outcome;
}

}  // namespace berth::serve::cia309
