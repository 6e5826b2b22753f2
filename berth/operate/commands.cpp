#include "berth/operate/commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/od/abort_code.hpp"
#include "berth/od/data_type.hpp"
#include "berth/operate/command_parts.hpp"
#include "berth/text/quantity.hpp"

namespace berth::operate {

using places::SlotState;

// ---- text in and out ----

std::string dump(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

std::string hex(std::uint32_t value, unsigned digits) { return fmt::format("0x{:0{}X}", value, digits); }

std::string to_json(const CommandRequest& request) {
  Json json;
  json["verb"] = request.verb;
  json["arguments"] = Json::object();
  for (const auto& [key, value] : request.arguments) json["arguments"][key] = value;
  return dump(json);
}

CommandRequest parse_request(const std::string& line, std::string& error) {
  CommandRequest request;
  const auto json = Json::parse(line, nullptr, false);
  const auto no = [&](const char* why) {
    error = why;
    return CommandRequest{};
  };
  if (!json.is_object()) return no("a request is one JSON object on one line");
  for (const auto& [key, value] : json.items()) {
    if (key == "verb" && value.is_string()) {
      request.verb = value.get<std::string>();
    } else if (key == "arguments" && value.is_object()) {
      for (const auto& [name, text] : value.items()) {
        if (!text.is_string()) return no("every argument is a string");
        request.arguments[name] = text.get<std::string>();
      }
    } else {
      return no("a request has \"verb\", a string, and \"arguments\", an object of strings");
    }
  }
  if (request.verb.empty()) return no("the request has no verb");
  error.clear();
  return request;
}

std::string to_json(const CommandReply& reply) {
  Json json;
  json["status"] = reply.status;
  json["reply"] = Json::parse(reply.json, nullptr, false);
  json["lines"] = reply.lines;
  json["error"] = reply.error;
  return dump(json);
}

CommandReply parse_reply(const std::string& line) {
  const auto json = Json::parse(line, nullptr, false);
  const bool good = json.is_object() && json.contains("status") && json["status"].is_number_integer() &&
                    json.contains("reply") && json["reply"].is_object() && json.contains("lines") &&
                    json["lines"].is_array() && json.contains("error") && json["error"].is_string() &&
                    std::ranges::all_of(json["lines"], [](const auto& l) { return l.is_string(); });
  if (!good) return refusal(3, "the running `berth up` answered something that is no reply");
  CommandReply reply;
  reply.status = json["status"].get<int>();
  reply.json = dump(json["reply"]);
  reply.lines = json["lines"].get<std::vector<std::string>>();
  reply.error = json["error"].get<std::string>();
  return reply;
}

void give(CommandReply& reply, const Json& json, std::vector<std::string> lines) {
  reply.json = dump(json);
  reply.lines = std::move(lines);
}

void refuse(CommandReply& reply, int status, const std::string& message, const std::string& fix) {
  Json json;
  json["error"]["message"] = message;
  if (!fix.empty()) json["error"]["fix"] = fix;
  reply.status = status;
  reply.json = dump(json);
  reply.lines.clear();
  reply.error = fix.empty() ? message : message + "; " + fix;
}

CommandReply refusal(int status, std::string message) {
  CommandReply reply;
  refuse(reply, status, message);
  return reply;
}

namespace {

int status_of(Errc code) {
  switch (code) {
    case Errc::bus:
    case Errc::io:
    case Errc::exhausted:
    case Errc::cancelled: return 3;
    default: return 1;
  }
}

}  // namespace

void fail_with(CommandReply& reply, const Error& error, const std::string& where, const std::string& fix) {
  Json json;
  auto& e = json["error"];
  e["code"] = name(error.code);
  if (error.node != 0) e["node"] = error.node;
  std::string message = where + ": ";
  if (error.node != 0) message += fmt::format("node {}", error.node);
  if (error.index != 0) {
    e["object"] = fmt::format("0x{:04X}:{:02X}", error.index, error.sub);
    message += fmt::format("{}object {:04X}h:{:02X}", error.node != 0 ? ", " : "", error.index, error.sub);
  }
  if (error.node != 0 || error.index != 0) message += ": ";
  if (error.code == Errc::aborted && error.index != 0) {
    const auto* const text = od::text(static_cast<od::AbortCode>(error.detail));
    e["abort_code"] = hex(error.detail);
    e["text"] = text;
    message += fmt::format("aborted with {:08X}h, {}", error.detail, text);
  } else {
    message += *error.text != '\0' ? error.text : name(error.code);
  }
  e["message"] = message;
  if (!fix.empty()) e["fix"] = fix;
  reply.status = status_of(error.code);
  reply.json = dump(json);
  reply.lines.clear();
  reply.error = fix.empty() ? message : message + "; " + fix;
}

void put_address(Json& json, const LssAddress& address) {
  json["address"] = to_string(address);
  json["type"] = fmt::format("0x{:08X}{:08X}", address.vendor, address.product);
  json["r_sn"] = fmt::format("0x{:016X}", address.r_sn().value());
}

// ---- arguments ----

Arguments::Arguments(const CommandRequest& request, std::initializer_list<std::string_view> known) : request_(request) {
  for (const auto& [key, value] : request.arguments) {
    if (std::ranges::find(known, key) == known.end())
      wrong(fmt::format("\"{}\" has no argument \"{}\"", request.verb, key));
  }
}

bool Arguments::has(const std::string& key) const { return request_.arguments.contains(key); }

std::string Arguments::text(const std::string& key) const {
  const auto it = request_.arguments.find(key);
  return it == request_.arguments.end() ? std::string() : it->second;
}

std::string Arguments::required(const std::string& key) {
  if (text(key).empty()) wrong(fmt::format("\"{}\" needs {}", request_.verb, key));
  return text(key);
}

void Arguments::wrong(std::string problem) {
  if (problem_.empty()) problem_ = std::move(problem);
}

std::uint32_t Arguments::number(const std::string& key, std::uint32_t low, std::uint32_t high,
                                std::optional<std::uint32_t> fallback) {
  if (!has(key) && fallback) return *fallback;
  const std::string word = required(key);
  const auto parsed = od::parse_number(word);
  const bool good =
      parsed && !parsed->negative && !parsed->node_id && parsed->magnitude >= low && parsed->magnitude <= high;
  if (good) return static_cast<std::uint32_t>(parsed->magnitude);
  const bool as_hex = high > 0xFFF;
  wrong(as_hex ? fmt::format("{} {} is no number from 0x{:X} to 0x{:X}", key, text::quoted(word), low, high)
               : fmt::format("{} {} is no number from {} to {}", key, text::quoted(word), low, high));
  return low;
}

LssAddress Arguments::address(const std::string& key) {
  const std::string word = required(key);
  const auto parsed = parse_lss_address(word);
  if (parsed) return *parsed;
  wrong(
      fmt::format("{} {} is no LSS address; write vendor-product-revision-serial, eight hex digits each, such as "
                  "00000001-00000001-00000000-00000005",
                  key, text::quoted(word)));
  return {};
}

std::optional<LssAddress> Arguments::optional_address(const std::string& key) {
  if (!has(key)) return std::nullopt;
  return address(key);
}

std::uint8_t Arguments::node(const std::string& key, bool all_allowed) {
  const std::string word = required(key);
  if (all_allowed && word == "all") return 0;
  if (word.find('/') != std::string::npos) {
    wrong(fmt::format("{} {} lies beneath a gateway; nodes beneath gateways cannot be reached yet", key,
                      text::quoted(word)));
    return 1;
  }
  return static_cast<std::uint8_t>(number(key, 1, 127));
}

Checked<Network*> network_for(Session& session, const std::string& bus, Use use) {
  Network* const network = session.network(bus);
  if (network == nullptr) {
    std::string names;
    for (const auto& b : session.machine().buses) names += (names.empty() ? "" : ", ") + b.name;
    return tl::unexpected(bus.empty() ? fmt::format("the machine has several buses; give --bus, one of {}", names)
                                      : fmt::format("the machine has no bus {}; it has {}", text::quoted(bus), names));
  }
  const design::Role role = network->bus().role;
  if (role == design::Role::observer && use != Use::look) {
    return tl::unexpected(
        fmt::format("bus {} is only observed (role = \"observer\"): Berth sends no frame there", network->bus().name));
  }
  if (role == design::Role::commissioner && use == Use::command) {
    return tl::unexpected(
        fmt::format("bus {} is only commissioned (role = \"commissioner\"): Berth sends no NMT start "
                    "or reset there",
                    network->bus().name));
  }
  return network;
}

Checked<std::vector<Network*>> networks_for(Session& session, const std::string& bus, Use use) {
  std::vector<Network*> networks;
  for (const auto& b : session.machine().buses) {
    if (!bus.empty() && b.name != bus) continue;
    const auto network = network_for(session, b.name, use);
    if (!network) return tl::unexpected(network.error());
    networks.push_back(*network);
  }
  if (!networks.empty()) return networks;
  return tl::unexpected(network_for(session, bus, use).error());
}

// ---- verbs about the whole ----

namespace {

void report(Session& session, const CommandRequest& request, CommandReply& reply) {
  const Arguments arguments(request, {});
  if (!arguments.good()) return refuse(reply, 2, arguments.problem());
  const Report now = session.report();
  reply.json = to_json(now, -1);
  reply.lines = to_table(now.slots);
}

Json json_of(const Network::Seen& seen, const std::string& bus) {
  Json json;
  json["bus"] = bus;
  if (seen.id.configured()) {
    json["id"] = seen.id.value();
  } else {
    json["id"] = nullptr;
  }
  if (seen.device) put_address(json, *seen.device);
  if (seen.device_type) json["device_type"] = hex(*seen.device_type);
  if (seen.state) json["state"] = name(*seen.state);
  json["duplicate"] = seen.duplicate;
  if (!seen.slot.empty()) json["slot"] = seen.slot;
  return json;
}

std::string line_of(const Network::Seen& seen, const std::string& bus) {
  return fmt::format("{}  {:>3}  {:<35}  {:<15}{}{}", bus,
                     seen.id.configured() ? fmt::format("{}", seen.id.value()) : "-",
                     seen.device ? to_string(*seen.device) : "(does not tell its identity)",
                     seen.state ? name(*seen.state) : "-", seen.slot.empty() ? "" : "  slot " + seen.slot,
                     seen.duplicate ? "  DUPLICATE: two devices answer here; take one of them off the bus" : "");
}

// RAND has found them: they are "identified" and would not answer a running main job's question for new devices.
rt::Task<void> make_unknown_again(Network& network, const std::vector<Network::Seen>& seen) {
  co_await network.services().turn.take();
  const rt::Held held(network.services().turn);
  for (const auto& s : seen) {
    const bool stranger = s.device && s.slot.empty();
    if (!stranger) continue;
    const LssAddress device = *s.device;
    const auto told = co_await network.services().rand.switch_selective(device, nodeid::Identification::unknown);
    if (!told) co_return;
  }
}

rt::Task<void> scan(Session& session, const CommandRequest& request, CommandReply& reply) {
  const Arguments arguments(request, {"bus"});
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::send);
  if (!networks) co_return refuse(reply, 2, networks.error());
  Json json;
  json["nodes"] = Json::array();
  std::vector<std::string> lines;
  std::size_t unconfigured = 0;
  std::size_t duplicates = 0;
  for (Network* const network : *networks) {
    const auto seen = co_await network->scan();
    const std::string& bus = network->bus().name;
    if (!seen) co_return fail_with(reply, seen.error(), fmt::format("bus {}, scan", bus));
    for (const auto& s : *seen) {
      json["nodes"].push_back(json_of(s, bus));
      lines.push_back(line_of(s, bus));
      if (!s.id.configured()) ++unconfigured;
      if (s.duplicate) ++duplicates;
    }
    if (session.started()) co_await make_unknown_again(*network, *seen);
  }
  const std::size_t all = lines.size();
  json["configured"] = all - unconfigured;
  json["unconfigured"] = unconfigured;
  json["duplicates"] = duplicates;
  lines.push_back(fmt::format("{} devices: {} with a node-ID, {} without, {} duplicate", all, all - unconfigured,
                              unconfigured, duplicates));
  give(reply, json, std::move(lines));
  if (duplicates > 0) reply.status = 1;
}

void give_report(Session& session, CommandReply& reply) {
  const Report now = session.report();
  reply.json = to_json(now, -1);
  reply.lines = to_table(now.slots);
  for (const auto& network : session.networks()) {
    for (const auto& question : network->questions()) reply.lines.push_back(question.text);
    for (const auto& oddity : network->oddities()) reply.lines.push_back(oddity.text);
  }
}

rt::Task<void> bind(Session& session, const CommandRequest& request, CommandReply& reply) {
  Arguments arguments(request, {"bus", "method", "from-scratch", "yes"});
  const bool scratch = arguments.has("from-scratch");
  const bool yes = arguments.has("yes");
  const std::string method = arguments.text("method");
  if (!method.empty() && method != "auto" && !discovery::method(method)) {
    arguments.wrong(fmt::format("there is no discovery method {}", text::quoted(method)));
  }
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::send);
  if (!networks) co_return refuse(reply, 2, networks.error());
  std::string problem;
  int status = 0;
  for (Network* const network : *networks) {
    Result<void> bound;
    if (scratch) {
      bound = co_await network->bind_from_scratch(yes);
    } else {
      bound = co_await network->bind_once(method);
    }
    if (bound) continue;
    status = std::max(status, status_of(bound.error().code));
    problem += (problem.empty() ? "" : "; ") + fmt::format("bus {}: {}", network->bus().name, bound.error().text);
  }
  give_report(session, reply);
  reply.status = status;
  reply.error = problem;
}

// The new device's place is decided; an empty or silent slot may still get one.
bool settled(SlotState state) {
  switch (state) {
    case SlotState::operational:
    case SlotState::question:
    case SlotState::power_cycle:
    case SlotState::failed:
    case SlotState::duplicate:
    case SlotState::wrong_type: return true;
    default: return false;
  }
}

std::optional<SlotReport> slot_of(const Network& network, const std::string& name) {
  const auto slots = network.report();
  const auto it = std::ranges::find(slots, name, &SlotReport::name);
  return it == slots.end() ? std::nullopt : std::optional<SlotReport>(*it);
}

// The main job does the work in its own time; a slot for which no device comes stays empty.
rt::Task<void> await_slot(Network& network, const std::string& name) {
  const auto& timing = network.bus().timing;
  const rt::Time deadline = network.services().executor.now() + 3 * timing.probe_period + timing.boot_timeout;
  while (network.services().executor.now() < deadline) {
    co_await rt::sleep_for(timing.heartbeat_period / 8 + std::chrono::milliseconds(1));
    const auto slot = slot_of(network, name);
    if (slot && settled(slot->state)) co_return;
  }
}

rt::Task<void> replace(Session& session, const CommandRequest& request, CommandReply& reply) {
  Arguments arguments(request, {"bus", "slot", "device", "used"});
  const bool used = arguments.has("used");
  const std::string wanted = arguments.required("slot");
  const std::optional<LssAddress> device = arguments.optional_address("device");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const std::string bus = arguments.text("bus");
  std::string name;
  Network* const network = session.network_of_slot(bus.empty() ? wanted : bus + "/" + wanted, name);
  if (network == nullptr) {
    co_return refuse(reply, 2, fmt::format("the machine has no slot {}, or several", text::quoted(wanted)),
                     "name it as the machine file does, with its bus before it if need be: BUS/SLOT");
  }
  const auto usable = network_for(session, network->bus().name, Use::send);
  if (!usable) co_return refuse(reply, 2, usable.error());
  // Whether the slot's device is there is known only after a look, which the main job has taken already.
  if (!session.started()) {
    const auto looked = co_await network->bind_once();
    if (!looked && looked.error().code == Errc::bus) co_return fail_with(reply, looked.error(), "looking who is there");
  }
  const auto before = slot_of(*network, name);
  Result<void> cleared;
  {
    co_await network->services().turn.take();
    const rt::Held held(network->services().turn);
    cleared = network->replace(name, device, used);
  }
  if (!cleared) co_return fail_with(reply, cleared.error(), fmt::format("bus {}, slot {}", network->bus().name, name));
  if (session.started()) {
    co_await await_slot(*network, name);
  } else {
    const auto bound = co_await network->bind_once();
    if (!bound && bound.error().code == Errc::bus) co_return fail_with(reply, bound.error(), "binding");
  }
  const auto slot = slot_of(*network, name);
  const bool seated = slot && (slot->state == SlotState::operational || slot->state == SlotState::present);
  reply.json = slot ? to_json(*slot) : "{}";
  reply.lines = to_table(slot ? std::vector<SlotReport>{*slot} : std::vector<SlotReport>{});
  if (before && before->state == SlotState::absent) {
    reply.lines.insert(reply.lines.begin(),
                       fmt::format("slot {} is given away; it was kept: {}", name, before->reason));
  }
  if (seated) co_return;
  reply.status = 1;
  reply.error = fmt::format("slot {} has no new device yet; its binding is cleared, and {}", name,
                            session.started() ? "the next device of its type that comes gets it"
                                              : "`berth up` or `berth bind` gives it to the next device of its type");
}

void forget(Session& session, const CommandRequest& request, CommandReply& reply) {
  Arguments arguments(request, {"bus", "device"});
  const LssAddress device = arguments.address("device");
  if (!arguments.good()) return refuse(reply, 2, arguments.problem());
  const auto networks = networks_for(session, arguments.text("bus"), Use::look);
  if (!networks) return refuse(reply, 2, networks.error());
  bool known = false;
  for (Network* const network : *networks) {
    const auto forgotten = network->forget(device);
    const bool elsewhere = !forgotten && forgotten.error().code == Errc::not_found;
    if (!forgotten && !elsewhere) {
      return fail_with(reply, forgotten.error(), fmt::format("bus {}, forget", network->bus().name));
    }
    known = known || forgotten.has_value();
  }
  if (!known) {
    return refuse(reply, 1, fmt::format("nothing unfinished is known of device {}", to_string(device)),
                  "a device that sits in a slot leaves it by `berth replace SLOT`");
  }
  Json json;
  put_address(json, device);
  give(reply, json, {fmt::format("{} is no longer waited for", to_string(device))});
}

}  // namespace

