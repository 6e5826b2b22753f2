// upload: reads the configuration of a slot's device into a DCF.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/arguments.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/command/values.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

Json change_json(const manager::Difference& d) {
  Json json;
  json["object"] = fmt::format("0x{:04X}:{:02X}", d.object.index, d.object.sub);
  if (!d.name.empty()) json["name"] = d.name;
  json["was"] = manager::print_value(d.type, d.wanted);
  if (d.held) json["is"] = manager::print_value(d.type, *d.held);
  return json;
}

std::string change_line(const manager::Difference& d) {
  return fmt::format("    {}{}: {}, was {}", od::write_object(d.object), d.name.empty() ? "" : " \"" + d.name + '"',
                     d.held ? manager::print_value(d.type, *d.held) : std::string("?"),
                     manager::print_value(d.type, d.wanted));
}

}  // namespace

rt::Task<void> upload(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const std::string bus = arguments.text("bus");
  const std::string slot = arguments.required("slot");
  const bool whole = arguments.has("dcf");
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  const auto meant = own_slot(session, bus, slot, "`berth sdo dump` and `berth backup save` read its objects");
  if (!meant) co_return refuse(reply, 2, meant.error());
  const auto& [network, name] = *meant;
  const auto usable = network_for(session, network->bus().name, Use::send);
  if (!usable) co_return refuse(reply, 2, usable.error());
  auto done = co_await operate::upload_slot(*network, name);
  if (!done) co_return fail_with(reply, done.error(), fmt::format("bus {}", network->bus().name));
  if (!done->problem.empty()) {
    co_return refuse(reply, 1, fmt::format("slot {}: {}", text::quoted(name), done->problem),
                     "`berth status` shows which devices are there");
  }
  Json json;
  json["bus"] = done->bus;
  json["id"] = done->id.value();
  json["slot"] = done->slot;
  json["read"] = done->uploaded.read;
  json["refused"] = done->uploaded.refused;
  json["left_out"] = Json::array();
  for (const auto& object : done->uploaded.left_out) json["left_out"].push_back(od::write_object(object));
  json["bytes"] = done->uploaded.dcf.size();
  json["changes"] = Json::array();
  std::vector<std::string> lines{fmt::format("{}  {:>3}  {}: {} read, {} refused", done->bus, done->id.value(),
                                             done->slot, counted(done->uploaded.read, "value"),
                                             done->uploaded.refused)};
  for (const auto& object : done->uploaded.left_out) {
    lines.push_back(fmt::format("    {} is left out: a DCF cannot carry it", od::write_object(object)));
  }
  for (const auto& d : done->changes) {
    json["changes"].push_back(change_json(d));
    lines.push_back(change_line(d));
  }
  // A description may be in Windows-1252, but JSON is UTF-8: so the DCF goes out as bytes, like a value in `sdo read`.
  const std::vector<std::uint8_t> bytes(done->uploaded.dcf.begin(), done->uploaded.dcf.end());
  if (whole) json["dcf"] = hex_bytes(bytes);
  give(reply, json, std::move(lines));
}

}  // namespace berth::command
