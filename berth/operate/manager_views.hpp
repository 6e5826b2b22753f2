/// Berth's own master shows one slot's configuration and program in objects of CiA 302-3. These views are longer than a
/// number, or made of files (docs/manager-objects.md).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "berth/manager/configuration.hpp"
#include "berth/operate/slot_table.hpp"

namespace berth::operate {

/// 1F20h: what was uploaded or written, else the file of `config =` if that is a DCF. Empty: there is none.
[[nodiscard]] std::string dcf_of(const Seat& seat);
/// 1F22h: the whole configuration of the slot's device, links included, as a concise DCF in an order that devices
/// accept. Empty: nothing is wanted, or it cannot be computed.
[[nodiscard]] std::vector<std::uint8_t> concise_dcf_of(const Seat& seat);
/// 1F26h, 1F27h: the expected 1020h. 0, 0: nothing is wanted, it was not computed yet, or each boot-up compares
/// (`configure = "each-boot"`).
[[nodiscard]] manager::ConfigurationDate expected_date(const Seat& seat);
/// 1F55h: the expected identification of program 1 (1F56h of the device); 0: any.
[[nodiscard]] std::uint32_t expected_program(const Seat& seat);
/// 1F58h: the image of program 1. Empty: there is none, or it cannot be read.
[[nodiscard]] std::vector<std::uint8_t> program_of(const Seat& seat);
/// 1016h (CiA 301 §7.5.2.13): node-ID in bits 16 to 22, the time after which the slot's device is absent in ms; 0: its
/// heartbeat is not watched.
[[nodiscard]] std::uint32_t consumer_of(const design::Timing& timing, const Seat& seat);

}  // namespace berth::operate
