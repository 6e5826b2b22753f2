// lss: the user calls one service of CiA 305 at a time.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/co/guarding.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/lss/master.hpp"
#include "berth/lss/select_alone.hpp"
#include "berth/nodeid/rand_master.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

// The meaning of an error code depends on the service (CiA 305; lss/frames.hpp).
std::string refusal_text(std::uint32_t detail, const char* code1) {
  const unsigned code = detail & 0xFFU;
  if (code == 1) return code1;
  if (code == lss::error::storage) return "its memory cannot be written";
  if (code == lss::error::specific) return fmt::format("with the manufacturer-specific error {}", detail >> 8U & 0xFFU);
  return fmt::format("with error code {}", code);
}

void lss_failed(Reply& reply, const Network& network, const Error& error, const std::string& doing,
                const char* code1 = "it does not support this") {
  const std::string where = fmt::format("bus {}, LSS {}", network.bus().name, doing);
  switch (error.code) {
    case Errc::timeout:
      return fail_with(
          reply, {.code = error.code, .text = "no answer"}, where,
          "is the device on this bus, and does it speak LSS? `berth lss find` shows the devices that are there");
    case Errc::aborted:
      refuse(reply, 1, where + ": the device refused: " + refusal_text(error.detail, code1));
      reply.cause = error;
      return;
    default: return fail_with(reply, error, where);
  }
}

Json start_json(const Network& network, const std::string& service) {
  Json json;
  json["bus"] = network.bus().name;
  json["service"] = service;
  return json;
}

std::string named(const std::optional<LssAddress>& device) {
  return device ? to_string(*device) : std::string("the device in configuration state");
}

// Switches one device to configuration state, every other to waiting. Without an address it changes nothing: the
// service goes to the devices that are in configuration state already.
rt::Task<Result<void>> select(Network& network, std::optional<LssAddress> device) {
  if (!device) co_return Result<void>();
  const LssAddress address = *device;
  const lss::AloneOptions all_parts;
  const auto selected = co_await lss::select_alone(network.services().lss, address, all_parts);
  if (!selected) co_return fail(selected.error());
  switch (*selected) {
    case lss::Selection::alone: co_return Result<void>();
    case lss::Selection::absent: co_return fail(Errc::timeout, "no answer");
    case lss::Selection::not_alone: co_return fail(Errc::mismatch, "another device is in LSS configuration beside it");
    case lss::Selection::clones: break;
  }
  co_return fail(Errc::duplicate, "two devices answer to its LSS address");
}

rt::Task<void> release(Network& network, std::optional<LssAddress> device) {
  if (!device) co_return;
  const auto released = co_await network.services().lss.switch_global(lss::State::waiting);
  static_cast<void>(released);  // the service itself is done already
}

rt::Task<void> global(Network& network, lss::State state, Reply& reply) {
  const auto sent = co_await network.services().lss.switch_global(state);
  if (!sent) co_return lss_failed(reply, network, sent.error(), "switch state global");
  const char* const word = state == lss::State::waiting ? "waiting" : "configuration";
  Json json = start_json(network, "global");
  json["state"] = word;
  give(reply, json, {fmt::format("all devices were switched to LSS {} state", word)});
}

rt::Task<void> select_one(Network& network, LssAddress device, Reply& reply) {
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "select " + to_string(device));
  Json json = start_json(network, "select");
  put_address(json, device);
  give(reply, json,
       {fmt::format("{} is in LSS configuration state, every other device in waiting", to_string(device))});
}

constexpr std::array<std::string_view, 4> part_names{"vendor", "product", "revision", "serial"};

void put_parts(Json& json, const LssAddress& address) {
  json["vendor"] = hex(address.vendor);
  json["product"] = hex(address.product);
  json["revision"] = hex(address.revision);
  json["serial"] = hex(address.serial);
}

std::vector<std::string> part_lines(const LssAddress& address) {
  return {fmt::format("vendor-ID     {}", hex(address.vendor)), fmt::format("product code  {}", hex(address.product)),
          fmt::format("revision      {}", hex(address.revision)), fmt::format("serial number {}", hex(address.serial))};
}

