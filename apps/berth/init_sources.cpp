// `berth init`: the sources of a machine, which are device descriptions or an existing bus.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "berth/base/counted.hpp"
#include "berth/command/control.hpp"
#include "berth/eds/review.hpp"
#include "berth/eds/xdd.hpp"
#include "execute.hpp"
#include "init.hpp"
#include "machine_run.hpp"
#include "ports.hpp"
#include "single.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr std::uint8_t any_type = 3;    // `Identity::unknown`: vendor-ID and product code
constexpr unsigned most_devices = 126;  // one node-ID is Berth's own

struct DeviceKind {
  std::string path;
  unsigned count = 1;
  eds::File file;
};
using Descriptions = std::vector<DeviceKind>;

Failure misuse(const std::string& text) { return failure(Exit::usage, text); }

/// Reads "drive.eds:4" as four devices, unless a file has just that name.
tl::expected<DeviceKind, Failure> counted(const std::string& word) {
  DeviceKind all{word, 1, {}};
  std::error_code none;
  const auto colon = word.find_last_of(':');
  if (colon == std::string::npos || fs::exists(word, none)) return all;
  const char* const end = word.data() + word.size();
  const auto [last, bad] = std::from_chars(word.data() + colon + 1, end, all.count);
  const bool digits = word.find_first_not_of("0123456789", colon + 1) == std::string::npos && colon + 1 < word.size();
  if (!digits) return all;
  if (bad != std::errc{} || last != end || all.count < 1 || all.count > most_devices) {
    return tl::unexpected(misuse(fmt::format("--eds {}: a bus has 1 to {} devices beside Berth", word, most_devices)));
  }
  all.path = word.substr(0, colon);
  return all;
}

}  // namespace

std::string file_of_counted(const std::string& word) {
  const auto one = counted(word);
  std::error_code none;
  return one && one->path != word && fs::is_regular_file(one->path, none) ? one->path : std::string();
}

