#include "berth/serve/cia309_requests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/command/execute.hpp"
#include "berth/command/verbs.hpp"
#include "berth/lss/frames.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/notation.hpp"
#include "berth/serve/cia309_net.hpp"

namespace berth::serve::cia309 {

using Arguments = std::map<std::string, std::string>;

namespace {

constexpr std::uint32_t no_answer = 0x0504'0000;  // CiA 301's abort code; Berth sent it to the device, too
constexpr std::uint32_t refused_value = 1;        // error code of LSS configure and store services
constexpr std::uint32_t store_medium = 2;

// ---- the line as a request ----

Arguments sdo_arguments(const Request& line, const Net& net) {
  Arguments a;
  a["node"] = fmt::format("{}", line.node.value_or(0));
  a["object"] = od::write_object({line.index, line.sub});
  a["sdo-timeout"] = fmt::format("{}", std::chrono::duration_cast<std::chrono::milliseconds>(net.sdo_timeout).count());
  if (net.sdo_block) a["block"] = "auto";
  if (line.verb == Verb::read) return a;
  a["type"] = "d";
  a["value"] = fmt::format("{:02X}", fmt::join(line.data, ""));
  a["anyway"] = "1";  // the line's type counts, not the description's
  return a;
}

Arguments nmt_arguments(const Request& line) {
  static constexpr std::array<std::pair<Verb, const char*>, 5> words{{{Verb::start, "start"},
                                                                      {Verb::stop, "stop"},
                                                                      {Verb::preop, "preop"},
                                                                      {Verb::reset_node, "reset-node"},
                                                                      {Verb::reset_comm, "reset-comm"}}};
  const auto* const word = std::ranges::find(words, line.verb, &std::pair<Verb, const char*>::first);
  const auto node = line.node.value_or(0);
  return {{"command", word->second}, {"node", node == 0 ? "all" : fmt::format("{}", node)}, {"no-wait", "1"}};
}

Arguments identify_arguments(const Request& line) {
  static constexpr std::array names{"vendor", "product", "revision-low", "revision-high", "serial-low", "serial-high"};
  Arguments a;
  for (std::size_t i = 0; i < names.size(); ++i) a[names[i]] = fmt::format("{}", line.numbers[i]);
  return a;
}

// A rate that does not exist stands for another table than CiA 305's and for the reserved index.
std::string rate_of(const Request& line) {
  const auto rate = lss::bit_rate(static_cast<lss::BitRateIndex>(line.numbers[1]));
  if (line.numbers[0] != 0 || !rate) return "1";
  return *rate == 0 ? "auto" : fmt::format("{}", *rate);
}

Arguments arguments_of(const Request& line, const Net& net) {
  static constexpr std::array parts{"vendor", "product", "revision", "serial"};
  const auto& n = line.numbers;
  switch (line.verb) {
    case Verb::read:
    case Verb::write: return sdo_arguments(line, net);
    case Verb::lss_switch_global: return {{"state", n[0] == 1 ? "configuration" : "waiting"}};
    case Verb::lss_switch_selective: return {{"address", to_string(LssAddress{n[0], n[1], n[2], n[3]})}};
    case Verb::lss_set_node: return {{"address", "selected"}, {"id", fmt::format("{}", n[0])}};
    case Verb::lss_conf_bitrate: return {{"rate", rate_of(line)}};
    case Verb::lss_activate_bitrate: return {{"delay", fmt::format("{}", n[0])}};
    case Verb::lss_inquire_address: return {{"part", line.count == 0 ? "address" : parts[n[0] & 3U]}};
    case Verb::lss_get_node: return {{"part", "node-id"}};
    case Verb::lss_identity: return identify_arguments(line);
    default: return is_for_all_nodes(line.verb) ? nmt_arguments(line) : Arguments();
  }
}

bool is_carried_out(Verb verb) noexcept {
  switch (verb) {
    case Verb::set_tpdo:
    case Verb::write_pdo:
    case Verb::lss_fastscan:
    case Verb::lss_slowscan:
    case Verb::lss_allnodes: return false;
    default: return !verb_of(verb).empty();
  }
}

// ---- the reply as an outcome ----

Outcome value_of(const Request& line, const nlohmann::json& json) {
  std::string digits = json.at("bytes").get<std::string>();
  std::erase(digits, ' ');
  const std::array words{Word{digits}};
  const auto bytes = value_bytes({od::DataType::none, Type::Shown::hex_bytes}, std::span(words).first(!digits.empty()));
  if (!bytes || bytes->size() > Requests::longest_value) return Outcome::refused(Code::no_memory);
  const auto text = value_text(line.type, *bytes);
  if (!text) return Outcome::aborted(static_cast<std::uint32_t>(od::AbortCode::length_mismatch));
  return Outcome::value(*text);
}

Outcome answer_of(const Request& line, const command::Reply& reply) {
  const auto json = nlohmann::json::parse(reply.json);
  switch (line.verb) {
    case Verb::read: return value_of(line, json);
    case Verb::lss_get_node: return Outcome::value(fmt::format("{}", json.at("node_id").get<unsigned>()));
    case Verb::lss_inquire_address: {
      std::string text;
      for (const char* const part : {"vendor", "product", "revision", "serial"}) {
        if (json.contains(part)) text += (text.empty() ? "" : " ") + json.at(part).get<std::string>();
      }
      return Outcome::value(text);
    }
    default: return {};
  }
}

Outcome lss_refused(Verb verb, std::uint32_t detail) {
  const auto code = detail & 0xFFU;
  if (code == store_medium && verb == Verb::lss_store) return Outcome::refused(Code::lss_medium);
  if (code != refused_value) return Outcome::refused(Code::lss_specific);
  if (verb == Verb::lss_set_node) return Outcome::refused(Code::lss_node_id);
  if (verb == Verb::lss_conf_bitrate) return Outcome::refused(Code::lss_bit_rate);
  return Outcome::refused(verb == Verb::lss_store ? Code::lss_store : Code::lss_specific);
}

Outcome lss_failed(Verb verb, const Error& error, const Net& net) {
  switch (error.code) {
    case Errc::aborted: return lss_refused(verb, error.detail);
    case Errc::duplicate: return Outcome::refused(verb == Verb::lss_set_node ? Code::lss_node_id : Code::lss_specific);
    case Errc::mismatch: return Outcome::refused(Code::lss_specific);
    default: return net.failed(error);
  }
}

}  // namespace

command::Request request_of(const Request& line, const Net& net) {
  if (!is_carried_out(line.verb)) return {};
  command::Request request{std::string(verb_of(line.verb)), arguments_of(line, net)};
  request.arguments["bus"] = net.network.bus().name;
  return request;
}

Outcome outcome_of(const Request& line, const command::Reply& reply, const Net& net) {
  if (reply.status == 0) return answer_of(line, reply);
  if (reply.cause) {
    const Error& error = *reply.cause;
    const bool silent = error.code == Errc::timeout && (line.verb == Verb::read || line.verb == Verb::write);
    if (silent) return Outcome::aborted(no_answer);
    return is_lss(line.verb) ? lss_failed(line.verb, error, net) : net.failed(error);
  }
  if (line.verb == Verb::lss_conf_bitrate && reply.status == 2) return Outcome::refused(Code::lss_bit_rate);
  // A negative reply without an error: no device answered.
  return Outcome::refused(reply.error.empty() ? Code::timeout : Code::internal_state);
}

rt::Task<Outcome> Requests::run(const Request& line, Net& net) {
  command::Request request = request_of(line, net);
  // The user confirmed these devices when this conversation put them into LSS configuration state.
  const bool for_selected =
      line.verb == Verb::lss_set_node || line.verb == Verb::lss_conf_bitrate || line.verb == Verb::lss_store;
  const bool confirmed = permits_->house().confirmed || (net.selected && for_selected);
  if (confirmed) request.arguments["yes"] = "1";
  command::Reply reply;
  co_await command::execute(*permits_->house().session, request, reply, command::Turn::held);
  const bool by_berth = !reply.error.empty() && (!reply.cause || reply.cause->code == Errc::duplicate);
  if (by_berth) permits_->tell(reply.error);
  co_return outcome_of(line, reply, net);
}

}  // namespace berth::serve::cia309