std::string node_id_line(unsigned id) {
  return fmt::format("node-ID       {}", id == 0xFF ? "255 (none)" : fmt::format("{}", id));
}

rt::Task<void> inquire(Network& network, std::optional<LssAddress> device, Reply& reply) {
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "inquire " + named(device));
  const auto address = co_await lss::inquire_address(network.services().lss);
  if (!address) co_return lss_failed(reply, network, address.error(), "inquire " + named(device));
  const auto id = co_await network.services().lss.inquire_node_id();
  co_await release(network, device);
  if (!id) co_return lss_failed(reply, network, id.error(), "inquire node-ID of " + named(device));
  Json json = start_json(network, "inquire");
  put_address(json, *address);
  put_parts(json, *address);
  json["node_id"] = id->byte();
  auto lines = part_lines(*address);
  lines.push_back(node_id_line(id->byte()));
  give(reply, json, std::move(lines));
}

// One answer of the device is the whole reply. `part` is one of the words that `lss_arguments` takes.
rt::Task<void> inquire_selected(Network& network, const std::string& part, Reply& reply) {
  const std::string doing = fmt::format("inquire {} of {}", part, named({}));
  lss::Master& lss = network.services().lss;
  Json json = start_json(network, "inquire");
  std::vector<std::string> lines;
  if (part == "address") {
    const auto address = co_await lss::inquire_address(lss);
    if (!address) co_return lss_failed(reply, network, address.error(), doing);
    put_address(json, *address);
    put_parts(json, *address);
    lines = part_lines(*address);
  } else if (part == "node-id") {
    const auto id = co_await lss.inquire_node_id();
    if (!id) co_return lss_failed(reply, network, id.error(), doing);
    json["node_id"] = id->byte();
    lines.push_back(node_id_line(id->byte()));
  } else {
    const auto number = static_cast<unsigned>(std::ranges::find(part_names, part) - part_names.begin());
    const auto value = co_await lss.inquire(number);
    if (!value) co_return lss_failed(reply, network, value.error(), doing);
    json[part] = hex(value->value());
    lines.push_back(hex(value->value()));
  }
  give(reply, json, std::move(lines));
}

rt::Task<void> inquire_part(Network& network, std::optional<LssAddress> device, std::string part, Reply& reply) {
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "inquire " + named(device));
  co_await inquire_selected(network, part, reply);
  co_await release(network, device);
}

// Does another device have this node-ID? Asks by SDO, then by node guarding: an answer to either means yes.
rt::Task<Result<bool>> is_taken(Network& network, NodeId id) {
  co::SdoOptions patience = network.services().sdo.options();
  patience.timeout = network.bus().timing.guard_timeout;
  patience.abort_on_timeout = false;
  const auto type = co_await network.services().sdo.read<std::uint32_t>(id, 0x1000, 0, patience);
  if (type || type.error().code == Errc::aborted || type.error().code == Errc::mismatch) co_return true;
  if (type.error().code != Errc::timeout) co_return fail(type.error());
  const auto guarded = co_await co::guard_once(network.services().dispatcher, id, patience.timeout, 1);
  if (guarded) co_return true;
  if (guarded.error().code != Errc::timeout) co_return fail(guarded.error());
  co_return false;
}

struct NewId {
  std::optional<LssAddress> device;  // none: the device in configuration state
  NodeId id;
  bool store = false;
};

