// Any errors raised and cleared at an emergency producer, any frames and writes of 1028h at a consumer: the register is
// what is active, the consumer hears whom its list names and reports what the frame says, and an honest message gets
// through.
#include "berth/co/emcy.hpp"

#include <set>

#include "berth/base/bytes.hpp"
#include "berth/co/emcy_list.hpp"
#include "fuzz/bench_port.hpp"

namespace emcy_target {

namespace {

using namespace berth;
using fuzz::require;

struct Ear final : co::EmcyConsumer::Observer {
  void emergency(NodeId from, const co::Emcy& what, rt::Time) noexcept override {
    ++count;
    node = from;
    message = what;
    require(from.configured() && co::emcy_text(what.code) != nullptr);
  }
  unsigned count = 0;
  NodeId node;
  co::Emcy message;
};

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  for (std::uint8_t n = 1; n <= 8; ++n) {
    b.sub(0x1028, {.sub = n, .name = "consumer", .initial = od::Literal::number(0x80U + n)});
  }
  return b.build();
}

void produce(co::EmcyProducer& producer, std::set<std::uint16_t>& active, fuzz::Input& in) {
  const auto code = static_cast<std::uint16_t>(in.byte() << 8 | (in.byte() & 3U));
  const std::array<std::uint8_t, 5> info{in.byte()};
  if ((in.byte() & 1U) != 0) {
    const bool fits = (code >> 8) != 0 && active.size() < co::EmcyProducer::most_errors && !active.contains(code);
    require(producer.raise(code, in.byte(), info) == fits);
    if (fits) active.insert(code);
  } else {
    require(producer.clear(code, info) == (active.erase(code) == 1));
  }
  require((producer.error_register() != 0) == !active.empty());
}

void write(od::Values& values, fuzz::Input& in) {
  const auto sub = static_cast<std::uint8_t>(1 + in.byte() % 8);
  std::uint8_t bytes[4];
  store_le(bytes, in.word() & 0xA000'07FFU);
  (void)values.write({0x1028, sub}, bytes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto shared = description();
  fuzz::Input in(data, size);
  rt::Executor executor;
  fuzz::BenchPort near(executor), far(executor);
  can::Dispatcher producer_side(executor, near), consumer_side(executor, far);
  co::EmcyProducer producer(producer_side);
  od::Values values(shared);
  Ear ear;
  co::EmcyList list(consumer_side, values, ear);
  list.start();
  co::ErrorField field;
  std::set<std::uint16_t> active;
  near.on_sent = [&](const can::Frame& frame) {
    require(frame.size == 8 && ((frame.data[0] | frame.data[1]) == 0) == (frame.data[2] == 0));
    far.hear(frame);
  };
  while (!in.empty()) {
    const std::uint8_t kind = in.byte();
    switch (kind & 7U) {
      case 0:
      case 1:
        // No register bits of its own: generic is set by the producer.
        produce(producer, active, in);
        break;
      case 2: producer.enable((kind & 8U) != 0); break;
      case 3: producer.set_cob_id(co::CobId((kind & 8U) != 0 ? 0x80U + (kind >> 4) : 0x8000'0000U)); break;
      case 4: producer.set_inhibit(std::chrono::microseconds(in.half())); break;
      case 5: far.hear(in.frame((kind & 8U) != 0 ? in.word() : 0x80U + (kind >> 4))); break;
      case 6: write(values, in); break;
      default:
        executor.advance(executor.now() + std::chrono::microseconds(in.half()));
        near.refuses = (kind & 0x18U) == 0x18;
        field.push(ear.message);
        require(field.count() <= co::ErrorField::size);
    }
  }
  // An honest message of node 3.
  producer.reset();
  near.refuses = false;
  near.restart(0);
  executor.advance(executor.now() + std::chrono::seconds(2));
  list.stop();
  values.reset(NodeId(5));
  list.start();
  producer.set_inhibit({});
  producer.set_cob_id(co::CobId(0x83));
  producer.enable(true);
  ear.count = 0;
  require(producer.raise(0x8130, co::error_register::communication, {1, 2, 3, 4, 5}));
  executor.advance(executor.now() + std::chrono::seconds(1));
  require(ear.count == 1 && ear.node == NodeId(3));
  require(ear.message == co::Emcy{0x8130, 0x11, {1, 2, 3, 4, 5}});
  return 0;
}

}  // namespace emcy_target
