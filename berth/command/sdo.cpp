// sdo read, sdo write: one object, or several of one node.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/co/sdo_client.hpp"
#include "berth/command/notes.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/patience.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/values.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/notation.hpp"

namespace berth::command {
namespace {

using Bytes = std::vector<std::uint8_t>;

// The request may demand block transfer; only with "auto" does it fall back to other transfers if the device refuses.
co::SdoOptions transfer_options(Network& bus, Arguments& arguments) {
  co::SdoOptions options = bus.services().sdo.options();
  if (arguments.has("sdo-timeout")) {
    options.timeout = std::chrono::milliseconds(arguments.number("sdo-timeout", 1, 65'535));
    options.retries = 0;
  }
  const std::string block = arguments.text("block");
  if (block.empty()) return options;
  const bool is_devices_choice = block == "auto";
  options.mode = is_devices_choice ? co::SdoMode::automatic : co::SdoMode::block;
  options.fall_back = is_devices_choice;
  return options;
}

Json node_json(const Network& network, const NodeArgument& node) {
  Json json;
  json["bus"] = network.bus().name;
  json["node"] = node.node.value();
  if (!node.gateways.empty()) json["path"] = node.text();
  return json;
}

void put_object(Json& json, const KnownObject& object) {
  json["index"] = hex(object.ref.index, 4);
  json["sub"] = object.ref.sub;
  if (!object.name.empty()) json["name"] = object.name;
}

std::string object_line(const NodeArgument& node, const KnownObject& object, const std::string& what) {
  return fmt::format("node {}  {}  {}{}", node.text(), od::write_object(object.ref), what,
                     object.name.empty() ? "" : "  " + object.name);
}

/// The reply about one object or several: a single one is the whole reply, several are in "objects".
class Answers {
 public:
  Answers(Reply& reply, Network& network, const ObjectArguments& wanted, const char* what)
      : reply_(reply),
        network_(network),
        wanted_(wanted),
        several_(wanted.objects.size() > 1),
        where_(fmt::format("bus {}, SDO {}", network.bus().name, what)),
        json_(node_json(network, wanted.node)) {
    if (several_) json_["objects"] = Json::array();
  }

  [[nodiscard]] const std::string& where() const noexcept { return where_; }

  void good(const KnownObject& object, const Json& facts, const std::string& what) {
    Json json = several_ ? Json::object() : json_;
    put_object(json, object);
    json.update(facts);
    lines_.push_back(object_line(wanted_.node, object, what));
    add(std::move(json));
  }

  void failed(const KnownObject& object, const Error& error) {
    Reply one;
    const bool is_input =
        error.code == Errc::aborted && static_cast<od::AbortCode>(error.detail) == od::AbortCode::read_only;
    const std::string fix = is_input ? input_fix(object) : silence_fix(error, network_, wanted_.node);
    fail_with(one, error, where_, fix, wanted_.node.path());
    add(object, one);
  }

  void refused(const KnownObject& object, const std::string& message, const std::string& fix) {
    Reply one;
    refuse(one, 1, message, fix);
    add(object, one);
  }

  void finish() {
    const int status = reply_.status;
    const std::string error = reply_.error;
    give(reply_, json_, lines_);
    reply_.status = status;
    reply_.error = error;
  }

 private:
  // A sensor sets an input; a simulated device has no sensor.
  [[nodiscard]] std::string input_fix(const KnownObject& object) const {
    return fmt::format("of a simulated device `berth sim set {} {} VALUE` sets it, as its sensor would",
                       wanted_.node.text(), od::write_object(object.ref));
  }

  void add(Json json) {
    if (several_) {
      json_["objects"].push_back(std::move(json));
    } else {
      json_ = std::move(json);
    }
  }

  void add(const KnownObject& object, const Reply& one) {
    reply_.status = std::max(reply_.status, one.status);
    if (one.cause) reply_.cause = one.cause;
    reply_.error += (reply_.error.empty() ? "" : "\n") + one.error;
    Json json = Json::parse(one.json);
    if (several_) {
      Json told;
      put_object(told, object);
      told.update(json);
      json = std::move(told);
    }
    add(std::move(json));
  }

  Reply& reply_;
  Network& network_;
  const ObjectArguments& wanted_;
  bool several_;
  std::string where_;
  Json json_;
  std::vector<std::string> lines_;
};

// After such an error, no further object of the node is asked for.
bool hopeless(const Error& error) { return error.code != Errc::aborted && error.code != Errc::mismatch; }

// For the line of an object: the type in the description, if the device's value does not fit it.
std::string misfit(const KnownObject& object, std::span<const std::uint8_t> bytes) {
  if (object.type == od::DataType::none || fits(object.type, bytes)) return {};
  return fmt::format("  (the description says {}, {} bytes)", od::name(object.type), od::byte_size(object.type));
}

}  // namespace

rt::Task<void> sdo_read(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const ObjectArguments wanted = object_arguments(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, wanted.node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const auto how = transfer_options(bus, arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  std::optional<co::NodeAccess> direct;
  co::SdoAccess& device = objects_of(session, bus, wanted.node, how, direct);
  const NoteBook notes(session.machine(), wanted.node);
  Answers answers(reply, bus, wanted, "read");
  for (const KnownObject& object : wanted.objects) {
    const auto value = co_await device.read(object.ref.index, object.ref.sub);
    if (!value) {
      answers.failed(object, value.error());
      if (hopeless(value.error())) break;
      continue;
    }
    const auto bytes = value->bytes();
    if (object.type_given && !fits(object.type, bytes)) {
      answers.refused(object,
                      fmt::format("{}: node {}, object {} has {} bytes ({}), {} has {}", answers.where(),
                                  wanted.node.text(), od::write_object(object.ref), bytes.size(), hex_bytes(bytes),
                                  od::name(object.type), od::byte_size(object.type)),
                      "give the type of the object, or none to see the bytes");
      continue;
    }
    Json json;
    const KnownObject shown = notes.shown(object);
    put_value(json, shown, bytes);
    const Note note = notes.of(object.ref);
    put_note(json, note, object.type, bytes);
    answers.good(object, json, value_text(shown, bytes) + note_text(note, shown, bytes) + misfit(object, bytes));
  }
  answers.finish();
}

namespace {

// One value per object: one line each if there are several objects, else the whole text.
Checked<std::vector<Bytes>> values_of(const Arguments& arguments, const ObjectArguments& wanted) {
  const bool anyway = arguments.has("anyway");
  std::string rest = arguments.text("value");
  std::vector<Bytes> values;
  for (const KnownObject& object : wanted.objects) {
    const bool last = values.size() + 1 == wanted.objects.size();
    const auto end = last ? std::string::npos : rest.find('\n');
    if (!last && end == std::string::npos) return tl::unexpected(std::string("each object needs a value"));
    auto bytes = value_bytes(object, rest.substr(0, end), wanted.node.node, anyway);
    if (!bytes) return tl::unexpected(bytes.error());
    values.push_back(std::move(*bytes));
    if (!last) rest.erase(0, end + 1);
  }
  return values;
}

}  // namespace

WriteArguments write_arguments(Arguments& arguments, const design::Machine& machine) {
  WriteArguments wanted{object_arguments(arguments, machine), {}};
  if (!arguments.has("value")) arguments.wrong("\"sdo write\" needs value");
  if (!arguments.good()) return wanted;
  auto values = values_of(arguments, wanted.to);
  if (values) {
    wanted.values = std::move(*values);
  } else {
    arguments.wrong(values.error());
  }
  return wanted;
}

rt::Task<void> sdo_write(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const WriteArguments wanted = write_arguments(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, wanted.to.node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const auto how = transfer_options(bus, arguments);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  std::optional<co::NodeAccess> direct;
  co::SdoAccess& device = objects_of(session, bus, wanted.to.node, how, direct);
  const NoteBook notes(session.machine(), wanted.to.node);
  Answers answers(reply, bus, wanted.to, "write");
  for (std::size_t i = 0; i < wanted.values.size(); ++i) {
    const KnownObject& object = wanted.to.objects[i];
    const std::span<const std::uint8_t> data(wanted.values[i]);
    const auto written = co_await device.write(object.ref.index, object.ref.sub, data);
    if (!written) {
      answers.failed(object, written.error());
      break;  // later objects may depend on this one
    }
    Json json;
    const KnownObject shown = notes.shown(object);
    put_value(json, shown, data);
    answers.good(object, json,
                 fmt::format("written: {}{}", value_text(shown, data), note_text(notes.of(object.ref), shown, data)));
  }
  answers.finish();
}

}  // namespace berth::command
