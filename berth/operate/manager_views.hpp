/// What Berth's own master shows of one slot in the objects of CiA 302-3 that are longer than a number, or made of
/// files: the slot's configuration and its program (docs/manager-objects.md).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "berth/manager/configuration.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// 1F20h: what was uploaded or written, else the file of `config =` where that is a DCF. Empty: there is none.
[[nodiscard]] std::string dcf_of(const Seat& seat);
/// 1F22h: all that the slot's device is configured with, links included, as a concise DCF in an order that devices
/// take. Empty: nothing is wanted, or it cannot be worked out.
[[nodiscard]] std::vector<std::uint8_t> concise_dcf_of(const Seat& seat);
/// 1F26h, 1F27h: what 1020h shall be; 0, 0: nothing is wanted, it was not worked out yet, or each
/// boot-up compares (`configure = "each-boot"`).
[[nodiscard]] manager::ConfigurationDate expected_date(const Seat& seat);
/// 1F55h: the identification that program 1 shall have (1F56h of the device); 0: any.
[[nodiscard]] std::uint32_t expected_program(const Seat& seat);
/// 1F58h: the image of program 1. Empty: there is none, or it cannot be read.
[[nodiscard]] std::vector<std::uint8_t> program_of(const Seat& seat);
/// 1016h (CiA 301 §7.5.2.13): node-ID in bits 16 to 22, the time after which the slot's device is absent in ms; 0: its
/// heartbeat is not watched.
[[nodiscard]] std::uint32_t consumer_of(const design::Timing& timing, const Seat& seat);

}  // namespace berth::operate
