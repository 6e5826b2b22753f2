/// What an error says when a frame of Berth's stays in the queue: it stands alone there, or nothing hears it.
#pragma once

namespace berth::can {

/// The four causes that a person can look for, most likely first.
inline constexpr const char* no_acknowledge =
    "no device acknowledges what Berth sends: is the bit rate right, is the cable plugged in, do the devices have "
    "power, is the bus terminated?";

}  // namespace berth::can
