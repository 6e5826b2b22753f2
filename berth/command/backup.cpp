// backup save, compare, restore: save the content of devices as DCFs; compare a DCF with a device; write a DCF into a
// device.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/differences.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/values.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/manager/configuration_upload.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "berth/od/notation.hpp"
#include "berth/operate/timing_options.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

using manager::LoadedConfiguration;

constexpr const char* conforms = "`berth scan` shows which devices answer";

/// 1018h; a part that the device does not have is 0.
struct DeviceIdentity {
  TypeCode type;
  std::uint32_t revision = 0;
  std::uint32_t serial = 0;
};

rt::Task<Result<DeviceIdentity>> identity_of(co::SdoAccess& device) {
  constexpr std::uint16_t identity = 0x1018;
  DeviceIdentity told;
  const auto vendor = co_await device.read_u32(identity, 1);
  if (!vendor) co_return fail(vendor.error());
  told.type.vendor = *vendor;
  for (std::uint8_t sub = 2; sub <= 4; ++sub) {  // optional; only the vendor-ID is mandatory
    const auto value = co_await device.read_u32(identity, sub);
    if (!value && value.error().code == Errc::timeout) co_return fail(value.error());
    (sub == 2 ? told.type.product : sub == 3 ? told.revision : told.serial) = value ? *value : 0;
  }
  co_return told;
}

std::string words_of(TypeCode type) {
  return fmt::format("vendor-ID {:X}h, product code {:X}h", type.vendor, type.product);
}

// A file that names no type fits every device.
std::string misfit(const std::string& file, TypeCode of_file, TypeCode of_device) {
  const bool vendor_fits = of_file.vendor == 0 || of_file.vendor == of_device.vendor;
  const bool product_fits = of_file.product == 0 || of_file.product == of_device.product;
  if (vendor_fits && product_fits) return {};
  return fmt::format("{} is of another type of device: {}; the device has {}", file, words_of(of_file),
                     words_of(of_device));
}

const design::Slot* slot_of(const design::Machine& machine, const NodeArgument& node) {
  const auto* const bus = bus_of(machine, node);
  return bus == nullptr ? nullptr : machine.slot(bus->name, node.node);
}

/// One device of a backup.
struct Saved {
  NodeArgument node;
  std::string bus;   ///< the device's bus
  std::string slot;  ///< empty: the device is in no slot
  DeviceIdentity told;
  manager::UploadedConfiguration uploaded;
  std::string problem;  ///< why there is no DCF
};

// The device's description: its slot's, else the one stored in the device.
rt::Task<void> read_description(co::SdoAccess& device, const design::Slot* slot, eds::Reading& into, Saved& saved) {
  if (slot != nullptr && !slot->eds_path.empty()) {
    into = eds::read_any_file(slot->eds_path);
  } else {
    auto own = co_await manager::read_own_eds(device);
    if (!own) {
      saved.problem =
          fmt::format("a backup needs the device's description (eds = of its slot): {}", describe(own.error()));
      co_return;
    }
    into = eds::read_any(std::move(*own), "1021h");
  }
  const auto error = std::ranges::find(into.findings, Finding::Severity::error, &Finding::severity);
  if (error != into.findings.end()) saved.problem = to_string(*error);
}

rt::Task<void> save_one(Session& session, Saved& saved) {
  const auto network = node_network(session, saved.node, Place::beneath_too);
  if (!network) {
    saved.problem = network.error();
    co_return;
  }
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = (*network)->services().sdo.options();
  co::SdoAccess& device = objects_of(session, **network, saved.node, how, direct);
  const auto told = co_await identity_of(device);
  if (!told) {
    saved.problem = fmt::format("{}; {}", describe(told.error()), conforms);
    co_return;
  }
  saved.told = *told;
  eds::Reading reading;
  co_await read_description(device, slot_of(session.machine(), saved.node), reading, saved);
  if (!saved.problem.empty()) co_return;
  auto& commissioning = reading.file.commissioning;
  if (!commissioning) commissioning.emplace();
  commissioning->lss_serial_number = told->serial;
  auto uploaded = co_await manager::upload_configuration(device, reading.file, saved.node.node);
  if (!uploaded) {
    saved.problem = describe(uploaded.error());
    co_return;
  }
  saved.uploaded = std::move(*uploaded);
  const auto made = manager::read_configuration(saved.uploaded.dcf, "its description");
  saved.problem = misfit("its description", made.configuration.type, told->type);
}

