// sdo dump: reads every readable object of a device, one after the other. A refusal by the device is an answer like any
// other.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/co/sdo_client.hpp"
#include "berth/command/notes.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/patience.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/values.hpp"
#include "berth/decode/standard_objects.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/manager/configuration_upload.hpp"
#include "berth/manager/configurator.hpp"
#include "berth/od/abort_code.hpp"
#include "berth/od/notation.hpp"

namespace berth::command {
namespace {

bool kept_back(const od::Object& object, const od::SubObject& sub) {
  return ((object.obj_flags | sub.obj_flags) & od::refuse_read_on_scan) != 0;
}

// The objects that a scan may read: none that the description excludes from scans, and no DOMAIN, which can be a whole
// program.
std::vector<ObjectRef> described_objects(const od::Description& description) {
  std::vector<ObjectRef> refs;
  for (const od::Object& object : description.objects()) {
    for (const od::SubObject& sub : description.subs(object)) {
      const bool reads = od::readable(sub.access) && sub.type != od::DataType::domain && !kept_back(object, sub);
      if (reads) refs.push_back({object.index, sub.sub});
    }
  }
  return refs;
}

/// The objects to be read. Without a description: CiA 301's objects, and as many sub-indices of a record as its
/// sub-index 0 says.
class Walk {
 public:
  explicit Walk(const od::Description* description) : described_(description != nullptr) {
    if (described_) {
      left_ = described_objects(*description);
    } else {
      for (const auto& object : decode::standard_names().objects()) left_.push_back({object.index, 0});
      for (const auto first : {0x1200, 0x1400, 0x1600, 0x1800, 0x1A00}) {
        left_.push_back({static_cast<std::uint16_t>(first), 0});
      }
    }
    std::ranges::reverse(left_);
  }

  [[nodiscard]] std::optional<ObjectRef> next() {
    if (left_.empty()) return std::nullopt;
    const ObjectRef ref = left_.back();
    left_.pop_back();
    return ref;
  }

  // An object that exists adds further ones: the sub-indices of its record, and the next object of the same kind.
  void was_read(ObjectRef ref, std::span<const std::uint8_t> bytes) {
    if (described_ || ref.sub != 0) return;
    const bool of_many = ref.index >= 0x1200 && ref.index < 0x1C00;
    if (of_many && (ref.index & 0x1FFU) != 0x1FF) left_.push_back({static_cast<std::uint16_t>(ref.index + 1), 0});
    if (bytes.size() != 1 || is_variable(ref.index)) return;
    for (unsigned sub = bytes[0]; sub > 0; --sub) left_.push_back({ref.index, static_cast<std::uint8_t>(sub)});
  }

 private:
  static bool is_variable(std::uint16_t index) {
    const auto* const object = decode::standard_names().find(index);
    return object != nullptr && object->code == od::ObjectCode::var;
  }

  bool described_;
  std::vector<ObjectRef> left_;  // the next one is the last element
};

using Bytes = std::vector<std::uint8_t>;

/// The values of a device's settings by default, and by its slot's file (`config =`).
class Expectation {
 public:
  Expectation(const design::Machine& machine, const NodeArgument& node)
      : description_(node.description.get()), node_(node.node) {
    const auto* const bus = bus_of(machine, node);
    const auto* const slot = bus == nullptr ? nullptr : machine.slot(bus->name, node.node);
    if (slot == nullptr || slot->spec.config.empty()) return;
    const auto loaded = manager::load_configuration(slot->spec.config);
    auto wanted = manager::wanted(loaded.configuration, node.node);
    if (!wanted || !loaded.usable()) return;
    for (auto& entry : wanted->entries) configured_[entry.object] = std::move(entry.bytes);
  }

  /// Adds "default", "configured" and, for a setting, "differs": its value is not the configured one, or not the
  /// default if no file configures it. Returns text for the user: the value that it should have.
  [[nodiscard]] std::string put(Json& json, const KnownObject& object, std::span<const std::uint8_t> bytes) const {
    const auto* const holder = description_ == nullptr ? nullptr : description_->find(object.ref.index);
    if (holder == nullptr || object.described == nullptr) return {};
    const od::SubObject& sub = *object.described;
    const auto usual = eds::encode(description_->default_of(sub), sub.type, node_);
    const auto configured = configured_.find(object.ref);
    if (usual) json["default"] = value_of(object, *usual);
    if (configured != configured_.end()) json["configured"] = value_of(object, configured->second);
    if (!manager::is_setting(*holder, sub) || (!usual && configured == configured_.end())) return {};
    const Bytes& expected = configured != configured_.end() ? configured->second : *usual;
    const bool differs = !manager::same_value(sub.type, bytes, expected);
    json["differs"] = differs;
    if (!differs) return {};
    return fmt::format("  ({}: {})", configured != configured_.end() ? "configured" : "default",
                       value_text(object, expected));
  }

