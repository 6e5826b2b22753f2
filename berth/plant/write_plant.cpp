#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "berth/od/notation.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/plant/plant_words.hpp"

namespace berth::plant {
namespace {

using text::write_duration;

/// Lines `key = value`; what equals its default is left out.
class PlantWriter {
 public:
  void line(std::string_view text) { fmt::format_to(std::back_inserter(out_), "{}\n", text); }
  void raw(std::string_view key, std::string_view value) {
    fmt::format_to(std::back_inserter(out_), "{} = {}\n", key, value);
  }
  void string(std::string_view key, std::string_view value) { raw(key, text::quoted(value)); }
  template <class T>
  void number(std::string_view key, T value, T usual) {
    if (value != usual) raw(key, fmt::format("{}", value));
  }
  void flag(std::string_view key, bool value, bool usual) {
    if (value != usual) raw(key, value ? "true" : "false");
  }
  void time(std::string_view key, Duration value, Duration usual) {
    if (value != usual) string(key, write_duration(value));
  }
  void strings(std::string_view key, const std::vector<std::string>& values) {
    std::string list;
    for (const auto& value : values) list += (list.empty() ? "" : ", ") + text::quoted(value);
    raw(key, fmt::format("[{}]", list));
  }
  std::string take() { return std::move(out_); }