namespace {

/// Devices are found by identity: contradictions there are reported now, the rest by `berth eds check`.
void note_identity(const DeviceKind& kind, std::vector<std::string>& notes) {
  for (const auto& finding : eds::review(kind.file, kind.path)) {
    if (finding.key.find("1018") == std::string::npos) continue;
    notes.push_back(fmt::format("{}: {}; `berth eds check {}` shows more", kind.path, finding.message, kind.path));
  }
}

tl::expected<DeviceKind, Failure> described(const std::string& word, std::vector<std::string>& notes) {
  auto one = counted(word);
  if (!one) return one;
  if (eds::encoding_of(one->path) == eds::Encoding::windows_1252) {
    return tl::unexpected(
        misuse(fmt::format("--eds {}: the name is not UTF-8, and a machine file could not name it", word)));
  }
  auto reading = eds::read_any_file(one->path);
  if (!reading.usable()) return tl::unexpected(failure(reading.findings));
  one->file = std::move(reading.file);
  note_identity(*one, notes);
  return one;
}

tl::expected<Descriptions, Failure> read_all(const std::vector<std::string>& words, std::vector<std::string>& notes) {
  Descriptions all;
  for (const auto& word : words) {
    auto one = described(word, notes);
    if (!one) return tl::unexpected(one.error());
    std::error_code none;
    const auto before =
        std::ranges::find_if(all, [&](const auto& d) { return fs::equivalent(d.path, one->path, none); });
    if (before == all.end()) {
      all.push_back(std::move(*one));
    } else {
      before->count += one->count;
      notes.push_back(fmt::format("{} is named more than once: {} devices of it", before->path, before->count));
    }
  }
  return all;
}

/// The description does not identify a type, so a device that has a node-ID already cannot be recognised by it.
bool is_any(const DeviceKind& d) { return d.file.type_code() == TypeCode{}; }

/// The kind of device, for a comment.
std::string remark_of(const DeviceKind& d) {
  const auto type = d.file.type_code();
  std::string text = d.file.device.product_name;
  if (!d.file.device.vendor_name.empty()) text += (text.empty() ? "" : ", ") + d.file.device.vendor_name;
  text += text.empty() ? "" : ": ";
  if (is_any(d)) return text + "the description has neither vendor-ID nor product code";
  return fmt::format("{}vendor-ID 0x{:08X}, product code 0x{:08X}", text, type.vendor, type.product);
}

std::string base_name(const DeviceKind& d) {
  const auto& product = d.file.device.product_name;
  return name_from(product.empty() ? fs::path(d.path).stem().string() : product);
}

/// Only if the file says so explicitly; if it says nothing, LSS is tried.
bool has_no_lss(const eds::File& file) {
  const auto* const section = file.document.find("DeviceInfo");
  return section != nullptr && file.document.find(*section, "LSS_Supported") != nullptr && !file.device.lss;
}

// ---- bit rate ----

constexpr std::array<std::uint16_t, 8> rates_kbit{10, 20, 50, 125, 250, 500, 800, 1000};

bool supports(const DeviceKind& d, std::uint32_t kbit) {
  const auto& rates = d.file.device.baud_rates;
  return rates.empty() || std::ranges::find(rates, kbit) != rates.end();
}

void choose_rate(InitBus& bus, const Descriptions& all, std::optional<unsigned> wanted,
                 std::vector<std::string>& notes) {
  const auto by_all = [&](std::uint32_t kbit) {
    return std::ranges::all_of(all, [&](const auto& d) { return supports(d, kbit); });
  };
  if (wanted) {
    bus.bitrate = *wanted;
  } else if (!by_all(bus.bitrate / 1000)) {
    for (const auto kbit : rates_kbit) {
      if (by_all(kbit)) bus.bitrate = kbit * 1000U;
    }
  }
  if (by_all(bus.bitrate / 1000)) {
    bus.remark = "bit/s; no description excludes it";
    return;
  }
  bus.remark = "bit/s; not every description supports it";
  for (const auto& d : all) {
    if (supports(d, bus.bitrate / 1000)) continue;
    notes.push_back(fmt::format("{} does not support {} bit/s, but {} kbit/s", d.path, bus.bitrate,
                                fmt::join(d.file.device.baud_rates, ", ")));
  }
}

std::string machine_name(const InitOptions& init) {
  if (!init.name.empty()) return init.name;
  std::error_code none;
  const auto folder = fs::weakly_canonical(fs::absolute(init.file), none).parent_path().filename().string();
  return folder.empty() ? "machine" : name_from(folder);
}

std::string names_of(const Descriptions& all) {
  std::vector<std::string> names;
  for (const auto& d : all) names.push_back(fs::path(d.path).filename().string());
  constexpr std::size_t most = 4;
  const bool more = names.size() > most;
  const auto rest = names.size() - most;
  if (more) names.resize(most);
  return fmt::format("{}{}", fmt::join(names, ", "), more ? fmt::format(" and {} more", rest) : "");
}

}  // namespace

tl::expected<InitPlan, Failure> plan_of_descriptions(const Options& options, const InitOptions& init) {
  InitPlan plan;
  const auto all = read_all(init.eds, plan.notes);
  if (!all) return tl::unexpected(all.error());
  plan.name = machine_name(init);
  plan.from = names_of(*all);
  InitBus bus;
  bus.name = options.bus.empty() ? "field" : options.bus;
  choose_rate(bus, *all, options.bit_rate, plan.notes);
  unsigned next = 1;
  std::uint32_t serial = 1;
  for (const auto& d : *all) {
    if (next - 1 + d.count > most_devices) {
      return tl::unexpected(misuse(
          fmt::format("these are more than {} devices, and a bus has no more node-IDs beside Berth's own; make a "
                      "second machine of the rest, or add a second bus to the file",
                      most_devices)));
    }
    InitDevice device{base_name(d), remark_of(d), d.path, {}, next, d.count, has_no_lss(d.file) || is_any(d), false};
    device.device.address.serial = serial;
    if (is_any(d)) {
      device.device.unknown = any_type;
      plan.notes.push_back(
          fmt::format("{} gives neither vendor-ID nor product code (1018h, [DeviceInfo]): its slots accept any device "
                      "that answers at their node-IDs (type = \"any\")",
                      d.path));
    }
    serial += d.count;
    next += d.count;
    if (!device.fixed) {
      bus.devices.push_back(device);
      continue;
    }
    for (const std::string name = device.name; device.first_id < next;
         ++device.first_id, ++device.device.address.serial) {
      device.count = 1;
      if (d.count > 1) device.name = fmt::format("{} {}", name, device.first_id);
      bus.devices.push_back(device);
    }
  }
  plan.buses.push_back(std::move(bus));
  make_names_unique(plan);
  return plan;
}