std::string hex_digits(std::span<const std::uint8_t> bytes) {
  std::string text;
  text.reserve(2 * bytes.size());
  for (const auto byte : bytes) text += fmt::format("{:02X}", byte);
  return text;
}

Json json_of(const Saved& saved) {
  Json json{{"bus", saved.bus}, {"node", saved.node.node.value()}};
  if (!saved.slot.empty()) json["slot"] = saved.slot;
  if (!saved.problem.empty()) {
    json["problem"] = saved.problem;
    return json;
  }
  json["vendor"] = hex(saved.told.type.vendor);
  json["product"] = hex(saved.told.type.product);
  json["revision"] = hex(saved.told.revision);
  json["serial"] = hex(saved.told.serial);
  json["read"] = saved.uploaded.read;
  json["refused"] = saved.uploaded.refused;
  json["left_out"] = Json::array();
  for (const auto& object : saved.uploaded.left_out) json["left_out"].push_back(od::write_object(object));
  json["bytes"] = saved.uploaded.dcf.size();
  json["dcf"] = hex_digits(manager::pack_stored(saved.uploaded.dcf));
  return json;
}

std::string line_of(const Saved& saved) {
  const std::string who = fmt::format("{}  {:>3}  {}", saved.bus, saved.node.node.value(), saved.slot);
  if (!saved.problem.empty()) return fmt::format("{}: no backup: {}", who, saved.problem);
  return fmt::format("{}: {} read, {} refused, {} left out", who, counted(saved.uploaded.read, "value"),
                     saved.uploaded.refused, saved.uploaded.left_out.size());
}

// The devices named, one per line; if none is named, the device of every slot.
Checked<std::vector<Saved>> devices_of(Session& session, const std::string& bus, const std::string& nodes) {
  std::vector<std::string> words;
  if (!nodes.empty()) {
    words = lines_of(nodes);
  } else {
    for (const auto& slot : session.machine().slots) {
      if (bus.empty() || slot.spec.name.bus == bus) words.push_back(slot.spec.name.bus + "/" + slot.spec.name.name);
    }
  }
  if (words.empty()) return tl::unexpected(std::string("the machine has no slots there: name the nodes"));
  std::vector<Saved> devices;
  for (const auto& word : words) {
    auto node = find_node(session.machine(), nodes.empty() ? std::string() : bus, word);
    if (!node) return tl::unexpected(node.error());
    Saved saved;
    const auto on = known_bus_of(session.machine(), *node);
    if (!on) return tl::unexpected(on.error());
    saved.bus = (*on)->name;
    saved.node = std::move(*node);
    if (const auto* const slot = slot_of(session.machine(), saved.node)) saved.slot = slot->spec.name.name;
    devices.push_back(std::move(saved));
  }
  return devices;
}

}  // namespace

rt::Task<void> backup_save(Session& session, const Request& request, Reply& reply) {
  const Arguments arguments(request);
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const std::string nodes = arguments.has("all") ? std::string() : arguments.text("node");
  if (nodes.empty() && !arguments.has("all")) co_return refuse(reply, 2, "which devices? Name nodes, or all");
  auto devices = devices_of(session, arguments.text("bus"), nodes);
  if (!devices) co_return refuse(reply, 2, devices.error());
  Json json{{"backups", Json::array()}};
  std::vector<std::string> lines;
  std::size_t failed = 0;
  for (auto& saved : *devices) {
    co_await save_one(session, saved);
    if (!saved.problem.empty()) ++failed;
    json["backups"].push_back(json_of(saved));
    lines.push_back(line_of(saved));
    saved.uploaded = {};  // saves memory: of a hundred devices, only the answer is kept
  }
  json["failed"] = failed;
  give(reply, json, std::move(lines));
  if (failed == 0) co_return;
  reply.status = 1;
  reply.error = fmt::format("{} of {} without a backup", failed, counted(devices->size(), "device"));
}

