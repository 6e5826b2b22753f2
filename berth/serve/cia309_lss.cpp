#include "berth/serve/cia309_lss.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "berth/lss/fastscan.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using namespace std::chrono_literals;

namespace {

constexpr rt::Duration usual_window = 100ms;  // of a Fastscan request, as CANopenNode has it
constexpr std::uint32_t refused_value = 1;    // error code of configure and store services
constexpr std::uint32_t store_medium = 2;

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
  using enum Verb;
  const auto& n = request.numbers;
  switch (request.verb) {
    case lss_switch_global: {
      const bool configuration = n[0] == 1;
      co_return co_await switch_global(configuration, net);
    }
    case lss_switch_selective: {
      const LssAddress address{n[0], n[1], n[2], n[3]};
      co_return co_await switch_selective(address, net);
    }
    case lss_set_node: {
      const NodeId id(static_cast<std::uint8_t>(n[0]));
      co_return co_await this->set_node(id, net);
    }
    case lss_conf_bitrate:
    case lss_activate_bitrate:
    case lss_store: co_return co_await configure(request, net);
    case lss_inquire_address:
    case lss_get_node: co_return co_await inquire(request, net);
    case lss_identity:
    case lss_identify_non_configured: co_return co_await identify(request, net);
    case lss_slowscan: co_return co_await slowscan(request, net);
    case lss_fastscan: co_return co_await fastscan(request, net);
    default: co_return co_await allnodes(request, net);
  }
}

Outcome LssCommands::failed(const Error& error, Net& net, Code refused) const {
  if (error.code != Errc::aborted) return net.failed(error);
  const auto code = error.detail & 0xFFU;
  if (code == refused_value) return Outcome::refused(refused);
  if (code == store_medium && refused == Code::lss_store) return Outcome::refused(Code::lss_medium);
  return Outcome::refused(Code::lss_specific);
}

// ---- states ----

rt::Task<Outcome> LssCommands::switch_global(bool configuration, Net& net) {
  auto wanted = permits_->request_for(net, "lss global");
  wanted.arguments["state"] = configuration ? "configuration" : "waiting";
  if (!permits_->undisturbing(wanted)) co_return Outcome::refused(Code::internal_state);
  const auto state = configuration ? lss::State::configuration : lss::State::waiting;
  if (configuration) net.selected = true;
  const auto sent = co_await net.network.services().lss.switch_global(state);
  if (!sent) co_return net.failed(sent.error());
  if (!configuration) net.selected = false;
  co_return Outcome();
}

bool LssCommands::may_select(const LssAddress& address, Net& net) const {
  auto wanted = permits_->request_for(net, "lss select");
  wanted.arguments["address"] = to_string(address);
  return permits_->undisturbing(wanted);
}

rt::Task<Outcome> LssCommands::switch_selective(LssAddress address, Net& net) {
  if (!may_select(address, net)) co_return Outcome::refused(Code::internal_state);
  net.selected = true;
  const auto selected = co_await net.network.services().lss.switch_selective(address);
  if (!selected) co_return net.failed(selected.error());
  co_return Outcome();
}

// ---- services on devices in configuration state ----

// A device that this conversation has not put there may be any.
bool LssCommands::may_configure(Net& net) const {
  if (net.selected) return true;
  const auto wanted = permits_->request_for(net, "lss store");
  return permits_->undisturbing(wanted);
}

// Another device that answers under this node-ID: asked by SDO.
rt::Task<bool> LssCommands::is_taken(NodeId id, Net& net) {
  if (id == net.network.bus().master) co_return true;
  co::SdoOptions patience = net.network.services().sdo.options();
  patience.timeout = net.network.bus().timing.guard_timeout;
  patience.abort_on_timeout = false;
  const auto type = co_await net.network.services().sdo.upload(id, 0x1000, 0, patience);
  co_return type.has_value() || type.error().code == Errc::aborted || type.error().code == Errc::mismatch;
}

rt::Task<Outcome> LssCommands::set_node(NodeId id, Net& net) {
  if (!may_configure(net)) co_return Outcome::refused(Code::internal_state);
  const auto now = co_await net.network.services().lss.inquire_node_id();
  const bool keeps = now && now->byte() == id.value();
  if (id.configured() && !keeps) {
    const bool taken = co_await is_taken(id, net);
    if (taken) {
      permits_->tell(
          fmt::format("bus {}: LSS node-ID {} belongs to another device", net.network.bus().name, id.value()));
      co_return Outcome::refused(Code::lss_node_id);
    }
  }
  const auto set = co_await net.network.services().lss.configure_node_id(id);
  if (!set) co_return failed(set.error(), net, Code::lss_node_id);
  co_return Outcome();
}