// ---- from a bus ----

namespace {

/// Sends one request to whatever has the bus: this process, or a running one.
using Ask = std::function<tl::expected<Json, Failure>(const command::Request&)>;

tl::expected<Json, Failure> json_of(const command::Reply& reply) {
  auto json = Json::parse(reply.json, nullptr, false);
  // Two devices under one node-ID are an answer of status 1, too.
  if (json.is_object() && !json.contains("error")) return json;
  return tl::unexpected(failure(reply.status == 0 ? Exit::failed : reply.status, reply.error));
}

/// A found device.
struct Found {
  std::string bus;
  unsigned id = 0;  ///< 0: no node-ID
  std::optional<Identity> device;
  std::string name;
  bool duplicate = false;
};

Found found_in(const Json& node, const std::string& bus) {
  Found found{node.value("bus", bus), 0, std::nullopt, node.value("slot", ""), node.value("duplicate", false)};
  if (node.contains("id") && node.at("id").is_number_unsigned()) found.id = node.at("id").get<unsigned>();
  if (node.contains("address")) found.device = parse_identity(node.at("address").get<std::string>());
  return found;
}

/// The device's own name for itself (1008h); empty: it has none.
std::string name_of(const Ask& ask, const Found& found) {
  const auto read = ask(
      {"sdo read", {{"bus", found.bus}, {"node", std::to_string(found.id)}, {"object", "1008h:00"}, {"type", "vs"}}});
  if (!read || !read->contains("value") || !read->at("value").is_string()) return {};
  return read->at("value").get<std::string>();
}

// Without a serial number, several devices share the address that LSS reports.
bool is_same(const Identity& known, const Identity& by_lss) {
  return known == by_lss || (!by_lss.has_serial() && known.agrees(by_lss));
}

tl::expected<std::vector<Found>, Failure> look(const Ask& ask, const std::string& only_bus) {
  const auto scan = ask({"scan", {{"all", "1"}}});
  if (!scan) return tl::unexpected(scan.error());
  std::vector<Found> all;
  std::set<std::string> buses{only_bus};
  for (const auto& node : scan->value("nodes", Json::array())) {
    all.push_back(found_in(node, only_bus));
    buses.insert(all.back().bus);
    if (all.back().name.empty() && all.back().id != 0) all.back().name = name_of(ask, all.back());
  }
  // A scan does not show devices without a node-ID that know LSS but not RAND.
  buses.erase("");
  for (const auto& bus : buses) {
    const auto more = ask({"lss find", {{"bus", bus}}});
    if (!more) continue;
    for (const auto& device : more->value("devices", Json::array())) {
      Found found = found_in(device, bus);
      const bool known = std::ranges::any_of(all, [&](const Found& f) {
        return f.bus == bus && f.device && found.device && is_same(*f.device, *found.device);
      });
      if (!known) all.push_back(std::move(found));
    }
  }
  return all;
}

const DeviceKind* description_of(const Descriptions& all, const Identity& device) {
  const auto fits = std::ranges::find_if(all, [&](const auto& d) {
    const TypeCode type = d.file.type_code();
    return !is_any(d) && device.knows(0) &&
           device.agrees(Identity(type.vendor, type.product, device.address.revision, device.address.serial));
  });
  return fits == all.end() ? nullptr : &*fits;
}

/// The node-IDs of one bus: the devices', Berth's own, and the free ones.
class Ids {
 public:
  explicit Ids(const std::vector<Found>& all, const std::string& bus) {
    for (const auto& found : all) {
      if (found.bus == bus) taken_.insert(found.id);
    }
    master_ = 127;
    while (taken_.contains(master_)) --master_;
    taken_.insert(master_);
  }
  [[nodiscard]] unsigned master() const noexcept { return master_; }
  /// 0: none is left.
  [[nodiscard]] unsigned next() {
    unsigned id = 1;
    while (taken_.contains(id)) ++id;
    if (id > 127) return 0;
    taken_.insert(id);
    return id;
  }

