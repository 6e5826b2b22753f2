#include "berth/io/list_ports.hpp"

#include <algorithm>
#include <fstream>

#include "berth/io/socketcan_setup.hpp"

namespace berth::io {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t longest_attribute = 256;
constexpr std::size_t most_entries = 4096;

// The first line of a sysfs attribute; empty if there is none.
std::string attribute(const fs::path& file) {
  std::ifstream in(file);
  std::string text(longest_attribute, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(std::max<std::streamsize>(in.gcount(), 0)));
  return text.substr(0, text.find('\n'));
}

std::vector<std::string> entries(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end && names.size() < most_entries;
       it.increment(error)) {
    names.push_back(it->path().filename().string());
  }
  std::ranges::sort(names);
  return names;
}

// The identity of the device, or of the device that it is attached to.
std::optional<UsbIdentity> usb_identity(const fs::path& device) {
  std::error_code error;
  fs::path at = fs::canonical(device, error);
  constexpr int deepest = 12;
  for (int i = 0; !error && i < deepest && at.has_relative_path(); ++i, at = at.parent_path()) {
    const std::string vendor = attribute(at / "idVendor");
    if (vendor.empty()) continue;
    return UsbIdentity{vendor, attribute(at / "idProduct"), attribute(at / "manufacturer"), attribute(at / "product"),
                       attribute(at / "serial")};
  }
  return std::nullopt;
}

void ask_kernel(const std::string& name, PortSeen& seen) {
  const auto link = find_interface(name);
  if (!link) return;
  seen.driver = link->kind;
  seen.bit_rate = link->bit_rate;
  seen.state = !link->up ? "down" : link->state ? std::string(to_string(*link->state)) : "up";
}

}  // namespace

std::vector<PortSeen> list_ports(const fs::path& sys) {
  std::vector<PortSeen> ports;
  const fs::path net = sys / "class/net";
  for (const auto& name : entries(net)) {
    constexpr const char* can_interface = "280";  // ARPHRD_CAN
    if (attribute(net / name / "type") != can_interface) continue;
    PortSeen seen{.port = {can::PortKind::socketcan, name}, .usb = usb_identity(net / name / "device")};
    seen.state = attribute(net / name / "operstate");
    if (sys == "/sys") ask_kernel(name, seen);
    ports.push_back(std::move(seen));
  }
  const fs::path tty = sys / "class/tty";
  for (const auto& name : entries(tty)) {
    auto usb = usb_identity(tty / name / "device");
    if (usb) ports.push_back({.port = {can::PortKind::slcan, "/dev/" + name}, .usb = std::move(usb)});
  }
  return ports;
}

}  // namespace berth::io
