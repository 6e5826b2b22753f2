/// CAN-IDs in JSON.
#pragma once

#include <cstdint>
#include <string>

#include "berth/can/frame.hpp"
#include "berth/command/reply.hpp"

namespace berth::command {

/// A CAN-ID by its `can::Frame::key`, in the form of every JSON of the command line: "0x181", with eight digits if it
/// has 29 bits.
[[nodiscard]] inline std::string can_id_text(std::uint32_t key) {
  return hex(key & ~can::extended_flag, (key & can::extended_flag) != 0 ? 8 : 3);
}

}  // namespace berth::command
