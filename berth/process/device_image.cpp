#include "berth/process/device_image.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <utility>

#include "berth/co/pdo_records.hpp"
#include "berth/od/notation.hpp"

namespace berth::process {

DeviceImage::DeviceImage(device::Device& device, rt::Executor& executor, NetworkSide& image,
                         std::span<const Bound> bound, const Options& options)
    : device_(&device),
      executor_(&executor),
      image_(&image),
      options_(options),
      diagnosis_(device, image.diagnosis(), options.port) {
  began_.fill(rt::never);
  for (const auto& one : bound) bind(one);
  listen();
  if (options_.cycle > rt::Duration::zero()) executor.after(options_.cycle, *this);
}

void DeviceImage::bind(const Bound& bound) {
  const auto* const variable = image_->layout().find(bound.variable);
  const auto* const sub = device_->values().description().find(bound.object);
  const auto object = od::write_object(bound.object);
  if (variable == nullptr) {
    problems_.push_back(fmt::format("\"{}\" is not a variable of the image; declare it", bound.variable));
  } else if (sub == nullptr) {
    problems_.push_back(fmt::format("\"{}\": the device has no object {}", bound.variable, object));
  } else if (sub->type != variable->type) {
    problems_.push_back(fmt::format("\"{}\" is {}, {} is {}; declare it so", bound.variable, od::name(variable->type),
                                    object, od::name(sub->type)));
  } else {
    const Line line{bound.object, device_->values().scalar(*sub), variable->offset,
                    static_cast<std::uint32_t>(od::byte_size(sub->type)), variable->number};
    if (variable->direction == Direction::input) return inputs_.push_back(line);
    outputs_.push_back(line);
    // Runs after the work of this instant: all its frames make one publication.
    device_->on_write(bound.object, [this, number = line.number] { received(number); });
  }
}

void DeviceImage::received(std::uint32_t output) noexcept {
  if (first_ == rt::never) first_ = executor_->now();
  image_->received(output, executor_->now());
  executor_->post(publish_, rt::Rank::medium);
}

void DeviceImage::listen() {
  auto& on = device_->on();
  on.rpdo_silent = [this, before = std::move(on.rpdo_silent)](unsigned rpdo) {
    if (before) before(rpdo);
    silent(rpdo);
  };
  // A reset ends all errors. Errors that persist are reported anew.
  on.parameters = [this, before = std::move(on.parameters)] {
    if (before) before();
    error_ = 0;
    lost_ = false;
  };
  on.state = [this, before = std::move(on.state)](NmtState state) {
    if (before) before(state);
    image_->wait();
    executor_->post(publish_, rt::Rank::medium);
  };
}

void DeviceImage::run() noexcept {
  executor_->after(options_.cycle, *this);
  exchange();
}

void DeviceImage::exchange() noexcept {
  publish();
  take();
}

void DeviceImage::publish() noexcept {
  const auto image = image_->outputs();
  for (const auto& line : outputs_) std::memcpy(image.data() + line.offset, line.from, line.size);
  image_->set_now(executor_->now());
  diagnosis_.refresh();
  image_->publish();
  began_[image_->number() % began_.size()] = std::exchange(first_, rt::never);
}

void DeviceImage::take() noexcept {
  if (!image_->take()) return supervise();
  committed_ = executor_->now();
  if (std::exchange(lost_, false)) device_->errors().clear(application_lost);
  const auto image = image_->inputs();
  for (const auto& line : inputs_) write(line, image.subspan(line.offset, line.size));
  tell_error();
  react();
}

void DeviceImage::tell_error() noexcept {
  const auto& said = image_->said();
  if (said.error_code == error_) return;
  if (error_ != 0) device_->errors().clear(error_);
  error_ = said.error_code;
  if (error_ != 0) device_->errors().raise(error_, said.error_register);
}

void DeviceImage::react() noexcept {
  const auto now = image_->number();
  const auto seen = std::min(image_->said().seen, now);
  auto from = std::max(seen_, now < began_.size() ? 0 : now - began_.size()) + 1;
  seen_ = seen;
  auto first = rt::never;
  for (; from <= seen; ++from) first = std::min(first, began_[from % began_.size()]);
  if (first == rt::never) return;
  const auto took = executor_->now() - first;
  reactions_.shortest = reactions_.count == 0 ? took : std::min(reactions_.shortest, took);
  reactions_.longest = std::max(reactions_.longest, took);
  reactions_.sum += took;
  ++reactions_.count;
}

void DeviceImage::write(const Line& line, std::span<const std::uint8_t> value) noexcept {
  if (std::equal(value.begin(), value.end(), line.from)) return;
  if (device_->values().set_bytes(line.object, value) == od::AbortCode::none) device_->services().changed(line.object);
}

void DeviceImage::supervise() noexcept {
  if (options_.application_timeout == rt::Duration::zero() || committed_ == rt::never || lost_) return;
  if (executor_->now() - committed_ <= options_.application_timeout) return;
  lost_ = true;
  device_->errors().raise(application_lost, co::error_register::generic);
  if (error_ != 0) device_->errors().clear(std::exchange(error_, std::uint16_t{0}));
  if (options_.hold) return;
  constexpr std::array<std::uint8_t, 8> zero{};
  for (const auto& line : inputs_) write(line, std::span(zero).first(line.size));
}

void DeviceImage::silent(unsigned rpdo) noexcept {
  const auto mapping = co::mapping_index(co::PdoKind::rpdo, rpdo);
  const auto& values = device_->values();
  const auto count = values.get_or<std::uint8_t>({mapping, 0}, 0);
  for (unsigned sub = 1; sub <= count && sub <= co::PdoMapping::most_entries; ++sub) {
    const auto raw = values.get_or<std::uint32_t>({mapping, static_cast<std::uint8_t>(sub)}, 0);
    const auto line = std::ranges::find(outputs_, co::PdoEntry::of(raw).object, &Line::object);
    if (line != outputs_.end()) image_->silent(line->number);
  }
  executor_->post(publish_, rt::Rank::medium);
}

}  // namespace berth::process