// Gives the node-ID to the device that is selected already; `old` is its active node-ID.
rt::Task<void> configure_node_id(Network& network, const NewId& wanted, NodeId old, Reply& reply) {
  const std::string doing = fmt::format("set node-ID {} of {}", wanted.id.value(), named(wanted.device));
  if (wanted.id.configured() && wanted.id != old) {
    const auto taken = co_await is_taken(network, wanted.id);
    if (!taken) co_return lss_failed(reply, network, taken.error(), doing);
    if (*taken) {
      refuse(reply, 1,
             fmt::format("bus {}, LSS {}: another device answers under this node-ID", network.bus().name, doing),
             "take that device off the bus, or give it another node-ID first");
      reply.cause = Error{.code = Errc::duplicate};
      co_return;
    }
  }
  const auto set = co_await network.services().lss.configure_node_id(wanted.id);
  if (!set) co_return lss_failed(reply, network, set.error(), doing, "it does not take this node-ID");
  if (wanted.store) {
    const auto stored = co_await network.services().lss.store();
    if (!stored) co_return lss_failed(reply, network, stored.error(), "store of " + named(wanted.device));
  }
  Json json = start_json(network, "set-node-id");
  if (wanted.device) put_address(json, *wanted.device);
  json["node_id"] = wanted.id.value();
  json["stored"] = wanted.store;
  const bool reset = old.configured() && wanted.id != old;
  json["takes_effect"] = reset ? "reset communication" : "now";
  std::vector<std::string> lines{fmt::format("{}: node-ID {}{}", named(wanted.device), wanted.id.value(),
                                             wanted.store ? ", stored" : ", not stored: lost when it is switched off")};
  if (reset) lines.push_back(fmt::format("in use after: berth nmt reset-comm {}", old.value()));
  give(reply, json, std::move(lines));
}

rt::Task<void> set_node_id(Network& network, const NewId& wanted, Reply& reply) {
  const std::optional<LssAddress> device = wanted.device;
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "select " + named(device));
  const auto now = co_await network.services().lss.inquire_node_id();
  if (now) {
    const NodeId old = NodeId::make(now->byte()).value_or(NodeId());
    co_await configure_node_id(network, wanted, old, reply);
  } else {
    lss_failed(reply, network, now.error(), "inquire node-ID of " + named(device));
  }
  co_await release(network, device);
}

rt::Task<void> store(Network& network, std::optional<LssAddress> device, Reply& reply) {
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "select " + named(device));
  const auto stored = co_await network.services().lss.store();
  co_await release(network, device);
  if (!stored) co_return lss_failed(reply, network, stored.error(), "store of " + named(device));
  Json json = start_json(network, "store");
  if (device) put_address(json, *device);
  give(reply, json, {fmt::format("{} has stored node-ID and bit rate", named(device))});
}

rt::Task<void> bit_timing(Network& network, std::uint32_t rate, std::optional<LssAddress> device, Reply& reply) {
  const auto index = rate == 0 ? lss::BitRateIndex::automatic : lss::bit_rate_index(rate);
  if (!index) {
    co_return refuse(reply, 2, fmt::format("LSS has no index for {} bit/s", rate),
                     "use 10000, 20000, 50000, 125000, 250000, 500000, 800000 or 1000000");
  }
  const auto selected = co_await select(network, device);
  if (!selected) co_return lss_failed(reply, network, selected.error(), "select " + named(device));
  const auto set = co_await network.services().lss.configure_bit_timing(*index);
  if (!set)
    co_return lss_failed(reply, network, set.error(), "bit timing of " + named(device), "it cannot do this bit rate");
  Json json = start_json(network, "bit-timing");
  if (device) put_address(json, *device);
  json["bit_rate"] = rate;
  json["index"] = static_cast<unsigned>(*index);
  give(reply, json,
       {fmt::format("{} will use {}: `berth lss store` keeps it for the next power-on, `berth lss activate` changes "
                    "now",
                    named(device), rate == 0 ? "the bit rate that it finds" : fmt::format("{} bit/s", rate))});
}

// CiA 305: each device is silent for one delay, switches its bit rate, and is silent for another delay.
rt::Task<void> activate(Network& network, std::uint16_t delay_ms, std::uint32_t rate, Reply& reply) {
  const auto sent = co_await network.services().lss.activate_bit_timing(delay_ms);
  if (!sent) co_return lss_failed(reply, network, sent.error(), "activate bit timing");
  const rt::Duration delay = std::chrono::milliseconds(delay_ms);
  if (rate != 0) {
    co_await rt::sleep_for(delay);
    if (!network.services().dispatcher.port().restart(rate)) {
      co_return refuse(reply, 3,
                       fmt::format("bus {}: Berth's own port does not change to {} bit/s", network.bus().name, rate));
    }
    co_await rt::sleep_for(delay);
  }
  Json json = start_json(network, "activate");
  json["delay_ms"] = delay_ms;
  if (rate != 0) json["bit_rate"] = rate;
  std::vector<std::string> lines{
      fmt::format("devices in configuration state change their bit rate after {} ms", delay_ms)};
  if (rate != 0) lines.push_back(fmt::format("Berth's own port now uses {} bit/s", rate));
  give(reply, json, std::move(lines));
}

