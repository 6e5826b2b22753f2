// The command line: what may be written, and which file does it.
#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "adopt.hpp"
#include "berth/text/quantity.hpp"
#include "device.hpp"
#include "doctor.hpp"
#include "eds.hpp"
#include "gateway.hpp"
#include "options.hpp"
#include "output.hpp"
#include "real_time.hpp"
#include "serve.hpp"
#include "study.hpp"
#include "time_option.hpp"

namespace berth::cli {
namespace {

class CommandLine {
 public:
  CommandLine() {
    app_.require_subcommand(1);
    app_.set_version_flag("--version", std::string("berth ") + BERTH_VERSION);
    app_.get_formatter()->column_width(34);
    add_long_jobs();
    add_single_commands();
    add_forget();
    add_configure();
    add_sdo();
    add_nmt();
    add_lss();
    add_eds();
    add_doctor();
    add_study(app_, options_, action_);
    add_serve(app_, options_, action_);
    add_gateway(app_, options_, action_);
    add_adopt(app_, options_, action_);
    add_device(app_, options_, action_);
    add_real_time(app_, options_, action_);
    add_rest();
  }

  int run(int argc, char** argv) {
    try {
      app_.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      if (error.get_exit_code() == 0) return app_.exit(error);
      const bool json =
          std::any_of(argv, argv + argc, [](const char* word) { return std::string_view(word) == "--json"; });
      const auto used = app_.get_subcommands();
      if (used.empty() && argc > 1 && argv[1][0] != '-') return tell(failure(Exit::usage, no_command(argv[1])), json);
      const std::string help = used.empty() ? "berth --help" : fmt::format("berth {} --help", used.front()->get_name());
      return tell(failure(Exit::usage, fmt::format("{}; see {}", error.what(), help)), json);
    }
    return action_();
  }

 private:
  using Action = std::function<int()>;

  std::string no_command(const std::string& written) {
    std::vector<std::string> names;
    for (const auto* const sub : app_.get_subcommands([](const CLI::App*) { return true; }))
      names.push_back(sub->get_name());
    const std::vector<std::string_view> known(names.begin(), names.end());
    const auto meant = text::closest(written, known);
    return fmt::format("there is no command {}{}; see berth --help", text::quoted(written),
                       meant.empty() ? "" : fmt::format("; did you mean {}?", meant));
  }

  CLI::App* command(CLI::App& parent, const std::string& name, const std::string& help, Action action) {
    CLI::App* const sub = parent.add_subcommand(name, help);
    sub->callback([this, action = std::move(action)] { action_ = action; });
    return sub;
  }

  // A verb that becomes a request; each of its words is an argument of the request.
  CLI::App* verb(CLI::App& parent, const std::string& name, const std::string& full, const std::string& help) {
    CLI::App* const sub = command(parent, name, help, [this, full] {
      request_.verb = full;
      if (options_.yes) request_.arguments["yes"] = "1";
      return run_single(options_, request_);
    });
    common(*sub);
    sub->add_option("--control", options_.control, "socket of the running `berth up` (default: by the machine's name)");
    sub->add_flag("--up", options_.bring_up, "with --sim: first run the main job until the machine is operational");
    return sub;
  }
  CLI::Option* word(CLI::App* sub, const std::string& option, const std::string& key, const std::string& help) {
    return sub->add_option_function<std::string>(
        option, [this, key](const std::string& v) { request_.arguments[key] = v; }, help);
  }

  // CLI11 takes "-3" for a very large number.
  static CLI::Validator is_seed() {
    return {[](const std::string& text) {
              return text.empty() || text.front() == '-' ? fmt::format("\"{}\" is no seed; write a number from 0", text)
                                                         : std::string();
            },
            "NUMBER"};
  }

