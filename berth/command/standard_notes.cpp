// The built-in notes: CiA 301, 302, 401 and 402, as in public descriptions and stacks. Sub-index 255 means every
// sub-index except 0.
#include <algorithm>
#include <array>
#include <span>

#include "berth/command/notes.hpp"

namespace berth::command {
namespace {

constexpr std::uint8_t each = 255;

struct Name {
  int number;
  const char* name;
};
using Names = std::span<const Name>;

struct Standard {
  std::uint16_t first;
  std::uint16_t last;
  std::uint8_t sub;
  const char* text;
  const char* unit = "";
  double scale = 1;
  Names values{};
  Names bits{};
};

constexpr std::array error_bits{Name{0, "generic error"}, Name{1, "current"},       Name{2, "voltage"},
                                Name{3, "temperature"},   Name{4, "communication"}, Name{5, "device profile"},
                                Name{7, "manufacturer"}};
constexpr std::array sync_bits{Name{30, "produces SYNC"}, Name{29, "29-bit identifier"}};
constexpr std::array time_bits{Name{31, "consumes TIME"}, Name{30, "produces TIME"}};
constexpr std::array invalid_bit{Name{31, "not valid"}};
constexpr std::array tpdo_bits{Name{31, "not valid"}, Name{30, "no remote request"}, Name{29, "29-bit identifier"}};
constexpr std::array behaviour{Name{0, "to pre-operational"}, Name{1, "no change"}, Name{2, "to stopped"}};
constexpr std::array types{Name{0, "synchronous, acyclic"},      Name{1, "each SYNC"},
                           Name{252, "on request, synchronous"}, Name{253, "on request"},
                           Name{254, "event, manufacturer"},     Name{255, "event, profile"}};
constexpr std::array startup_bits{Name{0, "NMT master"},
                                  Name{1, "starts all by one command"},
                                  Name{2, "does not start itself"},
                                  Name{3, "starts no slaves"},
                                  Name{4, "resets all after an error of a mandatory slave"},
                                  Name{5, "flying master"},
                                  Name{6, "stops all after an error of a mandatory slave"}};

constexpr std::array communication{
    Standard{0x1000, 0x1000, 0, "Lower word: device profile (CiA number); upper word: what the profile adds"},
    Standard{0x1001, 0x1001, 0, "Errors that are there now; also in each EMCY", "", 1, {}, error_bits},
    Standard{0x1003, 0x1003, 0, "Number of errors kept; writing 0 empties the list"},
    Standard{0x1003, 0x1003, each, "Lower word: error code of an EMCY, the newest first"},
    Standard{0x1005, 0x1005, 0, "Identifier of SYNC", "", 1, {}, sync_bits},
    Standard{0x1006, 0x1006, 0, "Time between two SYNCs; 0: none is produced", "µs"},
    Standard{0x1007, 0x1007, 0, "Synchronous PDOs are sent no later than this after SYNC; 0: no limit", "µs"},
    Standard{0x1008, 0x1008, 0, "The maker's name of the device"},
    Standard{0x1009, 0x1009, 0, "The maker's version of the hardware"},
    Standard{0x100A, 0x100A, 0, "The maker's version of the software"},
    Standard{0x100C, 0x100C, 0, "Time between two guarding requests of the master", "ms"},
    Standard{0x100D, 0x100D, 0, "So many guard times without a request are an error; 0: not watched"},
    Standard{0x1010, 0x1010, each, "Writing \"save\" (65766173h) stores these parameters"},
    Standard{0x1011, 0x1011, each, "Writing \"load\" (64616F6Ch) restores the defaults at the next reset"},
    Standard{0x1012, 0x1012, 0, "Identifier of TIME", "", 1, {}, time_bits},
    Standard{0x1014, 0x1014, 0, "Identifier of this device's EMCY", "", 1, {}, invalid_bit},
    Standard{0x1015, 0x1015, 0, "Shortest time between two EMCYs", "µs", 100},
    Standard{0x1016, 0x1016, each, "A heartbeat that is watched: bits 16 to 22 node-ID, lower word its time in ms"},
    Standard{0x1017, 0x1017, 0, "Time between two heartbeats; 0: none is sent", "ms"},
    Standard{0x1018, 0x1018, 1, "Maker's number, given by CiA"},
    Standard{0x1018, 0x1018, 2, "The maker's number of this type of device"},
    Standard{0x1018, 0x1018, 3, "Upper word: major, lower word: minor revision"},
    Standard{0x1018, 0x1018, 4, "Serial number of this device"},
    Standard{0x1019, 0x1019, 0, "Highest count in a SYNC; 0: SYNC has no counter"},
    Standard{0x1020, 0x1020, 1, "Day of the configuration; 0: not configured", "days since 1984-01-01"},
    Standard{0x1020, 0x1020, 2, "Time of the configuration; 0: not configured", "ms"},
    Standard{0x1029, 0x1029, each, "NMT state after an error of this class", "", 1, behaviour},
    Standard{0x1400, 0x15FF, 1, "Identifier of a received PDO", "", 1, {}, invalid_bit},
    Standard{0x1400, 0x15FF, 2, "When received values count: 0 to 240 at the next SYNC, 254 and 255 at once"},
    Standard{0x1400, 0x15FF, 5, "Longest time between two PDOs; later is an error; 0: not watched", "ms"},
    Standard{0x1600, 0x17FF, 0, "Number of mapped objects; 0 while the mapping is changed"},
    Standard{0x1600, 0x17FF, each, "A mapped object: bits 16 to 31 index, 8 to 15 sub-index, 0 to 7 length in bits"},
    Standard{0x1800, 0x19FF, 1, "Identifier of a sent PDO", "", 1, {}, tpdo_bits},
    Standard{0x1800, 0x19FF, 2, "When it is sent; 1 to 240: each so many SYNCs", "", 1, types},
    Standard{0x1800, 0x19FF, 3, "Shortest time between two PDOs", "µs", 100},
    Standard{0x1800, 0x19FF, 5, "Longest time between two PDOs; 0: only by events", "ms"},
    Standard{0x1800, 0x19FF, 6, "SYNC counter at which it begins; 0: the counter does not count"},
    Standard{0x1A00, 0x1BFF, 0, "Number of mapped objects; 0 while the mapping is changed"},
    Standard{0x1A00, 0x1BFF, each, "A mapped object: bits 16 to 31 index, 8 to 15 sub-index, 0 to 7 length in bits"},
    Standard{0x1F80, 0x1F80, 0, "What this device does as NMT master (CiA 302-2)", "", 1, {}, startup_bits},
    Standard{0x1F89, 0x1F89, 0, "Longest boot-up of mandatory slaves; 0: no limit", "ms"},
};

constexpr std::array io{
    Standard{0x6000, 0x6000, each, "Digital inputs, 8 a byte"},
    Standard{0x6002, 0x6002, each, "Digital inputs: a 1 inverts the input"},
    Standard{0x6005, 0x6005, 0, "Digital inputs send their PDO when they change"},
    Standard{0x6006, 0x6006, each, "Digital inputs: a 1 lets any change of the input send the PDO"},
    Standard{0x6200, 0x6200, each, "Digital outputs, 8 a byte"},
    Standard{0x6202, 0x6202, each, "Digital outputs: a 1 inverts the output"},
    Standard{0x6206, 0x6206, each, "Digital outputs: a 1 lets the output take its value of 6207h after an error"},
    Standard{0x6207, 0x6207, each, "Digital outputs: their values after an error, where 6206h says so"},
    Standard{0x6401, 0x6401, each, "Analogue inputs, 16 bits"},
    Standard{0x6411, 0x6411, each, "Analogue outputs, 16 bits"},
    Standard{0x6423, 0x6423, 0, "Analogue inputs send their PDO by themselves"},
    Standard{0x6424, 0x6424, each, "Analogue inputs: at this value and above the PDO is sent"},
    Standard{0x6425, 0x6425, each, "Analogue inputs: below this value the PDO is sent"},
    Standard{0x6426, 0x6426, each, "Analogue inputs: a change of this size sends the PDO"},
    Standard{0x6443, 0x6443, each, "Analogue outputs: 1 lets the output take its value of 6444h after an error"},
    Standard{0x6444, 0x6444, each, "Analogue outputs: their values after an error, where 6443h says so"},
};

constexpr std::array control_bits{Name{0, "switch on"},        Name{1, "enable voltage"}, Name{2, "no quick stop"},
                                  Name{3, "enable operation"}, Name{7, "fault reset"},    Name{8, "halt"}};
constexpr std::array status_bits{Name{0, "ready to switch on"},
                                 Name{1, "switched on"},
                                 Name{2, "operation enabled"},
                                 Name{3, "fault"},
                                 Name{4, "voltage enabled"},
                                 Name{5, "no quick stop"},
                                 Name{6, "switch on disabled"},
                                 Name{7, "warning"},
                                 Name{9, "remote"},
                                 Name{10, "target reached"},
                                 Name{11, "internal limit active"}};
constexpr std::array modes{Name{0, "none"},
                           Name{1, "profile position"},
                           Name{2, "velocity"},
                           Name{3, "profile velocity"},
                           Name{4, "torque"},
                           Name{6, "homing"},
                           Name{7, "interpolated position"},
                           Name{8, "cyclic synchronous position"},
                           Name{9, "cyclic synchronous velocity"},
                           Name{10, "cyclic synchronous torque"}};
constexpr std::array mode_bits{Name{0, "profile position"},
                               Name{1, "velocity"},
                               Name{2, "profile velocity"},
                               Name{3, "torque"},
                               Name{5, "homing"},
                               Name{6, "interpolated position"},
                               Name{7, "cyclic synchronous position"},
                               Name{8, "cyclic synchronous velocity"},
                               Name{9, "cyclic synchronous torque"}};

constexpr std::array drives{
    Standard{0x603F, 0x603F, 0, "Error code of the last EMCY"},
    Standard{0x6040, 0x6040, 0, "Command to the drive's state machine", "", 1, {}, control_bits},
    Standard{0x6041, 0x6041, 0, "State of the drive", "", 1, {}, status_bits},
    Standard{0x6060, 0x6060, 0, "Mode of operation that is wanted", "", 1, modes},
    Standard{0x6061, 0x6061, 0, "Mode of operation that is active", "", 1, modes},
    Standard{0x6062, 0x6062, 0, "Position that the control loop wants, in position units"},
    Standard{0x6063, 0x6063, 0, "Position of the encoder, in increments"},
    Standard{0x6064, 0x6064, 0, "Position, in position units"},
    Standard{0x6065, 0x6065, 0, "Following error that is allowed, in position units"},
    Standard{0x6067, 0x6067, 0, "Distance from the target that counts as reached, in position units"},
    Standard{0x606B, 0x606B, 0, "Velocity that the control loop wants"},
    Standard{0x606C, 0x606C, 0, "Velocity"},
    Standard{0x6071, 0x6071, 0, "Torque that is wanted", "% of rated torque", 0.1},
    Standard{0x6072, 0x6072, 0, "Highest torque", "% of rated torque", 0.1},
    Standard{0x6073, 0x6073, 0, "Highest current", "% of rated current", 0.1},
    Standard{0x6075, 0x6075, 0, "Rated current of the motor", "A", 0.001},
    Standard{0x6076, 0x6076, 0, "Rated torque of the motor", "Nm", 0.001},
    Standard{0x6077, 0x6077, 0, "Torque", "% of rated torque", 0.1},
    Standard{0x6078, 0x6078, 0, "Current", "% of rated current", 0.1},
    Standard{0x6079, 0x6079, 0, "Voltage of the DC link", "V", 0.001},
    Standard{0x607A, 0x607A, 0, "Position that is wanted, in position units"},
    Standard{0x607C, 0x607C, 0, "Distance between home position and zero, in position units"},
    Standard{0x607D, 0x607D, 1, "Lowest position that is allowed"},
    Standard{0x607D, 0x607D, 2, "Highest position that is allowed"},
    Standard{0x6081, 0x6081, 0, "Velocity of a positioning"},
    Standard{0x6083, 0x6083, 0, "Acceleration of a positioning"},
    Standard{0x6084, 0x6084, 0, "Deceleration of a positioning"},
    Standard{0x6085, 0x6085, 0, "Deceleration of a quick stop"},
    Standard{0x6098, 0x6098, 0, "How the home position is found"},
    Standard{0x6099, 0x6099, 1, "Velocity while the switch is looked for"},
    Standard{0x6099, 0x6099, 2, "Velocity while zero is looked for"},
    Standard{0x60F4, 0x60F4, 0, "Following error, in position units"},
    Standard{0x60FF, 0x60FF, 0, "Velocity that is wanted"},
    Standard{0x6502, 0x6502, 0, "Modes of operation that the drive has", "", 1, {}, mode_bits},
};

Note made(const Standard& standard) {
  Note note{standard.text, standard.unit, standard.scale};
  for (const auto& [number, name] : standard.values) note.values[number] = name;
  for (const auto& [number, name] : standard.bits) note.bits[static_cast<unsigned>(number)] = name;
  return note;
}

Note found(std::span<const Standard> all, ObjectRef object) {
  const auto holds = [object](const Standard& s) {
    const bool here = s.first <= object.index && object.index <= s.last;
    return here && (s.sub == object.sub || (s.sub == each && object.sub != 0));
  };
  const auto it = std::ranges::find_if(all, holds);
  return it == all.end() ? Note() : made(*it);
}

}  // namespace

Note standard_note(std::uint16_t profile, ObjectRef object) {
  constexpr std::uint16_t of_io = 401;
  constexpr std::uint16_t of_drives = 402;
  if (object.index < 0x2000) return found(communication, object);
  if (profile == of_io) return found(io, object);
  return profile == of_drives ? found(drives, object) : Note();
}

}  // namespace berth::command