rt::Task<void> execute(Session& session, const CommandRequest& wanted, CommandReply& reply) {
  reply = CommandReply{};
  CommandRequest request = wanted;
  const bool goes = confirmed(session, request, reply);
  if (!goes) co_return;
  const std::string& verb = request.verb;
  if (verb == "report") co_return report(session, request, reply);
  if (verb == "forget") co_return forget(session, request, reply);
  if (verb == "scan") {
    co_await scan(session, request, reply);
  } else if (verb == "bind") {
    co_await bind(session, request, reply);
  } else if (verb == "replace") {
    co_await replace(session, request, reply);
  } else if (verb == "locate") {
    co_await locate(session, request, reply);
  } else if (verb == "configure") {
    co_await configure(session, request, reply);
  } else if (verb == "sdo read") {
    co_await sdo_read(session, request, reply);
  } else if (verb == "sdo write") {
    co_await sdo_write(session, request, reply);
  } else if (verb == "sdo probe") {
    co_await sdo_probe(session, request, reply);
  } else if (verb == "nmt") {
    co_await nmt_command(session, request, reply);
  } else if (verb == "lss move-bit-rate") {
    co_await bit_rate_command(session, request, reply);
  } else if (verb.starts_with("lss ")) {
    co_await lss_command(session, request, reply);
  } else {
    refuse(reply, 2, fmt::format("there is no command {}", text::quoted(verb)));
  }
}

}  // namespace berth::operate