rt::Task<Outcome> LssCommands::configure(const Request& request, Net& net) {
  const auto& n = request.numbers;
  if (request.verb == Verb::lss_activate_bitrate) {
    // Devices that stay behind at the old rate and those at the new one would destroy each other's frames.
    auto wanted = permits_->request_for(net, "lss activate");
    wanted.arguments["delay"] = fmt::format("{}", n[0]);
    if (!permits_->undisturbing(wanted)) co_return Outcome::refused(Code::internal_state);
    const auto sent = co_await net.network.services().lss.activate_bit_timing(static_cast<std::uint16_t>(n[0]));
    if (!sent) co_return net.failed(sent.error());
    co_return Outcome();
  }
  if (!may_configure(net)) co_return Outcome::refused(Code::internal_state);
  if (request.verb == Verb::lss_store) {
    const auto stored = co_await net.network.services().lss.store();
    if (!stored) co_return failed(stored.error(), net, Code::lss_store);
    co_return Outcome();
  }
  const auto index = static_cast<lss::BitRateIndex>(n[1]);
  const bool known = n[0] == 0 && index != lss::BitRateIndex::reserved;
  if (!known) co_return Outcome::refused(Code::lss_bit_rate);
  const auto set = co_await net.network.services().lss.configure_bit_timing(index);
  if (!set) co_return failed(set.error(), net, Code::lss_bit_rate);
  co_return Outcome();
}

rt::Task<Outcome> LssCommands::inquire(const Request& request, Net& net) {
  if (request.verb == Verb::lss_get_node) {
    const auto id = co_await net.network.services().lss.inquire_node_id();
    if (!id) co_return net.failed(id.error());
    co_return Outcome::value(fmt::format("{}", id->byte()));
  }
  if (request.count == 0) {
    const auto address = co_await net.network.services().lss.inquire_address();
    if (!address) co_return net.failed(address.error());
    co_return Outcome::value(address_text(*address));
  }
  const auto part = co_await net.network.services().lss.inquire(request.numbers[0]);
  if (!part) co_return net.failed(part.error());
  co_return Outcome::value(fmt::format("0x{:08X}", part->value()));
}

// ---- which devices are there ----

rt::Task<Outcome> LssCommands::identify(const Request& request, Net& net) {
  Result<lss::Reply> heard;
  if (request.verb == Verb::lss_identity) {
    const auto ranges = ranges_of(request);
    heard = co_await net.network.services().lss.identify_remote(ranges);
  } else {
    heard = co_await net.network.services().lss.identify_non_configured();
  }
  if (!heard) co_return net.failed(heard.error());
  if (heard->answers == 0) co_return Outcome::refused(Code::timeout);
  co_return Outcome();
}

rt::Task<Result<bool>> LssCommands::anybody_in(lss::IdentifyRanges ranges, Net& net) {
  const auto heard = co_await net.network.services().lss.identify_remote(ranges);
  if (!heard) co_return fail(heard.error());
  co_return heard->answers > 0;
}

// The lowest revision number, then the lowest serial number, each by halving the range.
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
  if (!may_select(address, net)) co_return Outcome::refused(Code::internal_state);
  net.selected = true;
  const auto selected = co_await net.network.services().lss.switch_selective(address);
  if (!selected) co_return net.failed(selected.error());
  co_return Outcome::value(address_text(address));
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

/// Gives out node-IDs from one on, but none that a device has.
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
  const bool others_only = partial && report->end == End::gave_up;  // a device answers that is not meant
  const bool whole = report->end == End::complete || others_only;
  Outcome outcome;
  const auto count = std::ranges::count_if(report->found, [](const auto& d) { return d.assigned.configured(); });
  outcome.text = ids.text + (whole ? fmt::format("# Found {} nodes, search finished.\r\n", count)
                                   : std::string("# Not all nodes scanned!\r\n"));
  net.release();
  co_return outcome;
}

}  // namespace berth::serve::cia309
