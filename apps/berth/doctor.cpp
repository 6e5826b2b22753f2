// `berth doctor`: listens on a machine's buses, asks if it may, and reports what is wrong. It joins each bus as its own
// node, in this world or in another process's plant, and knows only what its port shows. If another process runs a
// simulated machine, it follows that through the control socket.
#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "berth/base/counted.hpp"
#include "berth/base/words.hpp"
#include "berth/command/control.hpp"
#include "berth/command/diagnosis.hpp"
#include "berth/command/verbs.hpp"
#include "berth/doctor/conformance.hpp"
#include "berth/doctor/diagnose.hpp"
#include "berth/doctor/questions.hpp"
#include "berth/eds/xdd.hpp"
#include "berth/io/loop_driver.hpp"
#include "berth/rt/scope.hpp"
#include "followed.hpp"
#include "interrupt.hpp"
#include "machine_file.hpp"
#include "machine_run.hpp"
#include "node_words.hpp"
#include "verbs.hpp"

namespace berth::cli {
namespace {

using namespace std::chrono_literals;
using Json = nlohmann::ordered_json;

struct DoctorOptions {
  std::optional<std::chrono::nanoseconds> listen;  ///< empty: five heartbeat times of the slowest bus, 5 s at least
  bool active = false;                             ///< LSS questions
  bool intrusive = false;                          ///< also SDO questions
  std::string conformance;                         ///< this node is examined instead (docs/doctor.md); empty: none
  NodeId node{};                                   ///< that node; set as soon as its bus is known
  std::string eds;                                 ///< file of that node's description; empty: its slot's
};

/// How long simulated devices have run before the doctor starts: it does not see them boot, as on a running machine.
constexpr rt::Duration settled = 1s;

/// One bus, and what the doctor hears on it.
struct Patient {
  const design::Bus* bus = nullptr;
  std::unique_ptr<can::Port> port{};  // a node of the doctor's own, on a simulated bus
  std::unique_ptr<can::Dispatcher> own{};
  can::Dispatcher* dispatcher = nullptr;  // `own`, or the session's
  std::unique_ptr<doctor::Ear> ear{};
  doctor::Heard heard{};  // until the first question: questions cause collisions themselves
  doctor::Expected expected{};
  doctor::QuestionOptions questions{};
  doctor::Answers answers{};
  bool deaf = false;      // the port was down all the time
  std::string problem{};  // why questions could not be asked, or nothing was heard
};

// The doctor's own node on a simulated bus.
tl::expected<std::unique_ptr<can::Port>, Failure> node_on(MachineRun& run, const design::Bus& bus) {
  auto port = run.world()->attach_master(bus.name);
  if (port) return std::unique_ptr<can::Port>(std::move(port));
  return tl::unexpected(failure(Exit::failed, fmt::format("the simulated world has no bus \"{}\"", bus.name)));
}

// Prepares a simulated machine: devices boot; with --up, the machine is brought up first. Events that the plant file
// plans after "operational" are not run: the doctor examines the machine as it is.
void prepare(MachineRun& run, const Options& options) {
  if (options.single.bring_up && run.loop() == nullptr) {
    run.power_on();
    run.session().start();
    const auto limit = options.timeout.value_or(5min);
    const bool done = wait_until(
        run.driver(), run.interrupt(), [&] { return run.session().operational(); }, limit);
    if (!done) print_error("--up: the machine is not operational; it is looked at as it is");
  }
  run.power_on_and_boot(settled);
}

rt::Task<void> question(Patient& patient, unsigned& open) {
  const auto asked =
      co_await doctor::ask(*patient.dispatcher, *patient.ear, patient.expected, patient.questions, patient.answers);
  if (!asked && patient.problem.empty())
    patient.problem = fmt::format("bus {}: {}", patient.bus->name, describe(asked.error()));
  --open;
}

void ask_all(MachineRun& run, std::vector<Patient>& patients, const Options& options) {
  unsigned open = 0;
  rt::Scope scope(run.driver().executor());
  for (auto& patient : patients) {
    ++open;
    scope.spawn(question(patient, open));
  }
  const bool done = wait_until(
      run.driver(), run.interrupt(), [&] { return open == 0; }, options.timeout.value_or(5min));
  for (auto& patient : patients) patient.answers.frames = patient.ear->heard().frames - patient.heard.frames;
  if (done) return;
  for (auto& patient : patients) {
    if (patient.problem.empty()) patient.problem = "bus " + patient.bus->name + ": not all questions could be asked";
  }
}

Patient patient_of(const design::Machine& machine, const design::Bus& bus, const DoctorOptions& wanted) {
  Patient p;
  p.bus = &bus;
  p.expected = command::expected_on(machine, bus);
  p.questions = command::questions_on(bus, wanted.intrusive);
  return p;
}

// The doctor hears only what a port hears. On a simulated bus, every node gets a port.
Failure cannot_hear(const design::Machine& machine, const design::Bus& bus) {
  return no_port(
      bus, "the doctor needs a port to listen and to ask",
      fmt::format("with a port plugged in there: berth doctor --port can1 --bitrate {}; in a simulated world of "
                  "its own: --sim PLANT --up; what the gateway's master knows: berth scan --bus {} {}",
                  bus.bitrate, bus.name, machine.file));
}

tl::expected<std::vector<Patient>, Failure> patients_of(MachineRun& run, const Options& options,
                                                        const DoctorOptions& wanted) {
  std::vector<Patient> patients;
  for (const auto* const each : run.machine().all_buses()) {
    const design::Bus& bus = *each;
    if (!options.bus.empty() && bus.name != options.bus) continue;
    if (!bus.own_port && run.world() == nullptr) continue;
    if (wanted.active && bus.role == design::Role::observer) {
      return tl::unexpected(failure(
          Exit::usage, fmt::format("bus {} is only observed (role = \"observer\"): without --active the doctor only "
                                   "listens",
                                   bus.name)));
    }
    Patient p = patient_of(run.machine(), bus, wanted);
    if (run.guards().gate(bus.name) != nullptr) {
      // Uses the session's dispatcher: a port has only one listener, and a second dispatcher would replace the first.
      p.dispatcher = &run.session().network(bus.name)->services().dispatcher;
    } else {
      auto port = node_on(run, bus);
      if (!port) return tl::unexpected(port.error());
      p.port = std::move(*port);
      p.own = std::make_unique<can::Dispatcher>(run.driver().executor(), *p.port);
      p.dispatcher = p.own.get();
    }
    p.ear = std::make_unique<doctor::Ear>(*p.dispatcher);
    patients.push_back(std::move(p));
  }
  if (patients.empty()) return tl::unexpected(no_such_bus(run.machine(), options.bus));
  return patients;
}

// The bus for --bus and --conformance. If Berth has no port there, this is reported before anything is opened.
std::optional<Failure> settle_bus(const design::Machine& machine, bool simulates, Options& options,
                                  DoctorOptions& wanted) {
  if (!wanted.conformance.empty()) {
    const auto node = meant_node(machine, options.bus, wanted.conformance);
    if (!node) return node.error();
    options.bus = node->bus->name;
    wanted.node = node->node;
  }
  const auto* const bus = options.bus.empty() ? nullptr : machine.bus(options.bus);
  if (!options.bus.empty() && bus == nullptr) return no_such_bus(machine, options.bus);
  if (bus != nullptr && !bus->own_port && !simulates) return cannot_hear(machine, *bus);
  return std::nullopt;
}

// The buses on which the doctor cannot listen.
std::vector<std::string> not_heard(const design::Machine& machine, bool simulates, const Options& options) {
  std::vector<std::string> names;
  if (simulates || !options.bus.empty()) return names;
  for (const auto& bus : machine.beneath) names.push_back(bus.name);
  return names;
}

rt::Duration listening_time(const std::vector<Patient>& patients, const DoctorOptions& wanted) {
  if (wanted.listen) return *wanted.listen;
  rt::Duration longest{0};
  for (const auto& p : patients) longest = std::max(longest, command::listening_time(*p.bus));
  return longest;
}

// Listens, and returns for how long. A port that was down all the time shows nothing of its bus.
rt::Duration listen(MachineRun& run, std::vector<Patient>& patients, const DoctorOptions& wanted) {
  const auto began = run.now();
  wait_for(run.driver(), run.interrupt(), listening_time(patients, wanted));
  for (auto& p : patients) {
    p.heard = p.ear->heard();
    p.deaf = !p.dispatcher->port().status().up && p.heard.listened().count() <= 0;
    if (!p.deaf) continue;
    p.problem = fmt::format("bus {}: {} is down: nothing was heard", p.bus->name, can::to_string(p.bus->port));
  }
  return run.now() - began;
}

int report(std::vector<Patient>& patients, rt::Duration listened, const Options& options, const DoctorOptions& wanted,
           const std::vector<std::string>& silent) {
  Json json;
  json["listened_s"] = std::chrono::duration<double>(listened).count();
  json["asked"] = wanted.intrusive ? "lss and sdo" : wanted.active ? "lss" : "nothing";
  json["buses"] = Json::array();
  json["findings"] = Json::array();
  json["problems"] = Json::array();
  json["without_port"] = silent;
  for (auto& p : patients) {
    const auto& heard = p.heard;
    json["buses"].push_back({{"bus", p.bus->name},
                             {"frames", heard.frames},
                             {"load", heard.load(p.expected.bit_rate)},
                             {"errors", heard.errors}});
    const auto findings = p.deaf ? std::vector<doctor::Diagnosis>() : doctor::diagnose(heard, p.expected, p.answers);
    for (const auto& d : findings) {
      json["findings"].push_back(command::finding_json(d, p.bus->name));
      if (!options.json) print_lines(command::finding_lines(d, p.bus->name));
    }
    if (p.problem.empty()) continue;
    json["problems"].push_back(p.problem);
    if (!options.json) print_error(p.problem);
  }
  const auto found = json["findings"].size();
  const bool failed = !json["problems"].empty();
  if (options.json) {
    print_text(json.dump(2));
  } else {
    if (!silent.empty()) {
      print_line(
          fmt::format("not listened to, because Berth has no port there: {} (`berth scan` shows which nodes the "
                      "gateways' masters know)",
                      some_of(silent)));
    }
    print_line(fmt::format("{} in {:.1f} s on {}", found == 0 ? "nothing wrong" : counted(found, "finding"),
                           json["listened_s"].get<double>(), counted(patients.size(), "bus", "buses")));
  }
  if (failed) return Exit::failed;
  return found == 0 ? Exit::done : Exit::no;
}

// --- Conformance -----------------------------------------------------------------------------------------------------

// The node's description: --eds, else its slot's; null if it has neither.
tl::expected<std::shared_ptr<const od::Description>, Failure> description_of(const MachineRun& run,
                                                                             const Patient& patient,
                                                                             const DoctorOptions& wanted) {
  std::string path = wanted.eds;
  for (const auto& slot : run.machine().slots) {
    const bool is = slot.spec.name.bus == patient.bus->name && slot.spec.id == wanted.node;
    if (is && path.empty()) path = slot.eds_path;
  }
  if (path.empty()) return std::shared_ptr<const od::Description>();
  const auto reading = eds::read_any_file(path);
  if (!reading.usable()) return tl::unexpected(failure(reading.findings));
  return reading.file.description;
}

rt::Task<void> examine_node(Patient& patient, const doctor::ConformanceOptions& options, doctor::Conformance& report,
                            bool& over) {
  const auto done = co_await doctor::examine(*patient.dispatcher, options, report);
  if (!done) {
    patient.problem =
        fmt::format("bus {}, node {}: {}", patient.bus->name, options.node.value(), describe(done.error()));
  }
  over = true;
}

int report_conformance(const doctor::Conformance& report, const Patient& patient, NodeId node, const Options& options) {
  if (options.json) {
    print_text(command::conformance_json(report, patient.bus->name, node, patient.problem).dump(2));
  } else {
    print_lines(command::conformance_lines(report, patient.bus->name, node));
    if (!patient.problem.empty()) print_error(patient.problem);
  }
  if (!patient.problem.empty()) return Exit::failed;
  return report.count(doctor::Verdict::failed) == 0 ? Exit::done : Exit::no;
}

int run_conformance(MachineRun& run, std::vector<Patient>& patients, const Options& options,
                    const DoctorOptions& wanted) {
  if (patients.size() != 1) return tell(failure(Exit::usage, "of which bus? Give --bus NAME"), options.json);
  Patient& patient = patients.front();
  auto description = description_of(run, patient, wanted);
  if (!description) return tell(description.error(), options.json);
  const doctor::ConformanceOptions how{
      .node = wanted.node, .description = *description, .timeout = patient.bus->timing.sdo_timeout};
  doctor::Conformance report;
  bool over = false;
  {
    rt::Scope scope(run.driver().executor());
    scope.spawn(examine_node(patient, how, report, over));
    wait_until(
        run.driver(), run.interrupt(), [&] { return over; }, options.timeout.value_or(10min));
  }
  if (!over) patient.problem = "not all checks could be made: give a longer --timeout";
  return report_conformance(report, patient, wanted.node, options);
}

// --- Of a simulated machine that runs --------------------------------------------------------------------------------

// The control socket of the process that simulates the machine. Empty: the buses are real, or in a world of this
// process, or no process runs the machine.
std::string running_world(const Options& options, const design::Machine& machine) {
  const bool here =
      options.machine.empty() || !options.sim.plant.empty() || !options.ports.empty() || all_elsewhere(machine);
  return here ? std::string() : running_control(options, machine);
}

// Why the world stands still; empty: it runs. A paused world is as silent as a bus with a disconnected cable, so the
// doctor can find nothing there.
std::string standing(const std::string& path) {
  constexpr int patience_ms = 2000;
  const auto reply = command::control_call(path, {"report", {}}, patience_ms);
  const auto report = reply ? Json::parse(reply->json, nullptr, false) : Json();
  const bool stands = report.is_object() && report.value("paused", false);
  return stands ? reply->lines.back() : std::string();
}

int run_joined(const design::Machine& machine, const std::string& path, const Options& options,
               const DoctorOptions& wanted) {
  if (wanted.active) {
    return tell(
        failure(Exit::no, fmt::format("{}: another process runs this simulated machine, and only that process reaches "
                                      "its devices. Without --active and --conformance the doctor listens there; to "
                                      "ask devices, end that process and give --sim PLANT --up",
                                      path)),
        options.json);
  }
  rt::Executor executor;
  io::LoopDriver driver(executor);
  Interrupt interrupt(&driver.loop());
  if (const auto other = runs_another(options, path)) return tell(*other, options.json);
  if (const auto stands = standing(path); !stands.empty()) return tell(failure(Exit::no, stands), options.json);
  const auto followed = FollowedBuses::join(driver.loop(), path, machine);
  if (!followed) return tell(followed.error(), options.json);
  std::vector<Patient> patients;
  for (const auto& bus : machine.buses) {
    if (!options.bus.empty() && bus.name != options.bus) continue;
    auto& p = patients.emplace_back(patient_of(machine, bus, wanted));
    p.own = std::make_unique<can::Dispatcher>(executor, (*followed)->port(bus.name));
    p.dispatcher = p.own.get();
    p.ear = std::make_unique<doctor::Ear>(*p.dispatcher);
  }
  const auto began = driver.now();
  wait_until(
      driver, interrupt, [&] { return (*followed)->over(); }, listening_time(patients, wanted));
  for (auto& p : patients) {
    p.heard = p.ear->heard();
    if ((*followed)->over()) p.problem = "bus " + p.bus->name + ": the running `berth up` ended meanwhile";
  }
  const int status = report(patients, driver.now() - began, options, wanted, not_heard(machine, false, options));
  for (auto& p : patients) p.ear.reset(), p.own.reset();
  return status;
}

// Exit status: 0 no findings, 1 findings, 3 a bus could not be reached or asked.
int run_doctor(const Options& given, DoctorOptions wanted) {
  Options options = given;
  options.machine = default_machine(given);
  wanted.active = wanted.active || !wanted.conformance.empty();
  if (options.machine.empty() && options.ports.empty()) {
    return tell(failure(Exit::usage,
                        "name the machine file: --machine FILE; or a bus without one: --port can0" + machines_here()),
                options.json);
  }
  if (!options.machine.empty()) {
    const auto machine = design::load_machine(options.machine, options.files.allow_outside);
    if (!machine.machine) return tell(failure(machine.findings), options.json);
    const auto wrong = settle_bus(*machine.machine, !options.sim.plant.empty(), options, wanted);
    if (wrong) return tell(*wrong, options.json);
    const auto path = running_world(options, *machine.machine);
    if (!path.empty()) return run_joined(*machine.machine, path, options, wanted);
  }
  Options own = options;
  own.store.used = false;
  own.outside.observe = !wanted.active;
  own.store.file.clear();  // it needs no slot table, and `berth up` may hold it
  auto made = MachineRun::make(own, {options.machine, options.sim.plant, {}, {}});
  if (!made) return tell(made.error(), options.json);
  MachineRun& run = **made;
  if (options.machine.empty()) {
    if (const auto wrong = settle_bus(run.machine(), false, options, wanted)) return tell(*wrong, options.json);
  }
  prepare(run, options);
  auto patients = patients_of(run, options, wanted);
  if (!patients) return tell(patients.error(), options.json);
  if (wanted.active) {
    const auto clear = run.strangers().listen_first();
    if (!clear) return tell(clear.error(), options.json);
  }
  if (!wanted.conformance.empty()) return run.record().finish(run_conformance(run, *patients, options, wanted));
  const auto listened = listen(run, *patients, wanted);
  if (wanted.active) ask_all(run, *patients, options);
  return run.record().finish(
      report(*patients, listened, options, wanted, not_heard(run.machine(), run.world() != nullptr, options)));
}

}  // namespace

void add_doctor(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<DoctorOptions>();
  const command::Verb& known = *command::verb("doctor");
  const auto help = [&known](std::string_view name) { return std::string(known.parameter(name)->help); };
  const Verb doctor =
      berth.add("doctor", std::string(known.help), [&options, wanted] { return run_doctor(options, *wanted); });
  machine_words(doctor, options, {.sends = false, .stores = false});
  machine_word(doctor, options);
  control_word(doctor, options);
  doctor.time("--for", wanted->listen, "how long to listen (default: 5 heartbeat times, at least 5 s)");
  doctor.flag("--active", wanted->active, help("active"));
  doctor.flag(
      "--intrusive", [wanted] { wanted->active = wanted->intrusive = true; }, help("intrusive"));
  doctor.word("--conformance", wanted->conformance, help("conformance")).shown("NODE");
  doctor.word("--eds", wanted->eds, "with --conformance: its description (default: its slot's)").shown("FILE");
  doctor.word("--bitrate", options.bit_rate, "bit/s, for --port without a machine file")
      .from_to(10'000, 1'000'000)
      .shown("BIT/S");
  doctor.flag("--up", options.single.bring_up, "with --sim: first bring the machine up");
  doctor.footer(
      "Examples:\n  berth doctor machine.toml\n  berth doctor machine.toml --conformance 5 --eds drive.eds\n  berth "
      "doctor machine.toml --sim plant.toml --up\n"
      "  berth doctor --port can0 --for \"20 s\"\n"
      "  berth doctor machine.toml --active --for \"20 s\" --json");
}

}  // namespace berth::cli
