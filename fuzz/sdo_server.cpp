// Bytes from outside as SDO requests: 8 at a time, the first byte of the input chooses the buffer's size. Whatever
// comes, answers are well-formed, sub-blocks are bounded, streams are closed as often as opened, and after an abort the
// server serves an honest client.
#include "berth/co/sdo_server.hpp"

#include <cstdlib>

#include "fuzz/void_port.hpp"

namespace sdo_server_target {

namespace {

using namespace berth;
using fuzz::require;

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = od::Access::ro, .initial = od::Literal::number(0x192)});
  b.variable(0x1008, {.name = "name", .type = od::DataType::visible_string, .capacity = 30});
  b.variable(0x2000, {.name = "domain", .type = od::DataType::domain, .capacity = 300});
  b.variable(0x2001, {.name = "long", .type = od::DataType::integer64});
  b.variable(0x2002, {.name = "stream", .type = od::DataType::domain});
  b.variable(0x2003, {.name = "slow", .type = od::DataType::unsigned32});
  return b.build();
}

struct Stream final : od::Stream {
  od::Answer<std::optional<std::size_t>> open_read(ObjectRef) noexcept override {
    ++open;
    left = 2000;
    return std::optional<std::size_t>();
  }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    require(open == 1 && !into.empty());
    const auto count = std::min(into.size(), left);
    left -= count;
    std::memset(into.data(), 0x55, count);
    return count;
  }
  od::AbortCode open_write(ObjectRef, std::optional<std::size_t>) noexcept override {
    ++open;
    return od::AbortCode::none;
  }
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    require(open == 1 && !bytes.empty());
    return od::AbortCode::none;
  }
  od::AbortCode close(ObjectRef, bool) noexcept override {
    --open;
    require(open == 0);
    return od::AbortCode::none;
  }
  std::size_t left = 0;
  int open = 0;
};

struct Slow final : od::Hook {
  od::AbortCode writing(const od::Values&, ObjectRef, std::span<const std::uint8_t>) noexcept override {
    return od::AbortCode::pending;
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto shared = description();
  if (size == 0) return 0;
  od::Values values(shared, NodeId(5));
  Stream stream;
  Slow slow;
  values.attach(stream, {0x2002, 0});
  values.attach(slow, 0x2003);
  co::SdoServer server(values, data[0]);
  server.set_response_id(co::CobId(0x585));
  for (std::size_t at = 1; at + 8 <= size; at += 8) {
    const auto request = can::Frame::base(0x605, std::span(data + at, 8));
    const bool idle = !server.busy();
    const auto answer = co::answer_of(server, request);
    require(!answer || (answer->id == 0x585 && answer->size == 8));
    // What begins nothing and ends nothing is refused; a deferred write answers later.
    if (idle && !server.pending()) require(answer.has_value() == ((data[at] >> 5) != 4));
    unsigned segments = 0;
    can::Frame segment;
    for (; server.sending(); ++segments) {
      server.segments().segment(segment);
      server.segments().advance();
    }
    require(segments <= 127);
    server.segments().confirm();
    if ((data[at] >> 5) == 7) {
      const auto later = server.complete(data[at + 1] % 2 == 0 ? od::AbortCode::none : od::AbortCode::hardware);
      require(!later || !server.pending());
    }
    if (data[at] == 0xFF) static_cast<void>(server.expire());
  }
  require(!co::answer_of(server, can::Frame::base(0x605, {0x80, 0, 0, 0, 0, 0, 0, 0})));
  require(!server.busy() && stream.open == 0);
  const auto answer = co::answer_of(server, can::Frame::base(0x605, {0x40, 0x00, 0x10, 0, 0, 0, 0, 0}));
  require(answer == can::Frame::base(0x585, {0x43, 0x00, 0x10, 0, 0x92, 0x01, 0, 0}));
  return 0;
}

}  // namespace sdo_server_target