  void common(CLI::App& sub) {
    sub.add_flag("--json", options_.json, "one JSON object");
    sub.add_option("--machine", options_.machine, "machine file");
    sub.add_option("--bus", options_.bus, "one bus of the machine");
    sub.add_option("--port", options_.ports, "port of the bus, or BUS=PORT, instead of the machine file's")
        ->allow_extra_args(false)
        ->option_text("[BUS=]PORT");
    sub.add_option("--sim", options_.sim, "plant file: run on a simulated world");
    sub.add_option("--sim-state", options_.state, "file that keeps what the simulated devices remember between runs");
    sub.add_option("--seed", options_.seed, "seed of the simulated world, instead of the plant file's")
        ->check(is_seed());
    sub.add_option("--store", options_.store, "slot table's file (default: in memory on a simulated world)");
    sub.add_option("--record", options_.record, "write every frame to this file, as candump -L does");
    sub.add_flag("--yes,-y", options_.yes, "confirms what would else be asked");
    sub.add_flag("--dry-run", options_.dry_run, "print every frame that Berth would send, and change nothing");
    time_option(
        sub, "--timeout", [this](std::chrono::nanoseconds time) { options_.timeout = time; },
        "longest time, of the bus when it is simulated");
  }

  void drive_flags(CLI::App& sub, std::vector<std::string> ends) {
    sub.add_option("--until", options_.until, "end when this is reached")->check(CLI::IsMember(std::move(ends)));
    auto* const pace =
        sub.add_flag("--pace", options_.pace, "in real time, and stay up until Ctrl-C (on a terminal: always)");
    sub.add_flag("--fast", options_.fast, "as fast as possible, on a terminal too; ends by itself")->excludes(pace);
    sub.add_option("--listen,--control", options_.control,
                   "socket for other commands (default: by the machine's name)");
  }

  void add_long_jobs() {
    auto* const demo =
        command(app_, "demo", "the built-in machine: from blank devices to operational, then a replacement",
                [this] { return run_demo(options_); });
    common(*demo);
    drive_flags(*demo, {"operational", "replaced"});
    auto* const up = command(app_, "up", "bring a machine up and keep it running", [this] { return run_up(options_); });
    common(*up);
    up->add_option("machine,-m", options_.machine, "machine file")->option_text("MACHINE");
    drive_flags(*up, {"operational", "replaced"});
    up->add_option("--on-exit", options_.on_exit,
                   "to the devices when it ends: leave, preop, stop (default: as the machine file)")
        ->check(CLI::IsMember({"leave", "preop", "stop"}));
  }

  void add_single_commands() {
    auto* const scan = verb(app_, "scan", "scan", "who is on this bus: configured, unconfigured, duplicates");
    scan->add_option("--bitrate", bitrate_, "auto: which bit rate does the bus run at? Listens, sends nothing")
        ->check(CLI::IsMember({"auto"}));
    scan->callback([this] {
      action_ = [this] {
        if (!bitrate_.empty()) return run_bit_rate(options_);
        request_.verb = "scan";
        return run_single(options_, request_);
      };
    });
    verb(app_, "status", "report", "the slot table as it stands");
    auto* const bind = verb(app_, "bind", "bind", "discovery and binding once, without starting anything");
    word(bind, "--method", "method",
         "how new devices are found: auto, rand, fastscan, … (default: as the machine file)");
    bind->add_flag_function(
        "--from-scratch", [this](std::int64_t) { request_.arguments["from-scratch"] = "1"; },
        "stop the bus, forget every binding, take every node-ID that LSS can change, and bind all anew");
    auto* const locate = verb(app_, "locate", "locate", "a device shows itself: both of its indicators flicker");
    word(locate, "target", "target", "slot, LSS address or node-ID")->required();
    word(locate, "--seconds", "seconds", "for so long (1 to 600, default 10)");
    locate->add_flag_function(
        "--anyway", [this](std::int64_t) { request_.arguments["anyway"] = "1"; }, "also when it is operational");
    auto* const replace = verb(app_, "replace", "replace", "give a slot to a new device");
    word(replace, "slot", "slot", "its name, BUS/NAME or node-ID")->required();
    word(replace, "--device", "device", "LSS address of the device that shall sit there");
    replace->add_flag_function(
        "--used", [this](std::int64_t) { request_.arguments["used"] = "1"; },
        "the used device that waits for the slot, or sits in it: it gets its factory settings first");
  }