struct AnybodyWords {
  const char* yes;
  const char* no;
};

void tell_anybody(const Network& network, const char* service, std::size_t answers, const AnybodyWords& words,
                  Reply& reply) {
  Json json = start_json(network, service);
  json["anybody"] = answers > 0;
  json["answers"] = answers;
  give(reply, json, {answers > 0 ? words.yes : words.no});
  if (answers == 0) reply.status = 1;
}

rt::Task<void> identify(Network& network, const lss::IdentifyRanges& ranges, Reply& reply) {
  const auto heard = co_await network.services().lss.identify_remote(ranges);
  if (!heard) co_return lss_failed(reply, network, heard.error(), "identify remote slave");
  tell_anybody(network, "identify", heard->answers,
               {"at least one device lies in these ranges", "no device lies in these ranges"}, reply);
}

rt::Task<void> identify_unconfigured(Network& network, Reply& reply) {
  const auto heard = co_await network.services().lss.identify_non_configured();
  if (!heard) co_return lss_failed(reply, network, heard.error(), "identify non-configured slaves");
  tell_anybody(network, "identify-unconfigured", heard->answers,
               {"at least one device has no node-ID", "no device without a node-ID answers"}, reply);
}

// A found device that sits in no slot is made "unknown" again, so that a running main job finds it, too.
rt::Task<void> find(Network& network, Reply& reply) {
  const auto blank = co_await network.services().lss.identify_non_configured();
  if (!blank) co_return lss_failed(reply, network, blank.error(), "identify non-configured slaves");
  const auto report = co_await network.find_new();
  if (!report) co_return lss_failed(reply, network, report.error(), "discovery");
  Json json = start_json(network, "find");
  json["unconfigured_lss"] = blank->answers > 0;
  json["complete"] = report->complete;
  json["devices"] = Json::array();
  std::vector<std::string> lines;
  const auto slots = network.report();
  for (const auto& d : report->found) {
    Json device;
    put_address(device, d.address);
    device["possible_clone"] = d.possible_clone;
    json["devices"].push_back(device);
    lines.push_back(to_string(d.address) + (d.possible_clone ? "  answered twice: two devices with one address" : ""));
    const bool seated = std::ranges::any_of(slots, [&](const auto& s) { return s.device == d.address; });
    if (seated) continue;
    const LssAddress stranger = d.address;
    const auto told = co_await network.services().rand.switch_selective(stranger, nodeid::Identification::unknown);
    static_cast<void>(told);  // a failure does no harm: the next discovery asks all devices anew
  }
  lines.push_back(fmt::format("{} found; {} device without a node-ID answers LSS", report->found.size(),
                              blank->answers > 0 ? "at least one" : "no"));
  if (!report->complete) lines.push_back(fmt::format("the discovery ended early: {}", report->end));
  give(reply, json, std::move(lines));
  if (report->found.empty() && blank->answers == 0) reply.status = 1;
}

}  // namespace

