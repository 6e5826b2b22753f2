// Any frames, object writes, events and pauses at a whole set of PDOs with SYNC: what it sends are its TPDOs, errors
// begin and end once, objects that no PDO may touch keep their values, and afterwards the standard's sequence makes
// PDOs work.
//
// Input: entries of a kind byte and what that kind needs.
#include <set>

#include "berth/base/bytes.hpp"
#include "berth/co/emcy.hpp"
#include "berth/co/pdo.hpp"
#include "berth/co/sync.hpp"
#include "fuzz/bench_port.hpp"

namespace pdo_target {

namespace {

using namespace berth;
using fuzz::require;
using od::Access;
using od::DataType;
using std::chrono::microseconds;

constexpr std::uint32_t canary = 0x5AFE'5AFE;

void add_records(od::DescriptionBuilder& b, std::uint16_t communication, std::uint32_t cob_id) {
  b.sub(communication, {.sub = 1, .name = "COB-ID", .initial = od::Literal::number(cob_id)});
  b.sub(communication, {.sub = 2, .name = "type", .type = DataType::unsigned8, .initial = od::Literal::number(0xFF)});
  b.sub(communication, {.sub = 3, .name = "inhibit time", .type = DataType::unsigned16});
  b.sub(communication, {.sub = 4, .name = "reserved", .type = DataType::unsigned8});
  b.sub(communication, {.sub = 5, .name = "event timer", .type = DataType::unsigned16});
  b.sub(communication, {.sub = 6, .name = "SYNC start value", .type = DataType::unsigned8});
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  b.sub(mapping, {.sub = 0, .name = "count", .type = DataType::unsigned8, .initial = od::Literal::number(2)});
  for (std::uint8_t i = 1; i <= 12; ++i) {
    const std::uint32_t raw = i == 1 ? 0x20010008U : i == 2 ? 0x20020010U : 0U;
    b.sub(mapping, {.sub = i, .name = "entry", .initial = od::Literal::number(raw)});
  }
}

std::shared_ptr<const od::Description> description() {
  od::DescriptionBuilder b;
  b.variable(0x1005, {.name = "COB-ID SYNC", .initial = od::Literal::number(0x80)});
  b.variable(0x1006, {.name = "period"});
  b.variable(0x1007, {.name = "window"});
  b.variable(0x1013, {.name = "time stamp", .mappable = true});
  b.variable(0x1019, {.name = "overflow", .type = DataType::unsigned8});
  for (std::uint16_t n = 0; n < 3; ++n) {
    add_records(b, static_cast<std::uint16_t>(0x1400 + n), 0x205U + 0x100U * n);
    add_records(b, static_cast<std::uint16_t>(0x1800 + n), 0x185U + 0x100U * n);
  }
  for (std::uint8_t i = 1; i <= 3; ++i) {
    b.sub(0x1FA0, {.sub = i, .name = "scanner", .initial = od::Literal::number(i == 1 ? 0x04200101 : 0)});
    b.sub(0x1FD0, {.sub = i, .name = "dispatcher", .type = DataType::unsigned64});
  }
  const DataType types[]{DataType::unsigned8, DataType::unsigned16, DataType::boolean,  DataType::integer24,
                         DataType::real64,    DataType::unsigned32, DataType::integer40};
  std::uint16_t index = 0x2001;
  for (const DataType type : types) b.variable(index++, {.name = "x", .type = type, .mappable = true});
  b.variable(0x2010, {.name = "canary", .initial = od::Literal::number(canary)});
  b.variable(0x2011,
             {.name = "canary", .access = Access::ro, .mappable = true, .initial = od::Literal::number(canary)});
  for (std::uint8_t i = 1; i <= 20; ++i) {
    b.sub(0x2020, {.sub = i, .name = "bit", .type = DataType::boolean, .mappable = true});
  }
  b.dummies(0xFE);
  return b.build();
}

struct Device final : co::ServiceOwner, co::Pdos::Observer {
  explicit Device(const std::shared_ptr<const od::Description>& shared) : values(shared, NodeId(5)) {
    pdos.observe(this);
    port.on_sent = [](const can::Frame& frame) {
      require(frame.size <= 8 && !frame.remote && !frame.fd);
      require(frame.extended || frame.id == 0x80 || !co::restricted(frame.id));
    };
  }
  void raise_error(std::uint16_t code, std::uint8_t, const std::array<std::uint8_t, 5>&) noexcept override {
    require(active.insert(code).second || code == co::emcy_code::id_collision);
  }
  void clear_error(std::uint16_t code) noexcept override { require(active.erase(code) == 1); }
  void received(unsigned number, rt::Time) noexcept override {
    require(pdos.active(co::PdoKind::rpdo, number));
    (void)pdos.event(number);
  }
  void received_mpdo(ObjectRef object, rt::Time) noexcept override { (void)pdos.changed(object); }
  od::AbortCode write(ObjectRef ref, std::uint64_t value) {
    const auto* const sub = values.description().find(ref);
    if (sub == nullptr) return od::AbortCode::no_object;
    std::uint8_t bytes[8];
    store_le(bytes, value);
    return values.write(ref, std::span(bytes).first(od::byte_size(sub->type)));
  }