  void add_forget() {
    auto* const forget = verb(app_, "forget", "forget", "a device that was to give its node-ID up is gone for good");
    word(forget, "device", "device", "its LSS address")->required();
  }

  void add_configure() {
    auto* const sub = verb(app_, "configure", "configure", "bring devices to what their configuration files want");
    word(sub, "slot", "slot", "its name, BUS/NAME or node-ID (default: every slot with a configuration)");
    sub->add_flag_function(
        "--check", [this](std::int64_t) { request_.arguments["check"] = "1"; }, "compare only, and say what differs");
  }

  void add_sdo() {
    auto* const sdo = app_.add_subcommand("sdo", "read or write one object");
    sdo->require_subcommand(1);
    auto* const read = verb(*sdo, "read", "sdo read", "read an object: berth sdo read 5 0x1018 4 --type u32");
    auto* const write = verb(*sdo, "write", "sdo write", "write an object: berth sdo write 5 0x1017 0 500 --type u16");
    for (CLI::App* const sub : {read, write}) {
      word(sub, "node", "node", "node-ID")->required();
      word(sub, "index", "index", "index, such as 0x1018")->required();
    }
    word(read, "sub", "sub", "sub-index (default 0)");
    word(write, "sub", "sub", "sub-index")->required();
    word(write, "value", "value", "value of --type; without a type hex bytes such as \"F4 01\"")->required();
    for (CLI::App* const sub : {read, write}) {
      word(sub, "--type,-t", "type", "u8 u16 u32 i8 i16 i32 r32 vs os …");
      sub->add_flag_function(
          "--block", [this](std::int64_t) { request_.arguments["block"] = "1"; }, "by SDO block transfer");
    }
  }

  void add_nmt() {
    auto* const nmt = verb(app_, "nmt", "nmt", "one NMT command to one node or all");
    word(nmt, "command", "command", "start, stop, preop, reset-node, reset-comm")->required();
    word(nmt, "node", "node", "node-ID, or all")->required();
  }

  void add_lss() {
    auto* const lss = app_.add_subcommand("lss", "layer setting services (CiA 305), one at a time");
    lss->require_subcommand(1);
    const auto service = [&](const std::string& name, const std::string& help) {
      return verb(*lss, name, "lss " + name, help);
    };
    const char* const address = "VENDOR-PRODUCT-REVISION-SERIAL, eight hex digits each";
    word(service("select", "one device to configuration state"), "address", "address", address)->required();
    word(service("inquire", "vendor, product, revision, serial number, node-ID"), "address", "address", address);
    word(service("store", "a device stores node-ID and bit rate"), "address", "address", address);
    auto* const set = service("set-node-id", "give a device a node-ID");
    word(set, "address", "address", address)->required();
    word(set, "id", "id", "1 to 127, or 255 for none")->required();
    set->add_flag_function(
        "--save", [this](std::int64_t) { request_.arguments["store"] = "1"; }, "and let the device store it");
    auto* const timing = service("bit-timing", "give a device a bit rate");
    word(timing, "rate", "rate", "bit/s")->required();
    word(timing, "address", "address", address);
    auto* const activate = service("activate", "devices in configuration state change to their new bit rate");
    word(activate, "delay", "delay", "switch delay in ms")->required();
    word(activate, "--rate", "rate", "bit/s that Berth's own port changes to");
    word(service("global", "all devices to waiting or configuration state"), "state", "state",
         "waiting or configuration")
        ->required();
    service("find", "every device that no slot has; is anybody without a node-ID?");
    auto* const move = service("move-bit-rate", "every device of a bus to another bit rate, together");
    word(move, "rate", "rate", "bit/s")->required();
    word(move, "--delay", "delay", "switch delay in ms (default 200)");
    auto* const identify = service("identify", "is a device within these ranges?");
    word(identify, "vendor", "vendor", "vendor-ID")->required();
    word(identify, "product", "product", "product code")->required();
    word(identify, "--revision-low", "revision-low", "default 0");
    word(identify, "--revision-high", "revision-high", "default 0xFFFFFFFF");
    word(identify, "--serial-low", "serial-low", "default 0");
    word(identify, "--serial-high", "serial-high", "default 0xFFFFFFFF");
  }

