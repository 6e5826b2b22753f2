/// The words of the plant file, in the order of their enumerations: reader and writer share them.
#pragma once

#include <array>
#include <string_view>

namespace berth::plant {

inline constexpr std::array<std::string_view, 5> source_words{"blank", "nonvolatile", "hard-coded", "switches",
                                                              "connector"};
inline constexpr std::array<std::string_view, 2> queue_words{"in-order", "priority"};
inline constexpr std::array<std::string_view, 11> speaks_words{
    "lss", "fastscan", "feedback-29", "feedback-11",        "rand", "rand-literal", "rand-resume",
    "and", "claim",    "negotiation", "negotiation-literal"};
inline constexpr std::array<std::string_view, 2> habit_words{"canopennode", "lely"};
inline constexpr std::array<std::string_view, 6> lackable_words{"select",   "inquire-identity", "inquire-node-id",
                                                                "identify", "bit-timing",       "activate"};
inline constexpr std::array<std::string_view, 2> lss_store_words{"kept", "refused"};
inline constexpr std::array<std::string_view, 4> identity_words{"vendor", "product", "revision", "serial"};
inline constexpr std::array<std::string_view, 4> reset_words{"never", "keeps", "forgets", "silent"};
inline constexpr std::array<std::string_view, 4> after_words{"start", "discovered", "bound", "operational"};
inline constexpr std::array<std::string_view, 14> action_words{
    "plug",      "unplug", "power-off", "power-on", "reset",      "deaf",        "slow",
    "cut-cable", "join",   "disturb",   "overrun",  "set-serial", "set-node-id", "recover"};
inline constexpr std::array<std::string_view, 3> disturbance_words{"flip", "dominant", "recessive"};

}  // namespace berth::plant
