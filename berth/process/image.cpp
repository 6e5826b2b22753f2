#include "berth/process/image.hpp"

#include <cstdlib>
#include <new>

namespace berth::process {

NetworkSide::NetworkSide(std::uint8_t* memory, const Layout& layout, const ImageFormat& format, Clock clock)
    : layout_(&layout),
      values_at_(format.output_values_at()),
      outputs_(format.outputs(memory), format.outputs()),
      inputs_(format.inputs(memory), format.inputs()),
      clock_(clock) {}

void NetworkSide::publish() noexcept {
  ++head().number;
  if (clock_ != nullptr) head().monotonic_ns = clock_();
  outputs_.give();
}

OutputStatus* NetworkSide::status(std::uint32_t output) noexcept {
  if (output >= layout_->count(Direction::output)) return nullptr;
  return reinterpret_cast<OutputStatus*>(outputs_.work().data() + ImageFormat::status_at) + output;
}

void NetworkSide::received(std::uint32_t output, rt::Time at) noexcept {
  if (auto* const its = status(output)) *its = {at.time_since_epoch().count(), BERTH_GOOD, 0};
}

void NetworkSide::silent(std::uint32_t output) noexcept {
  if (auto* const its = status(output)) its->validity = BERTH_SILENT;
}

void NetworkSide::wait() noexcept {
  for (std::uint32_t i = 0; i < layout_->count(Direction::output); ++i) status(i)->validity = BERTH_WAITING;
}

berth_diagnosis& NetworkSide::diagnosis() noexcept {
  return *reinterpret_cast<berth_diagnosis*>(outputs_.work().data() + ImageFormat::diagnosis_at);
}

ApplicationSide::ApplicationSide(std::uint8_t* memory, const ImageFormat& format)
    : values_at_(format.output_values_at()),
      outputs_(format.outputs(memory), format.outputs()),
      inputs_(format.inputs(memory), format.inputs()) {}

const OutputStatus* ApplicationSide::status(std::uint32_t output) const noexcept {
  const auto block = outputs_.taken();
  const auto at = ImageFormat::status_at + output * sizeof(OutputStatus);
  if (at + sizeof(OutputStatus) > values_at_) return nullptr;
  return reinterpret_cast<const OutputStatus*>(block.data() + at);
}

berth_validity ApplicationSide::validity_of(std::uint32_t output) const noexcept {
  const auto* const its = status(output);
  return its == nullptr || its->validity > BERTH_SILENT ? BERTH_WAITING : static_cast<berth_validity>(its->validity);
}

std::optional<rt::Duration> ApplicationSide::age_of(std::uint32_t output) const noexcept {
  if (validity_of(output) == BERTH_WAITING) return std::nullopt;
  return rt::Duration(head().now_ns - status(output)->received_ns);
}

const berth_diagnosis& ApplicationSide::diagnosis() const noexcept {
  return *reinterpret_cast<const berth_diagnosis*>(outputs_.taken().data() + ImageFormat::diagnosis_at);
}

void Image::Free::operator()(std::uint8_t* memory) const noexcept { std::free(memory); }

Image::Memory Image::begun(const ImageFormat& format) {
  auto* const memory = static_cast<std::uint8_t*>(std::aligned_alloc(BlockLayout::line, format.size()));
  if (memory == nullptr) throw std::bad_alloc();
  std::memset(memory, 0, format.size());
  format.begin(memory);
  return Memory(memory);
}

Image::Image(const Layout& layout)
    : layout_(layout),
      format_(layout_),
      memory_(begun(format_)),
      network_(memory_.get(), layout_, format_),
      application_(memory_.get(), format_) {}

}  // namespace berth::process
