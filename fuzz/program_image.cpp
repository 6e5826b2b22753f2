// Any bytes as the image of a program, in pieces as an SDO server gives them, into a device's program memory: what is
// valid afterwards is the content of a right image for this product, whole. The first byte says how long the pieces are.
#include <algorithm>
#include <cstdint>
#include <vector>

#include "berth/base/crc.hpp"
#include "berth/device/dictionary.hpp"
#include "berth/device/programs.hpp"
#include "fuzz/require.hpp"

namespace program_image_target {

namespace {

using namespace berth;
using namespace berth::device;
using fuzz::require;

constexpr TypeCode product{0x11, 0x33};
constexpr ProgramLayout layout{.count = 1, .images = 2, .longest = 2'048, .sector = 256};

struct Host final : Programs::Owner {
  void restart() noexcept override {}
  void answer(ObjectRef, od::AbortCode code) noexcept override { answered = code; }
  od::AbortCode answered = od::AbortCode::pending;
};

std::shared_ptr<const od::Description> fuzzed_description() {
  static const auto made = [] {
    od::DescriptionBuilder b;
    add_device(b);
    add_programs(b);
    return b.build();
  }();
  return made;
}

void settle(rt::Executor& executor) {
  for (auto next = executor.next(); next; next = executor.next()) executor.advance(*next);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::size_t piece = 1U + data[0] * 3U;
  const std::span image(data + 1, size - 1);
  rt::Executor executor;
  SimFlash flash(executor, ProgramMemory::footprint(layout), std::chrono::microseconds(10));
  od::Values values(fuzzed_description());
  Host host;
  Programs programs(executor, values, {.memory = &flash, .layout = layout}, product, host);
  programs.power_on();
  od::StreamUse use;
  od::Stream* const stream = values.stream({0x1F50, 1});
  require(stream != nullptr);
  auto code = use.open_write(*stream, {0x1F50, 1}, std::nullopt);
  for (std::size_t at = 0; at < image.size() && code == od::AbortCode::none; at += piece) {
    host.answered = od::AbortCode::pending;
    code = use.write(image.subspan(at, std::min(piece, image.size() - at)));
    if (code != od::AbortCode::pending) continue;
    settle(executor);
    code = host.answered;
  }
  const auto closed = use.close(code == od::AbortCode::none);
  settle(executor);
  programs.power_on();
  const auto& program = programs.memory().program(1);
  const auto head = read_program_head(image);
  const bool right = head && (head->type == product || head->type == TypeCode{}) && head->length > 0 &&
                     head->length <= layout.longest && image.size() == ProgramHead::size + head->length &&
                     crc32(image.subspan(ProgramHead::size)) == head->crc;
  require(program.valid == right);
  require(right == (code == od::AbortCode::none && closed == od::AbortCode::none));
  if (!right) return 0;
  std::vector<std::uint8_t> held(program.length);
  programs.memory().read(1, 0, held);
  require(std::ranges::equal(held, image.subspan(ProgramHead::size)));
  return 0;
}

}  // namespace program_image_target
