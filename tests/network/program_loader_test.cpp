// Programs into whole devices over a simulated bus, and what goes wrong with them (docs/programs.md).
#include "berth/manager/program_loader.hpp"

#include "berth/co/sdo_server.hpp"
#include "tests/network/program_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using od::AbortCode;

namespace {

std::string said(const Result<void>& done) { return done ? "done" : describe(done.error()); }

}  // namespace

// S5.10: a device that has only its boot loader gets a program by SDO block transfer to 1F50h.
TEST(ProgramLoader, ABlankDeviceGetsItsProgram) {
  ProgramRig rig;
  auto& device = *rig.devices[1];
  ASSERT_FALSE(device.device.programs()->runs());
  device.device.apply(co::NmtCommand::start);
  EXPECT_EQ(device.device.state(), NmtState::pre_operational) << "a boot loader does not become operational";
  const auto content = program_content(8'000, 1);
  const auto done = rig.download(1, program_image(8'000, 1), crc32(content));
  ASSERT_TRUE(done) << said(done);
  EXPECT_EQ(device.held(), content);
  EXPECT_TRUE(device.device.programs()->runs());
  EXPECT_EQ(rig.read<std::uint8_t>(1, 0x1F51, 1), 1);
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F56, 1), crc32(content));
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F57, 1), 0U);
  EXPECT_EQ(rig.report.bytes, 8'032U);
  EXPECT_EQ(rig.report.tries, 1U);
  device.device.apply(co::NmtCommand::start);
  EXPECT_EQ(device.device.state(), NmtState::operational);
  device.off();
  device.on();
  rig.world.run_for(50ms);
  EXPECT_TRUE(device.device.programs()->runs()) << "it outlives the power";
}

