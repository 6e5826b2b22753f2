// `berth init`: plans, checks what it would write, writes both files or none, and tells the user the next step.
#include "init.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "ask.hpp"
#include "berth/base/counted.hpp"
#include "berth/base/words.hpp"
#include "berth/design/machine.hpp"
#include "berth/plant/plant_file.hpp"
#include "berth/text/printable.hpp"
#include "berth/text/quantity.hpp"
#include "simulated.hpp"
#include "verbs.hpp"
#include "whole_files.hpp"

namespace berth::cli {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr const char* usual_file = "berth.toml";

Failure wrong_name(const char* option, const std::string& name) {
  return failure(Exit::usage, fmt::format("{} \"{}\": this is not a name; {}", option, name, design::name_fix));
}

// Refuses early what the readers of both files would refuse: before anything is asked or read.
tl::expected<void, Failure> check_names(const Options& options, const InitOptions& init) {
  if (!init.name.empty() && !design::good_name(init.name)) return tl::unexpected(wrong_name("--name", init.name));
  if (!options.bus.empty() && !design::good_name(options.bus)) return tl::unexpected(wrong_name("--bus", options.bus));
  return {};
}

tl::expected<void, Failure> check_files(const Options& options, const InitOptions& init) {
  for (const auto& path : {init.file, init.plant}) {
    if (const auto why = init_file_problem(path); !why.empty()) {
      return tl::unexpected(failure(Exit::usage, fmt::format("{}: {}", path, why)));
    }
  }
  if (init.file == init.plant) {
    return tl::unexpected(failure(Exit::usage, init.file + ": machine file and plant file are two files"));
  }
  std::error_code none;
  for (const auto& path : {init.file, init.plant}) {
    if (const auto why = init_folder_problem(path); !why.empty()) return tl::unexpected(failure(Exit::failed, why));
    if (init.force || options.dry_run || !fs::exists(fs::symlink_status(path, none))) continue;
    return tl::unexpected(failure(
        Exit::no, path + " is there already and is left as it is; name another file, or replace it by --force"));
  }
  return {};
}

// Reads the new files as Berth will, with the descriptions at their present places: so no file is written that Berth
// would not run.
tl::expected<void, Failure> check_texts(const InitPlan& plan, const InitOptions& init, const Options& options,
                                        const std::vector<std::string>& allowed) {
  const std::string machine = machine_text(plan, init.file, init.plant);
  const auto read = design::read_machine(machine, init.file, design::eds_loader(), {}, {}, allowed);
  if (!read.machine) return tl::unexpected(failure(read.findings));
  const auto devices = plant::read_plant(plant_text(plan, init.file, init.plant), init.plant, allowed);
  if (!devices.plant) return tl::unexpected(failure(devices.findings));
  std::vector<plant::BusRate> rates;
  for (const auto& bus : read.machine->buses) rates.push_back({bus.name, bus.bitrate});
  Options quiet = options;
  quiet.json = true;  // a run of the plant reports what descriptions lack
  quiet.sim.state.clear();
  const auto world = make_world(*devices.plant, rates, init.plant, quiet);
  if (!world) return tl::unexpected(world.error());
  return {};
}

Json json_of(const InitPlan& plan, const InitOptions& init) {
  Json json{{"machine_file", init.file}, {"plant_file", init.plant}, {"name", plan.name}};
  json["devices"] = plan.devices();
  json["buses"] = Json::array();
  for (const auto& bus : plan.buses) {
    Json one{{"name", bus.name}, {"port", can::to_string(bus.port)}, {"bitrate", bus.bitrate}};
    one["slots"] = Json::array();
    for (const auto& device : bus.devices) {
      for (unsigned i = 0; i < device.count; ++i) {
        const auto name = text::fill(device.name, "id", std::to_string(device.first_id + i));
        Json slot{{"id", device.first_id + i}, {"name", name}};
        if (!device.eds.empty()) slot["eds"] = device.eds;
        one["slots"].push_back(std::move(slot));
      }
    }
    json["buses"].push_back(std::move(one));
  }
  json["notes"] = plan.notes;
  return json;
}

std::string number_of(std::size_t count, const char* what) { return counted(count, what); }

void tell_written(const InitPlan& plan, const InitOptions& init) {
  std::string buses;
  for (const auto& bus : plan.buses) {
    buses += fmt::format("{}bus {} at {} bit/s", buses.empty() ? "" : ", ", bus.name, bus.bitrate);
  }
  print_line(fmt::format("{}: machine \"{}\", {}, {}", init.file, plan.name, number_of(plan.devices(), "slot"), buses));
  print_line(fmt::format("{}: the same devices, simulated", init.plant));
  for (const auto& note : plan.notes) print_line("note: " + note);
  print_line("Next:");
  print_line(fmt::format("  berth up {} --sim {}", init.file, init.plant));
  const bool simulated = plan.buses.front().port.kind == can::PortKind::sim;
  print_line(fmt::format("  berth up {}{} --dry-run", init.file, simulated ? " --port can0" : ""));
}

std::vector<WholeFile> files_of(const std::vector<InitCopy>& copies) {
  std::vector<WholeFile> files;
  for (const auto& copy : copies) {
    if (!copy.there) files.push_back({copy.to, copy.bytes});
  }
  return files;
}

// The folders in which the machine file may name files, and those of the descriptions that will be copied.
std::vector<std::string> folders_of(const std::vector<InitCopy>& copies, const Options& options) {
  std::vector<std::string> folders = options.files.allow_outside;
  for (const auto& copy : copies) folders.push_back(fs::absolute(copy.from).parent_path().string());
  return folders;
}

int write_machine(const InitPlan& as_found, const Options& options, const InitOptions& init) {
  InitPlan plan = as_found;
  const auto copies = take_along(plan, init, options.files.allow_outside);
  if (!copies) return tell(copies.error(), options.json);
  if (const auto good = check_texts(as_found, init, options, folders_of(*copies, options)); !good)
    return tell(good.error(), options.json);
  const std::string machine = machine_text(plan, init.file, init.plant);
  const std::string plant = plant_text(plan, init.file, init.plant);
  auto files = files_of(*copies);
  files.push_back({init.plant, plant});
  files.push_back({init.file, machine});
  Json json = json_of(plan, init);
  json["written"] = !options.dry_run;
  if (options.dry_run) {
    json["machine"] = machine;
    json["plant"] = plant;
    if (!options.json) {
      write_text(fmt::format("# ---- {}\n{}\n# ---- {}\n{}", text::printable(init.file), text::printable(machine),
                             text::printable(init.plant), text::printable(plant)));
    }
  } else if (const auto wrong = write_whole(files, init.force)) {
    return tell(*wrong, options.json);
  } else if (!options.json) {
    tell_written(plan, init);
  }
  if (options.json) print_text(json.dump(2, ' ', false, Json::error_handler_t::replace));
  return Exit::done;
}

tl::expected<void, Failure> ask_or_refuse(Options& options, InitOptions& init) {
  if (!init.eds.empty() || !options.ports.empty()) return {};
  if (options.json || !someone_types() || !on_terminal()) {
    return tl::unexpected(failure(Exit::usage,
                                  "a machine file needs a source: give the devices' descriptions, --eds drive.eds "
                                  "--eds io.eds:4, or the port of an existing bus, --port can0"));
  }
  Interrupt interrupt;
  return ask_for_machine(options, init, interrupt);
}

int run_init(const Options& given, const InitOptions& wanted) {
  Options options = given;
  InitOptions init = wanted;
  if (const auto good = check_names(options, init); !good) return tell(good.error(), options.json);
  if (const auto good = ask_or_refuse(options, init); !good) return tell(good.error(), options.json);
  if (init.file.empty()) init.file = usual_file;
  if (init.plant.empty()) init.plant = plant_beside(init.file);
  if (const auto good = check_files(options, init); !good) return tell(good.error(), options.json);
  const auto plan = options.ports.empty() ? plan_of_descriptions(options, init) : plan_of_bus(options, init);
  return plan ? write_machine(*plan, options, init) : tell(plan.error(), options.json);
}

}  // namespace

