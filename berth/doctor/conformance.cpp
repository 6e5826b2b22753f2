#include "berth/doctor/conformance.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "berth/base/bytes.hpp"
#include "berth/doctor/conformance_parts.hpp"

namespace berth::doctor {
namespace {

struct Place {
  std::uint16_t first;
  std::uint16_t last;
  std::string_view paragraph;
};
constexpr std::array<Place, 38> places{{
    {0x1000, 0x1000, "7.5.2.1"},  {0x1001, 0x1001, "7.5.2.2"},  {0x1002, 0x1002, "7.5.2.3"},
    {0x1003, 0x1003, "7.5.2.4"},  {0x1005, 0x1005, "7.5.2.5"},  {0x1006, 0x1006, "7.5.2.6"},
    {0x1007, 0x1007, "7.5.2.7"},  {0x1008, 0x1008, "7.5.2.8"},  {0x1009, 0x1009, "7.5.2.9"},
    {0x100A, 0x100A, "7.5.2.10"}, {0x100C, 0x100C, "7.5.2.11"}, {0x100D, 0x100D, "7.5.2.12"},
    {0x1010, 0x1010, "7.5.2.13"}, {0x1011, 0x1011, "7.5.2.14"}, {0x1012, 0x1012, "7.5.2.15"},
    {0x1013, 0x1013, "7.5.2.16"}, {0x1014, 0x1014, "7.5.2.17"}, {0x1015, 0x1015, "7.5.2.18"},
    {0x1016, 0x1016, "7.5.2.19"}, {0x1017, 0x1017, "7.5.2.20"}, {0x1018, 0x1018, "7.5.2.21"},
    {0x1019, 0x1019, "7.5.2.22"}, {0x1020, 0x1020, "7.5.2.23"}, {0x1021, 0x1021, "7.5.2.24"},
    {0x1022, 0x1022, "7.5.2.25"}, {0x1023, 0x1023, "7.5.2.26"}, {0x1024, 0x1024, "7.5.2.27"},
    {0x1025, 0x1025, "7.5.2.28"}, {0x1026, 0x1026, "7.5.2.29"}, {0x1027, 0x1027, "7.5.2.30"},
    {0x1028, 0x1028, "7.5.2.31"}, {0x1029, 0x1029, "7.5.2.32"}, {0x1200, 0x127F, "7.5.2.33"},
    {0x1280, 0x12FF, "7.5.2.34"}, {0x1400, 0x15FF, "7.5.2.35"}, {0x1600, 0x17FF, "7.5.2.36"},
    {0x1800, 0x19FF, "7.5.2.37"}, {0x1A00, 0x1BFF, "7.5.2.38"},
}};

std::string written(od::AbortCode code) {
  const auto raw = static_cast<std::uint32_t>(code);
  return fmt::format("{:04X} {:04X} ({})", raw >> 16U, raw & 0xFFFFU, od::text(code));
}

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

const char* name(Verdict verdict) noexcept {
  switch (verdict) {
    case Verdict::passed: return "passed";
    case Verdict::failed: return "failed";
    case Verdict::skipped: return "skipped";
  }
  return "unknown";
}

std::size_t Conformance::count(Verdict verdict) const noexcept {
  return static_cast<std::size_t>(std::ranges::count(checks, verdict, &Check::verdict));
}

std::string to_string(const Check& check) {
  const auto object =
      check.has_object ? fmt::format("{:04X}h:{:02X}", check.object.index, check.object.sub) : std::string();
  return fmt::format("§{:<11}{:<9} {}: {}{}{}", check.paragraph, object, check.what, name(check.verdict),
                     check.told.empty() ? "" : ": ", check.told);
}

std::string_view paragraph_of(std::uint16_t index) noexcept {
  const auto* const found = std::ranges::find_if(places, [&](auto p) { return index >= p.first && index <= p.last; });
  return found == places.end() ? "7.4" : found->paragraph;
}

std::uint64_t Told::number() const noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = std::min<std::size_t>(bytes.size(), 8); i-- > 0;) value = value << 8U | bytes[i];
  return value;
}