 private:
  std::string out_;
};

const PlantDevice usual_device;
const Strike usual_strike;

void write_response(PlantWriter& w, const Latency& r) {
  if (r == usual_device.response) return;
  if (r.min == r.max && r.outlier_ppm == 0 && r.outlier == Duration(0))
    return w.string("response", write_duration(r.min));
  std::string text = fmt::format("{{ min = \"{}\", max = \"{}\"", write_duration(r.min), write_duration(r.max));
  if (r.outlier_ppm != 0 || r.outlier != Duration(0)) {
    text += fmt::format(", outlier = \"{}\", outlier_ppm = {}", write_duration(r.outlier), r.outlier_ppm);
  }
  w.raw("response", text + " }");
}

void write_speaks(PlantWriter& w, const PlantDevice& d) {
  if (d.speaks == PlantDevice{}.speaks) return;
  std::vector<std::string> words;
  for (std::size_t i = 0; i < speaks_words.size(); ++i) {
    if (d.speaks.has(static_cast<Speaks>(i))) words.emplace_back(speaks_words[i]);
  }
  w.strings("speaks", words);
}

void write_habits(PlantWriter& w, const PlantDevice& d) {
  if (d.lss.habit) w.strings("habits", {name(*d.lss.habit)});
  std::vector<std::string> without;
  for (std::size_t i = 0; i < lackable_words.size(); ++i) {
    if (d.lss.without.has(static_cast<lss::Lackable>(i))) without.emplace_back(lackable_words[i]);
  }
  if (!without.empty()) w.strings("lss_without", without);
  if (d.lss.refuses_store) w.string("lss_store", lss_store_words[1]);
  w.flag("short_answers", d.lss.short_answers, false);
}

void write_oddities(PlantWriter& w, const PlantOddities& odd) {
  std::vector<std::string> changing;
  for (std::size_t i = 0; i < identity_words.size(); ++i) {
    if ((odd.changing >> i & 1U) != 0) changing.emplace_back(identity_words[i]);
  }
  if (!changing.empty()) w.strings("identity_changes", changing);
  if (odd.sdo_serial) w.raw("sdo_serial", fmt::format("0x{:08X}", *odd.sdo_serial));
  w.flag("identity_only_pre_operational", odd.identity_only_pre_operational, false);
  if (odd.resets != ResetsAtHeartbeat::never)
    w.string("resets_at_heartbeat", reset_words[static_cast<std::size_t>(odd.resets)]);
  w.time("heartbeat_sent", odd.heartbeat_sent, Duration(0));
}

void write_programs(PlantWriter& w, const PlantPrograms& p) {
  if (p.count == 0) return;
  const PlantPrograms usual;
  std::string table = fmt::format("{{ count = {}", p.count);
  if (p.size != usual.size) table += fmt::format(", size = {}", p.size);
  if (p.images != usual.images) table += fmt::format(", images = {}", p.images);
  if (p.sector != usual.sector) table += fmt::format(", sector = {}", p.sector);
  if (p.erase != usual.erase) table += fmt::format(", erase = \"{}\"", write_duration(p.erase));
  if (p.write != usual.write) table += fmt::format(", write = \"{}\"", write_duration(p.write));
  if (!p.checked) table += ", checked = false";
  if (!p.loaded.empty()) table += ", loaded = " + text::quoted(p.loaded);
  w.raw("programs", table + " }");
}

void write_node_id(PlantWriter& w, const PlantDevice& d) {
  if (d.node_id.configured()) w.raw("node_id", fmt::format("{}", d.node_id.value()));
  const auto implied = d.node_id.configured() ? NodeIdSource::nonvolatile : NodeIdSource::blank;
  if (d.source != implied) w.string("source", name(d.source));
  if (d.node_id_object.object) w.string("node_id_object", od::write_object(*d.node_id_object.object));
  if (d.node_id_object.signature) {
    const auto& s = *d.node_id_object.signature;
    w.raw("node_id_signature", fmt::format("{{ object = \"{}\", value = \"0x{:X}\", size = {} }}",
                                           od::write_object(s.object), s.value, s.size));
  }
}

void write_variables(PlantWriter& w, const PlantDevice& d) {
  if (d.does.variables.empty()) return;
  std::string list = "[\n";
  for (const auto& each : d.does.variables) {
    list += fmt::format("  {{ name = {}, type = \"{}\", object = \"{}\" }},\n", text::quoted(each.name),
                        od::name(each.type), od::write_object(each.object));
  }
  w.raw("variables", list + "]");
}

void write_device(PlantWriter& w, const PlantDevice& d) {
  w.line("\n[[device]]");
  w.string("bus", d.bus);
  w.string("name", d.name);
  if (!d.eds.empty()) w.string("eds", d.eds);
  if (!d.does.script.file.empty()) w.string("script", d.does.script.file);
  write_variables(w, d);
  write_programs(w, d.storing.programs);
  if (!d.address_of_eds) {
    std::string type = fmt::format("{{ vendor = 0x{:08X}, product = 0x{:08X}", d.address.vendor, d.address.product);
    if (d.address.revision != 0) type += fmt::format(", revision = 0x{:08X}", d.address.revision);
    w.raw("type", type + " }");
  }
  if (d.address.serial != 0) w.raw("serial", fmt::format("0x{:08X}", d.address.serial));
  write_node_id(w, d);
  if (d.does.master && !d.does.master->flying) {
    w.raw("master", fmt::format("{{ flying = false, most = {} }}", d.does.master->most));
  } else if (d.does.master) {
    std::string slaves;
    for (const auto id : d.does.master->slaves) slaves += fmt::format("{}{}", slaves.empty() ? "" : ", ", id);
    w.raw("master", fmt::format("{{ priority = {}, slaves = \"{}\", keep_alive = {} }}", d.does.master->priority,
                                slaves, d.does.master->keep_alive));
  }
  w.number("hardware", d.does.hardware, usual_device.does.hardware);
  w.number("bitrate", d.bitrate, usual_device.bitrate);
  write_speaks(w, d);
  write_habits(w, d);
  write_response(w, d.response);
  w.time("boot", d.boot, usual_device.boot);
  w.time("reset", d.reset, usual_device.reset);
  w.time("store", d.storing.time, usual_device.storing.time);
  w.flag("deaf_while_storing", d.storing.deaf, false);
  w.flag("power_cycle_after_store", d.storing.power_cycle_after, false);
  w.flag("needs_first_save", d.storing.needs_first_save, false);
  if (d.controller.queue != usual_device.controller.queue)
    w.string("queue", queue_words[static_cast<std::size_t>(d.controller.queue)]);
  w.number("rx_depth", d.controller.rx_depth, usual_device.controller.rx_depth);
  w.time("heartbeat", d.heartbeat, usual_device.heartbeat);
  write_oddities(w, d.does.odd);
  w.time("bus_off_recovery", d.controller.bus_off_recovery, usual_device.controller.bus_off_recovery);
  w.number("repeat_ppm", d.controller.repeat_ppm, usual_device.controller.repeat_ppm);
  w.flag("extended_frames", d.controller.extended_frames, true);
  w.number("drift_ppm", d.controller.drift_ppm, usual_device.controller.drift_ppm);
  w.flag("plugged", d.plugged, true);
}

void write_strike(PlantWriter& w, const PlantEvent& e) {
  const auto& s = e.strike;
  if (!e.nodes.empty()) w.strings("nodes", e.nodes);
  if (s.frame) w.raw("frame", fmt::format("{}", *s.frame));
  if (s.id) {
    const bool extended = (*s.id & 0x8000'0000U) != 0;
    w.raw("id", fmt::format("0x{:X}", *s.id & 0x1FFF'FFFFU));
    w.flag("extended", extended, false);
  }
  w.number("skip", s.skip, usual_strike.skip);
  w.number("times", s.times, usual_strike.times);
  w.flag("spare_senders", s.spare_senders, false);
  if (!s.sender.empty()) w.string("sender", s.sender);
  if (e.action != Action::disturb) return;
  if (s.kind != usual_strike.kind) w.string("kind", disturbance_words[static_cast<std::size_t>(s.kind)]);
  w.raw(s.from_end ? "bit_from_end" : "bit", fmt::format("{}", s.bit));
  w.number("bits", s.bits, usual_strike.bits);
}

void write_event(PlantWriter& w, const PlantEvent& e) {
  w.line("\n[[event]]");
  if (e.after == After::start) {
    w.string("at", write_duration(e.delay));
  } else {
    w.string("after", name(e.after));
    w.time("delay", e.delay, Duration(0));
  }
  w.string("action", name(e.action));
  if (!e.bus.empty()) w.string("bus", e.bus);
  switch (e.action) {
    case Action::cut_cable: return w.strings("nodes", e.nodes);
    case Action::join: return;
    case Action::disturb:
    case Action::overrun: return write_strike(w, e);
    default: break;
  }
  w.string("device", e.device);
  w.time("duration", e.duration, Duration(0));
  if (e.action == Action::slow) w.string("latency", write_duration(e.latency));
  if (e.action == Action::set_serial || e.action == Action::set_node_id) w.raw("value", fmt::format("{}", e.value));
}

void write_gateway(PlantWriter& w, const PlantGateway& gateway) {
  w.line("\n[[gateway]]");
  w.string("above", gateway.above);
  w.strings("beneath", gateway.beneath);
  w.number("layout", gateway.layout, PlantGateway().layout);
  if (!gateway.speaks_layout.empty()) {
    w.raw("speaks_layout", fmt::format("[{}]", fmt::join(gateway.speaks_layout, ", ")));
  }
  if (gateway.literal) w.raw("literal", "true");
  w.number("signals", gateway.signals, PlantGateway().signals);
}

void write_comment(PlantWriter& w, std::string_view comment) {
  while (!comment.empty()) {
    const auto newline = comment.find('\n');
    std::string text(comment.substr(0, newline));
    std::ranges::replace_if(
        text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }, ' ');
    w.line(text.empty() ? "#" : fmt::format("# {}", text));
    comment.remove_prefix(newline == std::string_view::npos ? comment.size() : newline + 1);
  }
}

}  // namespace

std::string write_plant(const PlantFile& plant, std::string_view comment) {
  PlantWriter w;
  write_comment(w, comment);
  w.line("[plant]");
  if (plant.seed >> 63U != 0) {
    w.string("seed", fmt::format("0x{:016X}", plant.seed));
  } else {
    w.raw("seed", fmt::format("{}", plant.seed));
  }
  for (const auto& bus : plant.buses) {
    w.line(fmt::format("\n[bus.{}]", text::quoted(bus.name)));
    w.number("bitrate", bus.bitrate, 0U);
    w.number("fd_bitrate", bus.fd_bitrate, 0U);
  }
  for (const auto& device : plant.devices) write_device(w, device);
  for (const auto& gateway : plant.gateways) write_gateway(w, gateway);
  for (const auto& event : plant.events) write_event(w, event);
  return w.take();
}

}  // namespace berth::plant