  void add_eds() {
    auto* const eds = app_.add_subcommand("eds", "device descriptions: EDS, DCF, XDD, XDC");
    eds->require_subcommand(1);
    using Verb = int (*)(const Options&, const EdsOptions&);
    const auto service = [&](const char* name, const char* help, const char* examples, Verb does) {
      auto* const sub = command(*eds, name, help, [this, does] { return does(options_, eds_); });
      sub->footer(std::string("Examples:\n") + examples);
      return sub;
    };
    const auto node = [&](CLI::App* sub, const char* help) {
      sub->add_option("--node", eds_.node, help)->check(CLI::Range(1, 127))->option_text("N");
    };
    auto* const check =
        service("check", "what is wrong with a description, in words, and what to do about it",
                "  berth eds check sensor.eds\n  berth eds check --strict --json *.eds *.dcf", run_eds_check);
    check->add_option("file", eds_.files, "EDS, DCF, XDD or XDC")->required()->option_text("FILE...");
    check->add_flag("--strict", eds_.strict, "exit status 1 for warnings too");
    check->add_flag("--quiet,-q", eds_.quiet, "no notes");
    check->add_flag("--json", options_.json, "one JSON object");
    auto* const convert =
        service("convert", "write a description in another form, and say what that form cannot hold",
                "  berth eds convert sensor.eds sensor.xdd\n  berth eds convert left.dcf left.cdcf --node 5\n"
                "  berth eds convert left.cdcf left.dcf --eds sensor.eds --node 5",
                run_eds_convert);
    convert->add_option("files", eds_.files, "the file to read, the file to write (- for standard output)")
        ->required()
        ->expected(2)
        ->option_text("IN OUT");
    convert->add_option("--to", eds_.to, "eds, dcf, xdd, xdc, cdcf or bin (default: by the end of OUT)");
    convert->add_option("--eds", eds_.eds, "of a concise DCF: the device's description")->option_text("FILE");
    node(convert, "node-ID, for $NODEID and the commissioning");
    convert->add_flag("--json", options_.json, "one JSON object");
    auto* const diff = service("diff", "what two descriptions say differently, or a description and the device",
                               "  berth eds diff old.eds new.eds\n"
                               "  berth eds diff sensor.eds --node 5 --machine machine.toml --sim plant.toml --up",
                               run_eds_diff);
    diff->add_option("file", eds_.files, "one or two files")->required()->expected(1, 2)->option_text("FILE [FILE]");
    node(diff, "compare with this device instead of a second file");
    diff->add_flag("--values", eds_.values, "with --node: compare values too");
    common(*diff);
    diff->add_option("--control", options_.control,
                     "socket of the running `berth up` (default: by the machine's name)");
    diff->add_flag("--up", options_.bring_up, "with --sim: first run the main job until the machine is operational");
    auto* const show = service(
        "show", "the object dictionary as a table, or one object in detail",
        "  berth eds show sensor.eds\n  berth eds show sensor.eds 0x1018\n  berth eds show sensor.eds heartbeat",
        run_eds_show);
    show->add_option_function<std::string>(
            "file", [this](const std::string& file) { eds_.files = {file}; }, "EDS, DCF, XDD or XDC")
        ->required()
        ->option_text("FILE");
    show->add_option("object", eds_.object, "index (1018, 0x1018:1) or a part of a name")->option_text("OBJECT");
    show->add_flag("--json", options_.json, "one JSON object");
  }

