// sdo read, sdo write, nmt.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "berth/co/nmt_master.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/od/data_type.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {

using od::DataType;

ObjectArguments object_arguments(Arguments& arguments) {
  ObjectArguments object;
  object.bus = arguments.text("bus");
  object.node = NodeId(arguments.node("node", false));
  object.index = static_cast<std::uint16_t>(arguments.number("index", 0, 0xFFFF));
  object.sub = static_cast<std::uint8_t>(arguments.number("sub", 0, 0xFF, 0));
  const std::string type = arguments.text("type");
  if (type.empty()) return object;
  const auto known = od::data_type(type);
  if (known) {
    object.type = *known;
  } else {
    arguments.wrong(
        fmt::format("{} is no data type; use one of b i8 i16 i24 i32 i40 i48 i56 i64 u8 u16 u24 u32 u40 u48 "
                    "u56 u64 r32 r64 t td vs os us d, or CiA 301's names such as UNSIGNED32",
                    text::quoted(type)));
  }
  return object;
}

namespace {

std::string hex_bytes(std::span<const std::uint8_t> bytes) {
  std::string out;
  for (const auto byte : bytes) out += fmt::format("{}{:02X}", out.empty() ? "" : " ", byte);
  return out;
}

bool printable(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return false;
  for (const auto byte : bytes) {
    if (byte < 0x20 || byte > 0x7E) return false;
  }
  return true;
}

// Numbers that JSON's readers keep exact go out as numbers.
void put_value(Json& json, DataType type, std::span<const std::uint8_t> bytes) {
  const std::string text = od::print(type, bytes);
  if (!od::is_integer(type)) {
    json["value"] = text;
  } else if (od::is_signed(type)) {
    json["value"] = static_cast<std::int64_t>(od::load(type, bytes.data()));
  } else {
    json["value"] = od::load(type, bytes.data());
  }
}

std::string value_text(DataType type, std::span<const std::uint8_t> bytes) {
  if (type != DataType::none) {
    const bool number = od::is_unsigned(type) && type != DataType::boolean;
    const auto digits = static_cast<int>(2 * od::byte_size(type));
    return number ? fmt::format("{} (0x{:0{}X})", od::print(type, bytes), od::load(type, bytes.data()), digits)
                  : od::print(type, bytes);
  }
  std::string text = bytes.empty() ? "(no bytes)" : hex_bytes(bytes);
  if (printable(bytes)) text += fmt::format("  \"{}\"", std::string(bytes.begin(), bytes.end()));
  std::uint64_t number = 0;
  for (std::size_t i = bytes.size(); i-- > 0 && bytes.size() <= 8;) number = number << 8U | bytes[i];
  if (!bytes.empty() && bytes.size() <= 8) text += fmt::format("  = {} (0x{:X})", number, number);
  return text;
}

}  // namespace

Checked<std::vector<std::uint8_t>> value_bytes(DataType type, const std::string& text, NodeId node) {
  const DataType read_as = type == DataType::none ? DataType::octet_string : type;
  if (text.empty() && od::byte_size(read_as) == 0) return std::vector<std::uint8_t>();
  const auto parsed = od::parse(read_as, text);
  if (!parsed) return tl::unexpected(fmt::format("value {}: {}", text::quoted(text), parsed.error().what));
  if (!parsed->value.present()) return tl::unexpected(std::string("the value is empty"));
  if (type == DataType::none && parsed->notes.has(od::Note::plain_text)) {
    return tl::unexpected(
        fmt::format("value {} is no row of hex bytes such as \"91 01 0F 00\"; give --type for anything "
                    "else",
                    text::quoted(text)));
  }
  if (parsed->notes.has(od::Note::wrapped)) {
    return tl::unexpected(fmt::format("value {} does not fit {}", text::quoted(text), od::name(type)));
  }
  if (parsed->value.kind == od::Literal::Kind::bytes) return parsed->value.bytes;
  std::vector<std::uint8_t> bytes(od::byte_size(read_as));
  od::store(read_as, parsed->value.resolve(read_as, node.value()), bytes.data());
  return bytes;
}

namespace {

Json object_json(const Network& network, const ObjectArguments& object) {
  Json json;
  json["bus"] = network.bus().name;
  json["node"] = object.node.value();
  json["index"] = hex(object.index, 4);
  json["sub"] = object.sub;
  return json;
}

Checked<Network*> sdo_network(Session& session, const ObjectArguments& object) {
  const auto network = network_for(session, object.bus, Use::send);
  if (network && object.node == (*network)->bus().master) {
    return tl::unexpected(
        fmt::format("node-ID {} is Berth's own on bus {}", object.node.value(), (*network)->bus().name));
  }
  return network;
}

// By block transfer when it is wanted, and then by nothing else.
co::SdoOptions transfer_options(Network& bus, Arguments& arguments) {
  co::SdoOptions options = bus.services().sdo.options();
  if (arguments.text("block").empty()) return options;
  options.mode = co::SdoMode::block;
  options.fall_back = false;
  return options;
}

const char* sdo_fix(Errc code) {
  switch (code) {
    case Errc::timeout: return "is the device there and not stopped? `berth scan` shows who answers";
    case Errc::bus: return "is anybody else on the bus to acknowledge frames, at this bit rate?";
    default: return "";
  }
}

}  // namespace

