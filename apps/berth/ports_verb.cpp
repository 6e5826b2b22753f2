// `berth ports`: lists the CAN ports of this computer.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/io/list_ports.hpp"
#include "output.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const io::PortSeen& seen) {
  Json json;
  json["port"] = can::to_string(seen.port);
  if (seen.port.kind == can::PortKind::socketcan) {
    json["driver"] = seen.driver;
    json["state"] = seen.state;
    json["bit_rate"] = seen.bit_rate == 0 ? Json() : Json(seen.bit_rate);
  }
  if (seen.usb) {
    json["usb"] = {{"vendor", seen.usb->vendor},
                   {"product", seen.usb->product},
                   {"maker", seen.usb->maker},
                   {"name", seen.usb->name},
                   {"serial", seen.usb->serial}};
  }
  return json;
}

std::string line_of(const io::PortSeen& seen) {
  std::string line = fmt::format("{:<24}", can::to_string(seen.port));
  if (seen.port.kind == can::PortKind::socketcan) {
    line += fmt::format("  {:<8}  {:<10}", seen.state,
                        seen.bit_rate == 0 ? "no rate" : fmt::format("{} bit/s", seen.bit_rate));
    if (!seen.driver.empty()) line += "  " + seen.driver;
  }
  if (seen.usb) {
    line += fmt::format("  USB {}:{}", seen.usb->vendor, seen.usb->product);
    for (const auto* const part : {&seen.usb->maker, &seen.usb->name, &seen.usb->serial}) {
      if (!part->empty()) line += "  " + *part;
    }
  }
  return line;
}

int run_ports(const Options& options) {
  const auto ports = io::list_ports();
  if (options.json) {
    Json json;
    json["ports"] = Json::array();
    for (const auto& seen : ports) json["ports"].push_back(json_of(seen));
    print_text(json.dump(2));
    return Exit::done;
  }
  for (const auto& seen : ports) print_line(line_of(seen));
  if (ports.empty()) {
    print_line("no CAN interface and no serial adapter on USB is there; a bus elsewhere is socketcand://HOST:PORT/BUS");
  }
  return Exit::done;
}

}  // namespace

void add_ports(Verb& berth, Options& options) {
  const Verb ports = berth.add("ports", "what is plugged in: CAN interfaces, serial adapters",
                               [&options] { return run_ports(options); });
  json_flag(ports, options);
  ports.footer("Example:\n  berth ports && berth scan --port can0");
}

}  // namespace berth::cli
