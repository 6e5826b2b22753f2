// That a running device takes nothing from the heap and throws nothing, whatever comes; and how much memory it has.
#include <dlfcn.h>
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <vector>

#include <cstdlib>
#include <new>
#include <stdexcept>

#include "../pch.hpp"
#include "rig.hpp"

namespace {
std::uint64_t allocations = 0;
std::uint64_t exceptions = 0;
}  // namespace

// Counts what the whole test program throws, caught or not.
extern "C" [[noreturn]] void __cxa_throw(void* object, void* type, void (*destroy)(void*)) {
  ++exceptions;
  using Throw = void (*)(void*, void*, void (*)(void*));
  reinterpret_cast<Throw>(dlsym(RTLD_NEXT, "__cxa_throw"))(object, type, destroy);
  std::abort();
}

// Counts what the whole test program takes from the heap.
void* operator new(std::size_t size) {
  ++allocations;
  void* memory = std::malloc(size == 0 ? 1 : size);
  if (memory == nullptr) std::abort();
  return memory;
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return operator new(size); }
void* operator new[](std::size_t size) { return operator new(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return operator new(size); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

namespace berth::device::test::heap_tests {
namespace {

Options stored(std::uint32_t serial, std::uint8_t id) {
  return {.address = address_of(serial), .node_id = NodeId(id), .bit_rate = 500'000};
}

// A frame's way is noexcept by type: from the port, from a timer, from the application, to the values.
static_assert(noexcept(std::declval<can::Listener&>().received(std::declval<const can::Frame&>(),
                                                               std::declval<rt::Time>())));
static_assert(noexcept(std::declval<can::Listener&>().sent(1, std::declval<rt::Time>())));
static_assert(noexcept(std::declval<can::Listener&>().changed(std::declval<const can::Status&>(),
                                                              std::declval<rt::Time>())));
static_assert(noexcept(std::declval<rt::Job&>().run()));
static_assert(noexcept(std::declval<od::Values&>().write(ObjectRef{}, {})));
static_assert(
    noexcept(std::declval<Device&>().errors().raise(0, 0)) && noexcept(std::declval<Device&>().errors().clear(0)));
static_assert(noexcept(std::declval<Device&>().apply(co::NmtCommand::start)));
static_assert(noexcept(std::declval<Device&>().services().event(1)));
static_assert(noexcept(std::declval<Variable<float>&>().set(1)));
static_assert(noexcept(std::declval<NvMemory::Done&>().written(true)));

/// A port without a bus, and without a heap of its own: what is sent is counted and on the wire at once.
class BarePort final : public can::Port, private rt::Job {
 public:
  explicit BarePort(rt::Executor& executor) : executor_(executor) {}
  can::Queued send(const can::Frame&, std::uint32_t tag) noexcept override {
    ++sent;
    if (tag != 0 && waiting_ < tags_.size()) tags_[waiting_++] = tag;
    executor_.post(*this);
    return can::Queued::yes;
  }
  void withdraw(std::uint32_t tag) noexcept override {
    for (auto& t : tags_) t = t == tag ? 0 : t;
  }
  void listen(can::Listener* listener, std::span<const can::IdRange> accept) noexcept override {
    listener_ = listener;
    count_ = std::min(accept.size(), accept_.size());
    std::copy_n(accept.begin(), count_, accept_.begin());
  }
  [[nodiscard]] can::Status status() const noexcept override { return {.bit_rate = 500'000, .up = true}; }
  bool restart(std::uint32_t) noexcept override { return true; }
  void arrive(const can::Frame& frame) {
    in_ = frame;
    arrived_ = true;
    executor_.post(*this);
    executor_.advance(executor_.now());
  }
  [[nodiscard]] bool hears(std::uint32_t key) const {
    return std::any_of(accept_.begin(), accept_.begin() + count_, [&](auto r) { return r.contains(key); });
  }
  std::uint64_t sent = 0;

 private:
  void run() noexcept override {
    if (std::exchange(arrived_, false)) {
      if (hears(in_.key())) listener_->received(in_, executor_.now());
    } else if (waiting_ > 0) {
      const auto tag = tags_[--waiting_];
      if (tag != 0) listener_->sent(tag, executor_.now());
    }
    if (waiting_ > 0) executor_.post(*this);
  }
  rt::Executor& executor_;
  can::Listener* listener_ = nullptr;
  std::array<can::IdRange, 32> accept_{};
  std::size_t count_ = 0;
  std::array<std::uint32_t, 32> tags_{};
  std::size_t waiting_ = 0;
  can::Frame in_;
  bool arrived_ = false;
};

// docs/architecture.md, decision 4: no heap use after construction: frames, timers, stores, resets, new node-IDs.
TEST(Device, FramesAndResetsTakeNothingFromTheHeap) {
  rt::Executor executor;
  BarePort bare(executor);
  const Timing timing{.response_min = microseconds(100), .response_max = microseconds(900)};
  SimFlash flash(executor, 64, milliseconds(3));
  TimedPort port(executor, bare, timing, Random(1));
  can::Dispatcher dispatcher(executor, port);
  auto options = stored(5, 9);
  options.presets.push_back({{0x1017, 0}, 20});
  Device device(dispatcher, minimal_description(), &flash, options, &port, timing);
  std::vector<can::Frame> story;
  for (const char* text : {"7E5#0400000000000000",
                           "7E5#4001000001000000",
                           "7E5#4101000000000000",
                           "7E5#4200000000000000",
                           "7E5#4305000000000000",
                           "7E5#1103000000000000",
                           "7E5#1700000000000000",
                           "7E5#0400000000000000",
                           "000#8200",
                           "603#4008100000000000",
                           "603#6000000000000000",
                           "603#7000000000000000",
                           "603#2316100164000100",
                           "701#05",
                           "603#2B17100005000000",
                           "1F940000#80000000",
                           "000#0103",
                           "703#R1",
                           "703#7F",
                           "583#0000000000000000",
                           "000#8103",
                           "7E5#0401000000000000",
                           "7E5#1109000000000000",
                           "7E5#1700000000000000",
                           "7E5#0400000000000000",
                           "000#8200"}) {
    story.push_back(*can::parse_frame(text));
  }
  const auto play = [&] {
    for (const auto& frame : story) {
      bare.arrive(frame);
      executor.advance(executor.now() + milliseconds(7));
    }
    executor.advance(executor.now() + milliseconds(300));
  };
  const auto before_start = allocations;
  device.power_on();
  EXPECT_EQ(allocations, before_start);
  play();  // the dispatcher's lists grow to their size
  const auto before = allocations;
  const auto sent = bare.sent;
  for (int i = 0; i < 20; ++i) play();
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(device.node_id(), NodeId(9));
  EXPECT_EQ(device.lss().persistent().node_id, NodeId(9));
  EXPECT_GT(bare.sent - sent, 500U);
  EXPECT_GT(flash.writes_ended(), 40U);
}

/// A device with every service.
std::shared_ptr<const od::Description> everything() {
  using od::DataType;
  using od::Literal;
  od::DescriptionBuilder b;
  add_device(b, {.name = "A device with a name of some length", .heartbeat_ms = 20});
  add_storage(b);
  add_sync(b);
  b.variable(0x1012, {.initial = Literal::number(0x8000'0100)});
  b.object(0x1028, od::ObjectCode::array, "Emergency consumer");
  for (std::uint8_t i = 1; i <= 3; ++i) b.sub(0x1028, {.sub = i, .initial = Literal::number(0x80U + i)});
  b.variable(0x2000, {.type = DataType::unsigned32, .access = od::Access::ro, .mappable = true});
  b.variable(0x2001, {.type = DataType::unsigned32, .access = od::Access::rww, .mappable = true});
  b.variable(0x2002, {.type = DataType::visible_string, .capacity = 60});
  b.variable(0x2003, {.type = DataType::octet_string, .capacity = 200});
  add_tpdo(b, 1, {.map = {{{0x2000, 0}, 32}}, .inhibit_100us = 20, .event_timer_ms = 50});
  add_tpdo(b, 2, {.map = {{{0x2000, 0}, 32}, {{0x1001, 0}, 8}}, .type = 1});
  add_rpdo(b, 1, {.map = {{{0x2001, 0}, 32}}, .event_timer_ms = 40});
  add_rpdo(b, 2, {.map = {{{0x2001, 0}, 32}}, .type = 1});
  return b.build();
}

// The issue, part 6: the frame path of a running device allocates nothing and throws nothing: NMT, SDO expedited,
// segmented and block, PDO, SYNC, TIME, EMCY both ways, heartbeat both ways, LSS, storing, with callbacks set.
// The same for Fastscan, whose answer waits for its feedback's confirmation (S4.10).
TEST(Device, FastscanWithFeedbackTakesNothingFromTheHeap) {
  rt::Executor executor;
  BarePort bare(executor);
  const Timing timing{.response_min = microseconds(100), .response_max = microseconds(900)};
  TimedPort port(executor, bare, timing, Random(1));
  can::Dispatcher dispatcher(executor, port);
  const Options options{.address = {1, 1, 0, 5}, .lss = {.feedback = lss::Feedback::extended}};
  Device device(dispatcher, minimal_description(), nullptr, options, &port, timing);
  device.power_on();
  executor.advance(executor.now() + milliseconds(300));
  const auto play = [&] {
    for (const char* text :
         {"7E5#5100000000800000", "7E5#5100000000100000", "7E5#5101000000000001", "7E5#5101000000000102",
          "7E5#5100000000000203", "7E5#5105000000000300", "7E5#0400000000000000"}) {
      bare.arrive(*can::parse_frame(text));
      executor.advance(executor.now() + milliseconds(7));
    }
  };
  play();
  const auto before = allocations;
  const auto sent = bare.sent;
  for (int i = 0; i < 20; ++i) play();
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(bare.sent - sent, 20 * 11U);  // six answers, five with feedback before them
}

TEST(Device, EveryServiceTakesNothingFromTheHeapAndThrowsNothing) {
  EXPECT_THROW(throw std::runtime_error("counted"), std::runtime_error);
  ASSERT_GE(exceptions, 1U) << "the counter works";
  rt::Executor executor;
  BarePort bare(executor);
  SimFlash flash(executor, memory_size(*everything()), milliseconds(2));
  const Timing at_once{};
  TimedPort port(executor, bare, at_once, Random(1));
  can::Dispatcher dispatcher(executor, port);
  Device device(dispatcher, everything(), &flash, stored(5, 9), &port);
  std::array<unsigned, 8> calls{};
  device.on().rpdo = [&](unsigned) { ++calls[0]; };
  device.on().sync = [&](std::uint8_t) { ++calls[1]; };
  device.on().time = [&](const co::TimeOfDay&) { ++calls[2]; };
  device.on().emergency = [&](NodeId, const co::Emcy&) { ++calls[3]; };
  device.on().heartbeat = [&](const co::HeartbeatEvent&) { ++calls[4]; };
  device.on_write({0x2001, 0}, [&] { ++calls[5]; });
  device.on_write({0x2002, 0}, [&] { ++calls[6]; });  // segmented
  device.on_write({0x2003, 0}, [&] { ++calls[7]; });  // block
  auto measured = device.variable<std::uint32_t>({0x2000, 0});
  std::vector<can::Frame> story;
  for (const char* text :
       {"000#0109", "609#4000100000000000", "609#2316100164000100", "701#05",
        // segmented upload of 1008h, segmented download to 2002h
        "609#4008100000000000", "609#6000000000000000", "609#7000000000000000", "609#6000000000000000",
        "609#2102200009000000", "609#0041424344454647", "609#1B48490000000000",
        // block download of 9 bytes to 2003h, without CRC; block upload of it
        "609#C203200009000000", "609#0161626364656667", "609#8268690000000000", "609#D500000000000000",
        "609#A00320007F000000", "609#A300000000000000", "609#A2027F0000000000", "609#A100000000000000",
        // refused: no object, read only, too long
        "609#4000300000000000", "609#2300100000000000", "609#23171000FFFFFFFF", "609#8000100000000405",
        // PDO, SYNC, TIME, EMCY
        "000#0109", "209#01020304", "309#05060708", "080#", "209#01", "209#01020304", "100#010000000200",
        "081#3081110000000000", "701#05", "701#7F", "709#R1", "189#R4",
        // own identifier, wrong SYNC
        "189#01020304", "080#05", "080#",
        // storing, dating, LSS
        "609#2320100101000000", "609#2310100173617665", "609#231110016C6F6164", "7E5#0401000000000000",
        "7E5#1109000000000000", "7E5#1700000000000000", "7E5#0400000000000000",
        // states and resets
        "000#0209", "000#8009", "000#0109", "000#8209", "000#8109"}) {
    const auto frame = can::parse_frame(text);
    ASSERT_TRUE(frame) << text;
    story.push_back(*frame);
  }
  unsigned value = 0;
  const auto play = [&] {
    for (const auto& frame : story) {
      bare.arrive(frame);
      executor.advance(executor.now() + milliseconds(7));
      measured.set(++value);
      device.errors().raise(0xFF01, 0x80);
      device.services().event(1);
      executor.advance(executor.now() + milliseconds(3));
      device.errors().clear(0xFF01);
    }
    executor.advance(executor.now() + milliseconds(300));
  };
  device.power_on();
  executor.advance(executor.now() + milliseconds(1));
  play();  // lists grow to their size
  calls = {};
  const auto before = allocations;
  const auto thrown = exceptions;
  const auto sent = bare.sent;
  for (int i = 0; i < 10; ++i) play();
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(exceptions, thrown);
  EXPECT_GT(bare.sent - sent, 1000U);
  for (unsigned i = 0; i < calls.size(); ++i) EXPECT_GE(calls[i], 10U) << "callback " << i;
  EXPECT_EQ(device.state(), NmtState::pre_operational);
}

// The acceptance filter is narrow: what a device does not need costs it nothing.
TEST(Device, AcceptsOnlyWhatConcernsIt) {
  rt::Executor executor;
  BarePort bare(executor);
  can::Dispatcher dispatcher(executor, bare);
  Device device(dispatcher, minimal_description(), nullptr, stored(5, 9));
  device.power_on();
  executor.advance(executor.now());
  std::vector<std::uint32_t> heard;
  for (std::uint32_t id = 0; id <= 0x7FF; ++id) {
    if (bare.hears(id)) heard.push_back(id);
  }
  EXPECT_EQ(heard, (std::vector<std::uint32_t>{0x000, 0x089, 0x589, 0x609, 0x709, 0x7E5}));
  for (const std::uint32_t id : {0x1F500400U, 0x1F900014U, 0x1F940004U})
    EXPECT_FALSE(bare.hears(id | can::extended_flag));
  EXPECT_TRUE(bare.hears(0x1F940000U | can::extended_flag));
}

// The issue's figure "memory per simulated device"; printed, and a bound that a careless field would break.
TEST(Device, MemoryPerDevice) {
  Rig rig;
  Node first(rig.world, rig.bus, stored(5, 9));
  std::printf(
      "sizeof: Device %zu, HeartbeatConsumer %zu, SdoServerService %zu, EmcyProducer %zu, ErrorField %zu, "
      "TimedPort %zu, Dispatcher %zu, Controller %zu, Values(minimal) %zu\n",
      sizeof(Device), sizeof(co::HeartbeatConsumer), sizeof(co::SdoServerService), sizeof(co::EmcyProducer),
      sizeof(co::ErrorField), sizeof(TimedPort), sizeof(can::Dispatcher), sizeof(sim::Controller),
      first.device.values().memory());
  std::printf("Device::memory() with the minimal description: %zu\n", first.device.memory());
  EXPECT_LT(first.device.memory(), 8000U);
}

}  // namespace
}  // namespace berth::device::test::heap_tests
