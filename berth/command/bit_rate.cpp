// `berth lss move-bit-rate`: switches a whole network to another bit rate.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/operate/network_bitrate.hpp"

namespace berth::command {
namespace {

using operate::BitRateOptions;
using operate::BitRateReport;
using End = BitRateReport::End;

std::string named(const BitRateReport::Node& node) {
  const std::string id = node.id.configured() ? fmt::format("node {}", node.id.value()) : "a device without node-ID";
  return node.device ? fmt::format("{} ({})", id, to_string(*node.device)) : id;
}

Json json_of(const BitRateReport& report, const std::string& bus) {
  Json json;
  json["bus"] = bus;
  json["service"] = "move-bit-rate";
  json["result"] = name(report.end);
  json["before"] = report.before;
  json["bit_rate"] = report.rate;
  json["nodes"] = Json::array();
  for (const auto& node : report.nodes) {
    Json n;
    n["node_id"] = node.id.value();
    if (node.device) put_address(n, *node.device);
    n["moved"] = node.moved;
    n["stored"] = node.stored;
    n["heard"] = node.heard;
    if (!node.problem.empty()) n["problem"] = node.problem;
    json["nodes"].push_back(n);
  }
  return json;
}

std::string problems(const BitRateReport& report) {
  std::string text = report.reason;
  for (const auto& node : report.nodes) {
    if (!node.problem.empty()) text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", named(node), node.problem);
  }
  return text;
}

// What the user must do if not all devices were heard again.
std::string way_out(const BitRateReport& report) {
  const std::string cycle = "switch the power of every device of this bus off and on: ";
  std::string kept;
  for (const auto& node : report.nodes) {
    if (node.stored) kept += fmt::format("{}{}", kept.empty() ? "" : ", ", named(node));
  }
  if (kept.empty()) return cycle + fmt::format("nothing was stored, so all come back at {} bit/s", report.before);
  return cycle + fmt::format("all come back at {} bit/s, except those that stored the new rate or may have: {}",
                             report.before, kept);
}

void tell(const BitRateReport& report, const BitRateOptions& options, const std::string& bus, Reply& reply) {
  Json json = json_of(report, bus);
  const std::string where = fmt::format("bus {}, move to {} bit/s", bus, options.rate);
  const auto no = [&](int status, const std::string& message, const std::string& fix) {
    json["error"]["message"] = message;
    json["error"]["fix"] = fix;
    give(reply, json, {});
    reply.status = status;
    reply.error = error_line(message, fix);
  };
  switch (report.end) {
    case End::moved: {
      std::vector<std::string> lines;
      for (const auto& node : report.nodes) lines.push_back(named(node) + ": moved and stored");
      lines.push_back(fmt::format("bus {} is at {} bit/s; write bitrate = {} into the machine file", bus, report.rate,
                                  report.rate));
      return give(reply, json, std::move(lines));
    }
    case End::unconfirmed:
      return no(1, fmt::format("{}: {} would change; nothing was done", where, counted(report.nodes.size(), "device")),
                "confirm it with --yes");
    case End::refused:
      return no(1, fmt::format("{}: nothing was changed: {}", where, problems(report)),
                "every device must speak LSS, know the bit rate and not be operational");
    case End::brought_back:
      return no(1, fmt::format("{}: brought back to {} bit/s: {}", where, report.rate, problems(report)),
                "check that device, then try again");
    case End::lost:
      return no(3, fmt::format("{}: not all were heard again: {}", where, problems(report)), way_out(report));
  }
}

}  // namespace

rt::Task<void> bit_rate_command(Session& session, const Request& request, Reply& reply) {
  Arguments a(request);
  BitRateOptions options;
  options.rate = a.number("rate", 1, 1'000'000);
  options.delay = std::chrono::milliseconds(a.number("delay", 10, 10'000, 200));
  options.confirmed = a.text("yes") == "1";
  if (!lss::bit_rate_index(options.rate)) {
    a.wrong(
        fmt::format("LSS has no index for {} bit/s; use 10000, 20000, 50000, 125000, 250000, 500000, 800000 or "
                    "1000000",
                    options.rate));
  }
  if (!a.good()) co_return refuse(reply, 2, a.problem());
  const auto found = network_for(session, a.text("bus"), Use::send);
  if (!found) co_return refuse(reply, 2, found.error());
  Network& network = **found;
  const auto report = co_await operate::move_bit_rate(network, options);
  tell(report, options, network.bus().name, reply);
}

}  // namespace berth::command
