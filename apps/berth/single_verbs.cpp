// The verbs that are one request: what may stand behind them becomes the request's arguments.
#include <filesystem>
#include <memory>
#include <utility>

#include "berth/text/quantity.hpp"
#include "request_verb.hpp"
#include "verbs.hpp"

namespace berth::cli {

void add_scan(Verb& berth, Options& options) {
  const auto rate = std::make_shared<std::string>();
  const RequestVerb scan(berth, options, "scan", "scan",
                         "which devices are on this bus: configured, unconfigured, duplicates",
                         [rate](command::Request& request) {
                           if (*rate == "auto") request.arguments["bitrate"] = *rate;
                           return std::string();
                         },
                         {.bit_rate = false, .machine = {.confirms = false}});
  const auto read = [&options, rate](const std::string& text) {
    *rate = text;
    const auto number = text::parse_ranges(text, 10'000, 1'000'000);
    if (number && number->size() == 1) options.bit_rate = number->front();
    return text == "auto" || options.bit_rate ? std::string() : "\"" + text + "\" is no bit rate; write bit/s, or auto";
  };
  scan.verb().read("--bitrate", "BIT/S", read,
                   "bit/s, where --port is all that is known; auto: at which does the bus run? Listens, sends nothing");
  scan.footer(
      "Examples:\n  berth scan machine.toml\n  berth scan --port can0\n"
      "  berth scan --bitrate auto --port slcan:/dev/ttyACM0");
}

void add_bind(Verb& berth, Options& options) {
  const RequestVerb bind(berth, options, "bind", "bind", "discovery and binding once, without starting anything", {},
                         {.alone = false});
  bind.word("--method", "method", "how new devices are found: auto, rand, fastscan, … (default: as the machine file)")
      .shown("METHOD");
  bind.flag("--from-scratch", "from-scratch",
            "stop the bus, forget every binding, take every node-ID that LSS can change, and bind all anew");
  bind.footer(
      "Examples:\n  berth bind machine.toml --sim plant.toml\n  berth bind machine.toml --method planner-rand "
      "--dry-run\n"
      "docs/machine-file.md has the methods.");
}

void add_locate(Verb& berth, Options& options) {
  const RequestVerb locate(berth, options, "locate", "locate", "a device shows itself: both of its indicators flicker");
  locate.word("target", "target", "slot, LSS address or node-ID").required();
  locate.word("--seconds", "seconds", "for so long (1 to 600, default 10)").shown("N");
  locate.flag("--anyway", "anyway", "also when it is operational");
  locate.footer("Examples:\n  berth locate left --anyway\n  berth locate 5 --port can0 --seconds 30");
}

void add_replace(Verb& berth, Options& options) {
  const RequestVerb replace(berth, options, "replace", "replace", "give a slot to a new device", {}, {.alone = false});
  replace.word("slot", "slot", "its name, BUS/NAME or node-ID").required();
  replace.word("--device", "device", "LSS address of the device that shall sit there").shown("ADDRESS");
  replace.flag("--used", "used",
               "the used device that waits for the slot, or sits in it: it gets its factory settings first");
  replace.footer("Examples:\n  berth replace left\n  berth replace left --device 00000001-00000002-00010000-00000015");
}

void add_forget(Verb& berth, Options& options) {
  const RequestVerb forget(berth, options, "forget", "forget",
                           "a device that was to give its node-ID up is gone for good", {}, {.alone = false});
  forget.word("device", "device", "its LSS address").required();
  forget.footer("Example:\n  berth forget 00000001-00000002-00010000-00000015");
}

void add_configure(Verb& berth, Options& options) {
  const RequestVerb configure(berth, options, "configure", "configure",
                              "bring devices to what their configuration files want", {}, {.alone = false});
  configure.word("slot", "slot", "its name, BUS/NAME or node-ID (default: every slot with a configuration)");
  configure.flag("--check", "check", "compare only, and say what differs");
  configure.footer("Examples:\n  berth configure --check\n  berth configure left machine.toml");
}

namespace {

RequestVerb program_verb(const Verb& program, Options& options, const std::string& name, const std::string& help,
                         RequestVerb::Finish finish = {}) {
  RequestVerb verb(program, options, name, "program " + name, help, std::move(finish));
  verb.word("node", "node", "node-ID or slot's name").required();
  verb.word("--program", "number", "1 to 254").shown("N");
  verb.footer("Example:\n  berth program " + name + " drive machine.toml");
  return verb;
}

}  // namespace

void add_program(Verb& berth, Options& options) {
  const Verb program = berth.group("program", "the programs of a device: what runs, download, start, stop, clear");
  program.footer(
      "Examples:\n  berth program status drive\n  berth program download drive --file drive.bprg\n"
      "docs/programs.md has what an image is.");
  program_verb(program, options, "status", "which programs it has, and whether they run");
  // Another process may carry it out, in another folder.
  const auto absolute = [](command::Request& request) {
    const auto file = request.arguments.find("file");
    if (file != request.arguments.end()) file->second = std::filesystem::absolute(file->second).string();
    return std::string();
  };
  const auto download =
      program_verb(program, options, "download", "stop, clear, download and start a program", absolute);
  download.word("--file", "file", "its image (default: the programs of its slot)").shown("FILE");
  download.word("--identification", "identification", "what 1F56h tells then (default: the CRC-32 of the content)")
      .shown("NUMBER");
  program_verb(program, options, "start", "start a program");
  program_verb(program, options, "stop", "stop a program; the device's own: it restarts into its boot loader");
  program_verb(program, options, "clear", "take a stopped program away");
  add_program_image(program, options);
}

void add_boot(Verb& berth, Options& options) {
  const RequestVerb boot(berth, options, "boot", "boot",
                         "reset, check, configure and start the devices of the slots once (CiA 302-2)", {},
                         {.up = false, .alone = false});
  boot.footer(
      "Examples:\n  berth boot machine.toml\n  berth boot machine.toml --bus drives --json\n"
      "`berth up` does it all the time, and gives node-IDs before.");
}

void add_nmt(Verb& berth, Options& options) {
  const RequestVerb nmt(berth, options, "nmt", "nmt", "one NMT command to one node or all");
  nmt.word("command", "command", "start, stop, preop, reset-node, reset-comm").required();
  nmt.word("node", "node", "node-ID, slot's name, or all").required();
  nmt.word("--request", "request", "the NMT master with this node-ID is asked to do it (1F82h)").shown("NODE-ID");
  nmt.footer(
      "Examples:\n  berth nmt preop drive machine.toml\n  berth nmt start all --port can0\n"
      "  berth nmt stop 5 --request 1 --port can0");
}

namespace {

const char* const some_device = "00000001-00000002-00010000-00000015";
const char* const address = "VENDOR-PRODUCT-REVISION-SERIAL, eight hex digits each";

RequestVerb lss_verb(const Verb& lss, Options& options, const std::string& name, const std::string& help,
                     const std::string& example) {
  RequestVerb verb(lss, options, name, "lss " + name, help);
  verb.footer("Example:\n  berth lss " + example);
  return verb;
}

void add_lss_of_one_device(const Verb& lss, Options& options) {
  lss_verb(lss, options, "select", "one device to configuration state", std::string("select ") + some_device)
      .word("address", "address", address)
      .required();
  lss_verb(lss, options, "inquire", "vendor, product, revision, serial number, node-ID", "inquire")
      .word("address", "address", address);
  lss_verb(lss, options, "store", "a device stores node-ID and bit rate", std::string("store ") + some_device)
      .word("address", "address", address);
  const auto set = lss_verb(lss, options, "set-node-id", "give a device a node-ID",
                            std::string("set-node-id ") + some_device + " 5 --save");
  set.word("address", "address", address).required();
  set.word("id", "id", "1 to 127, or 255 for none").required();
  set.flag("--save", "store", "and let the device store it");
  const auto timing = lss_verb(lss, options, "bit-timing", "give a device a bit rate", "bit-timing 250000");
  timing.word("rate", "rate", "bit/s").required();
  timing.word("address", "address", address);
}

void add_lss_of_a_bus(const Verb& lss, Options& options) {
  const auto activate =
      lss_verb(lss, options, "activate", "devices in configuration state change to their new bit rate",
               "activate 200 --rate 250000");
  activate.word("delay", "delay", "switch delay in ms").required();
  activate.word("--rate", "rate", "bit/s that Berth's own port changes to").shown("BIT/S");
  lss_verb(lss, options, "global", "all devices to waiting or configuration state", "global waiting")
      .word("state", "state", "waiting or configuration")
      .required();
  lss_verb(lss, options, "find", "every device that no slot has; is any device without a node-ID?", "find --port can0");
  const auto move = lss_verb(lss, options, "move-bit-rate", "every device of a bus to another bit rate, together",
                             "move-bit-rate 250000 --dry-run");
  move.word("rate", "rate", "bit/s").required();
  move.word("--delay", "delay", "switch delay in ms (default 200)").shown("MS");
  const auto identify = lss_verb(lss, options, "identify", "is a device within these ranges?",
                                 "identify 0x1 0x2 --serial-low 16 --serial-high 31");
  identify.word("vendor", "vendor", "vendor-ID").required();
  identify.word("product", "product", "product code").required();
  identify.word("--revision-low", "revision-low", "default 0").shown("N");
  identify.word("--revision-high", "revision-high", "default 0xFFFFFFFF").shown("N");
  identify.word("--serial-low", "serial-low", "default 0").shown("N");
  identify.word("--serial-high", "serial-high", "default 0xFFFFFFFF").shown("N");
}

}  // namespace

void add_lss(Verb& berth, Options& options) {
  const Verb lss = berth.group("lss", "layer setting services (CiA 305), one at a time");
  lss.footer("Examples:\n  berth lss find --port can0\n  berth help lss set-node-id");
  add_lss_of_one_device(lss, options);
  add_lss_of_a_bus(lss, options);
}

}  // namespace berth::cli
