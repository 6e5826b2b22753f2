// Bytes from both sides of an SDO gateway: nine at a time, the first says whether they are a client's request above, an
// answer from beneath, or time that passes. Whatever comes, answers above are well-formed and go to their client, nothing
// is stuck when both sides are silent, and an honest client is served afterwards.
#include "berth/multilevel/sdo_gateway.hpp"

#include "berth/co/sdo_servers.hpp"
#include "fuzz/void_port.hpp"

namespace sdo_gateway_target {

namespace {

using namespace berth;
using namespace std::chrono_literals;
using fuzz::require;

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1000, {.name = "Device type", .access = od::Access::ro, .initial = od::Literal::number(0x192)});
  b.object(0x1201, od::ObjectCode::record, "SDO server parameter", od::DataType::sdo_parameter);
  b.sub(0x1201, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(0x331)});
  b.sub(0x1201, {.sub = 2, .name = "COB-ID", .initial = od::Literal::number(0x3B1)});
  multilevel::add_sdo_gateway(b);
  return b.build();
}

can::Frame frame(std::uint32_t id, const std::uint8_t* bytes) { return can::Frame::base(id, std::span(bytes, 8)); }

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto shared = description();
  rt::Executor executor;
  fuzz::VoidPort above(executor), beneath(executor);
  can::Dispatcher upper(executor, above), lower(executor, beneath);
  od::Values values(shared, NodeId(3));
  co::SdoServers servers(upper, values, 64);
  co::SdoClient client(lower, {.timeout = 10ms});
  multilevel::SdoGateway gateway(values, client, executor, {.store = 100, .client_timeout = 30ms});
  servers.start(NodeId(3));
  const auto let_run = [&](rt::Duration time) { executor.advance(executor.now() + time); };
  // So that most inputs come as far as the bus beneath.
  for (const auto id : {0x603U, 0x331U}) {
    above.hear(can::Frame::base(id, {0x2F, 0x30, 0x5F, 0x00, 0x05, 0, 0, 0}));
    let_run(1ms);
  }
  for (std::size_t at = 0; at + 9 <= size; at += 9) {
    switch (data[at] & 3U) {
      case 0: above.hear(frame(0x603, data + at + 1)); break;
      case 1: above.hear(frame(0x331, data + at + 1)); break;
      case 2: beneath.hear(frame(0x580U + 1 + data[at] % 7U, data + at + 1)); break;
      default: let_run(std::chrono::milliseconds(data[at + 1])); break;
    }
    let_run(100us);
    require(above.last.size == 8 && (above.last.id == 0x583 || above.last.id == 0x3B1));
    if (data[at] == 0xFF) gateway.reset();
  }
  let_run(200s);
  require(gateway.busy() == 0);
  // An abort, and then as paper 3's Figure 13.
  const std::uint8_t abort[8] = {0x80, 0, 0, 0, 0, 0, 0, 8};
  above.hear(frame(0x603, abort));
  above.hear(can::Frame::base(0x603, {0x2F, 0x30, 0x5F, 0x00, 0x05, 0, 0, 0}));
  above.hear(can::Frame::base(0x603, {0x23, 0x32, 0x5F, 0x00, 0x40, 0x00, 0x10, 0x00}));
  let_run(1ms);
  require(beneath.last == can::Frame::base(0x605, {0x40, 0x00, 0x10, 0, 0, 0, 0, 0}));
  beneath.hear(can::Frame::base(0x585, {0x43, 0x00, 0x10, 0, 0x92, 0x01, 0, 0}));
  above.hear(can::Frame::base(0x603, {0x40, 0x31, 0x5F, 0x00, 0, 0, 0, 0}));
  let_run(1ms);
  require(above.last == can::Frame::base(0x583, {0x43, 0x31, 0x5F, 0, 0x92, 0x01, 0, 0}));
  return 0;
}

}  // namespace sdo_gateway_target