// What is told on the way: each stage once, the bytes ascending to the end.
TEST(ProgramLoader, TheProgressIsTold) {
  ProgramRig rig;
  ASSERT_TRUE(rig.download(1, program_image(5'000, 2)));
  std::vector<ProgramStage> stages;
  std::size_t last = 0;
  std::size_t steps = 0;
  for (const auto& p : rig.progress) {
    if (stages.empty() || stages.back() != p.stage) stages.push_back(p.stage);
    if (p.stage != ProgramStage::downloading) continue;
    EXPECT_GE(p.done, last);
    EXPECT_EQ(p.total, 5'032U);
    last = p.done;
    ++steps;
  }
  using enum ProgramStage;
  EXPECT_EQ(stages, (std::vector{stopping, clearing, downloading, flashing, checking, starting}));
  EXPECT_EQ(last, 5'032U);
  EXPECT_GT(steps, 5U);
}

// S5.10: up to 254 programs, or parts of one, each by its sub-index.
TEST(ProgramLoader, TwoHundredFiftyFourPrograms) {
  ProgrammedSpec spec;
  spec.layout = {.count = 254, .images = 1, .longest = 256, .sector = 256};
  ProgramRig rig(1, spec);
  std::vector<Image> images;
  for (unsigned n = 1; n <= 254; ++n) images.push_back(program_image(10 + n % 200, n));
  std::vector<ProgramWish> wishes;
  for (unsigned n = 1; n <= 254; ++n) {
    wishes.push_back({.number = static_cast<std::uint8_t>(n),
                      .image = images[n - 1],
                      .identification = crc32(program_content(10 + n % 200, n))});
  }
  const auto done = rig.download(1, wishes);
  ASSERT_TRUE(done) << said(done);
  for (unsigned n = 1; n <= 254; ++n) {
    const auto number = static_cast<std::uint8_t>(n);
    EXPECT_EQ(rig.devices[1]->held(number), program_content(10 + n % 200, n)) << n;
    EXPECT_TRUE(rig.devices[1]->device.programs()->runs(number)) << n;
  }
  EXPECT_EQ(rig.read<std::uint8_t>(1, 0x1F51, 255), od::refuse(AbortCode::no_sub_index));
}

// S5.11: 1F51h starts, stops, resets and clears each program; 1F52h has the latest date and time of them.
TEST(ProgramLoader, ProgramControl) {
  ProgrammedSpec spec;
  spec.layout.count = 2;
  ProgramRig rig(1, spec);
  auto& device = *rig.devices[1];
  const auto first = program_image(100, 1, {.type = programmed_product, .date = 15'000, .time = 7});
  const auto second = program_image(100, 2, {.type = programmed_product, .date = 14'000, .time = 9});
  const std::array wishes{ProgramWish{.number = 1, .image = first}, ProgramWish{.number = 2, .image = second}};
  const auto done = rig.download(1, wishes);
  ASSERT_TRUE(done) << said(done);
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F52, 1), 15'000U);
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F52, 2), 7U);
  const auto state = [&](std::uint8_t number) { return rig.read<std::uint8_t>(1, 0x1F51, number); };
  const auto boots = [&] {
    const bool running = device.device.programs()->runs();
    return running;
  };
  EXPECT_EQ(rig.control(1, 3), AbortCode::device_state) << "it runs";
  EXPECT_EQ(rig.control(1, 0, 2), AbortCode::none);
  EXPECT_EQ(state(2), 0);
  EXPECT_EQ(state(1), 1) << "each by itself";
  EXPECT_EQ(rig.control(1, 0), AbortCode::none);
  EXPECT_EQ(state(1), 0);
  EXPECT_FALSE(boots());
  EXPECT_EQ(rig.control(1, 2), AbortCode::none) << "reset: from its beginning";
  EXPECT_EQ(state(1), 1);
  EXPECT_EQ(rig.control(1, 0), AbortCode::none);
  EXPECT_EQ(rig.control(1, 1), AbortCode::none);
  EXPECT_TRUE(boots());
  EXPECT_EQ(rig.control(1, 0), AbortCode::none);
  EXPECT_EQ(rig.control(1, 3), AbortCode::none);
  EXPECT_EQ(state(1), 3);
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F56, 1), 0U);
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F57, 1), 1U << 1U) << "no valid program";
  EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F52, 1), 14'000U) << "of those that are there";
  EXPECT_EQ(rig.control(1, 1), AbortCode::no_data);
  EXPECT_EQ(rig.control(1, 2), AbortCode::no_data);
  for (const std::uint8_t other : {std::uint8_t{4}, std::uint8_t{0x80}, std::uint8_t{0xFF}}) {
    EXPECT_EQ(rig.control(1, other), AbortCode::invalid_value);
  }
}

// A program that was stopped is in the boot loader until it is started, reset by NMT, or power was off.
TEST(ProgramLoader, AnNmtResetStartsAStoppedProgram) {
  ProgramRig rig;
  auto& device = *rig.devices[1];
  ASSERT_TRUE(rig.download(1, program_image(100, 1)));
  ASSERT_EQ(rig.control(1, 0), AbortCode::none);
  ASSERT_FALSE(device.device.programs()->runs());
  device.device.apply(co::NmtCommand::reset_communication);
  rig.world.run_for(100ms);
  EXPECT_FALSE(device.device.programs()->runs());
  device.device.apply(co::NmtCommand::reset_node);
  rig.world.run_for(100ms);
  EXPECT_TRUE(device.device.programs()->runs());
}

// ---- what the device refuses

// Each with the words of 1F57h, at once and not again; the device stays in its boot loader, and takes the right one.
TEST(ProgramLoader, ImagesThatAreNone) {
  const auto good = program_image(3'000, 1);
  auto damaged = good;
  damaged[1'500] ^= 0x10;
  auto short_of = good;
  short_of.pop_back();
  auto longer = good;
  longer.push_back(0);
  struct Case {
    Image image;
    std::string_view words;
    std::uint32_t error;
  };
  const std::array cases{
      Case{damaged, "checksum is wrong", 3},
      Case{short_of, "checksum is wrong", 3},
      Case{longer, "checksum is wrong", 3},
      Case{program_image(100, 1, {.type = {0x11, 0x34}}), "product", 3},
      Case{program_content(500, 1), "data format", 2},
      Case{Image{}, "checksum is wrong", 3},
      Case{program_image(9'000, 1), "does not fit", 6},
  };
  for (const auto& c : cases) {
    ProgramRig rig;
    ASSERT_TRUE(rig.download(1, program_image(200, 9)));
    const auto done = rig.download(1, c.image);
    ASSERT_FALSE(done) << c.words;
    EXPECT_NE(said(done).find(c.words), std::string::npos) << said(done);
    EXPECT_EQ(rig.report.tries, 1U) << c.words;
    EXPECT_EQ(rig.read<std::uint32_t>(1, 0x1F57, 1), c.error << 1U) << c.words;
    EXPECT_EQ(rig.read<std::uint8_t>(1, 0x1F51, 1), 3) << c.words;
    EXPECT_FALSE(rig.devices[1]->device.programs()->runs());
    const auto healed = rig.download(1, good);
    EXPECT_TRUE(healed) << said(healed);
  }
}

TEST(ProgramLoader, AnImageWithoutAHeadIsAProgramWhereTheDeviceTakesAny) {
  ProgrammedSpec spec;
  spec.checked = false;
  ProgramRig rig(1, spec);
  const auto content = program_content(777, 5);
  ASSERT_TRUE(rig.download(1, content, crc32(content)));
  EXPECT_EQ(rig.devices[1]->held(), content);
}

TEST(ProgramLoader, AnotherIdentificationIsTold) {
  ProgramRig rig;
  const auto done = rig.download(1, program_image(100, 1), 0x1234);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::mismatch);
  EXPECT_EQ(done.error().index, 0x1F56);
  EXPECT_EQ(rig.report.stage, ProgramStage::checking);
  EXPECT_EQ(rig.read<std::uint8_t>(1, 0x1F51, 1), 0) << "it is not started";
}

TEST(ProgramLoader, AMemoryThatCannotBeWritten) {
  ProgramRig rig;
  rig.devices[1]->flash.broken(true);
  const auto done = rig.download(1, program_image(4'000, 1));
  ASSERT_FALSE(done);
  EXPECT_NE(said(done).find("could not be written"), std::string::npos) << said(done);
}

// ---- bad luck

TEST(ProgramLoader, ADeviceThatRestartsInMidDownloadGetsItAgain) {
  for (const auto command : {co::NmtCommand::reset_node, co::NmtCommand::reset_communication}) {
    ProgramRig rig;
    const auto image = program_image(6'000, 4);
    const std::array wishes{ProgramWish{.number = 1, .image = image}};
    const auto done = rig.download(1, wishes, 3'000, [&] { rig.devices[1]->device.apply(command); });
    ASSERT_TRUE(done) << said(done);
    EXPECT_EQ(rig.report.tries, 2U);
    EXPECT_EQ(rig.devices[1]->held(), program_content(6'000, 4));
    EXPECT_TRUE(rig.devices[1]->device.programs()->runs());
  }
}

// It has taken the whole image, and has none when it is back: its memory was not yet written to the end.
TEST(ProgramLoader, ADeviceThatLosesItsPowerWhileItWritesGetsItAgain) {
  ProgrammedSpec slow;
  slow.times.sector = 300ms;
  ProgramRig rig(1, slow);
  rig.act_in = ProgramStage::flashing;
  const auto image = program_image(6'000, 4);
  const std::array wishes{ProgramWish{.number = 1, .image = image}};
  const auto done = rig.download(1, wishes, 0, [&] {
    rig.devices[1]->off();
    rig.devices[1]->on();
  });
  ASSERT_TRUE(done) << said(done);
  EXPECT_EQ(rig.report.tries, 2U);
  EXPECT_EQ(rig.devices[1]->held(), program_content(6'000, 4));
}

TEST(ProgramLoader, ADeviceThatStaysSilentIsGivenUp) {
  ProgramRig rig;
  rig.given.restart_time = 500ms;
  const auto image = program_image(6'000, 4);
  const std::array wishes{ProgramWish{.number = 1, .image = image}};
  const auto done = rig.download(1, wishes, 3'000, [&] { rig.devices[1]->off(); });
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, Errc::timeout) << said(done);
  EXPECT_EQ(rig.report.tries, 3U);
  const auto began = rig.world.now();
  EXPECT_FALSE(rig.get_task(clear_program, 1));
  EXPECT_LE(rig.world.now() - began, 2s) << "nothing is waited for where nothing answers";
}

// A device whose SDO server knows no block transfer, and that has neither 1F56h nor 1F57h, nor a state to be read.
TEST(ProgramLoader, ABlockTransferThatIsRefusedGoesSegmented) {
  ProgramRig rig(0);
  od::DescriptionBuilder b;
  device::add_device(b);
  b.object(0x1F50, od::ObjectCode::array, "Program data", od::DataType::domain);
  b.sub(0x1F50, {.sub = 1, .name = "Program data", .type = od::DataType::domain, .capacity = 4'096});
  b.object(0x1F51, od::ObjectCode::array, "Program control", od::DataType::unsigned8);
  b.sub(0x1F51, {.sub = 1, .name = "Program control", .type = od::DataType::unsigned8});
  od::Values values(b.build(), NodeId(5));
  struct Old final : can::Handler {
    Old(can::Dispatcher& on, od::Values& of) : dispatcher(&on), server(of, 4'096) {
      server.set_response_id(co::CobId(0x585));
      on.add(can::only(0x605), *this);
    }
    void received(const can::Frame& frame, rt::Time) noexcept override {
      can::Frame answer;
      const bool block = (frame.data[0] & 0xE0U) == 0xC0U;
      if (block) {
        ++blocks;
        answer = can::Frame::base(0x585, std::array<std::uint8_t, 8>{0x80, frame.data[1], frame.data[2], frame.data[3],
                                                                     0x01, 0x00, 0x04, 0x05});
      } else if (!server.handle(frame, answer)) {
        return;
      }
      static_cast<void>(dispatcher->send(answer));
    }
    can::Dispatcher* dispatcher;
    co::SdoServer server;
    unsigned blocks = 0;
  };
  const auto port = rig.wire.attach({.queue_depth = 16, .rx_depth = 64});
  can::Dispatcher dispatcher(rig.world.executor(), *port);
  Old old(dispatcher, values);
  const auto image = program_content(2'000, 8);
  const auto done = rig.download(5, image);
  ASSERT_TRUE(done) << said(done);
  EXPECT_EQ(old.blocks, 1U);
  EXPECT_TRUE(std::ranges::equal(values.bytes({0x1F50, 1}), image));
  EXPECT_EQ(values.get<std::uint8_t>({0x1F51, 1}), 1);
}

// ---- many at once

namespace {

struct Fleet {
  explicit Fleet(ProgramRig& of, const Image& image, bool paced = true) : rig(&of), wish{ProgramWish{.image = image}} {
    rig->given.transfers = paced ? &rig->transfers : nullptr;
  }
  rt::Task<void> one(NodeId id) {
    co::NodeAccess access(rig->managed.sdo(), id);
    ProgramLoader loader(access, wish, rig->given);
    ProgramReport report;
    const auto done = co_await loader.run(report);
    ++(done ? good : bad);
    if (!done) words += describe(report, done.error()) + "; ";
    most_tries = std::max(most_tries, report.tries);
  }
  void run() {
    rt::Scope scope(rig->world.executor());
    for (auto& [id, device] : rig->devices) scope.spawn(one(NodeId(id)));
    EXPECT_TRUE(rig->world.run_until([&] { return good + bad == rig->devices.size(); }, 600s));
  }
  ProgramRig* rig;
  std::array<ProgramWish, 1> wish;
  std::size_t good = 0;
  std::size_t bad = 0;
  unsigned most_tries = 0;
  std::string words;
};

}  // namespace

// 44 devices side by side, each at its first try; none of them loses its heartbeat meanwhile.
TEST(ProgramLoader, FortyFourDevicesAtOnce) {
  for (const std::uint32_t bit_rate : {125'000U, 500'000U}) {
    ProgrammedSpec spec;
    spec.bit_rate = bit_rate;
    ProgramRig rig(44, spec);
    struct Lost final : co::HeartbeatConsumer::Observer {
      void heartbeat(const co::HeartbeatEvent& event, rt::Time) noexcept override {
        if (event.kind == co::HeartbeatEvent::Kind::lost) ++lost;
      }
      unsigned lost = 0;
    } lost;
    co::HeartbeatConsumer consumer(rig.dispatcher, lost);
    for (const auto& [id, device] : rig.devices) consumer.supervise(NodeId(id), 500ms);
    rig.world.run_for(1s);
    ASSERT_EQ(lost.lost, 0U);
    const auto image = program_image(3'000, 6);
    Fleet fleet(rig, image);
    fleet.run();
    EXPECT_EQ(fleet.good, 44U) << fleet.words;
    EXPECT_EQ(fleet.most_tries, 1U);
    EXPECT_EQ(lost.lost, 0U) << "the segments leave room for the heartbeats, at " << bit_rate;
    for (const auto& [id, device] : rig.devices) EXPECT_TRUE(device->device.programs()->runs());
  }
}

TEST(ProgramTransfers, AsManyAtOnceAsHaveTheirTurnInTime) {
  EXPECT_EQ(ProgramTransfers::at_once(10'000), 2U);
  EXPECT_EQ(ProgramTransfers::at_once(125'000), 2U);
  EXPECT_EQ(ProgramTransfers::at_once(500'000), 9U);
  EXPECT_EQ(ProgramTransfers::at_once(1'000'000), 16U);
  EXPECT_EQ(ProgramTransfers::at_once(0), 2U);
}