 private:
  static Json value_of(const KnownObject& object, const Bytes& bytes) {
    Json json;
    put_value(json, object, bytes);
    return json.contains("value") ? json["value"] : json["bytes"];
  }

  const od::Description* description_;
  NodeId node_;
  std::map<ObjectRef, Bytes> configured_;
};

/// The device's answers, as JSON and as a table.
struct Dump {
  const Expectation& expected;
  const NoteBook& notes;
  Json objects = Json::array();
  std::vector<std::string> lines{};
  std::size_t read = 0;
  std::size_t refused = 0;

  void value(const KnownObject& object, std::span<const std::uint8_t> bytes) {
    ++read;
    Json json = head(object);
    const KnownObject shown = notes.shown(object);
    put_value(json, shown, bytes);
    const std::string should = expected.put(json, object, bytes);
    const Note note = notes.of(object.ref);
    put_note(json, note, object.type, bytes);
    objects.push_back(std::move(json));
    line(object, value_text(shown, bytes) + note_text(note, shown, bytes) + should);
  }

  void abort(const KnownObject& object, std::uint32_t code) {
    ++refused;
    Json json = head(object);
    json["abort_code"] = hex(code);
    json["text"] = od::text(static_cast<od::AbortCode>(code));
    objects.push_back(std::move(json));
    line(object, fmt::format("refused: {:08X}h, {}", code, od::text(static_cast<od::AbortCode>(code))));
  }

  void failure(const KnownObject& object, const Error& error) {
    ++refused;
    Json json = head(object);
    json["failure"] = error.text;
    objects.push_back(std::move(json));
    line(object, fmt::format("not read: {}", error.text));
  }

 private:
  static Json head(const KnownObject& object) {
    Json json;
    json["index"] = hex(object.ref.index, 4);
    json["sub"] = object.ref.sub;
    json["name"] = object.name;
    return json;
  }
  void line(const KnownObject& object, const std::string& what) {
    lines.push_back(fmt::format("{}  {:<44}  {}", od::write_object(object.ref), object.name, what));
  }
};

bool is_absent(const Error& error) {
  return error.code == Errc::aborted && (error.detail == static_cast<std::uint32_t>(od::AbortCode::no_object) ||
                                         error.detail == static_cast<std::uint32_t>(od::AbortCode::no_sub_index));
}

}  // namespace

rt::Task<void> sdo_dump(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const NodeArgument wanted = node_argument(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, wanted, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  Network& bus = **network;
  const od::Description* const description = wanted.description.get();
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = bus.services().sdo.options();
  co::SdoAccess& device = objects_of(session, bus, wanted, how, direct);
  Walk walk(description);
  const Expectation expected(session.machine(), wanted);
  const NoteBook notes(session.machine(), wanted);
  Dump dump{.expected = expected, .notes = notes};
  Patience patience;
  while (const auto ref = walk.next()) {
    const KnownObject object = known_object(description, *ref);
    const auto answer = co_await device.read(ref->index, ref->sub);
    const bool gives_up = patience.over(answer);
    if (answer) {
      dump.value(object, answer->bytes());
      walk.was_read(*ref, answer->bytes());
      continue;
    }
    const Error& error = answer.error();
    if (gives_up) co_return fail_silent(reply, error, bus, wanted);
    if (description == nullptr && is_absent(error)) continue;
    if (error.code == Errc::aborted) {
      dump.abort(object, error.detail);
    } else {
      dump.failure(object, error);
    }
  }
  Json json;
  json["bus"] = bus.bus().name;
  json["node"] = wanted.node.value();
  if (!wanted.gateways.empty()) json["path"] = wanted.text();
  json["described"] = description != nullptr;
  json["read"] = dump.read;
  json["refused"] = dump.refused;
  json["objects"] = std::move(dump.objects);
  dump.lines.push_back(fmt::format("node {}: {} read, {} refused{}", wanted.text(), counted(dump.read, "value"),
                                   dump.refused,
                                   description != nullptr ? ""
                                                          : "; no description is known: only CiA 301's objects were "
                                                            "asked for (eds = of the slot, or --eds)"));
  if (!notes.problem().empty()) {
    json["notes"] = notes.problem();
    dump.lines.push_back(notes.problem());
  }
  give(reply, json, std::move(dump.lines));
}

}  // namespace berth::command