std::string plant_beside(const std::string& file) {
  return (fs::path(file).parent_path() / (fs::path(file).stem().string() + ".plant.toml")).string();
}

std::string init_file_problem(const std::string& path) {
  if (path.ends_with(".toml") && fs::path(path).filename() != ".toml") return {};
  auto ending = fs::path(path).extension().string();
  std::ranges::transform(ending, ending.begin(), lower);
  const bool description = ending == ".eds" || ending == ".dcf" || ending == ".xdd" || ending == ".xdc";
  return description ? "this is a description: give it as --eds " + path
                     : std::string("a machine file and a plant file end in .toml");
}

std::string init_folder_problem(const std::string& path) {
  std::error_code none;
  const auto folder = fs::path(path).parent_path();
  return folder.empty() || fs::is_directory(folder, none) ? std::string()
                                                          : folder.string() + ": there is no such folder";
}

void add_init(Verb& berth, Options& options) {
  const auto wanted = std::make_shared<InitOptions>();
  const Verb init = berth.add("init", "a machine file and its plant file, from descriptions or from a bus",
                              [&options, wanted] { return run_init(options, *wanted); });
  init.word("file", wanted->file, "machine file to write (default: berth.toml)").shown("MACHINE");
  init.word("--eds", wanted->eds,
            "description of a device, and how many there are of it; with --port: of what is found")
      .shown("FILE[:COUNT]")
      .one_each();
  init.word("--port,-p", options.ports,
            "instead: a slot for each device that answers on this bus (can0, a plant's "
            "socket), or on the buses of the `berth up` at this socket")
      .shown("PORT")
      .values(1, 1);
  init.word("--bitrate", options.bit_rate, "bit/s (default: 125000, or what every description supports)")
      .one_of(std::vector<std::uint32_t>{10'000, 20'000, 50'000, 125'000, 250'000, 500'000, 800'000, 1'000'000})
      .shown("BIT/S");
  init.word("--bus", options.bus, "name of the bus (default: field)").shown("NAME");
  init.word("--name", wanted->name, "name of the machine (default: the folder's)").shown("NAME");
  init.word("--plant", wanted->plant, "plant file to write (default: MACHINE with .plant.toml)").shown("FILE");
  init.flag("--force", wanted->force, "replace files that are there");
  reach_word(init, options);
  init.flag("--dry-run", options.dry_run, "print both files, and write none");
  init.time("--timeout", options.timeout, "with --port: longest time");
  json_flag(init, options);
  init.footer(
      "Without --eds and --port it asks, on a terminal.\n"
      "Examples:\n  berth init --eds drive.eds --eds io.eds:4\n  berth init conveyor.toml --port can0 --eds drive.eds");
}

}  // namespace berth::cli