 private:
  std::set<unsigned> taken_;
  unsigned master_;
};

std::string base_name(const Found& found, const DeviceKind* description, unsigned id) {
  if (!found.name.empty()) return name_from(found.name);
  if (description != nullptr) return base_name(*description);
  return fmt::format("node {}", id);
}

void add_found(InitBus& bus, const Found& found, const Descriptions& descriptions, Ids& ids) {
  const std::string who = found.id != 0 ? fmt::format("node-ID {}", found.id) : "a device without a node-ID";
  const bool again = found.id != 0 && std::ranges::any_of(bus.devices, [&](const auto& d) {
                       return d.has_id && d.first_id == found.id;
                     });
  if (!found.device) {
    bus.left_out.push_back(who + ": does not report its identity (1018h); write its [[slot]] by hand");
    return;
  }
  const unsigned id = found.id != 0 && !again ? found.id : ids.next();
  if (id == 0) {
    bus.left_out.push_back(fmt::format("{}: no node-ID is left for it", to_string(*found.device)));
    return;
  }
  const DeviceKind* const description = description_of(descriptions, *found.device);
  InitDevice device{base_name(found, description, id),
                    {},
                    description != nullptr ? description->path : "",
                    *found.device,
                    id,
                    1,
                    found.device->at.configured() || (found.device->unknown & any_type) == any_type,
                    found.id != 0 && !again};
  const std::string number = found.device->has_serial()
                                 ? fmt::format("serial number 0x{:08X}", found.device->address.serial)
                                 : std::string("no serial number");
  device.remark = fmt::format("{}; {}", number,
                              again           ? fmt::format("another device has its node-ID {}, too", found.id)
                              : device.has_id ? "it has this node-ID already"
                                              : "it had no node-ID");
  bus.devices.push_back(std::move(device));
}

void tell_equals_apart(InitBus& bus) {
  std::map<std::string, unsigned> often;
  for (const auto& device : bus.devices) ++often[device.name];
  for (auto& device : bus.devices) {
    if (often.at(device.name) > 1) device.name += fmt::format(" {}", device.first_id);
  }
}

/// All buses, in the order in which they were seen.
tl::expected<std::vector<InitBus>, Failure> buses_of(const std::vector<Found>& all, const Descriptions& descriptions) {
  std::vector<InitBus> buses;
  for (const auto& found : all) {
    if (std::ranges::find(buses, found.bus, &InitBus::name) != buses.end()) continue;
    InitBus bus;
    bus.name = found.bus;
    Ids ids(all, found.bus);
    bus.master_id = ids.master();
    if (bus.master_id == 0) {
      return tl::unexpected(failure(Exit::no, fmt::format("bus {}: 127 devices leave no node-ID to Berth", bus.name)));
    }
    for (const bool with_id : {true, false}) {
      for (const auto& each : all) {
        if (each.bus == bus.name && (each.id != 0) == with_id) add_found(bus, each, descriptions, ids);
      }
    }
    std::ranges::sort(bus.devices, {}, &InitDevice::first_id);
    tell_equals_apart(bus);
    buses.push_back(std::move(bus));
  }
  return buses;
}

tl::expected<InitPlan, Failure> plan_of(const Ask& ask, const Options& options, const InitOptions& init,
                                        const std::string& only_bus) {
  InitPlan plan;
  const auto descriptions = read_all(init.eds, plan.notes);
  if (!descriptions) return tl::unexpected(descriptions.error());
  const auto all = look(ask, only_bus);
  if (!all) return tl::unexpected(all.error());
  auto buses = buses_of(*all, *descriptions);
  if (!buses) return tl::unexpected(buses.error());
  plan.name = machine_name(init);
  plan.from = "what answered on " + options.ports.front();
  plan.buses = std::move(*buses);
  for (const auto& bus : plan.buses) {
    for (const auto& line : bus.left_out) plan.notes.push_back(fmt::format("bus {}: {}", bus.name, line));
  }
  if (plan.devices() > 0) return plan;
  std::vector<std::string> why{"no device answered on " + options.ports.front()};
  why.insert(why.end(), plan.notes.begin(), plan.notes.end());
  why.emplace_back("nothing was written; `berth doctor` says what may be wrong");
  return tl::unexpected(failure_in_lines(Exit::no, why));
}

tl::expected<InitPlan, Failure> plan_of_port(const Options& options, const InitOptions& init) {
  Options own = options;
  own.dry_run = false;  // --dry-run applies only to the files
  own.machine.clear();
  if (own.bus.empty()) own.bus = "field";
  auto made = MachineRun::make(own, {});
  if (!made) return tl::unexpected(made.error());
  MachineRun& run = **made;
  if (const auto clear = run.strangers().listen_first(); !clear) return tl::unexpected(clear.error());
  if (const auto alone = run.strangers().ask(false); !alone) return tl::unexpected(alone.error());
  const Ask ask = [&](const command::Request& request) -> tl::expected<Json, Failure> {
    command::Reply reply;
    if (execute_in(run, request, reply, options.timeout.value_or(5min))) return json_of(reply);
    return tl::unexpected(failure(Exit::failed, run.interrupt().came() ? "ended before all were asked; nothing was "
                                                                         "written"
                                                                       : "the bus was not asked within --timeout"));
  };
  auto plan = plan_of(ask, own, init, own.bus);
  if (!plan) return plan;
  const design::Bus& bus = run.machine().buses.front();
  plan->buses.front().port = bus.port;
  plan->buses.front().bitrate = bus.bitrate;
  return plan;
}

// The running process knows its ports, but does not report them.
tl::expected<InitPlan, Failure> plan_of_running(const Options& options, const InitOptions& init) {
  Options own = options;
  own.control = options.ports.front();
  own.ports.clear();
  const Ask ask = [&own](const command::Request& request) -> tl::expected<Json, Failure> {
    const auto reply = carry_out(own, request);
    if (!reply) return tl::unexpected(reply.error());
    return json_of(*reply);
  };
  auto plan = plan_of(ask, options, init, {});
  if (!plan) return plan;
  for (auto& bus : plan->buses) {
    bus.bitrate = options.bit_rate.value_or(bus.bitrate);
    bus.remark = options.bit_rate ? "" : "bit/s; a guess: the running machine does not report its own";
  }
  return plan;
}

}  // namespace

tl::expected<InitPlan, Failure> plan_of_bus(const Options& options, const InitOptions& init) {
  const auto port = port_of_word(options.ports.front());
  if (!port) return tl::unexpected(misuse(port.error()));
  const bool running = port->kind == can::PortKind::plant && command::control_answers(port->address) &&
                       command::control_call(port->address, {"report", {}}, 5000).has_value();
  auto plan = running ? plan_of_running(options, init) : plan_of_port(options, init);
  if (plan) make_names_unique(*plan);
  return plan;
}

}  // namespace berth::cli
