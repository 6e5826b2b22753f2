#include "berth/process/device_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "berth/od/notation.hpp"

namespace berth::process {

DeviceImage::DeviceImage(device::Device& device, rt::Executor& executor, Image& image, std::span<const Bound> bound,
                         rt::Duration cycle)
    : device_(&device), executor_(&executor), image_(&image), cycle_(cycle) {
  for (const auto& one : bound) bind(one);
  if (cycle_ > rt::Duration::zero()) executor.after(cycle_, *this);
}

void DeviceImage::bind(const Bound& bound) {
  const auto* const variable = image_->layout().find(bound.variable);
  const auto* const sub = device_->values().description().find(bound.object);
  const auto object = od::write_object(bound.object);
  if (variable == nullptr) {
    problems_.push_back(fmt::format("\"{}\" is no variable of the image; declare it", bound.variable));
  } else if (sub == nullptr) {
    problems_.push_back(fmt::format("\"{}\": the device has no object {}", bound.variable, object));
  } else if (sub->type != variable->type) {
    problems_.push_back(fmt::format("\"{}\" is {}, {} is {}; declare it so", bound.variable, od::name(variable->type),
                                    object, od::name(sub->type)));
  } else {
    const Line line{bound.object, device_->values().scalar(*sub), variable->offset,
                    static_cast<std::uint32_t>(od::byte_size(sub->type))};
    if (variable->direction == Direction::input) return inputs_.push_back(line);
    outputs_.push_back(line);
    // Behind the work of this instant: all frames of it are one publication.
    device_->on_write(bound.object, [this] { executor_->post(publish_, rt::Rank::medium); });
  }
}

void DeviceImage::run() noexcept {
  executor_->after(cycle_, *this);
  take();
}

void DeviceImage::exchange() noexcept {
  publish();
  take();
}

void DeviceImage::publish() noexcept {
  const auto image = image_->network().outputs();
  for (const auto& line : outputs_) std::memcpy(image.data() + line.offset, line.from, line.size);
  image_->network().publish();
}

void DeviceImage::take() noexcept {
  if (!image_->network().take()) return;
  const auto image = image_->network().inputs();
  for (const auto& line : inputs_) {
    const auto value = image.subspan(line.offset, line.size);
    if (std::equal(value.begin(), value.end(), line.from)) continue;
    if (device_->values().set_bytes(line.object, value) == od::AbortCode::none)
      device_->services().changed(line.object);
  }
}

}  // namespace berth::process
