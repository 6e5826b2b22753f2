#include "berth/command/differences.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace berth::command {

Json difference_json(const manager::Difference& d) {
  Json json;
  json["object"] = fmt::format("0x{:04X}:{:02X}", d.object.index, d.object.sub);
  if (!d.name.empty()) json["name"] = d.name;
  if (d.line != 0) json["line"] = d.line;
  if (d.held) json["has"] = manager::print_value(d.type, *d.held);
  json["wants"] = manager::print_value(d.type, d.wanted);
  return json;
}

}  // namespace berth::command
