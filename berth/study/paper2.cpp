// Paper 2: negotiation of node-IDs (S2.3, S2.7, S2.16, S2.18).
#include <fmt/format.h>

#include <algorithm>

#include "berth/lss/fastscan.hpp"
#include "berth/research/negotiation_frames.hpp"
#include "berth/study/formulas.hpp"
#include "berth/study/listings.hpp"
#include "berth/study/simulated.hpp"
#include "berth/study/verdict.hpp"

namespace berth::study {
namespace {

using namespace std::chrono_literals;
using plant::Speaks;

std::uint32_t rate(const Conditions& c) { return c.bit_rate.value_or(125'000); }
rt::Duration latency(const Conditions& c) { return c.latency.value_or(500us); }

plant::PlantDevice negotiator(const LssAddress& address, std::uint8_t preferred, rt::Duration response) {
  auto plant = plant_of({.devices = 1, .speaks = {Speaks::negotiation_literal}});
  auto device = plant.devices.front();
  device.name = fmt::format("n{}", preferred);
  device.address = address;
  device.node_id = NodeId(preferred);
  device.response = {response, response, 0, rt::Duration(0)};
  device.boot = 50ms;
  device.reset = 1ms;
  device.heartbeat = 1s;
  return device;
}

plant::PlantFile plant_with(std::vector<plant::PlantDevice> devices) {
  auto plant = plant_of({.devices = 0});
  plant.devices = std::move(devices);
  return plant;
}

/// The trace from power-on, with nothing else on the bus. Each device gets the node-ID that it prefers.
trace::Trace heard(const plant::PlantFile& plant, std::uint32_t bit_rate, rt::Duration time, Figures& figures,
                   const char* name) {
  Stage stage(plant, bit_rate);
  stage.record();
  stage.settle(time);
  std::vector<places::Assignment> preferred;
  for (const auto& device : plant.devices) preferred.push_back({device.address, device.node_id});
  right(figures, name, differences(stage, preferred, Hold::active));
  return stage.trace();
}

/// Keeps a trace up to the last frame of this kind. Returns its span in seconds; empty: there is no such frame.
std::optional<double> up_to(const trace::Trace& all, const can::Frame& last, std::uint32_t bit_rate, Figures& figures,
                            const std::string& name) {
  trace::Trace part = all;
  while (!part.entries.empty() && !(part.entries.back().frame == last)) part.entries.pop_back();
  figures.traces.push_back({name, bit_rate, part});
  if (part.entries.empty()) figures.wrong.push_back(name + ": its last frame was never sent");
  if (std::ranges::any_of(figures.wrong, [&](const auto& line) { return line.starts_with(name); })) return std::nullopt;
  return seconds(part.entries.back().at - part.entries.front().at);
}

rt::Task<void> scan_one(Stage& stage, const lss::FastscanOptions& options, std::vector<LssAddress>& found) {
  lss::Master master(stage.master());
  lss::Fastscan fastscan(master, options);
  const auto device = co_await fastscan.scan();
  if (device && *device) found.push_back((*device)->address);
}

Row fastscan(const Conditions& c, Figures& figures) {
  Row row{.paper = 2, .what = "Fastscan of one unknown device, 10 ms time-out"};
  row.published = 1.28;
  row.formula = seconds(scan_windows(about_128, 10ms));
  auto plant = plant_of({.devices = 1, .speaks = {Speaks::fastscan}});
  plant.devices[0].address = {0xFFFF'FFFF, 0xFFFF'FFFF, 0xFFFF'FFFF, 0xFFFF'FFFF};
  plant.devices[0].response = {latency(c), latency(c), 0, rt::Duration(0)};
  lss::FastscanOptions options;
  options.confirm = false;
  options.wait_first = false;
  {
    std::vector<LssAddress> found;
    Stage stage(plant, rate(c));
    row.simulated = measured(stage, scan_one(stage, options, found), 1min, figures, "paper2-fastscan");
    if (!right(figures, "paper2-fastscan", differences(stage, found))) row.simulated.reset();
  }
  row.berth = by_method(plant, rate(c), discovery::Method::planner_fastscan, {.window = 10ms}, figures,
                        "paper2-fastscan-berth");
  row.trace = "paper2-fastscan";
  row.marks = "begin: the master's heartbeat 77F#05 before the first request; end: the one after the last window";
  row.note =
      "128 x 10 ms. CiA 305 takes 133 requests (80h, 32 bits and the whole number for each part), and each is 0.9 to "
      "1.1 ms "
      "on the wire at 125 kbit/s, which the paper leaves out. The formula knows neither bit rate nor response. Worst "
      "address: every bit 1. Berth: planner-fastscan, nothing known of the device, windows learnt.";
  return row;
}

void shares(Figures& figures) {
  Row bits{.paper = 2, .what = "share of the 29 identifier bits that negotiation uses"};
  bits.published = 0.44;
  bits.formula = negotiation_bit_share;
  bits.unit = "share";
  bits.note = "13 of 29 bits are 44.8 %; the paper cuts to 44 %.";
  Row ids{.paper = 2, .what = "share of all extended identifiers"};
  ids.published = 0.000015;
  ids.formula = negotiation_id_share;
  ids.unit = "share";
  ids.note = "2^13 of 2^29: 0.0015 %.";
  figures.rows.push_back(bits);
  figures.rows.push_back(ids);
}

trace::Trace figure_2(const Conditions& c, Figures& figures) {
  const LssAddress address{0x0000'0319, 0xAA55'EEFF, 0xDEAD'BEEF, 0x1234'5678};
  return heard(plant_with({negotiator(address, 0x20, latency(c))}), rate(c), 1600ms, figures, "paper2-figure2");
}

trace::Trace table_4(const Conditions& c, Figures& figures) {
  // The paper's two nodes began at one instant and ran up to 2 ms apart.
  auto a = negotiator({0x0000'0319, 0xAA55'EEFF, 0xDEAD'BEEF, 0x8765'4321}, 0x40, latency(c));
  auto b = negotiator({0x0000'0319, 0xAA55'EEFF, 0xDEAD'BEEF, 0x8765'43FF}, 0x41, latency(c));
  b.boot += 10ms;
  return heard(plant_with({std::move(a), std::move(b)}), rate(c), 1800ms, figures, "paper2-table4");
}

Row least_cycle() {
  Row row{.paper = 2, .what = "negotiation: least cycle, 100 ms + 15 x 5 ms + 100 ms"};
  row.formula = seconds(cycle({}));
  row.note =
      "Not printed by the paper: the sum of the delays that it states. Devices need 16 frames, whatever their number.";
  return row;
}

Row complete_cycle(const Conditions& c, Figures& figures) {
  Row row{.paper = 2, .what = "negotiation: complete cycle of one device, Figure 2"};
  row.published = 0.282;
  row.formula = seconds(cycle({}));
  row.simulated = up_to(figure_2(c, figures), research::used(NodeId(0x20)), rate(c), figures, "paper2-figure2");
  row.trace = "paper2-figure2";
  row.marks = "begin: 00000100# (ReqUsedNodeId); end: 00000220# (ActUsedNodeId 20h)";
  row.note =
      "The stated delays are 275 ms at least; the paper's device is up to 7 ms late with single frames. Simulated: "
      "exact "
      "delays. Berth: no planner, there is no master; the devices' stack is Berth's.";
  return row;
}

Row two_nodes(const Conditions& c, Figures& figures) {
  Row row{.paper = 2, .what = "negotiation: two devices until both have booted, Table 4"};
  row.published = 0.562;
  row.formula = seconds(2 * cycle({}));
  row.simulated = up_to(table_4(c, figures), can::Frame::base(0x741, {0}), rate(c), figures, "paper2-table4");
  row.trace = "paper2-table4";
  row.marks = "begin: 00000100#; end: 741#00 (boot-up of node 41h)";
  row.note =
      "Formula: two least cycles. The paper's trace says that the revision numbers differ; the serial numbers do. "
      "Boot-up "
      "1 ms after the announcement.";
  return row;
}

}  // namespace

namespace paper2 {
trace::Trace figure_2(const Conditions& conditions, Figures& figures) { return study::figure_2(conditions, figures); }
trace::Trace table_4(const Conditions& conditions, Figures& figures) { return study::table_4(conditions, figures); }
}  // namespace paper2

void reproduce_paper2(const Conditions& conditions, Figures& figures) {
  figures.rows.push_back(fastscan(conditions, figures));
  shares(figures);
  figures.rows.push_back(least_cycle());
  figures.rows.push_back(complete_cycle(conditions, figures));
  figures.rows.push_back(two_nodes(conditions, figures));
}

}  // namespace berth::study
