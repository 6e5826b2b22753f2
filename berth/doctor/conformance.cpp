#include "berth/doctor/conformance.hpp"

#include <fmt/format.h>

#include <algorithm>

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

rt::Task<Result<void>> examine(can::Dispatcher& dispatcher, const ConformanceOptions& options, Conformance& report) {
  if (!options.node.configured()) co_return fail(Errc::invalid, "an unconfigured node-ID cannot be asked");
  DeviceUnderTest device(dispatcher, options);
  Verdicts verdicts(device, report);
  co_await device.await_quiet();
  const unsigned others = device.others();
  const auto type = co_await device.read(0x1000, 0);
  if (type.silent && device.reachable()) co_return fail(Errc::timeout, "the device does not answer");
  CommunicationChecks communication(device, verdicts, options);
  co_await communication.mandatory();
  SdoChecks sdo(device, verdicts, options);
  co_await sdo.run();
  ObjectChecks objects(device, verdicts, options);
  co_await objects.run();
  co_await communication.optional();
  PdoChecks pdos(device, verdicts, options);
  co_await pdos.run();
  if (options.lasting) {
    co_await communication.consumer_entries();
    NmtChecks nmt(device, verdicts, options);
    co_await nmt.run();
  }
  if (!device.reachable()) co_return fail(*device.bus_error());
  if (device.others() > others) {
    verdicts.skip(
        "7.2.4.3", {}, "no other SDO client uses the node",
        fmt::format("another one sent {} SDO requests: some verdicts may be of its answers", device.others() - others));
  }
  co_return Result<void>();
}

// --- Verdicts --------------------------------------------------------------------------------------------------------

void Verdicts::add(std::string_view paragraph, ObjectRef object, std::string what, Verdict verdict, std::string told) {
  if (!device_->reachable()) return;  // nothing was judged
  report_->checks.push_back({paragraph, object, object.index != 0, std::move(what), verdict, std::move(told)});
}

void Verdicts::holds(std::string_view paragraph, ObjectRef object, std::string what, bool so, std::string told) {
  add(paragraph, object, std::move(what), so ? Verdict::passed : Verdict::failed, so ? std::string() : std::move(told));
}

void Verdicts::granted(std::string_view paragraph, ObjectRef object, std::string what, const AccessResult& told) {
  holds(paragraph, object, std::move(what), told.good(), told.words());
}

void Verdicts::refused(std::string_view paragraph, ObjectRef object, std::string what, const AccessResult& told,
                       const Codes& codes) {
  const bool so = !told.silent && told.problem.empty() && codes.has(told.code);
  holds(paragraph, object, fmt::format("{} is refused with {}", what, written(codes.any.front())), so, told.words());
}

void Verdicts::refused(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer,
                       const Codes& codes) {
  AccessResult told;
  told.silent = !answer;
  if (answer && answer->data[0] == 0x80) told.code = co::sdo::abort_code(*answer);
  refused(paragraph, ObjectRef{}, std::move(what), told, codes);
}

void Verdicts::silent(std::string_view paragraph, std::string what, const std::optional<can::Frame>& answer) {
  holds(paragraph, {}, std::move(what), !answer, answer ? "it answered " + can::to_string(*answer) : "");
}

void Verdicts::skip(std::string_view paragraph, ObjectRef object, std::string what, std::string why) {
  add(paragraph, object, std::move(what), Verdict::skipped, std::move(why));
}

// --- The description -------------------------------------------------------------------------------------------------

const od::SubObject* Described::find(std::uint16_t index, std::uint8_t sub) const noexcept {
  return description_ != nullptr ? description_->find(ObjectRef{index, sub}) : nullptr;
}

bool Described::has(std::uint16_t index) const noexcept {
  return description_ != nullptr && description_->find(index) != nullptr;
}

bool Described::settable(std::uint16_t index, std::uint8_t sub, std::size_t size) const noexcept {
  const auto* const found = find(index, sub);
  return found != nullptr && od::readable(found->access) && od::writable(found->access) &&
         od::byte_size(found->type) == size;
}

bool Described::leaves_out(std::uint16_t index, std::uint8_t sub, const AccessResult& told) const noexcept {
  const bool missing = told.code == od::AbortCode::no_object || told.code == od::AbortCode::no_sub_index;
  return missing && description_ != nullptr && find(index, sub) == nullptr;
}

// An index that the object dictionary's layout reserves.
std::uint16_t Described::absent() const noexcept {
  std::uint16_t index = 0x0FFF;
  while (has(index)) --index;
  return index;
}

bool Described::mappable(std::uint32_t entry) const noexcept {
  const auto* const sub = find(static_cast<std::uint16_t>(entry >> 16U), static_cast<std::uint8_t>(entry >> 8U));
  return sub != nullptr && sub->mappable;
}

// --- Checks ----------------------------------------------------------------------------------------------------------

rt::Task<void> Checks::must_refuse(std::uint16_t index, std::uint8_t sub, std::size_t size, std::uint64_t value,
                                   const Codes& codes, const char* what) {
  const auto before = co_await device_.read(index, sub);
  const auto told = co_await device_.write_number(index, sub, size, value);
  report_.refused(paragraph_of(index), {index, sub}, what, told, codes);
  if (told.good() && before.good()) co_await device_.write(index, sub, before.bytes);
}

}  // namespace berth::doctor