rt::Task<void> sdo_read(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const ObjectArguments object = object_arguments(arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = sdo_network(session, object);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const auto how = transfer_options(bus, arguments);
  const auto value = co_await bus.services().sdo.upload(object.node, object.index, object.sub, how);
  const std::string where = fmt::format("bus {}, SDO read", bus.bus().name);
  if (!value) co_return fail_with(reply, value.error(), where, sdo_fix(value.error().code));
  const auto bytes = value->bytes();
  const std::size_t size = od::byte_size(object.type);
  if (object.type != DataType::none && size != 0 && size != bytes.size()) {
    co_return refuse(
        reply, 1,
        fmt::format("{}: node {}, object {:04X}h:{:02X} has {} bytes ({}), {} has {}", where, object.node.value(),
                    object.index, object.sub, bytes.size(), hex_bytes(bytes), od::name(object.type), size),
        "give its own type, or none to see the bytes");
  }
  Json json = object_json(bus, object);
  json["bytes"] = hex_bytes(bytes);
  if (object.type != DataType::none) {
    json["type"] = std::string(od::name(object.type));
    put_value(json, object.type, bytes);
  }
  give(reply, json,
       {fmt::format("node {}  {:04X}h:{:02X}  {}", object.node.value(), object.index, object.sub,
                    value_text(object.type, bytes))});
}

rt::Task<void> sdo_write(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const ObjectArguments object = object_arguments(arguments);
  if (!request.arguments.contains("value")) arguments.wrong("\"sdo write\" needs value");
  const std::string text = arguments.text("value");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = sdo_network(session, object);
  if (!network) co_return refuse(reply, 2, network.error());
  const auto bytes = value_bytes(object.type, text, object.node);
  if (!bytes) co_return refuse(reply, 2, bytes.error());
  Network& bus = **network;
  const auto how = transfer_options(bus, arguments);
  const std::span<const std::uint8_t> data(*bytes);
  const auto written = co_await bus.services().sdo.download(object.node, object.index, object.sub, data, how);
  const std::string where = fmt::format("bus {}, SDO write", bus.bus().name);
  if (!written) co_return fail_with(reply, written.error(), where, sdo_fix(written.error().code));
  Json json = object_json(bus, object);
  json["bytes"] = hex_bytes(*bytes);
  give(reply, json,
       {fmt::format("node {}  {:04X}h:{:02X}  written: {}", object.node.value(), object.index, object.sub,
                    hex_bytes(*bytes))});
}

NmtArguments nmt_arguments(Arguments& arguments) {
  static constexpr std::array<std::pair<std::string_view, co::NmtCommand>, 5> commands{
      {{"start", co::NmtCommand::start},
       {"stop", co::NmtCommand::stop},
       {"preop", co::NmtCommand::enter_pre_operational},
       {"reset-node", co::NmtCommand::reset_node},
       {"reset-comm", co::NmtCommand::reset_communication}}};
  NmtArguments nmt;
  nmt.bus = arguments.text("bus");
  nmt.word = arguments.required("command");
  const std::uint8_t node = arguments.node("node", true);
  if (node != 0) nmt.target = NodeId(node);
  const auto* const it = std::ranges::find(commands, nmt.word, &decltype(commands)::value_type::first);
  if (it != commands.end()) {
    nmt.command = it->second;
  } else {
    arguments.wrong(
        fmt::format("{} is no NMT command; use start, stop, preop, reset-node or reset-comm", text::quoted(nmt.word)));
  }
  return nmt;
}

rt::Task<void> nmt_command(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const NmtArguments nmt = nmt_arguments(arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const bool harmless = nmt.command == co::NmtCommand::stop || nmt.command == co::NmtCommand::enter_pre_operational;
  const auto network = network_for(session, nmt.bus, harmless ? Use::send : Use::command);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const auto sent = co_await bus.services().nmt.send(nmt.command, nmt.target);
  const bool all = nmt.target == co::NmtTarget::all();
  const std::string whom = all ? "all nodes" : fmt::format("node {}", nmt.target.node);
  if (!sent)
    co_return fail_with(reply, sent.error(), fmt::format("bus {}, NMT {} to {}", bus.bus().name, nmt.word, whom));
  bus.commanded(nmt.command, nmt.target);
  Json json;
  json["bus"] = bus.bus().name;
  json["command"] = nmt.word;
  if (all) {
    json["node"] = "all";
  } else {
    json["node"] = nmt.target.node;
  }
  json["sent_s"] = operate::seconds(*sent);
  give(reply, json, {fmt::format("NMT {} sent to {}", co::name(nmt.command), whom)});
}

}  // namespace berth::command
