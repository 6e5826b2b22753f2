// SDO services: CiA 301 §7.2.4.3.
#include "berth/base/bytes.hpp"
#include "berth/doctor/conformance_parts.hpp"

namespace berth::doctor {
namespace {

constexpr std::string_view abort_codes = "7.2.4.3.17", protocol = "7.2.4.3", upload = "7.2.4.3.6",
                           segments = "7.2.4.3.7", download_segments = "7.2.4.3.4", blocks = "7.2.4.3.13";
constexpr std::size_t expedited = 4;

constexpr std::uint8_t initiate_upload = 0x40, upload_segment = 0x60, toggle = 0x10, client_abort = 0x80,
                       initiate_block_upload = 0xA0, unknown = 0xE0;

bool is_abort(const std::optional<can::Frame>& frame, od::AbortCode code) noexcept {
  return frame && frame->data[0] == client_abort && co::sdo::abort_code(*frame) == code;
}

std::string answer_text(const std::optional<can::Frame>& frame) { return frame ? can::to_string(*frame) : "no answer"; }

}  // namespace

rt::Task<void> SdoChecks::run() {
  co_await refusals();
  co_await commands();
  const auto type = co_await device_.read(0x1000, 0);
  if (!described_.leaves_out(0x1000, 0, type)) co_await device_type();
  const auto found = co_await long_object();
  if (!found) {
    report_.skip(segments, {}, "a segmented upload",
                 "the device has no object of more than four bytes that can be read");
  } else {
    co_await segmented_upload(found->index, found->sub);
    co_await block_transfer(found->index, found->sub);
  }
  co_await download_toggle();
}

rt::Task<void> SdoChecks::refusals() {
  const auto nothing = described_.absent();
  const auto no_read = co_await device_.read(nothing, 0);
  report_.refused(abort_codes, {nothing, 0}, "an upload of an object that does not exist", no_read, codes::no_object);
  const auto no_write = co_await device_.write_number(nothing, 0, 4, 0);
  report_.refused(abort_codes, {nothing, 0}, "a download to an object that does not exist", no_write, codes::no_object);
  const auto high = co_await device_.read(0x1018, 0xFE);
  report_.refused(abort_codes, {0x1018, 0xFE}, "an upload of a sub-index that does not exist", high, codes::no_sub);
}

rt::Task<void> SdoChecks::commands() {
  const auto strange = co_await device_.raw_undisturbed(device_.request(unknown, 0x1000, 0));
  report_.refused(abort_codes, "an unknown command specifier", strange, codes::unknown_command);
  const auto alone = co_await device_.raw_undisturbed(device_.request(upload_segment, 0, 0));
  report_.refused(abort_codes, "an upload segment that belongs to no transfer", alone, codes::unknown_command);
  const auto alone_down = co_await device_.raw_undisturbed(device_.request(0x01, 0, 0));
  report_.refused(abort_codes, "a download segment that belongs to no transfer", alone_down, codes::unknown_command);

  auto aborting = device_.request(client_abort, 0x1000, 0, static_cast<std::uint32_t>(od::AbortCode::general));
  const auto aborted = co_await device_.raw_undisturbed(aborting);
  report_.silent(abort_codes, "a client's abort is not answered", aborted);
  auto short_one = device_.request(initiate_upload, 0x1000, 0);
  short_one.size = 7;
  const auto short_answer = co_await device_.raw_undisturbed(short_one);
  report_.silent(protocol, "a request of seven bytes is not answered", short_answer);
  auto remote = device_.request(initiate_upload, 0x1000, 0);
  remote.remote = true;
  const auto remote_answer = co_await device_.raw_undisturbed(remote);
  report_.silent(protocol, "a remote frame is not answered", remote_answer);
}

rt::Task<void> SdoChecks::device_type() {
  const auto no_sub = co_await device_.read(0x1000, 1);
  report_.refused(abort_codes, {0x1000, 1}, "an upload of a sub-index that does not exist", no_sub, codes::no_sub);
  const auto no_sub_write = co_await device_.write_number(0x1000, 1, 4, 0);
  report_.refused(abort_codes, {0x1000, 1}, "a download to a sub-index that does not exist", no_sub_write,
                  codes::no_sub);
  const auto answer = co_await device_.raw(device_.request(initiate_upload, 0x1000, 0));
  const bool shape = answer && answer->size == 8 && (answer->data[0] & 0xE2U) == 0x42U &&
                     co::sdo::multiplexer(*answer) == ObjectRef{0x1000, 0};
  report_.holds(upload, {0x1000, 0},
                "an upload of four bytes is answered expedited, in eight bytes, with its multiplexer", shape,
                answer_text(answer));
  const bool counted = answer && (answer->data[0] & 0x0FU) == 0x03U;
  report_.holds(upload, {0x1000, 0}, "it says that no byte is unused", counted, answer_text(answer));
}

rt::Task<std::optional<ObjectRef>> SdoChecks::long_object() {
  for (const std::uint16_t index : std::array<std::uint16_t, 3>{0x1008, 0x1009, 0x100A}) {
    const auto told = co_await device_.read(index, 0);
    if (told.good() && told.bytes.size() > expedited) co_return ObjectRef{index, 0};
  }
  if (!options_.description) co_return std::nullopt;
  for (const auto& each : options_.description->objects()) {
    if (each.index < 0x1000) continue;
    for (const auto& sub : options_.description->subs(each)) {
      const bool may = od::readable(sub.access) && sub.type != od::DataType::domain &&
                       ((each.obj_flags | sub.obj_flags) & od::refuse_read_on_scan) == 0;
      const bool may_be_long = od::byte_size(sub.type) > expedited || sub.variable_length();
      if (!may || !may_be_long) continue;
      const auto told = co_await device_.read(each.index, sub.sub);
      if (told.good() && told.bytes.size() > expedited) co_return ObjectRef{each.index, sub.sub};
    }
  }
  co_return std::nullopt;
}

rt::Task<void> SdoChecks::segmented_upload(std::uint16_t index, std::uint8_t sub) {
  const ObjectRef ref{index, sub};
  const auto whole = co_await device_.read(index, sub);
  report_.granted(segments, ref, "a segmented upload succeeds", whole);
  const auto begun = co_await device_.raw(device_.request(initiate_upload, index, sub));
  const bool segmented = begun && (begun->data[0] & 0xF2U) == 0x40U;
  report_.holds(upload, ref, "more than four bytes are not answered expedited", segmented, answer_text(begun));
  const bool sized = begun && (begun->data[0] & 0x01U) != 0;
  if (sized) {
    const auto size = load_le<std::uint32_t>(begun->data.data() + 4);
    report_.holds(upload, ref, "the initiate response has the size of the value", size == whole.bytes.size(),
                  answer_text(begun));
  }
  const auto wrong = co_await device_.raw(device_.request(upload_segment | toggle, 0, 0));
  report_.refused(abort_codes, "an upload segment whose toggle bit does not alternate", wrong, codes::toggle);
  const auto over = co_await device_.raw(device_.request(upload_segment, 0, 0));
  report_.refused(abort_codes, "the next segment of an aborted upload", over, codes::unknown_command);

  co_await device_.raw(device_.request(initiate_upload, index, sub));
  const auto first = co_await device_.raw(device_.request(upload_segment, 0, 0));
  report_.holds(segments, ref, "the first segment has toggle bit 0", first && (first->data[0] & 0xF0U) == 0,
                answer_text(first));
  const auto again = co_await device_.raw(device_.request(initiate_upload, index, sub));
  const bool anew = again && begun && *again == *begun;
  report_.holds(protocol, ref, "an initiate within a transfer begins anew", anew, answer_text(again));
  const auto first_again = co_await device_.raw(device_.request(upload_segment, 0, 0));
  const bool from_start = first_again && first && *first_again == *first;
  report_.holds(protocol, ref, "and the value comes from its first byte again", from_start, answer_text(first_again));
  device_.forget();
  device_.send(device_.request(client_abort, index, sub, static_cast<std::uint32_t>(od::AbortCode::general)));
  const auto after_abort = co_await device_.raw(device_.request(upload_segment | toggle, 0, 0));
  const bool ended = is_abort(after_abort, od::AbortCode::command_specifier);
  report_.holds(abort_codes, ref, "a client's abort ends the transfer", ended, answer_text(after_abort));
}

rt::Task<void> SdoChecks::block_transfer(std::uint16_t index, std::uint8_t sub) {
  const ObjectRef ref{index, sub};
  const auto whole = co_await device_.read(index, sub);
  auto none = device_.request(initiate_block_upload, index, sub, 0);
  const auto no_size = co_await device_.raw(none);
  if (is_abort(no_size, od::AbortCode::command_specifier)) {
    report_.skip(blocks, ref, "block transfer", "the device has none (0504 0001 to its initiate)");
    co_return;
  }
  report_.refused(abort_codes, "a block upload with block size 0", no_size, codes::block_size);
  const auto high = co_await device_.raw(device_.request(initiate_block_upload, index, sub, 128));
  report_.refused(abort_codes, "a block upload with block size 128", high, codes::block_size);
  for (const bool crc : std::array<bool, 2>{true, false}) {
    const auto told = co_await device_.read_by_block(index, sub, crc);
    const char* const what = crc ? "a block upload with CRC brings the value" : "a block upload without CRC brings it";
    report_.holds(blocks, ref, what, told.good() && told.bytes == whole.bytes, told.words());
  }
  const auto nothing = co_await device_.read_by_block(described_.absent(), 0, true);
  report_.refused(abort_codes, {described_.absent(), 0}, "a block upload of an object that does not exist", nothing,
                  codes::no_object);
  const auto no_write = co_await device_.raw(device_.request(0xC2, described_.absent(), 0, 8));
  report_.refused(abort_codes, "a block download to an object that does not exist", no_write, codes::no_object);
  const auto to_identity = co_await device_.raw(device_.request(0xC2, 0x1018, 1, 4));
  report_.refused(abort_codes, "a block download to 1018h:01", to_identity, codes::read_only);
}

// The first segment gets the second one's toggle bit: nothing is written.
rt::Task<void> SdoChecks::download_toggle() {
  if (!described_.settable(0x1017, 0, 2)) {
    report_.skip(download_segments, {0x1017, 0}, "the toggle bit of a segmented download",
                 "1017h is not described as rw");
    co_return;
  }
  const auto before = co_await device_.read(0x1017, 0);
  const auto begun = co_await device_.raw(device_.request(0x21, 0x1017, 0, 2));
  report_.holds(download_segments, {0x1017, 0}, "a download of two bytes may be segmented",
                begun && begun->data[0] == 0x60, answer_text(begun));
  auto segment = device_.request(0x00, 0, 0);
  segment.data = {toggle | 5U << 1U | 1U, before.bytes.empty() ? std::uint8_t{0} : before.bytes[0],
                  before.bytes.size() < 2 ? std::uint8_t{0} : before.bytes[1]};
  const auto wrong = co_await device_.raw(segment);
  report_.refused(abort_codes, "a download segment whose toggle bit does not alternate", wrong, codes::toggle);
  const auto after = co_await device_.read(0x1017, 0);
  report_.holds(download_segments, {0x1017, 0}, "an aborted download changes nothing", after.bytes == before.bytes,
                after.words());
  if (!before.good()) co_return;
  co_await device_.raw(device_.request(0x21, 0x1017, 0, 2));
  segment.data[0] = 5U << 1U | 1U;
  const auto good = co_await device_.raw(segment);
  report_.holds(download_segments, {0x1017, 0}, "a segmented download of the value that is there succeeds",
                good && good->data[0] == 0x20, answer_text(good));
  co_await device_.raw(device_.request(0x21, 0x1017, 0, 2));
  segment.data[0] = 0x00;
  const auto long_one = co_await device_.raw(segment);
  report_.refused(abort_codes, "a segment that brings more than was promised", long_one, codes::too_long);
}

}  // namespace berth::doctor
