#include "tests/field/kinds.hpp"

#include <algorithm>
#include <array>

namespace berth::field {
namespace {

using namespace std::chrono_literals;
using lss::Lackable;
using plant::Speaks;

constexpr plant::SpeaksSet plain_lss{Speaks::lss};
constexpr plant::SpeaksSet scanned{Speaks::fastscan};
constexpr plant::Latency slow{150ms, 400ms, 0, 0ms};
constexpr plant::Latency very_slow{500ms, 900ms, 0, 0ms};
// Answers come from a main loop that is busy now and then.
constexpr plant::Latency by_loop{1ms, 10ms, 5'000, 40ms};

constexpr std::array table{
    // ---- drives
    Kind{.name = "wheel drive",
         .source =
             "Servo drive in a robot's wheel; the EDS that its makers publish: 1018h whole in the device, product "
             "code and revision 0 in the EDS; node-ID by its own setup tool, no LSS",
         .device_type = 0x0002'0192,
         .from = From::firmware,
         .watched = {.period = 100},
         .slowest = 20'000,
         .settings = true},
    Kind{.name = "frequency inverter",
         .source = "Manual of a frequency inverter: node-ID by DIP switches, guarding or heartbeat, and guarding ends "
                   "when 1017h is not 0; 1018h whole",
         .device_type = 0x0001'0192,
         .from = From::switches,
         .watched = {.guards = true},
         .response = by_loop,
         .boot = 2s,
         .settings = true},
    Kind{.name = "drive adapter of the first years",
         .source = "Installation guide of a plug-in adapter for drives, written before heartbeat: guarding alone, DIP "
                   "switches; and an inverter's manual whose 1018h has the vendor-ID alone",
         .device_type = 0x0001'0192,
         .parts = 1,
         .serial = Serial::absent,
         .from = From::switches,
         .watched = {.access = "", .guards = true},
         .boot = 1s,
         .slowest = 10'000,
         .quickest = 500'000},
    Kind{.name = "pump motor",
         .source =
             "Operating manual of an inverter on a pump's motor: 1018h whole, heartbeat or guarding, each ends the "
             "other; node-ID by its parameters",
         .device_type = 0x0001'0192,
         .from = From::firmware,
         .watched = {.period = 1000, .guards = true},
         .response = {5ms, 30ms, 0, 0ms},
         .boot = 3s,
         .settings = true},
    Kind{.name = "positioning drive",
         .source = "Manual of a small positioning drive with display: 1017h takes 0 and 10 ms upwards, node-ID by keys "
                   "or LSS, which is plain",
         .device_type = 0x0004'0192,
         .from = From::lss,
         .speaks = plain_lss,
         .watched = {.low = 10},
         .settings = true},
    // ---- encoders and sensors
    Kind{.name = "absolute encoder with LSS",
         .source = "Manual of an absolute rotary encoder: LSS with selection by the four parts of 1018h and inquiries, "
                   "node-ID stored; no Fastscan is named",
         .device_type = 0x0008'0196,
         .speaks = plain_lss,
         .settings = true},
    Kind{.name = "encoder with switches",
         .source = "Manual of a hollow-shaft encoder: rotary switches under its cover, no LSS, 1018h whole",
         .device_type = 0x0001'0196,
         .from = From::switches,
         .slowest = 10'000},
    Kind{.name = "inclinometer with LSS",
         .source = "Operating instructions of an inclination sensor: LSS with inquiries of all four parts and of the "
                   "node-ID, identify non-configured; delivered with a node-ID",
         .device_type = 0x0004'019A,
         .factory = 10,
         .speaks = plain_lss,
         .lss = {.habit = {}, .without = {Lackable::activate}},
         .watched = {.guards = true}},
    Kind{.name = "inclinometer with an object",
         .source = "Instructions of another inclination sensor: its node-ID is an object of the maker's, in use when a "
                   "second object is written and the sensor starts again; no LSS, one node-ID for all when new",
         .device_type = 0,
         .from = From::object,
         .factory = 32,
         .most = 1},
    Kind{.name = "pressure transmitter",
         .source =
             "Report of a user of a scripting library: LSS as the data sheet says, node-ID 1 when new, and no answer "
             "to Fastscan while it has one",
         .device_type = 0x0002'0194,
         .factory = 1,
         .speaks = plain_lss,
         .lss = {.habit = {}, .without = {}, .short_answers = true}},
    Kind{.name = "track sensor",
         .source = "Device description of a guidance sensor for vehicles: 1017h 1000 ms when new, seven-digit serial "
                   "number, node-ID by a service program",
         .device_type = 0,
         .from = From::firmware,
         .watched = {.period = 1000}},
    Kind{.name = "position camera",
         .source =
             "Manual of a camera that reads a code band: 1018h has all four parts, and all but the vendor-ID are 0",
         .device_type = 0,
         .serial = Serial::zero,
         .from = From::firmware,
         .says_product = false},
    Kind{.name = "thermocouple controller",
         .source =
             "Manual of a controller of CiA 404: ships with node-ID 127 and 125 kbit/s, LSS is the only way to change "
             "either",
         .device_type = 0x0000'0194,
         .factory = 127,
         .speaks = plain_lss,
         .slowest = 125'000,
         .quickest = 125'000},
    Kind{.name = "rotary switch I/O",
         .source =
             "User's manual of a remote I/O module: node-ID and bit rate by rotary switches; no serial number that "
             "the manual names",
         .device_type = 0x0004'0191,
         .parts = 3,
         .serial = Serial::absent,
         .from = From::switches,
         .watched = {.guards = true}},
    // ---- valves and I/O
    Kind{.name = "valve island",
         .source =
             "Manual of a valve island of the predefined device (CiA 301 before heartbeat): guarding alone, address "
             "by switches, no serial number",
         .device_type = 0x0003'0191,
         .parts = 3,
         .serial = Serial::absent,
         .from = From::switches,
         .watched = {.access = "", .guards = true},
         .emcy = true},
    Kind{
        .name = "valve coupler",
        .source = "Manual of a bus coupler for valves: emergency while its load supply is off, 1018h:04 is 0, switches",
        .device_type = 0x0002'0191,
        .serial = Serial::zero,
        .from = From::switches,
        .watched = {.guards = true},
        .response = by_loop,
        .settings = true,
        .emcy = true},
    Kind{.name = "load valve",
         .source = "Manual of a hydraulic load valve: 125 kbit/s and its node-ID cannot be changed, heartbeat always "
                   "every second",
         .device_type = 0,
         .parts = 2,
         .serial = Serial::absent,
         .from = From::firmware,
         .watched = {.access = "ro", .period = 1000},
         .slowest = 125'000,
         .quickest = 125'000,
         .most = 1},
    Kind{.name = "modular I/O by lot",
         .source =
             "Page on an I/O coupler's object directory: 1018h:04 is the week and year of production, DIP switches",
         .device_type = 0x000F'0191,
         .serial = Serial::lot,
         .from = From::switches,
         .watched = {.guards = true},
         .boot = 1500ms,
         .settings = true,
         .most = 1},
    Kind{.name = "modular I/O by rotary switch",
         .source =
             "Manual of a decentralised I/O system: 1018h:04 without use, list of modules in the maker's objects, "
             "1017h 0 when new",
         .device_type = 0x000F'0191,
         .serial = Serial::zero,
         .from = From::switches,
         .boot = 4s,
         .emcy = true},
    Kind{.name = "vehicle I/O",
         .source =
             "Manual of an expansion module for vehicles: node-ID by coded inputs, and a change needs a reset or the "
             "key switch",
         .device_type = 0x000F'0191,
         .serial = Serial::zero,
         .from = From::connector,
         .watched = {.period = 200, .low = 16}},
    // ---- in a vehicle's cab
    Kind{.name = "joystick",
         .source = "No single page: the joystick profile of CiA 401, with what makers leave out: no serial number, LSS "
                   "without bit timing, one node-ID for all when new, heartbeat at power-on",
         .device_type = 0x0008'0191,
         .serial = Serial::zero,
         .factory = 16,
         .speaks = plain_lss,
         .lss = {.habit = {}, .without = {Lackable::bit_timing, Lackable::activate}},
         .watched = {.period = 500},
         .most = 1},
    Kind{.name = "keypad",
         .source =
             "Manual of an illuminated keypad: boot-up, then a heartbeat at once; node-ID 11 when new, changed by LSS "
             "or an object",
         .device_type = 0x0001'0191,
         .factory = 11,
         .speaks = plain_lss,
         .watched = {.period = 1000}},
    Kind{.name = "display",
         .source = "No single page: a display as a slave, node-ID in its menu, an operating system that boots for "
                   "seconds, and answers that wait for its pictures",
         .device_type = 0,
         .serial = Serial::zero,
         .from = From::firmware,
         .response = slow,
         .boot = 7s,
         .settings = true},
    // ---- energy
    Kind{.name = "battery",
         .source = "CiA's page on CiA 418, which makes the heartbeat mandatory, and a maker's object dictionary of a "
                   "battery pack: short list of objects, node-ID by the place in the rack",
         .device_type = 0x0000'01A2,
         .from = From::connector,
         .watched = {.low = 100, .high = 2000},
         .response = {10ms, 80ms, 0, 0ms}},
    Kind{.name = "charger",
         .source = "CiA's page on CiA 419, beside that on batteries; here with a heartbeat that nobody can change",
         .device_type = 0x0000'01A3,
         .from = From::firmware,
         .watched = {.access = "const", .period = 500}},
    // ---- controllers and gateways
    Kind{.name = "PLC as a slave",
         .source =
             "Help page of a PLC's CANopen module, which gives slaves nearly ten seconds for an SDO answer; and pages "
             "of a slave library: node-ID from the project, boots with its program",
         .device_type = 0,
         .serial = Serial::zero,
         .from = From::firmware,
         .response = very_slow,
         .boot = 6s,
         .settings = true},
    Kind{.name = "gateway to another fieldbus",
         .source =
             "Manual of a gateway between a PLC's Ethernet fieldbus and CANopen: node-ID set from the other side, "
             "watched by heartbeat or guarding, errors told in 1001h and by emergency",
         .device_type = 0,
         .parts = 2,
         .serial = Serial::absent,
         .from = From::firmware,
         .watched = {.guards = true},
         .response = {20ms, 60ms, 0, 0ms},
         .emcy = true},
    // ---- boards on open stacks
    Kind{.name = "board on CANopenNode",
         .source =
             "Issues and examples of an open C stack on microcontrollers: LSS by Fastscan, serial number from the "
             "chip, answers from its main loop, memory written late",
         .device_type = 0,
         .speaks = scanned,
         .lss = {.habit = plant::Habit::canopennode, .without = {}},
         .watched = {.period = 1000}},
    Kind{.name = "board on Lely core",
         .source =
             "Sources and pages of an open C++ stack: Fastscan answered with a node-ID too, a first node-ID counts "
             "after NMT reset communication",
         .device_type = 0,
         .speaks = scanned,
         .lss = {.habit = plant::Habit::lely, .without = {}}},
    Kind{.name = "own board with little LSS",
         .source = "Reports of people who wrote an LSS slave of their own: selection, node-ID and store, no inquiries; "
                   "found by Fastscan",
         .device_type = 0,
         .speaks = scanned,
         .lss = {.habit = {},
                 .without = {Lackable::inquire_identity, Lackable::inquire_node_id, Lackable::bit_timing,
                             Lackable::activate}}},
    Kind{.name = "sensor that forgets",
         .source = "Reports on LSS store answered by an error where the memory is write-protected: told its node-ID at "
                   "each power-on",
         .device_type = 0x0001'0194,
         .speaks = scanned,
         .lss = {.habit = {}, .without = {}, .refuses_store = true}},
    Kind{.name = "sensor with everything",
         .source = "CiA 305 with Fastscan, and RAND, as this repository's papers want devices to be",
         .device_type = 0x0001'0194,
         .speaks = {Speaks::fastscan, Speaks::rand},
         .settings = true},
};

static_assert(table.size() >= 20);

}  // namespace

std::span<const Kind> kinds() noexcept { return table; }

const Kind* kind(std::string_view name) noexcept {
  const auto* const it = std::ranges::find(table, name, &Kind::name);
  return it == table.end() ? nullptr : it;
}

}  // namespace berth::field
