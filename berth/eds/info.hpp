/// The sections about the file and the whole device. Internal to room `eds`.
#pragma once

#include "berth/eds/context.hpp"
#include "berth/eds/eds.hpp"

namespace berth::eds {

[[nodiscard]] FileInfo read_file_info(Context& context);
[[nodiscard]] DeviceInfo read_device_info(Context& context);
[[nodiscard]] std::optional<Commissioning> read_commissioning(Context& context);
/// [DummyUsage] as a mask: bit n = data type n may be mapped.
[[nodiscard]] std::uint32_t read_dummies(Context& context);
/// [Comments] or [MxComments]: the lines in the order of their numbers.
[[nodiscard]] std::vector<std::string> read_comments(Context& context, const Section& section);
[[nodiscard]] std::vector<Tool> read_tools(Context& context);
[[nodiscard]] std::vector<DynamicSegment> read_dynamic_segments(Context& context);
[[nodiscard]] std::vector<std::uint16_t> read_connected_modules(Context& context);
/// True for sections of CiA 306 other than those of objects.
[[nodiscard]] bool known_section(std::string_view name) noexcept;

}  // namespace berth::eds