LssArguments lss_arguments(const Request& request, std::string& problem) {
  LssArguments r;
  r.service = request.verb.substr(4);
  Arguments a(request);
  r.bus = a.text("bus");
  if (r.service == "global") {
    const std::string word = a.required("state");
    if (word == "configuration") r.state = lss::State::configuration;
    if (word != "configuration" && word != "waiting") a.wrong("state is waiting or configuration");
  } else if (r.service == "select") {
    r.device = a.address("address");
  } else if (r.service == "inquire" || r.service == "store") {
    r.device = a.optional_address("address");
    r.part = a.text("part");
    const bool known = r.part.empty() || r.part == "address" || r.part == "node-id" ||
                       std::ranges::find(part_names, r.part) != part_names.end();
    if (!known) a.wrong("part is address, vendor, product, revision, serial or node-id");
  } else if (r.service == "set-node-id") {
    if (a.text("address") != "selected") r.device = a.address("address");
    const auto id = NodeId::make(a.number("id", 1, 255));
    if (!id) a.wrong("id is 1 to 127, or 255 for none");
    r.id = id.value_or(NodeId());
    r.store = a.text("store") == "1";
  } else if (r.service == "bit-timing") {
    if (a.text("rate") != "auto") r.rate = a.number("rate", 1, 1'000'000);
    r.device = a.optional_address("address");
  } else if (r.service == "activate") {
    r.delay_ms = static_cast<std::uint16_t>(a.number("delay", 0, 0xFFFF));
    r.rate = a.number("rate", 1, 1'000'000, 0);
    if (r.rate != 0 && !lss::bit_rate_index(r.rate)) a.wrong(fmt::format("{} bit/s is not a CANopen bit rate", r.rate));
  } else if (r.service == "identify") {
    constexpr std::uint32_t top = 0xFFFF'FFFF;
    r.ranges = {a.number("vendor", 0, top),          a.number("product", 0, top),
                a.number("revision-low", 0, top, 0), a.number("revision-high", 0, top, top),
                a.number("serial-low", 0, top, 0),   a.number("serial-high", 0, top, top)};
  }
  problem = a.problem();
  return r;
}

namespace {

// The network for the service. Null: the reply says why there is none, or what is wrong with the request.
Network* network_of(Session& session, const LssArguments& wanted, const std::string& problem, Reply& reply) {
  if (!problem.empty()) {
    refuse(reply, 2, problem);
    return nullptr;
  }
  const auto found = network_for(session, wanted.bus, Use::send);
  if (!found) {
    refuse(reply, 2, found.error());
    return nullptr;
  }
  Network* const network = *found;
  if (wanted.service != "set-node-id" || wanted.id != network->bus().master) return network;
  refuse(reply, 2, fmt::format("node-ID {} is Berth's own on bus {}", wanted.id.value(), network->bus().name));
  reply.cause = Error{.code = Errc::duplicate};
  return nullptr;
}

rt::Task<void> carry_out(Network& network, LssArguments r, Reply& reply) {
  if (r.service == "global") {
    co_await global(network, r.state, reply);
  } else if (r.service == "select") {
    co_await select_one(network, *r.device, reply);
  } else if (r.service == "inquire" && !r.part.empty()) {
    co_await inquire_part(network, r.device, r.part, reply);
  } else if (r.service == "inquire") {
    co_await inquire(network, r.device, reply);
  } else if (r.service == "set-node-id") {
    const NewId wanted{r.device, r.id, r.store};
    co_await set_node_id(network, wanted, reply);
  } else if (r.service == "store") {
    co_await store(network, r.device, reply);
  } else if (r.service == "bit-timing") {
    co_await bit_timing(network, r.rate, r.device, reply);
  } else if (r.service == "activate") {
    co_await activate(network, r.delay_ms, r.rate, reply);
  } else if (r.service == "identify") {
    co_await identify(network, r.ranges, reply);
  } else if (r.service == "identify-unconfigured") {
    co_await identify_unconfigured(network, reply);
  } else {
    co_await find(network, reply);
  }
}

}  // namespace

rt::Task<void> lss_service(Session& session, const Request& request, Reply& reply) {
  std::string problem;
  LssArguments wanted = lss_arguments(request, problem);
  Network* const network = network_of(session, wanted, problem, reply);
  if (network != nullptr) co_await carry_out(*network, std::move(wanted), reply);
}

rt::Task<void> lss_command(Session& session, const Request& request, Reply& reply) {
  std::string problem;
  LssArguments wanted = lss_arguments(request, problem);
  Network* const network = network_of(session, wanted, problem, reply);
  if (network == nullptr) co_return;
  co_await network->services().turn.take();
  const rt::Held held(network->services().turn);
  co_await carry_out(*network, std::move(wanted), reply);
}

}  // namespace berth::command
