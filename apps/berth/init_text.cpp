// `berth init`: the text of the machine file and of the plant file.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <set>

#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "init.hpp"

namespace berth::cli {
namespace {

namespace fs = std::filesystem;

// For a comment, which ends with its line.
std::string one_line(const std::string& text) {
  std::string line = text::printable(text);
  std::ranges::replace_if(
      line, [](char c) { return c == '\n' || c == '\t' || c == '\r'; }, ' ');
  return line;
}

// Quoted for a shell, if necessary.
std::string word(const std::string& text) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) != 0 || c >= 0x80 || std::strchr("._-/+,:=@%", c); };
  if (!text.empty() && std::ranges::all_of(text, plain)) return text;
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

fs::path folder_of(const std::string& file) {
  const auto folder = fs::path(file).parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

// The description's path, relative to the folder in which `file` will be. Links of folders are resolved; the
// description's own name stays.
std::string seen_from(const std::string& file, const std::string& eds) {
  const fs::path path(eds);
  std::error_code error;
  const auto folder = fs::weakly_canonical(folder_of(eds), error);
  const auto base = fs::weakly_canonical(folder_of(file), error);
  const auto relative = (folder / path.filename()).lexically_relative(base);
  return error || relative.empty() ? fs::absolute(path).string() : relative.string();
}

std::string hex(std::uint32_t number) { return fmt::format("0x{:04X}_{:04X}", number >> 16U, number & 0xFFFFU); }

std::string type_of(const Identity& device, const std::string& space) {
  if (!device.knows(0)) return fmt::format("type{}= \"any\"", space.substr(1));
  std::string type = fmt::format("type{}= {{ vendor = {}", space.substr(1), hex(device.address.vendor));
  if (device.knows(1)) type += ", product = " + hex(device.address.product);
  if (device.knows(2) && device.address.revision != 0) type += ", revision = " + hex(device.address.revision);
  return type + " }";
}

std::string what_it_is(const InitDevice& device, const std::string& file, const std::string& space) {
  return device.eds.empty() ? type_of(device.device, space)
                            : "eds" + space + "= " + text::quoted(seen_from(file, device.eds));
}

void add_slot(std::string& text, const InitBus& bus, const InitDevice& device, const std::string& file) {
  text += "\n";
  if (!device.remark.empty()) text += "# " + one_line(device.remark) + "\n";
  text += fmt::format("[[slot]]\nbus  = {}\n", text::quoted(bus.name));
  if (device.count == 1) {
    text += fmt::format("id   = {}\n", device.first_id);
  } else {
    text += fmt::format("ids  = \"{}..{}\"\n", device.first_id, device.first_id + device.count - 1);
  }
  text += fmt::format("name = {}\n{}\n", text::quoted(device.name), what_it_is(device, file, "  "));
  const bool any = !device.eds.empty() && !device.device.knows(0);
  if (any) text += "type = \"any\"                    # any device that answers at its node-ID is accepted\n";
  if (!device.fixed) return;
  text += fmt::format("assign = \"fixed\"                # {}: set its node-ID on the device itself\n",
                      device.device.has_serial() && device.device.knows(0) ? "no LSS" : "known by its node-ID");
}

void add_device(std::string& text, const InitBus& bus, const InitDevice& device, const std::string& file) {
  text += fmt::format("\n[[device]]\nbus    = {}\nname   = {}\n{}\n", text::quoted(bus.name),
                      text::quoted(text::fill(device.name, "id", device.count > 1 ? "{n}" : "")),
                      what_it_is(device, file, "    "));
  if (device.count == 1) {
    text += fmt::format("serial = 0x{:X}\n", device.device.address.serial);
  } else {
    text += fmt::format("count  = {}\nserial_first = 0x{:X}\n", device.count, device.device.address.serial);
    if (device.first_id != 1)
      text += fmt::format("n_first = {}                    # as the slots' names\n", device.first_id);
  }
  if (device.fixed || device.has_id) text += fmt::format("node_id = {}\n", device.first_id);
  if (device.fixed) text += "source = \"switches\"\n";
}

}  // namespace

std::size_t InitPlan::devices() const noexcept {
  std::size_t all = 0;
  for (const auto& bus : buses) {
    for (const auto& device : bus.devices) all += device.count;
  }
  return all;
}