  std::set<std::uint16_t> active;
  rt::Executor executor;
  fuzz::BenchPort port{executor};
  can::Dispatcher dispatcher{executor, port};
  od::Values values;
  co::Pdos pdos{dispatcher, values, *this};
  co::Sync sync{dispatcher, values, *this, &pdos};
};

// Writes that hit something, most of the time.
void write(Device& device, fuzz::Input& in) {
  const std::uint8_t where = in.byte();
  const std::uint8_t sub = in.byte() % 14;
  const std::uint16_t records[]{0x1400, 0x1600, 0x1800, 0x1A00};
  const std::uint16_t others[]{0x1005, 0x1006, 0x1007, 0x1019, 0x1FA0, 0x1FD0, 0x2001, 0x2002};
  if ((where & 0x80U) != 0) {
    const std::uint16_t index = others[where & 7U];
    std::uint64_t value = static_cast<std::uint64_t>(in.word()) << ((where & 0x40U) != 0 ? 32 : 0) | in.half();
    if (index == 0x1006 && value != 0) value |= 0x400;  // a SYNC each microsecond would only take time
    (void)device.write({index, static_cast<std::uint8_t>((index & 0xFF80U) == 0x1F80 ? sub % 4 : 0)}, value);
    return;
  }
  const auto index = static_cast<std::uint16_t>(records[where & 3U] + (where >> 2) % 3);
  const bool mapping = (where & 1U) != 0;
  std::uint32_t value = 0;
  if (mapping && sub != 0) {
    const std::uint8_t lengths[]{1, 8, 16, 24, 32, 40, 64, in.byte()};
    value = static_cast<std::uint32_t>(0x2000 + in.byte() % 0x24) << 16 |
            static_cast<std::uint32_t>(in.byte() % 21) << 8 | lengths[in.byte() & 7U];
  } else if (!mapping && sub == 1) {
    value = in.word() & 0xE000'07FFU;
  } else {
    value = in.half();
  }
  (void)device.write({index, sub}, value);
}

void act(Device& device, fuzz::Input& in) {
  const std::uint8_t kind = in.byte();
  switch (kind & 15U) {
    case 0:
    case 1:
    case 2: return write(device, in);
    case 3: return device.port.hear(in.frame(0x80));
    case 4:
    case 5: return device.port.hear(in.frame(0x205U + 0x100U * (kind >> 4) % 0x300U));
    case 6: return device.port.hear(in.frame(0x185U + 0x100U * (kind >> 4) % 0x300U));
    case 7: return device.port.hear(in.frame(in.word() & (can::extended_flag | can::extended_mask)));
    case 8: return (void)device.pdos.event(kind >> 4);
    case 9: return (void)device.pdos.changed({static_cast<std::uint16_t>(0x2000 + in.byte() % 0x24), in.byte()});
    case 10: return device.executor.advance(device.executor.now() + microseconds(in.half()));
    case 11: return device.executor.advance(device.executor.now() + microseconds(100) * (in.half() & 0xFFF));
    case 12:
      if ((kind & 0x10U) != 0) device.port.capacity = kind >> 5;
      device.port.refuses = (kind & 0x30U) == 0x20;
      if ((kind & 0x40U) != 0) device.port.restart(0);
      return;
    case 13:
      if ((kind & 0x10U) != 0) return device.pdos.stop();
      return device.pdos.start(NodeId(static_cast<std::uint8_t>(1 + (kind >> 4))));
    case 14:
      if ((kind & 0x10U) != 0) return device.sync.stop();
      if ((kind & 0x20U) != 0) return device.sync.start();
      return device.pdos.refresh();
    default: {
      const std::uint8_t data[]{in.byte(), in.byte(), 3, 4, 5};
      (void)device.pdos.send_dam(kind >> 1, {in.half(), in.byte()}, std::span(data).first(kind >> 5 & 7U));
    }
  }
}

void set_up(Device& device, std::uint16_t communication, std::uint32_t cob_id) {
  const auto mapping = static_cast<std::uint16_t>(communication + 0x200);
  const auto none = od::AbortCode::none;
  require(device.write({communication, 1}, 0x8000'0000U | cob_id) == none);
  require(device.write({mapping, 0}, 0) == none);
  require(device.write({communication, 2}, 0xFF) == none);
  require(device.write({communication, 3}, 0) == none);
  require(device.write({communication, 5}, 0) == none);
  require(device.write({mapping, 1}, 0x2006'0020) == none);
  require(device.write({mapping, 2}, 0x2001'0008) == none);
  require(device.write({mapping, 0}, 2) == none);
  require(device.write({communication, 1}, cob_id) == none);
}

// An honest use of the same device.
void check(Device& device) {
  device.pdos.stop();
  device.sync.stop();
  device.active.erase(0x8150);  // stays until the device is reset
  require(device.active.empty());
  require(device.values.get<std::uint32_t>({0x2010, 0}) == canary);
  require(device.values.get<std::uint32_t>({0x2011, 0}) == canary);
  device.port.refuses = false;
  device.port.capacity = 32;
  device.port.restart(0);
  for (std::uint16_t n = 0; n < 3; ++n) {
    require(device.write({static_cast<std::uint16_t>(0x1800 + n), 1}, 0x8000'0000) == od::AbortCode::none);
    require(device.write({static_cast<std::uint16_t>(0x1400 + n), 1}, 0x8000'0000) == od::AbortCode::none);
  }
  device.executor.advance(device.executor.now() + std::chrono::seconds(2));
  set_up(device, 0x1400, 0x205);
  set_up(device, 0x1800, 0x185);
  device.pdos.start(NodeId(5));
  std::vector<can::Frame> log;
  device.port.on_sent = [&log](const can::Frame& frame) { log.push_back(frame); };
  device.executor.advance(device.executor.now() + std::chrono::milliseconds(300));
  log.clear();
  device.port.hear(can::Frame::base(0x205, {1, 2, 3, 4, 5}));  // the observer answers with an event
  device.executor.advance(device.executor.now() + std::chrono::milliseconds(1));
  require(log.size() == 1 && log[0] == can::Frame::base(0x185, {1, 2, 3, 4, 5}));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto shared = description();
  fuzz::Input in(data, size);
  Device device(shared);
  device.sync.start();
  device.pdos.start(NodeId(5));
  while (!in.empty()) act(device, in);
  check(device);
  return 0;
}

}  // namespace pdo_target
