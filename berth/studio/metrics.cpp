#include "berth/studio/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <utility>

#include "berth/text/printable.hpp"

namespace berth::studio {
namespace {

namespace metric {

constexpr std::string_view counter = "counter", gauge = "gauge", histogram = "histogram";

constexpr Metric build{"berth_build_info", gauge, "Always 1; the version is in the label."};
constexpr Metric machine{"berth_machine_info", gauge, "Always 1; the machine's name is in the label."};
constexpr Metric start{"berth_start_time_seconds", gauge, "When this Berth began, Unix time."};
constexpr Metric age{"berth_figures_age_seconds", gauge,
                     "How long ago the event loop last told the figures of buses and slots."};
constexpr Metric latency{"berth_loop_latency_seconds", histogram,
                         "How late timers of the event loop ran, ten of them a second."};
constexpr Metric bus_state{"berth_bus_state", gauge,
                           "State of Berth's port on the bus: 1 for the present one, 0 for the others."};
constexpr Metric bus_load{"berth_bus_load_ratio", gauge, "Share of the last second in which frames were on the bus."};
constexpr Metric bus_busy{"berth_bus_busy_seconds_total", counter, "Time in which frames were on the bus."};
constexpr Metric bus_frames{"berth_bus_frames_total", counter, "Frames on the bus."};
constexpr Metric bus_errors{"berth_bus_errors_total", counter, "Errors on the bus that Berth's port reported."};
constexpr Metric bus_lost{"berth_bus_lost_frames_total", counter, "Frames that Berth's port lost before it read them."};
constexpr Metric bus_offs{"berth_bus_offs_total", counter, "How often Berth's port went bus-off."};
constexpr Metric bus_tec{"berth_bus_tec", gauge, "Transmit error counter of Berth's port (from 128: error passive)."};
constexpr Metric bus_rec{"berth_bus_rec", gauge, "Receive error counter of Berth's port (from 128: error passive)."};
constexpr Metric bus_aborts{"berth_bus_sdo_aborts_total", counter,
                            "SDO transfers on the bus that server or client aborted."};
constexpr Metric slots_by_state{"berth_slots", gauge, "Slots of the bus in each state."};
constexpr Metric slot_info{"berth_slot_info", gauge, "Always 1; the slot's node-ID is in the label."};
constexpr Metric slot_state{"berth_slot_state", gauge, "1, with the slot's present state in the label."};
constexpr Metric slot_operational{"berth_slot_operational", gauge, "1: the slot's device is operational."};
constexpr Metric slot_required{"berth_slot_required", gauge, "0: the slot is optional in the machine file."};
constexpr Metric slot_heartbeats{"berth_slot_heartbeats_lost_total", counter,
                                 "How often heartbeat or guarding of the slot's node-ID stopped."};
constexpr Metric slot_emergencies{"berth_slot_emergencies_total", counter,
                                  "EMCY messages of the slot's node-ID that report an error."};
constexpr Metric slot_restarts{"berth_slot_restarts_total", counter,
                               "Boot-up messages of the slot's node-ID after the first."};
constexpr Metric slot_aborts{"berth_slot_sdo_aborts_total", counter,
                             "SDO transfers with the slot's node-ID that server or client aborted."};
constexpr Metric slot_mismatches{"berth_slot_configuration_mismatches_total", counter,
                                 "Values that were not as the machine file wants when they were compared."};
constexpr Metric slot_differs{"berth_slot_configuration_differs", gauge,
                              "1: values of the device are not as wanted, and Berth has not corrected them."};

constexpr std::array all{build,
                         machine,
                         start,
                         age,
                         latency,
                         bus_state,
                         bus_load,
                         bus_busy,
                         bus_frames,
                         bus_errors,
                         bus_lost,
                         bus_offs,
                         bus_tec,
                         bus_rec,
                         bus_aborts,
                         slots_by_state,
                         slot_info,
                         slot_state,
                         slot_operational,
                         slot_required,
                         slot_heartbeats,
                         slot_emergencies,
                         slot_restarts,
                         slot_aborts,
                         slot_mismatches,
                         slot_differs};

}  // namespace metric

constexpr auto last_state = places::SlotState::wrong_type;

using Labels = std::initializer_list<std::pair<std::string_view, std::string_view>>;

/// The text, metric by metric.
class Writer {
 public:
  explicit Writer(Exposition exposition) : open_(exposition == Exposition::open_metrics) {}
  // OpenMetrics names a counter without the `_total` of its samples.
  void head(const Metric& metric) {
    constexpr std::string_view total = "_total";
    std::string_view name = metric.name;
    if (open_ && metric.type == metric::counter) name.remove_suffix(total.size());
    fmt::format_to(end(), "# HELP {} {}\n# TYPE {} {}\n", name, metric.help, name, metric.type);
  }
  template <class Number>
  void sample(std::string_view name, Labels labels, Number value) {
    text_ += name;
    char before = '{';
    for (const auto& [label, content] : labels) {
      fmt::format_to(end(), "{}{}=\"", before, label);
      escape(content);
      text_ += '"';
      before = ',';
    }
    if (before == ',') text_ += '}';
    fmt::format_to(end(), " {}\n", value);
  }
  [[nodiscard]] std::string finish() {
    if (open_) text_ += "# EOF\n";
    return std::move(text_);
  }

