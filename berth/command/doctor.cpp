// doctor: what is wrong on the buses of a running machine. It listens while the main job runs, and asks only if the
// user wants it.
#include <fmt/format.h>

#include <algorithm>
#include <list>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/command/diagnosis.hpp"
#include "berth/command/objects.hpp"
#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/doctor/diagnose.hpp"
#include "berth/tree/own_frames.hpp"

namespace berth::command {
namespace {

constexpr std::uint32_t longest_listening = 600;  // s

/// What the doctor asks in addition to listening.
struct Questions {
  bool active = false;
  bool intrusive = false;
};

/// One bus and what is heard on it: others' frames from the dispatcher, Berth's own from `OwnFrames`.
class Patient final : private tree::OwnFrames::Listener {
 public:
  Patient(Session& session, Network& network)
      : Listener(own_frames(session), network.bus().name),
        network_(&network),
        expected_(expected_on(session.machine(), network.bus())),
        ear_(network.services().dispatcher) {}

  [[nodiscard]] const design::Bus& bus() const noexcept { return network_->bus(); }

  /// Called before anything is asked: the questions themselves cause collisions.
  void end_listening() {
    heard_ = ear_.heard();
    deaf_ = !network_->services().port.status().up && heard_.listened().count() <= 0;
    if (deaf_) problem_ = fmt::format("bus {}: {} is down: nothing was heard", bus().name, can::to_string(bus().port));
  }

  /// Holds the turn, since it uses LSS: the main job binds nothing meanwhile.
  rt::Task<void> ask(bool intrusive) {
    operate::BusServices& services = network_->services();
    co_await services.turn.take();
    const rt::Held held(services.turn);
    const auto questions = questions_on(bus(), intrusive);
    const auto asked = co_await doctor::ask(services.dispatcher, ear_, expected_, questions, answers_);
    if (!asked) problem_ = fmt::format("bus {}: {}", bus().name, describe(asked.error()));
    answers_.frames = ear_.heard().frames - heard_.frames;
  }

  void tell(Json& json, std::vector<std::string>& lines) const {
    json["buses"].push_back({{"bus", bus().name},
                             {"frames", heard_.frames},
                             {"load", heard_.load(expected_.bit_rate)},
                             {"errors", heard_.errors}});
    const auto findings = deaf_ ? std::vector<doctor::Diagnosis>() : doctor::diagnose(heard_, expected_, answers_);
    for (const auto& finding : findings) {
      json["findings"].push_back(finding_json(finding, bus().name));
      const auto told = finding_lines(finding, bus().name);
      lines.insert(lines.end(), told.begin(), told.end());
    }
    if (!problem_.empty()) json["problems"].push_back(problem_);
  }

 private:
  void sent(const can::Frame& frame, rt::Time at) noexcept override { ear_.own(frame, at); }

  Network* network_;
  doctor::Expected expected_;
  doctor::Ear ear_;
  doctor::Heard heard_{};
  doctor::Answers answers_{};
  bool deaf_ = false;
  std::string problem_{};
};

rt::Task<void> examine(Session& session, Arguments& arguments, Reply& reply) {
  const auto node = find_node(session.machine(), arguments.text("bus"), arguments.text("conformance"));
  if (!node) co_return refuse(reply, 2, node.error());
  const auto network = node_network(session, *node);
  if (!network) co_return refuse(reply, 2, network.error());
  const design::Bus& bus = (*network)->bus();
  const doctor::ConformanceOptions how{
      .node = node->node, .description = node->description, .timeout = bus.timing.sdo_timeout};
  doctor::Conformance report;
  const auto done = co_await doctor::examine((*network)->services().dispatcher, how, report);
  std::string problem;
  if (!done) problem = fmt::format("bus {}, node {}: {}", bus.name, node->node.value(), describe(done.error()));
  give(reply, conformance_json(report, bus.name, node->node, problem), conformance_lines(report, bus.name, node->node));
  if (report.count(doctor::Verdict::failed) > 0) reply.status = 1;
  if (problem.empty()) co_return;
  reply.status = 3;
  reply.error = error_line(problem);
}

// The buses meant that can be heard. The problem is text for the user.
Checked<std::vector<Network*>> heard_buses(Session& session, const std::string& bus, const Questions& questions) {
  auto networks = networks_for(session, bus, Use::look);
  if (!networks || !questions.active) return networks;
  for (Network* const network : *networks) {
    const auto usable = network_for(session, network->bus().name, Use::send);
    if (!usable) return tl::unexpected(usable.error() + ": without --active the doctor only listens");
  }
  return networks;
}

void conclude(Session& session, bool all, const std::list<Patient>& patients, Json json, Reply& reply) {
  std::vector<std::string> lines;
  for (const char* const list : {"buses", "findings", "problems", "without_port"}) json[list] = Json::array();
  for (const auto& patient : patients) patient.tell(json, lines);
  if (all) {
    for (const auto& beneath : session.machine().beneath) json["without_port"].push_back(beneath.name);
  }
  const auto found = json["findings"].size();
  lines.push_back(fmt::format("{} in {:.1f} s on {}", found == 0 ? "nothing wrong" : counted(found, "finding"),
                              json["listened_s"].get<double>(), counted(patients.size(), "bus", "buses")));
  give(reply, json, std::move(lines));
  reply.status = found == 0 ? 0 : 1;
  if (json["problems"].empty()) return;
  reply.status = 3;
  for (const auto& problem : json["problems"]) {
    reply.error += (reply.error.empty() ? "" : "\n") + error_line(problem.get<std::string>());
  }
}

}  // namespace

rt::Task<void> doctor_command(Session& session, const Request& request, Reply& reply) {
  Arguments arguments(request);
  const std::string bus = arguments.text("bus");
  const std::uint32_t seconds = arguments.number("for", 1, longest_listening, 0);
  const bool intrusive = arguments.has("intrusive");
  const Questions questions{arguments.has("active") || intrusive, intrusive};
  if (!arguments.good()) co_return refuse(reply, 2, arguments.problem());
  if (arguments.has("conformance")) co_return co_await examine(session, arguments, reply);
  const auto networks = heard_buses(session, bus, questions);
  if (!networks) co_return refuse(reply, 2, networks.error());
  std::list<Patient> patients;  // a list, since others hold references to the elements
  rt::Duration time = std::chrono::seconds(seconds);
  for (Network* const network : *networks) {
    patients.emplace_back(session, *network);
    if (seconds == 0) time = std::max(time, listening_time(network->bus()));
  }
  co_await rt::sleep_for(time);
  for (auto& patient : patients) patient.end_listening();
  if (questions.active) {
    for (auto& patient : patients) co_await patient.ask(intrusive);
  }
  Json json;
  json["listened_s"] = std::chrono::duration<double>(time).count();
  json["asked"] = intrusive ? "lss and sdo" : questions.active ? "lss" : "nothing";
  conclude(session, bus.empty(), patients, std::move(json), reply);
}

}  // namespace berth::command
