#include "berth/command/diagnosis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/can/frame.hpp"
#include "berth/command/can_id_text.hpp"

namespace berth::command {

using namespace std::chrono_literals;
using doctor::Verdict;

namespace {

double in_s(rt::Time at) { return std::chrono::duration<double>(at.time_since_epoch()).count(); }

Json check_json(const doctor::Check& check) {
  Json j;
  j["paragraph"] = check.paragraph;
  if (check.has_object) {
    j["index"] = hex(check.object.index, 4);
    j["sub"] = check.object.sub;
  }
  j["what"] = check.what;
  j["verdict"] = doctor::name(check.verdict);
  if (!check.told.empty()) j["told"] = check.told;
  return j;
}

}  // namespace

doctor::Expected expected_on(const design::Machine& machine, const design::Bus& bus) {
  doctor::Expected e;
  e.slots = machine.specs(bus.name);
  if (bus.role != design::Role::observer) e.master = bus.master;
  e.heartbeat_period = bus.timing.heartbeat_period;
  e.heartbeat_timeout = bus.timing.heartbeat_timeout;
  e.bit_rate = bus.bitrate;
  e.predefined_pdos = machine.links.empty() &&
                      std::ranges::all_of(e.slots, [](const places::SlotSpec& slot) { return slot.config.empty(); });
  return e;
}

doctor::QuestionOptions questions_on(const design::Bus& bus, bool intrusive) {
  doctor::QuestionOptions questions;
  questions.lss_timeout = bus.timing.lss_timeout;
  questions.identify_window = std::min<rt::Duration>(bus.timing.lss_timeout, 30ms);
  questions.sdo_timeout = std::min<rt::Duration>(bus.timing.sdo_timeout, 200ms);
  questions.intrusive = intrusive;
  return questions;
}

rt::Duration listening_time(const design::Bus& bus) {
  return std::max<rt::Duration>(5s, 5 * bus.timing.heartbeat_timeout);
}

Json finding_json(const doctor::Diagnosis& d, const std::string& bus) {
  Json j;
  j["kind"] = doctor::name(d.kind);
  j["bus"] = bus;
  if (d.node.configured()) {
    j["node"] = d.node.value();
  } else {
    j["node"] = nullptr;
  }
  if (!d.slot.empty()) j["slot"] = d.slot;
  if (d.cob_id) j["cob_id"] = can_id_text(*d.cob_id);
  if (!d.devices.empty()) {
    j["devices"] = Json::array();
    for (const auto& device : d.devices) j["devices"].push_back(to_string(device));
  }
  j["certainty"] = doctor::name(d.certainty);
  j["what"] = d.what;
  j["evidence"] = d.evidence;
  j["count"] = d.count;
  if (d.count > 0) {
    j["first_s"] = in_s(d.first);
    j["last_s"] = in_s(d.last);
  }
  j["do"] = d.advice;
  return j;
}

std::vector<std::string> finding_lines(const doctor::Diagnosis& d, const std::string& bus) {
  std::vector<std::string> lines{
      fmt::format("{}: {} ({}): {}", bus, doctor::name(d.kind), doctor::name(d.certainty), d.what)};
  for (const auto& line : d.evidence) lines.push_back("    " + line);
  lines.push_back("    -> " + d.advice);
  return lines;
}

Json conformance_json(const doctor::Conformance& report, const std::string& bus, NodeId node,
                      const std::string& problem) {
  Json json{{"bus", bus},
            {"node", node.value()},
            {"passed", report.count(Verdict::passed)},
            {"failed", report.count(Verdict::failed)},
            {"skipped", report.count(Verdict::skipped)},
            {"problem", nullptr},
            {"checks", Json::array()}};
  if (!problem.empty()) json["problem"] = problem;
  for (const auto& check : report.checks) json["checks"].push_back(check_json(check));
  return json;
}

std::vector<std::string> conformance_lines(const doctor::Conformance& report, const std::string& bus, NodeId node) {
  std::vector<std::string> lines;
  for (const auto& check : report.checks) {
    if (check.verdict != Verdict::passed) lines.push_back(to_string(check));
  }
  lines.push_back(fmt::format("{}, node {}: CiA 301: {} checks passed, {} failed, {} skipped", bus, node.value(),
                              report.count(Verdict::passed), report.count(Verdict::failed),
                              report.count(Verdict::skipped)));
  return lines;
}

}  // namespace berth::command