 private:
  [[nodiscard]] std::back_insert_iterator<std::string> end() { return std::back_inserter(text_); }
  void escape(std::string_view content) {
    for (const char c : text::one_line(content)) {
      if (c == '\\' || c == '"') text_ += '\\';
      text_ += c;
    }
  }

  bool open_;
  std::string text_;
};

void write_about(Writer& out, const About& about) {
  out.head(metric::build);
  out.sample(metric::build.name, {{"version", about.version}}, 1);
  out.head(metric::machine);
  out.sample(metric::machine.name, {{"machine", about.machine}, {"simulated", about.simulated ? "true" : "false"}}, 1);
  out.head(metric::start);
  out.sample(metric::start.name, {}, about.start_s);
  out.head(metric::age);
  if (about.age_s) out.sample(metric::age.name, {}, *about.age_s);
}

void write_lateness(Writer& out, const Lateness& lateness) {
  const std::string bucket = fmt::format("{}_bucket", metric::latency.name);
  out.head(metric::latency);
  for (std::size_t i = 0; i < Lateness::limits.size(); ++i)
    out.sample(bucket, {{"le", fmt::format("{}", Lateness::limits[i])}}, lateness.within(i));
  out.sample(bucket, {{"le", "+Inf"}}, lateness.count());
  out.sample(fmt::format("{}_sum", metric::latency.name), {}, lateness.sum());
  out.sample(fmt::format("{}_count", metric::latency.name), {}, lateness.count());
}

/// Each bus that has a port, and what its frames tell.
template <class Value>
void write_ports(Writer& out, const Metric& metric, const Figures& figures, std::span<const Traffic> traffic,
                 Value value) {
  static const Traffic none;
  out.head(metric);
  for (std::size_t i = 0; i < figures.buses.size(); ++i) {
    const BusFigures& bus = figures.buses[i];
    if (bus.has_port) out.sample(metric.name, {{"bus", bus.name}}, value(bus, i < traffic.size() ? traffic[i] : none));
  }
}

void write_error_counter(Writer& out, const Metric& metric, const Figures& figures,
                         std::optional<std::uint8_t> BusFigures::*value) {
  out.head(metric);
  for (const auto& bus : figures.buses) {
    if (bus.has_port && bus.*value) out.sample(metric.name, {{"bus", bus.name}}, *(bus.*value));
  }
}

void write_buses(Writer& out, const Figures& figures, std::span<const Traffic> traffic) {
  out.head(metric::bus_state);
  for (const auto& bus : figures.buses) {
    if (!bus.has_port || bus.state.empty()) continue;
    for (const auto state : port_states)
      out.sample(metric::bus_state.name, {{"bus", bus.name}, {"state", state}}, state == bus.state ? 1 : 0);
  }
  const auto ports = [&](const Metric& metric, auto value) { write_ports(out, metric, figures, traffic, value); };
  ports(metric::bus_load, [](const auto&, const auto& frames) { return frames.load; });
  ports(metric::bus_busy, [](const auto&, const auto& frames) { return frames.busy_s; });
  ports(metric::bus_frames, [](const auto&, const auto& frames) { return frames.frames; });
  ports(metric::bus_errors, [](const auto& bus, const auto&) { return bus.errors; });
  ports(metric::bus_lost, [](const auto& bus, const auto&) { return bus.lost; });
  ports(metric::bus_offs, [](const auto& bus, const auto&) { return bus.bus_offs; });
  write_error_counter(out, metric::bus_tec, figures, &BusFigures::tec);
  write_error_counter(out, metric::bus_rec, figures, &BusFigures::rec);
  ports(metric::bus_aborts, [](const auto&, const auto& frames) {
    std::uint64_t sum = 0;
    for (const auto each : frames.sdo_aborts) sum += each;
    return sum;
  });
}

void write_slots_by_state(Writer& out, const Figures& figures) {
  std::vector<std::array<std::uint64_t, static_cast<std::size_t>(last_state) + 1>> counts(figures.buses.size());
  for (const auto& slot : figures.slots) ++counts[slot.bus][static_cast<std::size_t>(slot.state)];
  out.head(metric::slots_by_state);
  for (std::size_t bus = 0; bus < counts.size(); ++bus) {
    for (std::size_t state = 0; state < counts[bus].size(); ++state) {
      out.sample(metric::slots_by_state.name,
                 {{"bus", figures.buses[bus].name}, {"state", name(static_cast<places::SlotState>(state))}},
                 counts[bus][state]);
    }
  }
}

void write_slots(Writer& out, const Figures& figures, std::span<const Traffic> traffic) {
  const auto each = [&](const Metric& metric, bool with_port, auto value) {
    out.head(metric);
    for (const auto& slot : figures.slots) {
      const BusFigures& bus = figures.buses[slot.bus];
      if (bus.has_port || !with_port) out.sample(metric.name, {{"bus", bus.name}, {"slot", slot.name}}, value(slot));
    }
  };
  out.head(metric::slot_info);
  for (const auto& slot : figures.slots)
    out.sample(
        metric::slot_info.name,
        {{"bus", figures.buses[slot.bus].name}, {"slot", slot.name}, {"node_id", fmt::to_string(slot.id.value())}}, 1);
  out.head(metric::slot_state);
  for (const auto& slot : figures.slots)
    out.sample(metric::slot_state.name,
               {{"bus", figures.buses[slot.bus].name}, {"slot", slot.name}, {"state", name(slot.state)}}, 1);
  each(metric::slot_operational, false,
       [](const auto& slot) { return slot.state == places::SlotState::operational ? 1 : 0; });
  each(metric::slot_required, false, [](const auto& slot) { return slot.required ? 1 : 0; });
  each(metric::slot_heartbeats, true, [](const auto& slot) { return slot.heartbeats_lost; });
  each(metric::slot_emergencies, true, [](const auto& slot) { return slot.emergencies; });
  each(metric::slot_restarts, true, [](const auto& slot) { return slot.boots > 0 ? slot.boots - 1 : 0; });
  each(metric::slot_aborts, true, [&](const auto& slot) {
    return slot.bus < traffic.size() ? traffic[slot.bus].sdo_aborts[slot.id.value() & 127U] : 0U;
  });
  each(metric::slot_mismatches, true, [](const auto& slot) { return slot.mismatches; });
  each(metric::slot_differs, true, [](const auto& slot) { return slot.differs ? 1 : 0; });
}

}  // namespace

std::span<const Metric> metrics() noexcept { return metric::all; }

void Lateness::add(double seconds) noexcept {
  ++count_;
  sum_ += std::max(0.0, seconds);
  const auto* const limit = std::ranges::lower_bound(limits, seconds);
  if (limit != limits.end()) ++counts_[static_cast<std::size_t>(limit - limits.begin())];
}

std::uint64_t Lateness::within(std::size_t limit) const noexcept {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i <= limit; ++i) sum += counts_[i];
  return sum;
}