std::string name_from(const std::string& said) {
  std::string name = text::printable(said);
  std::ranges::replace_if(
      name,
      [](char c) { return c == '/' || c == '\\' || c == '{' || c == '}' || static_cast<unsigned char>(c) < 0x20; },
      '-');
  constexpr std::size_t longest = 60;  // a number comes after it
  std::size_t end = std::min(name.size(), longest);
  while (end < name.size() && end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0U) == 0x80U) --end;
  name.resize(end);
  name.erase(0, std::min(name.find_first_not_of(' '), name.size()));
  name.erase(name.find_last_not_of(' ') + 1);
  const bool number = !name.empty() && std::isdigit(static_cast<unsigned char>(name.front())) != 0;
  if (name.empty() || number || name == "master" || name == "all") name = name.empty() ? "device" : "device " + name;
  return name;
}

namespace {

std::set<std::string> names_of(const InitDevice& device) {
  std::set<std::string> names;
  for (unsigned i = 0; i < device.count; ++i) {
    auto name = text::fill(device.name, "id", std::to_string(device.first_id + i));
    std::ranges::transform(name, name.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    names.insert(name);
  }
  return names;
}

bool overlap(const std::set<std::string>& a, const std::set<std::string>& b) {
  return std::ranges::any_of(a, [&](const auto& name) { return b.contains(name); });
}

}  // namespace

void make_names_unique(InitPlan& plan) {
  std::set<std::string> taken;
  for (auto& bus : plan.buses) {
    for (auto& device : bus.devices) {
      const std::string said = device.name;
      const std::string varying = device.count > 1 ? " {id}" : "";
      device.name = said + varying;
      for (unsigned n = 2; overlap(names_of(device), taken); ++n)
        device.name = fmt::format("{} {}{}", said, n, varying);
      taken.merge(names_of(device));
    }
  }
}

std::string machine_text(const InitPlan& plan, const std::string& file, const std::string& plant_file) {
  const auto& first = plan.buses.front();
  const std::string of_bus = plan.buses.size() == 1 ? "" : word(first.name + "=");
  const std::string port = first.port.kind == can::PortKind::sim ? " --port " + of_bus + "can0" : "";
  std::string text = fmt::format(
      "# {}: written by `berth init` from {}.\n"
      "# You decide which device belongs in which slot: check node-IDs and names before this runs on a real bus.\n"
      "#\n"
      "#   berth up {} --sim {}\n"
      "#   berth up {}{}\n"
      "\n"
      "[machine]\n"
      "name = {}\n",
      one_line(plan.name), one_line(plan.from), one_line(word(file)), one_line(word(plant_file)), one_line(word(file)),
      one_line(port), text::quoted(plan.name));
  for (const auto& bus : plan.buses) {
    text += fmt::format("\n[bus.{}]\nport      = {}", text::quoted(bus.name), text::quoted(can::to_string(bus.port)));
    if (bus.port.kind == can::PortKind::sim) {
      text += "             # simulated; a real one: \"socketcan:can0\", \"slcan:/dev/ttyACM0\"";
    }
    text +=
        fmt::format("\nbitrate   = {}{}\nmaster_id = {:<3}               # Berth's own node-ID\ndiscovery = \"auto\"\n",
                    bus.bitrate, bus.remark.empty() ? "" : "            # " + one_line(bus.remark), bus.master_id);
    for (const auto& line : bus.left_out) text += "\n# " + one_line(line) + "\n";
    for (const auto& device : bus.devices) add_slot(text, bus, device, file);
  }
  return text;
}

std::string plant_text(const InitPlan& plan, const std::string& file, const std::string& plant_file) {
  std::string text =
      fmt::format("# The devices of {}, simulated; serial numbers {}.\n\n[plant]\nseed = 1\n",
                  one_line(word(fs::path(file).filename().string())),
                  plan.buses.front().port.kind == can::PortKind::sim ? "are made up" : "as they were found");
  for (const auto& bus : plan.buses) text += fmt::format("\n[bus.{}]\n", text::quoted(bus.name));
  for (const auto& bus : plan.buses) {
    for (const auto& device : bus.devices) add_device(text, bus, device, plant_file);
  }
  return text;
}

}  // namespace berth::cli
