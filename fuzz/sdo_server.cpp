// Bytes from outside as SDO requests: 8 at a time, the first byte of the input chooses the buffer's size. A server must
// answer every whole frame but an abort, and serve an honest client afterwards.
#include "berth/co/sdo_server.hpp"

#include <cstdlib>

namespace {

using namespace berth;

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = od::Access::ro, .initial = od::Literal::number(0x192)});
  b.variable(0x1008, {.name = "name", .type = od::DataType::visible_string, .capacity = 30});
  b.variable(0x2000, {.name = "domain", .type = od::DataType::domain, .capacity = 300});
  b.variable(0x2001, {.name = "long", .type = od::DataType::integer64});
  return b.build();
}

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto shared = description();
  if (size == 0) return 0;
  od::Values values(shared, NodeId(5));
  co::SdoServer server(values, data[0]);
  server.set_response_id(0x585);
  for (std::size_t at = 1; at + 8 <= size; at += 8) {
    const auto request = can::Frame::base(0x605, std::span(data + at, 8));
    const auto answer = server.handle(request);
    require(answer.has_value() == ((data[at] >> 5) != 4));
    require(!answer || (answer->id == 0x585 && answer->size == 8));
  }
  static_cast<void>(server.expire());
  const auto answer = server.handle(can::Frame::base(0x605, {0x40, 0x00, 0x10, 0, 0, 0, 0, 0}));
  require(answer == can::Frame::base(0x585, {0x43, 0x00, 0x10, 0, 0x92, 0x01, 0, 0}));
  return 0;
}