// The first byte of an abort is no first byte of a segment, of a block transfer either: there 80h would be segment 0.
void Traffic::add(const can::Frame& frame, unsigned bits, std::uint32_t bit_rate) noexcept {
  constexpr std::uint8_t abort = 0x80;
  ++frames;
  busy_s += static_cast<double>(bits) / bit_rate;
  const bool sdo = (frame.id > 0x580 && frame.id < 0x600) || (frame.id > 0x600 && frame.id < 0x680);
  if (sdo && !frame.extended && !frame.remote && frame.size == 8 && frame.data[0] == abort)
    ++sdo_aborts[frame.id & 0x7FU];
}

Exposition exposition_for(std::string_view accept) noexcept {
  return accept.find("application/openmetrics-text") == std::string_view::npos ? Exposition::prometheus
                                                                               : Exposition::open_metrics;
}

std::string_view content_type(Exposition exposition) noexcept {
  return exposition == Exposition::open_metrics ? "application/openmetrics-text; version=1.0.0; charset=utf-8"
                                                : "text/plain; version=0.0.4; charset=utf-8";
}

std::string metrics_page(const About& about, const Figures& figures, std::span<const Traffic> traffic,
                         Exposition exposition) {
  Writer out(exposition);
  write_about(out, about);
  write_lateness(out, figures.lateness);
  write_buses(out, figures, traffic);
  write_slots_by_state(out, figures);
  write_slots(out, figures, traffic);
  return out.finish();
}

}  // namespace berth::studio
