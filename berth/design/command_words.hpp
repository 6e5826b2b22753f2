/// The commands that a machine file may allow the nodes of a bus (`[bus.NAME.commands]`): the verbs of
/// berth/command/verbs.hpp, which is on a higher floor; tests/command compares the two.
#pragma once

#include <array>
#include <string_view>

namespace berth::design {

inline constexpr std::array<std::string_view, 51> command_words{"report",
                                                                "scan",
                                                                "bind",
                                                                "replace",
                                                                "forget",
                                                                "poll",
                                                                "locate",
                                                                "boot",
                                                                "configure",
                                                                "upload",
                                                                "backup save",
                                                                "backup compare",
                                                                "backup restore",
                                                                "sdo read",
                                                                "sdo write",
                                                                "sdo probe",
                                                                "sdo dump",
                                                                "note read",
                                                                "note write",
                                                                "note remove",
                                                                "sdo connect",
                                                                "sdo release",
                                                                "sdo channels",
                                                                "nmt",
                                                                "program status",
                                                                "program download",
                                                                "program start",
                                                                "program stop",
                                                                "program clear",
                                                                "emcy",
                                                                "store",
                                                                "restore",
                                                                "send",
                                                                "doctor",
                                                                "history",
                                                                "lss global",
                                                                "lss select",
                                                                "lss inquire",
                                                                "lss set-node-id",
                                                                "lss store",
                                                                "lss bit-timing",
                                                                "lss activate",
                                                                "lss identify",
                                                                "lss identify-unconfigured",
                                                                "lss find",
                                                                "lss move-bit-rate",
                                                                "world pause",
                                                                "world run",
                                                                "world step",
                                                                "world speed",
                                                                "world damage"};

}  // namespace berth::design
