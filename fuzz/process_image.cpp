// The memory of a process image, which another process writes: what is understood lies within it, whatever the words
// between the sides hold. The first bytes of a good image are replaced by the data.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "berth/process/image.hpp"
#include "fuzz/require.hpp"

namespace process_image_target {

namespace {

using namespace berth;

std::vector<std::uint64_t> good_image(std::size_t& bytes) {
  process::Layout layout;
  static_cast<void>(layout.output<std::uint16_t>("level"));
  static_cast<void>(layout.input<bool>("motor"));
  static_cast<void>(layout.declare_at("far", od::DataType::unsigned24, process::Direction::output, 5000));
  const process::ImageFormat format(layout);
  bytes = format.size();
  std::vector<std::uint64_t> memory((bytes + 7) / 8);
  format.begin(reinterpret_cast<std::uint8_t*>(memory.data()));
  return memory;
}

void use(std::uint8_t* memory, const process::Layout& layout, const process::ImageFormat& format) {
  process::NetworkSide network(memory, layout, format);
  process::ApplicationSide application(memory, format);
  for (int i = 0; i < 4; ++i) {
    network.publish();
    application.refresh();
    std::uint32_t sum = 0;
    for (const auto byte : application.outputs()) sum += byte;
    for (std::uint32_t output = 0; output < layout.count(process::Direction::output); ++output) {
      sum += application.validity_of(output) + (application.age_of(output) ? 1U : 0U);
    }
    std::ranges::fill(application.inputs(), static_cast<std::uint8_t>(sum));
    application.commit();
    network.take();
    for (const auto byte : network.inputs()) sum += byte;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static std::size_t bytes = 0;
  static const auto good = good_image(bytes);
  auto memory = good;
  auto* const begin = reinterpret_cast<std::uint8_t*>(memory.data());
  std::copy_n(data, std::min(size, bytes), begin);
  const auto layout = process::read_layout({begin, bytes});
  if (!layout) return 0;
  const process::ImageFormat format(*layout);
  berth::fuzz::require(format.size() == bytes);
  use(begin, *layout, format);
  return 0;
}

}  // namespace process_image_target
