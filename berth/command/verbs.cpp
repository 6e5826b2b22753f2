#include "berth/command/verbs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "berth/command/permission.hpp"
#include "berth/command/reply.hpp"
#include "berth/command/run.hpp"
#include "berth/text/quantity.hpp"

namespace berth::command {
namespace {

using enum Form;

constexpr Parameter of_bus{.name = "bus", .help = "the machine file's name of it"};
constexpr std::string_view a_node = "node-ID or slot's name";
constexpr std::string_view a_slot = "its name, BUS/NAME or node-ID";
constexpr std::string_view an_address = "VENDOR-PRODUCT-REVISION-SERIAL, eight hex digits each";

constexpr Parameter word_of(std::string_view name, std::string_view help, bool required = true) {
  return {.name = name, .form = word, .help = help, .required = required};
}
constexpr Parameter choice_of(std::string_view name, std::string_view help, std::string_view choices) {
  return {.name = name, .form = word, .help = help, .required = true, .choices = choices};
}
constexpr Parameter option_of(std::string_view name, std::string_view value, std::string_view help,
                              std::string_view spelled = {}) {
  return {.name = name, .form = option, .help = help, .value = value, .spelled = spelled};
}
constexpr Parameter flag_of(std::string_view name, std::string_view help, std::string_view spelled = {}) {
  return {.name = name, .form = flag, .help = help, .spelled = spelled};
}
constexpr Parameter own_of(std::string_view name, std::string_view help, bool required = false) {
  return {.name = name, .form = own, .help = help, .required = required};
}
constexpr Parameter personal(Parameter parameter) {
  parameter.personal = true;
  return parameter;
}

constexpr Parameter changing(Parameter parameter) {
  parameter.changes = true;
  return parameter;
}

constexpr std::array bus{of_bus};
constexpr std::array of_report{
    of_bus,
    word_of("slot", "all that is known of one: its name, BUS/NAME or node-ID (default: a row for each)", false)};
constexpr std::array of_scan{of_bus, flag_of("all",
                                             "ask every node-ID, and search for devices without one by RAND and LSS "
                                             "(default: listen for 2 s, then ask the nodes that were heard, by SDO)")};
constexpr std::array of_bind{
    of_bus,
    option_of("method", "METHOD", "how new devices are found: auto, rand, fastscan, … (default: as the machine file)"),
    personal(flag_of("from-scratch",
                     "stop the bus, forget every binding, take every node-ID that LSS can change, and bind all anew"))};
constexpr std::array of_replace{
    of_bus, word_of("slot", a_slot), option_of("device", "ADDRESS", "LSS address of the device for this slot"),
    flag_of("used", "take the used device that waits for the slot or is in it; it gets its factory settings first")};
constexpr std::array of_forget{of_bus, word_of("device", "its LSS address")};
constexpr std::array of_poll{of_bus, word_of("slot", a_slot), flag_of("stop", "stop asking for it")};
constexpr std::array of_locate{of_bus, word_of("target", "slot, LSS address or node-ID"),
                               option_of("seconds", "N", "seconds to flicker (1 to 600, default 10)"),
                               flag_of("anyway", "also when it is operational")};
constexpr std::array of_configure{
    of_bus,
    word_of("slot", "its name, BUS/NAME or node-ID (default: every slot with a configuration)", false),
    flag_of("check", "compare only, and say what differs"),
    personal(option_of("file", "FILE",
                       "first, this DCF, XDC or concise DCF replaces `config =` of the slot, until its kept copy is "
                       "deleted",
                       "--from")),
    own_of("dcf", "instead of file: the content as a zlib stream, in hexadecimal digits"),
    flag_of("restart", "also resets the device, so that it takes the configuration though it runs")};
constexpr std::array of_upload{of_bus, word_of("slot", a_slot), own_of("dcf", "the whole DCF in the answer")};
constexpr auto an_object = own_of("object", "1018h:04, 0x1018:4, 1018sub4, or its name", true);
constexpr auto a_sub = own_of("sub", "the sub-index, where object is the index alone");
constexpr auto a_type =
    option_of("type", "TYPE", "u8 u16 u32 i8 i16 i32 r32 vs os … (default: what the slot's eds = says)", "--type,-t");
constexpr auto by_block = flag_of("block", "by SDO block transfer");
constexpr auto an_answer = option_of(
    "sdo-timeout", "MS", "longest wait for each answer; no request is repeated (default: the machine file's)");
constexpr std::array of_sdo_read{of_bus, word_of("node", a_node), an_object, a_sub, a_type, by_block, an_answer};
constexpr std::array of_sdo_write{of_bus,
                                  word_of("node", a_node),
                                  an_object,
                                  a_sub,
                                  own_of("value", "of an unknown type hex bytes: 91 01 0F", true),
                                  a_type,
                                  by_block,
                                  an_answer,
                                  flag_of("anyway", "also a value outside of the description's limits")};
constexpr std::array of_sdo_probe{
    of_bus, word_of("node", a_node),
    word_of("objects", "hex: 1000:0,1018:0-4; a refusal is reported, and is not a failure")};
constexpr std::array of_sdo_dump{of_bus, word_of("node", a_node)};
constexpr auto a_client = word_of("client", "node-ID or slot's name of the node that will ask");
constexpr auto a_server = word_of("server", "that of the node that will answer");
constexpr auto a_manager =
    option_of("request", "NODE-ID", "the SDO manager with this node-ID is asked to do it (1F00h, 1F01h)");
constexpr std::array of_sdo_connect{of_bus, a_client, a_server,
                                    own_of("lease", "seconds until the channel is released (default 600)"), a_manager};
constexpr std::array of_sdo_release{of_bus, a_client, a_server, a_manager};
constexpr auto a_program = option_of("number", "N", "1 to 254", "--program");
constexpr std::array of_backup{of_bus, own_of("node", "node-IDs or slots' names, one a line"),
                               flag_of("all", "every slot's device")};
constexpr std::array of_comparison{of_bus, word_of("node", a_node),
                                   personal(word_of("file", "a DCF, XDC or concise DCF", false)),
                                   own_of("dcf", "instead of a file: the DCF as a zlib stream, in hexadecimal digits")};
constexpr std::array of_program{of_bus, word_of("node", a_node), a_program};
constexpr std::array of_program_download{
    of_bus,
    word_of("node", a_node),
    a_program,
    personal(option_of("file", "FILE", "its image (default: the programs of its slot)")),
    own_of("image", "instead of file: the image as a zlib stream, in hexadecimal digits"),
    option_of("identification", "NUMBER", "what 1F56h reports then (default: the CRC-32 of the content)"),
    flag_of("keep", "once it runs, it also replaces the file of the slot's program (earlier content: FILE.before)")};
constexpr std::array of_emcy{
    of_bus, word_of("node", "node-ID or slot's name: its error register (1001h) and history (1003h)", false),
    own_of("listen", "instead: show the messages that come during this many seconds")};
constexpr std::array of_memory{
    of_bus, word_of("node", a_node),
    word_of("group", "all (default), communication, application, or a sub-index that the maker describes", false)};
constexpr std::array of_send{of_bus, own_of("frame", "as candump writes it: 601#4018100400000000", true)};
constexpr std::array of_doctor{
    of_bus, own_of("for", "how long to listen, in seconds (1 to 600; default: 5 heartbeat times, at least 5 s)"),
    changing(flag_of("active", "ask by LSS, too")), changing(flag_of("intrusive", "ask by LSS and SDO, too")),
    changing(option_of("conformance", "NODE",
                       "instead: test this node against CiA 301 by SDO, paragraph by paragraph; changes nothing. A "
                       "node-ID, a slot, with --sim a path such as 3/5"))};
constexpr std::array of_history{
    of_bus, word_of("slot", "its name, BUS/NAME or node-ID (default: all)", false),
    flag_of("audit", "instead: every request that changed something: when, who, what, answer")};
constexpr std::array of_object{of_bus, word_of("node", a_node), an_object};
constexpr std::array of_note{
    of_bus,
    word_of("node", a_node),
    an_object,
    option_of("text", "TEXT", "what it is, in one line"),
    option_of("unit", "UNIT", "its unit: °C"),
    option_of("scale", "N", "value of one count in the unit: 0.1"),
    Parameter{.name = "values",
              .form = own,
              .help = "names of values, one a line: 3=fault; without a name: it has none any more",
              .spelled = "--value"},
    Parameter{.name = "bits", .form = own, .help = "names of bits, the same", .spelled = "--bit"},
    flag_of("anew", "replaces all that the file has about it (default: keeps what is not given)")};
constexpr std::array of_nmt{
    of_bus,
    choice_of("command", "start, stop, preop, reset-node, reset-comm", "start stop preop reset-node reset-comm"),
    word_of("node", "node-ID, slot's name, or all"),
    option_of("request", "NODE-ID", "the NMT master with this node-ID is asked to do it (1F82h)"),
    flag_of("no-wait", "does not wait for the heartbeats that report the new state")};
constexpr std::array of_lss_global{of_bus, choice_of("state", "waiting or configuration", "waiting configuration")};
constexpr std::array of_lss_select{of_bus, word_of("address", an_address)};
constexpr std::array of_lss_device{of_bus, word_of("address", an_address, false)};
constexpr std::array of_lss_inquire{
    of_bus, word_of("address", an_address, false),
    option_of("part", "WORD", "only address, vendor, product, revision, serial or node-id (default: all)")};
constexpr std::array of_lss_set_node_id{
    of_bus, word_of("address", "its LSS address, or selected: who is in configuration state"),
    word_of("id", "1 to 127, or 255 for none"), flag_of("store", "and let the device store it", "--save")};
constexpr std::array of_lss_bit_timing{of_bus, word_of("rate", "bit/s, or auto: it finds out (index 9)"),
                                       word_of("address", an_address, false)};
constexpr std::array of_lss_activate{of_bus, word_of("delay", "switch delay in ms"),
                                     option_of("rate", "BIT/S", "bit/s that Berth's own port changes to")};
constexpr std::array of_move_bit_rate{of_bus, word_of("rate", "bit/s"),
                                      option_of("delay", "MS", "switch delay in ms (default 200)")};
constexpr std::array of_lss_identify{of_bus,
                                     word_of("vendor", "vendor-ID"),
                                     word_of("product", "product code"),
                                     option_of("revision-low", "N", "default 0"),
                                     option_of("revision-high", "N", "default 0xFFFFFFFF"),
                                     option_of("serial-low", "N", "default 0"),
                                     option_of("serial-high", "N", "default 0xFFFFFFFF")};

constexpr std::span<const Parameter> none;
constexpr std::array of_world_step{word_of("frames", "1 to 10000, of all its buses (default 1)", false)};
constexpr std::array of_world_speed{word_of("factor", "0.01 to 1000; 1 is real time")};
constexpr std::array of_world_damage{
    of_bus, word_of("frames", "1 to 10000 (default 1)", false),
    option_of("from", "DEVICE", "only frames that it sends: its name in the plant file, its slot's name or node-ID")};

// The strongest effect of each verb, and so the role that it needs.
constexpr auto asks = Role::view;
constexpr auto operates = Role::operate;
constexpr auto changes = Role::configure;

constexpr std::array table{
    Verb{"report", "the slot table as it is now; exit status 1 when a slot is not operational", asks, of_report,
         report},
    Verb{"scan", "which devices are on this bus: configured, unconfigured, duplicates", asks, of_scan, scan},
    Verb{"bind", "discovery and binding once, without starting anything", operates, of_bind, bind},
    Verb{"replace", "give a slot to a new device", operates, of_replace, replace},
    Verb{"forget", "stop waiting for a device that had to release its node-ID", operates, of_forget, forget},
    Verb{"poll", "start or stop asking for the absent device of an optional slot", operates, of_poll, poll},
    Verb{"locate", "a device flickers both of its indicators", operates, of_locate, locate},
    Verb{"boot", "reset, check, configure and start the devices of the slots once (CiA 302-2)", operates, bus, boot},
    Verb{"configure", "write the values of their configuration files into devices", changes, of_configure, configure},
    Verb{"upload", "save a device's present configuration as its slot's file", changes, of_upload, upload},
    Verb{"backup save", "what devices hold now, as dated DCFs", asks, of_backup, backup_save},
    Verb{"backup compare", "a DCF compared with what a device holds", asks, of_comparison, backup_compare},
    Verb{"backup restore", "a DCF into a device of its type, stored there", changes, of_comparison, backup_restore},
    Verb{"sdo read", "read objects of a device", asks, of_sdo_read, sdo_read},
    Verb{"sdo write", "write objects of a device", changes, of_sdo_write, sdo_write},
    Verb{"sdo probe", "read all of these objects, whichever the device has", asks, of_sdo_probe, sdo_probe},
    Verb{"sdo dump", "every object of a device that can be read: a table, JSON, or a DCF", asks, of_sdo_dump, sdo_dump},
    Verb{"note read", "what is known of an object: text, unit, names of values and bits", asks, of_object,
         note_command},
    Verb{"note write", "a note of an object, into the file beside its description", changes, of_note, note_command},
    Verb{"note remove", "the note of an object, out of the file beside its description", changes, of_object,
         note_command},
    Verb{"sdo connect", "a channel of their own for two nodes (SDO manager, CiA 302-5)", changes, of_sdo_connect,
         sdo_connect},
    Verb{"sdo release", "releases the channel of two nodes", changes, of_sdo_release, sdo_release},
    Verb{"sdo channels", "the channels that the SDO manager of a bus has given", asks, bus, sdo_channels},
    Verb{"nmt", "one NMT command to one node or all", operates, of_nmt, nmt_command},
    Verb{"program status", "which programs it has, and whether they run", asks, of_program, program_status},
    Verb{"program download", "stop, clear, download and start a program", changes, of_program_download,
         program_download},
    Verb{"program start", "start a program", changes, of_program, program_control},
    Verb{"program stop", "stop a program; the device's own: it restarts into its boot loader", changes, of_program,
         program_control},
    Verb{"program clear", "delete a stopped program", changes, of_program, program_control},
    Verb{"emcy", "errors that devices report: present, past, and as they come", asks, of_emcy, emcy},
    Verb{"store", "a device stores its parameters (1010h)", changes, of_memory, device_memory},
    Verb{"restore", "a device takes its default parameters, after a reset (1011h)", changes, of_memory, device_memory},
    Verb{"send", "send frames; the role of the bus still decides what may be sent", changes, of_send, send},
    Verb{"doctor", "what is wrong on the buses; sends nothing unless asked to", asks, of_doctor, doctor_command},
    Verb{"history", "which device sat where, since when and why", asks, of_history, history},
    Verb{"lss global", "all devices to waiting or configuration state", changes, of_lss_global, lss_command},
    Verb{"lss select", "one device to configuration state", changes, of_lss_select, lss_command},
    Verb{"lss inquire", "vendor, product, revision, serial number, node-ID", asks, of_lss_inquire, lss_command},
    Verb{"lss set-node-id", "give a device a node-ID", changes, of_lss_set_node_id, lss_command},
    Verb{"lss store", "a device stores node-ID and bit rate", changes, of_lss_device, lss_command},
    Verb{"lss bit-timing", "give a device a bit rate", changes, of_lss_bit_timing, lss_command},
    Verb{"lss activate", "devices in configuration state change to their new bit rate", changes, of_lss_activate,
         lss_command},
    Verb{"lss identify", "is a device within these ranges?", asks, of_lss_identify, lss_command},
    Verb{"lss identify-unconfigured", "is a device without a node-ID there? (4Ch)", asks, bus, lss_command},
    Verb{"lss find", "every device without a slot; is any device without a node-ID?", asks, bus, lss_command},
    Verb{"lss move-bit-rate", "every device of a bus to another bit rate, together", changes, of_move_bit_rate,
         bit_rate_command},
    Verb{"world pause", "stops the time of a simulated world", operates, none, world_command},
    Verb{"world run", "lets a paused simulated world run on", operates, none, world_command},
    Verb{"world step", "lets a paused simulated world run for some frames", operates, of_world_step, world_command},
    Verb{"world speed", "a simulated world runs faster or slower than real time", operates, of_world_speed,
         world_command},
    Verb{"world damage", "the next frames of a simulated bus are damaged, and repeated", operates, of_world_damage,
         world_command},
};

constexpr Parameter confirmation{.name = "yes", .help = "it may disturb operational devices", .personal = true};

}  // namespace

const Parameter* Verb::parameter(std::string_view wanted) const noexcept {
  if (wanted == confirmation.name) return &confirmation;
  const auto it = std::ranges::find(parameters, wanted, &Parameter::name);
  return it == parameters.end() ? nullptr : &*it;
}

std::span<const Verb> verbs() noexcept { return table; }

const Verb* verb(std::string_view name) noexcept {
  const auto* const it = std::ranges::find(table, name, &Verb::name);
  return it == table.end() ? nullptr : it;
}

}  // namespace berth::command
