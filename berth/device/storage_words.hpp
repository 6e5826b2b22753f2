/// Explains why 1010h and 1011h of a device report another capability than its description: they report what this
/// device does (CiA 301 §7.5.2.13: bit 0 on command, bit 1 by itself), whatever its file says.
#pragma once

#include <string>
#include <vector>

#include "berth/device/device.hpp"

namespace berth::device {

/// A sentence for each sub-index that differs: "1010h:01 tells 1h, its description 3h: it stores on command and not by
/// itself". Empty: none differs, or there is no such object.
[[nodiscard]] std::vector<std::string> storage_words(const Device& device);

}  // namespace berth::device
