// The verbs that make one request, with examples. Their words and options are in the table of verbs
// (berth/command/verbs.cpp).
#include <filesystem>
#include <memory>
#include <utility>

#include "berth/command/objects.hpp"
#include "berth/text/quantity.hpp"
#include "request_verb.hpp"
#include "verbs.hpp"

namespace berth::cli {

void add_scan(Verb& berth, Options& options) {
  const auto rate = std::make_shared<std::string>();
  const RequestVerb scan(berth, options, "scan", "scan",
                         [rate](command::Request& request) {
                           if (*rate == "auto") request.arguments["bitrate"] = *rate;
                           return std::string();
                         },
                         {.bit_rate = false, .machine = {.confirms = false}});
  const auto read = [&options, rate](const std::string& text) {
    *rate = text;
    const auto number = text::parse_ranges(text, 10'000, 1'000'000);
    if (number && number->size() == 1) options.bit_rate = number->front();
    return text == "auto" || options.bit_rate ? std::string()
                                              : "\"" + text + "\" is not a bit rate; write bit/s, or auto";
  };
  scan.verb().read("--bitrate", "BIT/S", read,
                   "bit/s, for --port without a machine file; auto: find the bit rate by listening, send nothing");
  scan.footer(
      "Examples:\n  berth scan machine.toml\n  berth scan --port can0\n  berth scan --port can0 --all\n"
      "  berth scan --bitrate auto --port slcan:/dev/ttyACM0");
}

void add_bind(Verb& berth, Options& options) {
  const RequestVerb bind(berth, options, "bind", "bind", {}, {.alone = false});
  beside_master_flag(bind.verb(), options);
  bind.footer(
      "Examples:\n  berth bind machine.toml --sim plant.toml\n  berth bind machine.toml --method planner-rand "
      "--dry-run\n"
      "docs/machine-file.md has the methods.");
}

void add_locate(Verb& berth, Options& options) {
  const RequestVerb locate(berth, options, "locate", "locate");
  locate.footer("Examples:\n  berth locate left --anyway\n  berth locate 5 --port can0 --seconds 30");
}

void add_replace(Verb& berth, Options& options) {
  const RequestVerb replace(berth, options, "replace", "replace", {}, {.alone = false});
  beside_master_flag(replace.verb(), options);
  replace.footer("Examples:\n  berth replace left\n  berth replace left --device 00000001-00000002-00010000-00000015");
}

void add_forget(Verb& berth, Options& options) {
  const RequestVerb forget(berth, options, "forget", "forget", {}, {.alone = false});
  forget.footer("Example:\n  berth forget 00000001-00000002-00010000-00000015");
}

void add_poll(Verb& berth, Options& options) {
  const RequestVerb poll(berth, options, "poll", "poll", {}, {.alone = false});
  poll.footer("Examples:\n  berth poll left --stop\n  berth poll left");
}

void add_configure(Verb& berth, Options& options) {
  const RequestVerb configure(berth, options, "configure", "configure", {}, {.alone = false});
  configure.footer("Examples:\n  berth configure --check\n  berth configure left machine.toml");
}

namespace {

void program_verb(const Verb& program, Options& options, const std::string& name, RequestVerb::Finish finish = {}) {
  const RequestVerb verb(program, options, name, "program " + name, std::move(finish));
  verb.footer("Example:\n  berth program " + name + " drive machine.toml");
}

}  // namespace

void add_program(Verb& berth, Options& options) {
  const Verb program = berth.group("program", "the programs of a device: what runs, download, start, stop, clear");
  program.footer(
      "Examples:\n  berth program status drive\n  berth program download drive --file drive.bprg\n"
      "docs/programs.md has what an image is.");
  program_verb(program, options, "status");
  // Another process may carry out the request in another folder.
  const auto absolute = [](command::Request& request) {
    const auto file = request.arguments.find("file");
    if (file != request.arguments.end()) file->second = std::filesystem::absolute(file->second).string();
    return std::string();
  };
  program_verb(program, options, "download", absolute);
  program_verb(program, options, "start");
  program_verb(program, options, "stop");
  program_verb(program, options, "clear");
  add_program_image(program, options);
}

void add_boot(Verb& berth, Options& options) {
  const RequestVerb boot(berth, options, "boot", "boot", {}, {.up = false, .alone = false});
  boot.footer(
      "Examples:\n  berth boot machine.toml\n  berth boot machine.toml --bus drives --json\n"
      "`berth up` does it all the time, and gives node-IDs before.");
}

void add_nmt(Verb& berth, Options& options) {
  // Checks the command before looking for a process that runs the machine.
  const RequestVerb nmt(berth, options, "nmt", "nmt", [](command::Request& request) {
    const auto word = request.arguments.find("command");
    return word == request.arguments.end() ? std::string() : command::no_nmt_command(word->second);
  });
  nmt.footer(
      "Examples:\n  berth nmt preop drive machine.toml\n  berth nmt start all --port can0\n"
      "  berth nmt stop 5 --request 1 --port can0");
}

namespace {

void lss_verb(const Verb& lss, Options& options, const std::string& name, const std::string& example) {
  const RequestVerb verb(lss, options, name, "lss " + name);
  verb.footer("Example:\n  berth lss " + example);
}

}  // namespace

void add_lss(Verb& berth, Options& options) {
  const Verb lss = berth.group("lss", "layer setting services (CiA 305), one at a time");
  lss.footer("Examples:\n  berth lss find --port can0\n  berth help lss set-node-id");
  const std::string some_device = "00000001-00000002-00010000-00000015";
  lss_verb(lss, options, "select", "select " + some_device);
  lss_verb(lss, options, "inquire", "inquire");
  lss_verb(lss, options, "store", "store " + some_device);
  lss_verb(lss, options, "set-node-id", "set-node-id " + some_device + " 5 --save");
  lss_verb(lss, options, "bit-timing", "bit-timing 250000");
  lss_verb(lss, options, "activate", "activate 200 --rate 250000");
  lss_verb(lss, options, "global", "global waiting");
  lss_verb(lss, options, "find", "find --port can0");
  lss_verb(lss, options, "move-bit-rate", "move-bit-rate 250000 --dry-run");
  lss_verb(lss, options, "identify", "identify 0x1 0x2 --serial-low 16 --serial-high 31");
  lss_verb(lss, options, "identify-unconfigured", "identify-unconfigured --port can0");
}

}  // namespace berth::cli