  void add_doctor() {
    auto* const sub = command(app_, "doctor", "what is wrong on the buses; sends nothing unless it is told to", [this] {
      if (doctor_.conformance) doctor_.active = true;
      return run_doctor(options_, doctor_);
    });
    common(*sub);
    sub->add_option("machine,-m", options_.machine, "machine file")->option_text("MACHINE");
    time_option(
        *sub, "--for", [this](std::chrono::nanoseconds time) { doctor_.listen = time; },
        "how long to listen (default: 5 heartbeat times, at least 5 s)");
    sub->add_flag("--active", doctor_.active, "ask by LSS, too");
    sub->add_flag_function(
        "--intrusive", [this](std::int64_t) { doctor_.active = doctor_.intrusive = true; }, "ask by LSS and SDO, too");
    sub->add_option("--conformance", doctor_.conformance,
                    "instead: what CiA 301 wants of this node, paragraph by paragraph, by SDO; changes nothing")
        ->check(CLI::Range(1U, 127U))
        ->option_text("NODE");
    sub->add_option("--eds", doctor_.eds, "with --conformance: its description (default: its slot's)")
        ->option_text("FILE");
    sub->add_flag("--up", options_.bring_up, "with --sim: first bring the machine up");
    sub->footer(
        "Examples:\n  berth doctor machine.toml\n  berth doctor machine.toml --conformance 5 --eds drive.eds\n  berth "
        "doctor machine.toml --sim plant.toml --up\n"
        "  berth doctor machine.toml --active --for \"20 s\" --json");
  }

  void add_rest() {
    auto* const sim = app_.add_subcommand("sim", "textbook scenes of fault confinement, step by step");
    sim->require_subcommand(1);
    const std::pair<const char*, const char*> scenes[] = {
        {"two-with-one-id", "two nodes send different data under one identifier: error-passive"},
        {"again-with-one-id", "the same, again and again: bus-off"},
        {"wrong-bit-rate", "a node at another bit rate drives a healthy one to bus-off"},
        {"lone-node", "one node sends and nobody acknowledges"}};
    for (const auto& [name, help] : scenes) {
      auto* const sub =
          command(*sim, name, help, [this, scene = std::string(name)] { return run_scenario(options_, scene); });
      sub->add_flag("--json", options_.json, "one JSON object");
    }
    auto* const plant =
        command(app_, "plant", "a simulated plant: in real time for `berth up` in other processes, or by itself",
                [this] { return run_plant(options_); });
    plant->add_option("plant", options_.sim, "plant file")->required()->option_text("PLANT");
    auto* const how = plant->add_option_group("how");
    how->add_option("--listen", options_.control, "socket that `port = \"plant:PATH\"` of a machine file names");
    time_option(
        *how, "--for", [this](std::chrono::nanoseconds time) { options_.timeout = time; },
        "no socket: the plant by itself, so long, as fast as possible");
    how->require_option(1);
    plant->add_option("--record", options_.record, "with --for: write every frame to this file, as candump -L does");
    plant->add_option("--machine", options_.machine, "machine file: bit rates of buses that the plant file gives none");
    plant->add_option("--plant-state,--sim-state", options_.state,
                      "file that keeps what the devices remember between runs");
    plant->add_option("--seed", options_.seed, "seed of the world, instead of the plant file's");
    plant->add_flag("--json", options_.json, "one JSON object");
    command(app_, "version", "which Berth this is", [this] {
      return run_version(options_);
    })->add_flag("--json", options_.json, "one JSON object");
  }

  CLI::App app_{"Berth gives every CANopen device its place.", "berth"};
  Options options_;
  EdsOptions eds_;
  DoctorOptions doctor_;
  operate::CommandRequest request_;
  std::string bitrate_;  // of scan: "auto"
  Action action_;
};

}  // namespace
}  // namespace berth::cli

int main(int argc, char** argv) { return berth::cli::CommandLine().run(argc, argv); }
