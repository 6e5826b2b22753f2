// The device under test: its questions and results.
#include <fmt/format.h>

#include <algorithm>

#include "berth/base/bytes.hpp"
#include "berth/doctor/conformance_parts.hpp"

namespace berth::doctor {
namespace {

Bytes little_endian(std::size_t size, std::uint64_t value) {
  Bytes bytes(size);
  for (std::size_t i = 0; i < std::min<std::size_t>(size, 8); ++i) bytes[i] = static_cast<std::uint8_t>(value >> 8 * i);
  return bytes;
}

co::SdoOptions sdo_options(const ConformanceOptions& options) {
  co::SdoOptions made;
  made.timeout = options.timeout;
  made.longest = 1U << 20U;
  made.fall_back = false;
  return made;
}

}  // namespace

std::string written(od::AbortCode code) {
  const auto raw = static_cast<std::uint32_t>(code);
  return fmt::format("{:04X} {:04X} ({})", raw >> 16U, raw & 0xFFFFU, od::text(code));
}

std::uint64_t AccessResult::number() const noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = std::min<std::size_t>(bytes.size(), 8); i-- > 0;) value = value << 8U | bytes[i];
  return value;
}

std::string AccessResult::words() const {
  if (silent) return "no answer";
  if (!problem.empty()) return problem;
  return code == od::AbortCode::none ? "it was granted" : written(code);
}

DeviceUnderTest::DeviceUnderTest(can::Dispatcher& dispatcher, const ConformanceOptions& options)
    : dispatcher_(&dispatcher),
      node_(options.node),
      timeout_(options.timeout),
      client_(dispatcher, sdo_options(options)),
      box_(dispatcher.executor()) {
  const std::uint32_t node = options.node.value();
  for (const std::uint32_t base : {0x580U, 0x700U, 0x080U}) dispatcher.add(can::only(base + node), *this);
  dispatcher.add(can::only(co::sync_id), *this);
  dispatcher.add(can::only(co::sdo_request_id(options.node)), *this);
}

DeviceUnderTest::~DeviceUnderTest() { dispatcher_->remove(*this); }

rt::Task<void> DeviceUnderTest::await_quiet() {
  constexpr auto quiet = std::chrono::milliseconds(1500);
  constexpr auto longest = std::chrono::seconds(10);
  const rt::Time began = now();
  others_at_ = began;
  while (now() < others_at_ + quiet && now() < began + longest) co_await rt::sleep_until(others_at_ + quiet);
}

AccessResult DeviceUnderTest::told_by(const Error& error) {
  if (error.code == Errc::bus) bus_error_ = error;
  AccessResult told;
  if (error.code == Errc::aborted) {
    told.code = static_cast<od::AbortCode>(error.detail);
  } else if (error.code == Errc::timeout) {
    told.silent = true;
  } else {
    told.problem = describe(error);
  }
  return told;
}

rt::Task<AccessResult> DeviceUnderTest::read(std::uint16_t index, std::uint8_t sub) {
  AccessResult told;
  told.silent = true;
  if (bus_error_) co_return told;
  const auto value = co_await client_.upload(node_, index, sub);
  if (!value) co_return told_by(value.error());
  told.silent = false;
  told.bytes.assign(value->bytes().begin(), value->bytes().end());
  co_return told;
}

rt::Task<AccessResult> DeviceUnderTest::read_by_block(std::uint16_t index, std::uint8_t sub, bool crc) {
  AccessResult told;
  told.silent = true;
  if (bus_error_) co_return told;
  auto options = client_.options();
  options.mode = co::SdoMode::block;
  options.crc = crc;
  const auto value = co_await client_.upload(node_, index, sub, options);
  if (!value) co_return told_by(value.error());
  told.silent = false;
  told.bytes.assign(value->bytes().begin(), value->bytes().end());
  co_return told;
}

rt::Task<AccessResult> DeviceUnderTest::write(std::uint16_t index, std::uint8_t sub, const Bytes& bytes) {
  AccessResult told;
  told.silent = true;
  if (bus_error_) co_return told;
  const std::span<const std::uint8_t> data(bytes);
  const auto done = co_await client_.download(node_, index, sub, data);
  if (!done) co_return told_by(done.error());
  told.silent = false;
  co_return told;
}

rt::Task<AccessResult> DeviceUnderTest::write_number(std::uint16_t index, std::uint8_t sub, std::size_t size,
                                                     std::uint64_t value) {
  const auto bytes = little_endian(size, value);
  co_return co_await write(index, sub, bytes);
}

can::Frame DeviceUnderTest::request(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                                    std::uint32_t number) const noexcept {
  auto frame = co::sdo::make(co::sdo_request_id(node_), command, {index, sub});
  store_le(frame.data.data() + 4, number);
  return frame;
}

void DeviceUnderTest::send(const can::Frame& frame) {
  if (bus_error_) return;
  if (dispatcher_->send(frame) != can::Queued::yes)
    bus_error_ = Error{.code = Errc::bus, .text = "a request could not be sent"};
}

rt::Task<std::optional<can::Frame>> DeviceUnderTest::raw(can::Frame request) {
  box_.clear();
  send(request);
  co_return co_await hear(co::sdo_response_id(node_), timeout_);
}

rt::Task<std::optional<can::Frame>> DeviceUnderTest::raw_undisturbed(can::Frame request) {
  constexpr unsigned most = 3;
  std::optional<can::Frame> answer;
  for (unsigned i = 0; i < most; ++i) {
    const unsigned before = others_;
    answer = co_await raw(request);
    if (others_ == before) break;
    co_await await_quiet();
  }
  co_return answer;
}

rt::Task<std::optional<can::Frame>> DeviceUnderTest::hear(std::uint32_t key, rt::Duration limit) {
  const auto until = dispatcher_->executor().now() + limit;
  while (!bus_error_) {
    const auto heard = co_await box_.next(until);
    if (!heard) break;
    if (heard->frame.key() != key) continue;
    heard_at_ = heard->at;
    co_return heard->frame;
  }
  co_return std::nullopt;
}

void DeviceUnderTest::received(const can::Frame& frame, rt::Time at) noexcept {
  if (frame.id == co::sdo_request_id(node_)) {
    others_at_ = at;
    ++others_;
  } else if (!frame.remote) {
    box_.push({frame, at});
  }
}

}  // namespace berth::doctor
