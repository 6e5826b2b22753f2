/// Text for an error when one of Berth's frames stays in the queue: Berth is alone on the bus, or nothing receives the
/// frame.
#pragma once

namespace berth::can {

/// Four causes that the user can check, most likely first.
inline constexpr const char* no_acknowledge =
    "no device acknowledges what Berth sends: is the bit rate right, is the cable plugged in, do the devices have "
    "power, is the bus terminated?";

}  // namespace berth::can
