#include "berth/multilevel/hardware_version.hpp"

namespace berth::multilevel {

namespace {
constexpr std::uint16_t expected_object = od::paper3::expected_hardware;
}

void add_hardware_version(od::DescriptionBuilder& builder, std::uint32_t version) {
  builder.variable(
      hardware_version_object.index,
      {.name = "Hardware version", .access = od::Access::constant, .initial = od::Literal::number(version)});
}

void add_expected_hardware(od::DescriptionBuilder& builder, std::uint8_t most) {
  builder.object(expected_object, od::ObjectCode::array, "Expected hardware version");
  for (unsigned node = 1; node <= most; ++node) {
    builder.sub(expected_object, {.sub = static_cast<std::uint8_t>(node),
                                  .name = "Expected hardware version",
                                  .initial = od::Literal::number(0)});
  }
}

std::uint32_t expected_hardware(const od::Values& master, NodeId node) noexcept {
  return master.get_or<std::uint32_t>({expected_object, node.value()}, 0U);
}

rt::Task<Result<void>> check_hardware(co::SdoAccess& slave, std::uint32_t expected, bool literal) {
  if (expected == 0) co_return Result<void>();
  const ObjectRef object = literal ? literal_hardware_version_object : hardware_version_object;
  const auto version = co_await slave.read_u32(object.index, object.sub);
  if (!version) co_return fail(version.error());
  if (*version == expected) co_return Result<void>();
  co_return fail(Error{.code = Errc::mismatch,
                       .sub = object.sub,
                       .index = object.index,
                       .detail = *version,
                       .text = "its hardware version is not the expected one"});
}

}  // namespace berth::multilevel