// ---- a DCF and a device ----

namespace {

// A zlib stream in hex digits, as `backup save` writes it.
Checked<std::string> unpacked(const std::string& digits) {
  const auto nibble = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
                                  : -1;
  };
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    const int high = nibble(digits[i]);
    const int low = nibble(digits[i + 1]);
    if (high < 0 || low < 0) return tl::unexpected(std::string("dcf is a zlib stream in hexadecimal digits"));
    bytes.push_back(static_cast<std::uint8_t>(high * 16 + low));
  }
  auto text = manager::unpack_stored(manager::stored_format::zlib, bytes);
  if (!text || digits.size() % 2 != 0) return tl::unexpected(std::string("dcf is a zlib stream in hexadecimal digits"));
  return std::move(*text);
}

Checked<LoadedConfiguration> load(Arguments& arguments) {
  const std::string file = arguments.text("file");
  LoadedConfiguration loaded;
  if (!file.empty()) {
    loaded = manager::load_configuration(file);
  } else if (arguments.has("dcf")) {
    auto text = unpacked(arguments.text("dcf"));
    if (!text) return tl::unexpected(text.error());
    loaded = manager::read_configuration(std::move(*text), "the DCF");
  } else {
    return tl::unexpected(std::string("which DCF? Name its file"));
  }
  const auto error = std::ranges::find(loaded.findings, Finding::Severity::error, &Finding::severity);
  if (error != loaded.findings.end()) return tl::unexpected(to_string(*error));
  return loaded;
}

/// The comparison of a DCF with a device.
struct Comparison {
  NodeArgument node;
  std::string bus;
  manager::Wanted wanted;
  manager::ConfigurationReport report;
  std::vector<manager::Failure> refused;
};

const char* result_of(const Comparison& c, bool write) {
  if (!c.report.good()) return "failed";
  if (!write) return c.report.differences.empty() && c.refused.empty() ? "equal" : "differs";
  return c.refused.empty() ? "restored" : "partly restored";
}

Json json_of(const Comparison& c, bool write) {
  Json json{{"bus", c.bus}, {"node", c.node.node.value()}, {"file", c.wanted.file}, {"result", result_of(c, write)}};
  json["compared"] = c.report.compared;
  json["differences"] = Json::array();
  for (const auto& d : c.report.differences) json["differences"].push_back(difference_json(d));
  json["refused"] = Json::array();
  for (const auto& f : c.refused) {
    json["refused"].push_back({{"object", fmt::format("0x{:04X}:{:02X}", f.object.index, f.object.sub)},
                               {"name", f.name},
                               {"why", describe(f, c.wanted.file)}});
  }
  if (write) json["written"] = c.report.written;
  json["text"] = summary(c.report, c.wanted.file);
  return json;
}

// After a restore, the old value no longer differs: the line gives it as the value before.
std::string restored_line(const manager::Difference& d) {
  return fmt::format("    {}{}: {}, was {}", od::write_object(d.object), d.name.empty() ? "" : " \"" + d.name + '"',
                     manager::print_value(d.type, d.wanted),
                     d.held ? manager::print_value(d.type, *d.held) : std::string("unreadable"));
}

