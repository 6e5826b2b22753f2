// Any bytes where a person, a file or a peer writes a number, a time, an object, a port, an address or a frame: a value
// or none, within its limits, and what has a written form is read back equal.
#include <algorithm>

#include "berth/base/ids.hpp"
#include "berth/can/frame.hpp"
#include "berth/can/port_spec.hpp"
#include "berth/io/stream.hpp"
#include "berth/od/data_type.hpp"
#include "berth/od/notation.hpp"
#include "berth/text/quantity.hpp"
#include "berth/text/toml.hpp"
#include "fuzz/require.hpp"

namespace words_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  using fuzz::require;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (const auto time = text::parse_duration(text)) require(text::parse_duration(text::write_duration(*time)) == time);
  if (const auto ranges = text::parse_ranges(text, 1, 127)) {
    require(std::ranges::is_sorted(*ranges) && ranges->size() <= 127);
  }
  if (const auto object = od::read_object(text)) {
    require(od::read_object(od::write_object(object->ref()))->ref() == object->ref());
  }
  static_cast<void>(od::read_sub_index(text));
  if (const auto address = parse_lss_address(text)) require(parse_lss_address(to_string(*address)) == address);
  if (const auto frame = can::parse_frame(text)) require(can::parse_frame(can::to_string(*frame)) == frame);
  if (const auto port = can::parse_port(text)) require(can::parse_port(can::to_string(*port)).has_value());
  if (const auto where = io::parse_endpoint(text, 7000)) require(!where->host.empty());
  static_cast<void>(od::parse_number(text));
  Findings findings;
  if (!text::parse_toml(text, "x.toml", findings)) require(!findings.empty());
  return 0;
}

}  // namespace words_target
