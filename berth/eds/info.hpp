/// The sections about the file and the device as a whole. Inside of room `eds` only.
#pragma once

#include "berth/eds/context.hpp"
#include "berth/eds/eds.hpp"

namespace berth::eds {

[[nodiscard]] FileInfo read_file_info(Context& context);
[[nodiscard]] DeviceInfo read_device_info(Context& context);
[[nodiscard]] std::optional<Commissioning> read_commissioning(Context& context);
/// [DummyUsage] as a mask: bit n = data type n may be mapped.
[[nodiscard]] std::uint32_t read_dummies(Context& context);
/// True for sections that CiA 306 knows beside those of objects; modules are known and not expanded.
[[nodiscard]] bool known_section(std::string_view name) noexcept;
[[nodiscard]] bool module_section(std::string_view name) noexcept;

}  // namespace berth::eds