void give_result(const Comparison& c, bool write, Reply& reply) {
  const std::string result = result_of(c, write);
  std::vector<std::string> lines{
      fmt::format("{}  {:>3}: {}: {}", c.bus, c.node.node.value(), result, summary(c.report, c.wanted.file))};
  for (const auto& d : c.report.differences) {
    const bool refused = std::ranges::find(c.refused, d.object, &manager::Failure::object) != c.refused.end();
    if (!refused) lines.push_back(write ? restored_line(d) : "    " + describe(d, c.wanted.file));
  }
  for (const auto& f : c.refused) lines.push_back("    " + describe(f, c.wanted.file));
  give(reply, json_of(c, write), std::move(lines));
  if (result == "equal" || result == "restored") return;
  reply.status = 1;
  if (result == "differs") {
    reply.error = fmt::format("the device differs from {}", c.wanted.file);
  } else if (result == "partly restored") {
    reply.error =
        error_line(fmt::format("{} refused; the others are restored", counted(c.refused.size(), "value")),
                   "some devices accept them only in pre-operational: `berth nmt preop`, then repeat the command");
  } else {
    reply.status = c.report.failure->error.code == Errc::aborted ? 1 : 3;
    reply.error = error_line(describe(*c.report.failure, c.wanted.file),
                             write && c.report.written > 0
                                 ? "the values were written in part; repeat the command when the device is back"
                                 : conforms);
  }
}

rt::Task<void> bring(Session& session, Network& network, Comparison& c, bool write) {
  std::optional<co::NodeAccess> direct, patient;
  const co::SdoOptions how = network.services().sdo.options();
  co::SdoAccess& values = objects_of(session, network, c.node, how, direct);
  const auto saving_how = operate::saving_options(network.bus().timing);
  co::SdoAccess& saving = objects_of(session, network, c.node, saving_how, patient);
  auto options = operate::configurator_options(network.bus().timing);
  options.write = write;
  options.trust_date = false;
  options.refused = [&c](const manager::Failure& failure) { c.refused.push_back(failure); };
  manager::Configurator configurator(values, saving, c.wanted, options);
  co_await configurator.run(c.report);
}

rt::Task<void> beside(Session& session, const Request& request, Reply& reply, bool write) {
  Arguments arguments(request);
  Comparison c;
  c.node = node_argument(arguments, session.machine());
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto network = node_network(session, c.node, Place::beneath_too);
  if (!network) co_return refuse(reply, 2, network.error());
  const auto on = known_bus_of(session.machine(), c.node);
  if (!on) co_return refuse(reply, 2, on.error());
  c.bus = (*on)->name;
  const auto loaded = load(arguments);
  if (!loaded) co_return refuse(reply, 2, loaded.error());
  auto wanted = manager::wanted(loaded->configuration, c.node.node);
  if (!wanted) co_return fail_with(reply, wanted.error(), loaded->configuration.file);
  c.wanted = std::move(*wanted);
  rt::Turn& turn = (*network)->services().turn;
  co_await turn.take();  // so that the main job changes nothing in the device meanwhile
  const rt::Held held(turn);
  std::optional<co::NodeAccess> direct;
  const co::SdoOptions how = (*network)->services().sdo.options();
  const auto told = co_await identity_of(objects_of(session, **network, c.node, how, direct));
  if (!told) co_return fail_with(reply, told.error(), fmt::format("bus {}, reading 1018h", c.bus), conforms);
  const auto problem = misfit(c.wanted.file, c.wanted.type, told->type);
  if (!problem.empty()) co_return refuse(reply, 1, problem, "nothing was written");
  co_await bring(session, **network, c, write);
  give_result(c, write, reply);
  const auto* const slot = slot_of(session.machine(), c.node);
  if (write && slot != nullptr && session.configures(*slot)) {
    reply.lines.push_back("    the slot has its own configuration: Berth writes it again when the device boots");
  }
}

}  // namespace

rt::Task<void> backup_compare(Session& session, const Request& request, Reply& reply) {
  co_await beside(session, request, reply, false);
}

rt::Task<void> backup_restore(Session& session, const Request& request, Reply& reply) {
  co_await beside(session, request, reply, true);
}

}  // namespace berth::command