std::string Told::words() const {
  if (silent) return "no answer";
  if (!problem.empty()) return problem;
  return code == od::AbortCode::none ? "it was granted" : written(code);
}

rt::Task<Result<void>> examine(can::Dispatcher& dispatcher, const ConformanceOptions& options, Conformance& report) {
  if (!options.node.configured()) co_return fail(Errc::invalid, "an unconfigured node-ID cannot be asked");
  Examiner examiner(dispatcher, options, report);
  co_return co_await examiner.run();
}

Examiner::Examiner(can::Dispatcher& dispatcher, const ConformanceOptions& options, Conformance& report)
    : dispatcher_(&dispatcher),
      options_(&options),
      report_(&report),
      client_(dispatcher, sdo_options(options)),
      box_(dispatcher.executor()) {
  const std::uint32_t node = options.node.value();
  for (const std::uint32_t base : {0x580U, 0x700U, 0x080U}) dispatcher.add(can::only(base + node), *this);
  dispatcher.add(can::only(co::sync_id), *this);
}

Examiner::~Examiner() { dispatcher_->remove(*this); }

rt::Task<Result<void>> Examiner::run() {
  const auto type = co_await read(0x1000, 0);
  if (type.silent && !bus_error_) co_return fail(Errc::timeout, "the device does not answer");
  co_await mandatory();
  co_await sdo();
  co_await objects();
  co_await errors();
  co_await storage();
  co_await identifiers();
  co_await sync_objects();
  co_await default_channel();
  co_await pdos();
  if (options_->lasting) co_await consumer_entries();
  if (options_->lasting) co_await nmt();
  if (bus_error_) co_return fail(*bus_error_);
  co_return Result<void>();
}

// --- Asking ----------------------------------------------------------------------------------------------------------

namespace {

Told told_by(const Error& error) {
  Told told;
  if (error.code == Errc::aborted) {
    told.code = static_cast<od::AbortCode>(error.detail);
  } else if (error.code == Errc::timeout) {
    told.silent = true;
  } else {
    told.problem = describe(error);
  }
  return told;
}

}  // namespace

rt::Task<Told> Examiner::read(std::uint16_t index, std::uint8_t sub) {
  Told told;
  told.silent = true;
  if (bus_error_) co_return told;
  const auto value = co_await client_.upload(options_->node, index, sub);
  if (!value && value.error().code == Errc::bus) bus_error_ = value.error();
  if (!value) co_return told_by(value.error());
  told.silent = false;
  told.bytes.assign(value->bytes().begin(), value->bytes().end());
  co_return told;
}

rt::Task<Told> Examiner::read_by_block(std::uint16_t index, std::uint8_t sub, bool crc) {
  Told told;
  told.silent = true;
  if (bus_error_) co_return told;
  auto options = client_.options();
  options.mode = co::SdoMode::block;
  options.crc = crc;
  const auto value = co_await client_.upload(options_->node, index, sub, options);
  if (!value && value.error().code == Errc::bus) bus_error_ = value.error();
  if (!value) co_return told_by(value.error());
  told.silent = false;
  told.bytes.assign(value->bytes().begin(), value->bytes().end());
  co_return told;
}

rt::Task<Told> Examiner::write(std::uint16_t index, std::uint8_t sub, const Bytes& bytes) {
  Told told;
  told.silent = true;
  if (bus_error_) co_return told;
  const std::span<const std::uint8_t> data(bytes);
  const auto done = co_await client_.download(options_->node, index, sub, data);
  if (!done && done.error().code == Errc::bus) bus_error_ = done.error();
  if (!done) co_return told_by(done.error());
  told.silent = false;
  co_return told;
}

rt::Task<Told> Examiner::write_number(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value) {
  const auto bytes = little_endian(size, value);
  co_return co_await write(index, sub, bytes);
}

can::Frame Examiner::request(std::uint8_t command, std::uint16_t index, std::uint8_t sub,
                             std::uint32_t number) const noexcept {
  auto frame = co::sdo::make(co::sdo_request_id(options_->node), command, {index, sub});
  store_le(frame.data.data() + 4, number);
  return frame;
}

void Examiner::send(const can::Frame& frame) {
  if (bus_error_) return;
  if (dispatcher_->send(frame) != can::Queued::yes)
    bus_error_ = Error{.code = Errc::bus, .text = "a request could not be sent"};
}

rt::Task<std::optional<can::Frame>> Examiner::raw(can::Frame request) {
  box_.clear();
  send(request);
  co_return co_await hear(co::sdo_response_id(options_->node), options_->timeout);
}

rt::Task<std::optional<can::Frame>> Examiner::hear(std::uint32_t key, rt::Duration limit) {
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

void Examiner::received(const can::Frame& frame, rt::Time at) noexcept {
  if (!frame.remote) box_.push({frame, at});
}

// --- Judging ---------------------------------------------------------------------------------------------------------

void Examiner::add(std::string_view paragraph, ObjectRef object, std::string what, Verdict verdict, std::string told) {
  if (bus_error_) return;  // nothing was judged
  report_->checks.push_back({paragraph, object, object.index != 0, std::move(what), verdict, std::move(told)});
}

void Examiner::holds(std::string_view paragraph, ObjectRef object, std::string what, bool so, std::string told) {
  add(paragraph, object, std::move(what), so ? Verdict::passed : Verdict::failed, so ? std::string() : std::move(told));
}

void Examiner::granted(std::string_view paragraph, ObjectRef object, std::string what, const Told& told) {
  holds(paragraph, object, std::move(what), told.good(), told.words());
}

void Examiner::refused(std::string_view paragraph, ObjectRef object, std::string what, const Told& told,
                       const Codes& codes) {
  const bool so = !told.silent && told.problem.empty() && codes.has(told.code);
  holds(paragraph, object, fmt::format("{} is refused with {}", what, written(codes.any.front())), so, told.words());
}

void Examiner::refused(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer,
                       const Codes& codes) {
  Told told;
  told.silent = !answer;
  if (answer && answer->data[0] == 0x80) told.code = co::sdo::abort_code(*answer);
  refused(paragraph, ObjectRef{}, std::move(what), told, codes);
}

void Examiner::silent(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer) {
  holds(paragraph, {}, std::move(what), !answer, answer ? "it answered " + can::to_string(*answer) : "");
}

void Examiner::skip(std::string_view paragraph, ObjectRef object, std::string what, std::string why) {
  add(paragraph, object, std::move(what), Verdict::skipped, std::move(why));
}

rt::Task<void> Examiner::must_refuse(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value,
                                     const Codes& codes, const char* what) {
  const auto bytes = little_endian(size, value);
  co_await must_refuse_bytes(index, sub, bytes, codes, what);
}

rt::Task<void> Examiner::must_refuse_bytes(std::uint16_t index, std::uint8_t sub, const Bytes& bytes,
                                           const Codes& codes, const char* what) {
  const auto before = co_await read(index, sub);
  const auto told = co_await write(index, sub, bytes);
  refused(paragraph_of(index), {index, sub}, what, told, codes);
  if (told.good() && before.good()) co_await write(index, sub, before.bytes);
}

// --- The description -------------------------------------------------------------------------------------------------

const od::SubObject* Examiner::described(std::uint16_t index, std::uint8_t sub) const noexcept {
  return options_->description ? options_->description->find(ObjectRef{index, sub}) : nullptr;
}

bool Examiner::has(std::uint16_t index) const noexcept {
  return options_->description && options_->description->find(index) != nullptr;
}

bool Examiner::settable(std::uint16_t index, std::uint8_t sub, std::size_t size) const noexcept {
  const auto* const found = described(index, sub);
  return found != nullptr && od::readable(found->access) && od::writable(found->access) &&
         od::byte_size(found->type) == size;
}

bool Examiner::described_away(std::uint16_t index, std::uint8_t sub, const Told& told) const noexcept {
  const bool missing = told.code == od::AbortCode::no_object || told.code == od::AbortCode::no_sub_index;
  return missing && options_->description != nullptr && described(index, sub) == nullptr;
}

// Reserved in the layout of the object dictionary, so that no device has it.
std::uint16_t Examiner::absent() const noexcept {
  std::uint16_t index = 0x0FFF;
  while (has(index)) --index;
  return index;
}

}  // namespace berth::doctor
