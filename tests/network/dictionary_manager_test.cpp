// A device that is the master of its network by its own dictionary (docs/protocols/cia302.md §Objects of a master),
// with whole devices as slaves and a tool that reads and writes its objects by SDO.
#include "berth/network/dictionary_manager.hpp"

#include "berth/co/sdo_client.hpp"
#include "berth/eds/concise_dcf.hpp"
#include "berth/eds/write.hpp"
#include "berth/manager/stored_dcf.hpp"
#include "tests/network/network_rig.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::network::test;
using od::AbortCode;
using Kind = NetworkEvent::Kind;
using Phase = NetworkBoot::Phase;
using UploadState = ConfigurationUploads::State;
using namespace std::chrono_literals;

namespace {

constexpr std::uint32_t mandatory_slave = 0x0D;  // assigned, booted on error, mandatory
constexpr std::uint8_t master_id = 100;

const std::shared_ptr<const od::Description>& master_description() {
  static const auto description = [] {
    od::DescriptionBuilder b;
    device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
    add_manager_objects(b, {.most = 8, .startup = 0, .longest_concise = 200, .longest_dcf = 2000});
    return b.build();
  }();
  return description;
}

// A master with node-ID 100, slaves 1 to `slaves`, a tool.
struct MasterRig : can::Tap {
  explicit MasterRig(std::uint32_t startup = 1, std::uint8_t slaves = 3, std::vector<device::Preset> more = {},
                     const std::shared_ptr<const od::Description>& description = master_description()) {
    wire.add_tap(*this);
    auto presets = std::move(more);
    presets.push_back({{0x1F80, 0}, startup});
    for (std::uint8_t id = 1; id <= slaves; ++id) {
      presets.push_back({{0x1F81, id}, mandatory_slave});
      presets.push_back({{0x1F84, id}, slave_type});
      presets.push_back({{0x1016, id}, std::uint32_t{id} << 16U | 300U});
      stations[id] = std::make_unique<Station>(world, wire, id, slave_description());
      stations[id]->on();
    }
    master = std::make_unique<Station>(world, wire, master_id, description, std::move(presets));
    manager = std::make_unique<DictionaryManager>(master->dispatcher, master->device.values(),
                                                  [this](co::NmtCommand command) { master->device.apply(command); });
    master->device.on().state = [this](NmtState state) { manager->own_state(state, NodeId(master_id)); };
    manager->network().observe([this](const NetworkEvent& event) { events.push_back(event); });
  }
  ~MasterRig() {
    wire.remove_tap(*this);
    manager.reset();  // it hears the master's port
  }
  void frame(const can::Frame& frame, rt::Time, int) noexcept override { frames.push_back(can::to_string(frame)); }
  void go() {
    master->on();
    ASSERT_TRUE(run_to(Phase::operational));
    world.run_for(500ms);
    frames.clear();
    events.clear();
  }
  bool run_to(Phase phase, rt::Duration limit = 30s) {
    return world.run_until([&] { return manager->network().phase() == phase; }, limit);
  }
  template <class Op>
  auto get(Op&& op) {
    struct Done final : rt::Job {
      void run() noexcept override { done = true; }
      bool done = false;
    } done;
    if (!op.begin(world.executor(), done)) {
      EXPECT_TRUE(world.run_until([&] { return done.done; }, 10s));
    }
    return op.await_resume();
  }
  // By SDO, from another node; what the network makes of it gets some time.
  template <class T>
  AbortCode write(std::uint16_t index, std::uint8_t sub, T value) {
    const auto done = get(tool.write(NodeId(master_id), index, sub, value));
    world.run_for(300ms);
    if (done) return AbortCode::none;
    EXPECT_EQ(done.error().code, Errc::aborted) << describe(done.error());
    return static_cast<AbortCode>(done.error().detail);
  }
  AbortCode store(std::uint16_t index, std::uint8_t sub, std::span<const std::uint8_t> bytes) {
    const auto done = get(tool.download(NodeId(master_id), index, sub, bytes));
    return done ? AbortCode::none : static_cast<AbortCode>(done.error().detail);
  }
  AbortCode store_text(std::uint16_t index, std::uint8_t sub, const std::string& text) {
    return store(index, sub, std::vector<std::uint8_t>(text.begin(), text.end()));
  }
  template <class T>
  od::Answer<T> read(std::uint16_t index, std::uint8_t sub) {
    const auto value = get(tool.read<T>(NodeId(master_id), index, sub));
    if (value) return *value;
    return od::refuse(static_cast<AbortCode>(value.error().detail));
  }
  [[nodiscard]] std::size_t count(std::string_view frame) const {
    return static_cast<std::size_t>(std::ranges::count(frames, frame));
  }
  bool all_slaves(NmtState state) {
    return std::ranges::all_of(stations, [&](auto& s) { return s.second->state() == state; });
  }
  std::uint32_t limit(std::uint8_t id) { return stations[id]->device.values().get_or<std::uint32_t>({0x2000, 0}, 0); }

  sim::World world;
  sim::Bus& wire = world.add_bus("bus", 500'000);
  std::unique_ptr<sim::Controller> tool_port = wire.attach({.queue_depth = 16, .rx_depth = 64});
  can::Dispatcher tool_dispatcher{world.executor(), *tool_port};
  co::SdoClient tool{tool_dispatcher};
  std::map<std::uint8_t, std::unique_ptr<Station>> stations;
  std::unique_ptr<Station> master;
  std::unique_ptr<DictionaryManager> manager;
  std::vector<std::string> frames;
  std::vector<NetworkEvent> events;
};

// Finds out what a test says.
struct ScriptedSource final : manager::NodeIdSource {
  ~ScriptedSource() { gone(); }
  void begin(NodeId) noexcept override {}
  rt::Task<Result<void>> run(std::bitset<128>) override { co_return Result<void>{}; }
  [[nodiscard]] std::bitset<128> answered() const noexcept override { return who_answers; }
  [[nodiscard]] std::bitset<128> silent() const noexcept override { return who_is_silent; }
  [[nodiscard]] rt::Duration pause() const noexcept override { return 100ms; }
  std::bitset<128> who_answers;
  std::bitset<128> who_is_silent;
};

std::vector<std::uint8_t> concise(std::uint32_t limit) {
  std::vector<std::uint8_t> value(4);
  store_le(value.data(), limit);
  return eds::encode(eds::ConciseDcf{{{{0x2000, 0}, value}}});
}

std::string dcf_of_limit(unsigned limit) {
  return "[FileInfo]\nFileName=slave.dcf\n[DeviceInfo]\n[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
         "[1000]\nParameterName=Device type\nObjectType=7\nDataType=7\nAccessType=ro\nPDOMapping=0\n"
         "[ManufacturerObjects]\nSupportedObjects=1\n1=0x2000\n"
         "[2000]\nParameterName=Limit\nObjectType=7\nDataType=7\nAccessType=rw\nPDOMapping=0\nParameterValue=" +
         std::to_string(limit) + "\n";
}

}  // namespace

// S5.12, S5.13: 1F80h says that it is master, 1F81h which slaves, 1016h how they are supervised.
TEST(DictionaryManager, AnyDeviceIsAMasterByItsDictionary) {
  MasterRig rig;
  rig.master->on();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.world.run_for(20ms);
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
  EXPECT_EQ(rig.count("000#8200"), 1U);
  EXPECT_TRUE(rig.manager->network().find(NodeId(2))->supervised);
  EXPECT_FALSE(rig.manager->refused());
}

TEST(DictionaryManager, ADeviceThatIsNoMasterCommandsNothing) {
  for (const std::uint32_t startup : {0x00U, 0x20U, 0x80U}) {
    MasterRig rig(startup == 0 ? 0 : startup | 1U);
    rig.master->on();
    rig.world.run_for(3s);
    EXPECT_TRUE(std::ranges::none_of(rig.frames, [](auto& f) { return f.starts_with("000#"); })) << startup;
    EXPECT_EQ(rig.manager->network().phase(), Phase::off);
    EXPECT_EQ(rig.manager->refused().has_value(), startup != 0) << "flying master, reserved bit";
    EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x05), AbortCode::device_state);
    EXPECT_EQ(rig.write<std::uint8_t>(0x1F83, 1, 1), AbortCode::device_state);
    EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 1), 0);
  }
}

// A master of 1F80h = 09h (the application starts the slaves) is no device that starts itself by bit 3.
TEST(DictionaryManager, ItBecomesOperationalOnlyWhenTheSlavesAreReady) {
  MasterRig rig(0x09);
  rig.stations[2]->off();
  rig.master->on();
  rig.world.run_for(10s);
  EXPECT_EQ(rig.master->state(), NmtState::pre_operational);
  rig.stations[2]->on();
  rig.world.run_for(3s);
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  EXPECT_TRUE(rig.all_slaves(NmtState::pre_operational));
}

// 1F80h bit 2: the application makes its device operational, and that starts the slaves.
TEST(DictionaryManager, TheApplicationStartsItsOwnDevice) {
  MasterRig rig(0x07);
  rig.master->on();
  ASSERT_TRUE(rig.run_to(Phase::ready));
  rig.world.run_for(1s);
  EXPECT_TRUE(rig.all_slaves(NmtState::pre_operational));
  rig.master->device.apply(co::NmtCommand::start);
  rig.world.run_for(20ms);
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
  EXPECT_EQ(rig.count("000#0100"), 1U);
}

// 1F89h in ms, and what the master says of each slave then.
TEST(DictionaryManager, TheBootTime) {
  MasterRig rig(1, 3, {{{0x1F89, 0}, 4000}});
  rig.stations[2]->off();
  rig.master->on();
  const auto began = rig.world.now();
  ASSERT_TRUE(rig.run_to(Phase::halted));
  EXPECT_NEAR(std::chrono::duration<double>(rig.world.now() - began).count(), 4.0, 1.1);
  EXPECT_EQ(rig.master->state(), NmtState::pre_operational);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 2), 0x01) << "missing";
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 1), 0x05);
}

// 102Ah, in 100 us.
TEST(DictionaryManager, TheInhibitTime) {
  MasterRig rig(1, 3, {{{0x102A, 0}, 150}});
  std::vector<rt::Time> times;
  struct Clock final : can::Tap {
    explicit Clock(std::vector<rt::Time>& into) : times(&into) {}
    void frame(const can::Frame& frame, rt::Time at, int) noexcept override {
      if (frame.id == 0) times->push_back(at);
    }
    std::vector<rt::Time>* times;
  } clock(times);
  rig.wire.add_tap(clock);
  rig.master->on();
  ASSERT_TRUE(rig.run_to(Phase::operational));
  rig.world.run_for(100ms);
  rig.wire.remove_tap(clock);
  ASSERT_EQ(times.size(), 4U);
  for (std::size_t i = 1; i < times.size(); ++i) EXPECT_GE(times[i] - times[i - 1], 15ms);
}

// 1F80h bit 4: an error of a mandatory slave resets all, the master's own device too; it boots them again.
TEST(DictionaryManager, TheMasterResetsItselfToo) {
  MasterRig rig(0x11);
  rig.go();
  rig.stations[2]->device.power_on();
  rig.world.run_for(3s);
  EXPECT_EQ(rig.count("000#8100"), 1U);
  EXPECT_EQ(rig.count("764#00"), 1U) << "the master's boot-up message";
  EXPECT_EQ(rig.count("000#8200"), 1U);
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
}

// 1F82h: each request to one slave, and what is read then.
TEST(DictionaryManager, RequestNmtForOneSlave) {
  MasterRig rig;
  rig.go();
  struct Case {
    std::uint8_t value;
    std::string_view frame;
    NmtState state;
  };
  for (const auto& c : {Case{0x04, "000#0202", NmtState::stopped}, Case{0x7F, "000#8002", NmtState::pre_operational},
                        Case{0x05, "000#0102", NmtState::operational}}) {
    EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 2, c.value), AbortCode::none);
    EXPECT_EQ(rig.count(c.frame), 1U) << c.frame;
    EXPECT_EQ(rig.stations[2]->state(), c.state);
    EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 2), static_cast<std::uint8_t>(c.state));
  }
  for (const std::uint8_t reset : {std::uint8_t{0x06}, std::uint8_t{0x07}}) {
    rig.frames.clear();
    EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 2, reset), AbortCode::none);
    EXPECT_EQ(rig.count(reset == 0x06 ? "000#8102" : "000#8202"), 1U);
    EXPECT_EQ(rig.count("702#00"), 1U);
    EXPECT_EQ(rig.stations[2]->state(), NmtState::operational) << "it is booted again";
  }
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, master_id), od::refuse(AbortCode::no_sub_index)) << "has 1 to 8";
}

// A slave that failed to boot has no error control: that it left, and that it is there again, is known only to the part
// that assigns node-IDs. It is then reset, so that it is booted.
TEST(DictionaryManager, ASlaveThatFailedAndLeftHasNoState) {
  ScriptedSource source;
  MasterRig rig(1, 3, {{{0x1F85, 2}, std::uint32_t{0xBAD}}});
  rig.manager->assign_by(&source);
  rig.master->on();
  rig.world.run_for(3s);
  ASSERT_EQ(rig.manager->network().find(NodeId(2))->result.status, BootStatus::d);
  ASSERT_TRUE(rig.get(rig.tool.write(NodeId(2), 0x1017, 0, std::uint16_t{0}))) << "it sends nothing of itself";
  ASSERT_EQ(rig.read<std::uint8_t>(0x1F82, 2), 0x7F);
  source.who_answers.set(2);
  rig.frames.clear();
  rig.world.run_for(1s);
  EXPECT_EQ(rig.count("000#8102"), 0U) << "its state is known: it waits for a person";
  source.who_answers.reset();
  source.who_is_silent.set(2);
  rig.world.run_for(200ms);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 2), 0) << "unknown";
  source.who_is_silent.reset();
  source.who_answers.set(2);
  rig.world.run_for(1s);
  EXPECT_EQ(rig.count("000#8102"), 1U);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 2), 0x7F) << "it has told its boot-up";
}

// Bits 2 and 3 of 1F81h count from the slave's next boot-up on, without one of the master's.
TEST(DictionaryManager, ASlaveIsHeldBackAndLetIn) {
  MasterRig rig;
  rig.go();
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F81, 2, 0x01), AbortCode::none);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::operational) << "nothing is done to it";
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 2, 7), AbortCode::none);
  rig.world.run_for(3s);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::pre_operational);
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F81, 2, mandatory_slave), AbortCode::none);
  rig.world.run_for(1s);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::pre_operational);
  rig.frames.clear();
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 2, 7), AbortCode::none);
  EXPECT_TRUE(rig.world.run_until([&] { return rig.all_slaves(NmtState::operational); }, 3s));
  EXPECT_EQ(rig.count("000#0103") + rig.count("701#00") + rig.count("703#00"), 0U) << "the others run on";
}

// 04h to all is for the master too; 84h is not.
TEST(DictionaryManager, RequestNmtForAll) {
  MasterRig rig;
  rig.go();
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, 0x8F), AbortCode::none);
  EXPECT_EQ(rig.count("000#8000"), 1U);
  EXPECT_TRUE(rig.all_slaves(NmtState::pre_operational));
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, 0x85), AbortCode::none);
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, 0x84), AbortCode::none);
  EXPECT_TRUE(rig.all_slaves(NmtState::stopped));
  EXPECT_EQ(rig.master->state(), NmtState::operational);
  for (const std::uint8_t reset : {std::uint8_t{0x86}, std::uint8_t{0x87}}) {
    rig.frames.clear();
    EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, reset), AbortCode::none);
    EXPECT_EQ(rig.count(reset == 0x86 ? "000#8100" : "000#8200"), 1U);
    EXPECT_EQ(rig.count("703#00"), 1U);
    EXPECT_TRUE(rig.all_slaves(NmtState::operational));
  }
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, 0x7F), AbortCode::none);
  EXPECT_TRUE(rig.all_slaves(NmtState::pre_operational));
  EXPECT_EQ(rig.master->state(), NmtState::pre_operational);
}

// The requester is spared when it is known.
TEST(DictionaryManager, TheRequesterIsSpared) {
  MasterRig rig;
  rig.go();
  NetworkRequests requests(rig.manager->network());
  EXPECT_EQ(requests.nmt(0x80, 0x84, NodeId(2)), AbortCode::none);
  rig.world.run_for(20ms);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::stopped);
  EXPECT_EQ(rig.stations[2]->state(), NmtState::operational);
  EXPECT_EQ(rig.stations[3]->state(), NmtState::stopped);
}

TEST(DictionaryManager, RequestsThatAreRefused) {
  MasterRig rig;
  rig.go();
  const auto nmt = [&](std::uint8_t sub, std::uint8_t value) { return rig.write(0x1F82, sub, value); };
  EXPECT_EQ(nmt(4, 0x05), AbortCode::invalid_value) << "not assigned";
  EXPECT_EQ(nmt(9, 0x05), AbortCode::no_sub_index);
  EXPECT_EQ(nmt(0, 0x05), AbortCode::read_only);
  for (unsigned value = 0; value <= 0xFF; ++value) {
    const bool one = value == 0x04 || value == 0x05 || value == 0x06 || value == 0x07 || value == 0x7F;
    const bool all = (value >= 0x84 && value <= 0x87) || value == 0x8F;
    const auto request = static_cast<std::uint8_t>(value);
    if (one) continue;
    EXPECT_EQ(nmt(2, request), AbortCode::invalid_value) << value;
    if (all) continue;
    EXPECT_EQ(nmt(0x80, request), AbortCode::invalid_value) << value;
  }
  EXPECT_EQ(rig.write<std::uint16_t>(0x1F82, 2, 5), AbortCode::length_too_high);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 0x80), od::refuse(AbortCode::write_only));
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 4), 0) << "not assigned: unknown";
  EXPECT_TRUE(std::ranges::none_of(rig.frames, [](auto& f) { return f.starts_with("000#"); }));
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
}

// S5.12: 1F80h refuses what this master cannot do; the rest counts from its next boot-up.
TEST(DictionaryManager, TheStartupIsWrittenBySdo) {
  MasterRig rig;
  rig.go();
  for (unsigned bit = 7; bit < 32; ++bit) EXPECT_EQ(rig.write(0x1F80, 0, 1U | 1U << bit), AbortCode::invalid_value);
  EXPECT_EQ(rig.write(0x1F80, 0, 0x21U), AbortCode::invalid_value) << "flying master";
  EXPECT_EQ(rig.read<std::uint32_t>(0x1F80, 0), 1U);
  EXPECT_EQ(rig.write(0x1F80, 0, 0x5FU), AbortCode::none);
  EXPECT_EQ(rig.read<std::uint32_t>(0x1F80, 0), 0x5FU);
  EXPECT_TRUE(rig.manager->network().plan().startup == *startup_of(1)) << "the network runs by the former";
}

// 1F83h.
TEST(DictionaryManager, RequestGuarding) {
  MasterRig rig;
  rig.go();
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F83, 2), 1);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F83, 4), 0);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F83, 0x80), od::refuse(AbortCode::write_only));
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F83, 2, 2), AbortCode::invalid_value);
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F83, 4, 1), AbortCode::invalid_value);
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F83, 2, 0), AbortCode::none);
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F83, 2), 0);
  rig.stations[2]->off();
  rig.world.run_for(1s);
  EXPECT_TRUE(rig.events.empty());
  EXPECT_EQ(rig.write<std::uint8_t>(0x1F83, 0x80, 1), AbortCode::none);
  rig.world.run_for(1s);
  ASSERT_EQ(rig.events.size(), 1U);
  EXPECT_EQ(rig.events[0].kind, Kind::slave_lost);
  EXPECT_EQ(rig.events[0].node, NodeId(2));
  EXPECT_EQ(rig.read<std::uint8_t>(0x1F82, 2), 0x01) << "missing";
}

// S5.17: a concise DCF in 1F22h, stored by SDO and readable back, is brought into the slave on its next boot-up; with
// 1F26h and 1F27h equal to 1020h nothing is downloaded; zero or not equal: it is.
TEST(DictionaryManager, AConciseDcfIsBroughtIntoItsSlave) {
  MasterRig rig(1, 2, {{{0x1F26, 1}, 15'000}, {{0x1F27, 1}, 1'000}});
  rig.go();
  EXPECT_EQ(rig.limit(1), 0U);
  const auto stream = concise(77);
  ASSERT_EQ(rig.store(0x1F22, 1, stream), AbortCode::none);
  const auto back = rig.get(rig.tool.upload(NodeId(master_id), 0x1F22, 1));
  ASSERT_TRUE(back);
  EXPECT_TRUE(std::ranges::equal(back->bytes(), stream));
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
  EXPECT_EQ(rig.limit(1), 77U);
  EXPECT_EQ(rig.limit(2), 0U) << "only its own";
  EXPECT_EQ(rig.stations[1]->device.values().get<std::uint32_t>({0x1020, 1}), 15'000U);
  EXPECT_EQ(rig.stations[1]->device.values().get<std::uint32_t>({0x1020, 2}), 1'000U);
  rig.frames.clear();
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  EXPECT_EQ(rig.limit(1), 77U) << "it was saved";
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
  const auto downloads = std::ranges::count_if(rig.frames, [](auto& f) { return f.starts_with("601#2"); });
  EXPECT_EQ(downloads, 0) << "the date agrees";
}

// 1F20h: the DCF as text. 1F22h, where there is one, comes before it.
TEST(DictionaryManager, ADcfAsTextIsBroughtIntoItsSlave) {
  const std::string dcf = dcf_of_limit(41);
  MasterRig rig;
  rig.go();
  const std::vector<std::uint8_t> bytes(dcf.begin(), dcf.end());
  ASSERT_EQ(rig.store(0x1F20, 1, bytes), AbortCode::none);
  ASSERT_EQ(rig.store(0x1F20, 2, bytes), AbortCode::none);
  ASSERT_EQ(rig.store(0x1F22, 2, concise(42)), AbortCode::none);
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 0x80, 0x86), AbortCode::none);
  rig.world.run_for(1s);
  EXPECT_EQ(rig.limit(1), 41U);
  EXPECT_EQ(rig.limit(2), 42U);
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
}

// S5.17: a DCF that is stored compressed (1F21h = 128); what is stored is read back as it was written.
TEST(DictionaryManager, ACompressedDcfIsBroughtIntoItsSlave) {
  MasterRig rig;
  rig.go();
  const auto packed = pack_stored(dcf_of_limit(43));
  ASSERT_LT(packed.size(), dcf_of_limit(43).size());
  ASSERT_EQ(rig.store(0x1F20, 1, packed), AbortCode::none);
  ASSERT_EQ(rig.write(0x1F21, 1, stored_format::zlib), AbortCode::none);
  const auto back = rig.get(rig.tool.upload(NodeId(master_id), 0x1F20, 1));
  ASSERT_TRUE(back);
  EXPECT_TRUE(std::ranges::equal(back->bytes(), packed));
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  EXPECT_EQ(rig.limit(1), 43U);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
}

// 1F25h of the master's own node-ID: what 1F22h has for that goes into its own dictionary, and out of 1F22h.
TEST(DictionaryManager, ItsOwnConfiguration) {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
  add_manager_objects(b, {.most = master_id, .longest_concise = 200});
  MasterRig rig(1, 3, {}, b.build());
  rig.go();
  const std::uint32_t conf = ConfigurationRequests::signature;
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F25, master_id, conf), AbortCode::not_stored) << "there is none";
  const auto four = [](std::uint32_t value) {
    std::vector<std::uint8_t> bytes(4);
    store_le(bytes.data(), value);
    return bytes;
  };
  eds::ConciseDcf list{{{{0x1F81, 9}, four(5)}, {{0x1F85, 9}, four(77)}, {{0x1F22, 9}, concise(6)}}};
  EXPECT_EQ(rig.store(0x1F22, master_id, eds::encode(list)), AbortCode::none);
  EXPECT_EQ(*rig.read<std::uint32_t>(0x1F85, 9), 0U) << "not before it is told to";
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F25, master_id, 1), AbortCode::not_stored) << "another signature";
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F25, master_id, conf), AbortCode::none);
  EXPECT_EQ(*rig.read<std::uint32_t>(0x1F81, 9), 5U);
  EXPECT_EQ(*rig.read<std::uint32_t>(0x1F85, 9), 77U);
  const auto row = rig.master->device.values().bytes({0x1F22, 9});
  EXPECT_EQ(std::vector<std::uint8_t>(row.begin(), row.end()), concise(6));
  EXPECT_TRUE(rig.master->device.values().bytes({0x1F22, master_id}).empty());
  EXPECT_TRUE(rig.all_slaves(NmtState::operational)) << "a list counts at the master's next boot-up";
  // What refuses an entry is told, and nothing behind it is written.
  list = {{{{0x1F85, 9}, four(78)}, {{0x1018, 1}, four(1)}, {{0x1F85, 10}, four(79)}}};
  EXPECT_EQ(rig.store(0x1F22, master_id, eds::encode(list)), AbortCode::none);
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F25, master_id, conf), AbortCode::read_only);
  EXPECT_EQ(*rig.read<std::uint32_t>(0x1F85, 9), 78U);
  EXPECT_EQ(*rig.read<std::uint32_t>(0x1F85, 10), 0U);
  list = {{{{0x1F25, master_id}, four(conf)}}};
  EXPECT_EQ(rig.store(0x1F22, master_id, eds::encode(list)), AbortCode::none);
  EXPECT_EQ(rig.write<std::uint32_t>(0x1F25, master_id, conf), AbortCode::general);
}

// 1F25h: "conf" configures a slave at once and leaves its NMT state; 80h all of them.
TEST(DictionaryManager, RequestConfiguration) {
  MasterRig rig;
  std::map<std::uint8_t, bool> told;
  rig.manager->configurations().observe(
      [&](NodeId node, const Result<void>& done) { told[node.value()] = done.has_value(); });
  rig.go();
  for (const std::uint8_t id : {std::uint8_t{1}, std::uint8_t{2}}) {
    ASSERT_EQ(rig.store(0x1F22, id, concise(60U + id)), AbortCode::none);
  }
  EXPECT_EQ(rig.write(0x1F25, 1, std::uint32_t{0x666E'6F63}), AbortCode::none);
  EXPECT_EQ(rig.limit(1), 61U);
  EXPECT_EQ(rig.limit(2), 0U);
  EXPECT_EQ(told, (std::map<std::uint8_t, bool>{{1, true}}));
  EXPECT_EQ(rig.write(0x1F25, 0x80, ConfigurationRequests::signature), AbortCode::none);
  EXPECT_EQ(rig.limit(2), 62U);
  EXPECT_EQ(told.size(), 3U) << "slave 3 has nothing to be configured, and that is done";
  EXPECT_TRUE(rig.all_slaves(NmtState::operational));
  EXPECT_TRUE(rig.events.empty());
  EXPECT_TRUE(std::ranges::none_of(rig.frames, [](auto& f) { return f.starts_with("000#"); }));
}

TEST(DictionaryManager, ConfigurationsThatAreNotBegun) {
  MasterRig rig;
  rig.go();
  constexpr auto conf = ConfigurationRequests::signature;
  EXPECT_EQ(rig.write(0x1F25, 1, conf + 1), AbortCode::not_stored);
  EXPECT_EQ(rig.write(0x1F25, 0x80, 0U), AbortCode::not_stored);
  EXPECT_EQ(rig.write(0x1F25, 4, conf), AbortCode::invalid_value) << "not assigned";
  EXPECT_EQ(rig.read<std::uint32_t>(0x1F25, 1), od::refuse(AbortCode::write_only));
  // While it boots its configuration is under way anyhow.
  rig.stations[2]->off();
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 2, 0x06), AbortCode::none);
  EXPECT_EQ(rig.write(0x1F25, 2, conf), AbortCode::device_state);
  MasterRig idle(0);
  idle.master->on();
  idle.world.run_for(100ms);
  EXPECT_EQ(idle.write(0x1F25, 1, conf), AbortCode::device_state) << "no master";
}

// A slave that refuses its configuration is told, and runs on.
TEST(DictionaryManager, ARequestedConfigurationThatFails) {
  MasterRig rig;
  std::string why;
  rig.manager->configurations().observe([&](NodeId, const Result<void>& done) {
    if (!done) why = describe(done.error());
  });
  rig.go();
  const std::vector<std::uint8_t> text = {'n', 'o', ' ', 'D', 'C', 'F'};
  ASSERT_EQ(rig.store(0x1F20, 1, text), AbortCode::none);
  EXPECT_EQ(rig.write(0x1F25, 1, ConfigurationRequests::signature), AbortCode::none);
  EXPECT_NE(why.find("1F20h"), std::string::npos) << why;
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
}

// What is stored and is none, or is refused by the slave, is a J of that slave, with its reason.
TEST(DictionaryManager, AConfigurationThatIsNoneFailsItsSlave) {
  MasterRig rig;
  rig.go();
  const std::vector<std::uint8_t> junk = {2, 0, 0, 0, 0x00, 0x20, 0, 4, 0, 0, 0, 1};
  ASSERT_EQ(rig.store(0x1F22, 1, junk), AbortCode::none);
  const std::vector<std::uint8_t> text = {'n', 'o', ' ', 'D', 'C', 'F'};
  ASSERT_EQ(rig.store(0x1F20, 2, text), AbortCode::none);
  ASSERT_EQ(rig.store(0x1F20, 3, text), AbortCode::none);
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F21, 3, 129), AbortCode::none);
  for (const std::uint8_t id : {std::uint8_t{1}, std::uint8_t{2}, std::uint8_t{3}}) {
    ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, id, 0x06), AbortCode::none);
    const auto& status = *rig.manager->network().find(NodeId(id));
    EXPECT_EQ(letter(status.result.status), 'J') << int{id};
    EXPECT_NE(status.result.detail.find(id == 1   ? "1F22h"
                                        : id == 2 ? "1F20h"
                                                  : "1F21h"),
              std::string::npos)
        << status.result.text();
    EXPECT_EQ(rig.stations[id]->state(), NmtState::pre_operational);
  }
  EXPECT_EQ(rig.manager->network().phase(), Phase::operational) << "the others run on";
}

// A DCF for another product: nothing of it is written, and the right one heals it.
TEST(DictionaryManager, ADcfForAnotherProductIsNotBroughtIntoItsSlave) {
  MasterRig rig;
  rig.go();
  const auto dcf_for = [](const std::string& product) {
    std::string text = dcf_of_limit(44);
    const std::string head = "[DeviceInfo]\n";
    return text.insert(text.find(head) + head.size(), "VendorNumber=0x11\nProductNumber=" + product + "\n");
  };
  ASSERT_EQ(rig.store_text(0x1F20, 1, dcf_for("0x23")), AbortCode::none);
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  const auto& status = *rig.manager->network().find(NodeId(1));
  EXPECT_EQ(letter(status.result.status), 'J');
  EXPECT_NE(status.result.detail.find("another product"), std::string::npos) << status.result.text();
  EXPECT_EQ(rig.limit(1), 0U);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::pre_operational);
  ASSERT_EQ(rig.store_text(0x1F20, 1, dcf_for("0x22")), AbortCode::none);
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  EXPECT_EQ(rig.limit(1), 44U);
  EXPECT_EQ(rig.stations[1]->state(), NmtState::operational);
}

// 1F81h bit 7 and 1F8Ah: factory settings first, then a reset, then the configuration.
TEST(DictionaryManager, FactorySettingsComeFirst) {
  for (const std::uint8_t sub : {std::uint8_t{1}, std::uint8_t{2}}) {
    MasterRig rig(1, 2, {{{0x1F8A, 3}, sub}, {{0x1F81, 3}, 0x85}});
    rig.stations[3] = std::make_unique<Station>(rig.world, rig.wire, std::uint8_t{3}, slave_description());
    auto& slave = *rig.stations[3];
    slave.on();
    rig.world.run_for(50ms);
    const std::vector<std::uint8_t> limit = {9, 0, 0, 0};
    const std::vector<std::uint8_t> save = {'s', 'a', 'v', 'e'};
    ASSERT_TRUE(rig.get(rig.tool.download(NodeId(3), 0x2000, 0, limit)));
    ASSERT_TRUE(rig.get(rig.tool.download(NodeId(3), 0x1010, 1, save)));
    slave.off();
    slave.on();
    rig.world.run_for(50ms);
    ASSERT_EQ(rig.limit(3), 9U);
    rig.go();
    rig.world.run_for(2s);
    EXPECT_EQ(slave.state(), NmtState::operational);
    EXPECT_EQ(rig.limit(3), sub == 1 ? 0U : 9U) << "1011h:02 is about communication parameters";
  }
}

// ---- 5F0Ah: what a live slave has comes into 1F20h ------------------------------------------------------------------

namespace {

constexpr std::uint16_t upload_object = 0x5F0A;
constexpr std::uint32_t upld = 0x646C'7075;  // "upld", least significant byte first

// The slaves of `MasterRig`, as their maker describes them.
std::string slave_eds() {
  const eds::File file = [] {
    eds::File made;
    made.description = slave_description();
    made.info.file_name = "slave.eds";
    return made;
  }();
  return eds::write(file, {}).text;
}

const std::shared_ptr<const od::Description>& describing_master(std::uint32_t longest_dcf) {
  static std::map<std::uint32_t, std::shared_ptr<const od::Description>> made;
  auto& description = made[longest_dcf];
  if (description) return description;
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
  add_manager_objects(b, {.most = 8, .startup = 0, .longest_dcf = longest_dcf, .longest_eds = 60'000});
  return description = b.build();
}

}  // namespace

TEST(DictionaryManager, AReplacementGetsWhatTheOldOneHad) {
  MasterRig rig(1, 3, {}, describing_master(60'000));
  rig.go();
  ASSERT_EQ(rig.store_text(0x1F23, 1, slave_eds()), AbortCode::none);
  // Somebody has set the machine up by hand.
  ASSERT_TRUE(rig.get(rig.tool.write(NodeId(1), 0x2000, 0, std::uint32_t{77})));
  ASSERT_EQ(rig.read<std::uint32_t>(upload_object, 1), 0U) << "none yet";
  ASSERT_EQ(rig.write(upload_object, 1, upld), AbortCode::none);
  ASSERT_TRUE(
      rig.world.run_until([&] { return rig.manager->uploads().state(NodeId(1)) != UploadState::under_way; }, 20s));
  ASSERT_EQ(rig.read<std::uint32_t>(upload_object, 1), 2U) << "done";
  const auto dcf = rig.get(rig.tool.upload(NodeId(master_id), 0x1F20, 1));
  ASSERT_TRUE(dcf);
  const auto loaded = read_configuration(std::string(dcf->bytes().begin(), dcf->bytes().end()), "1F20h");
  ASSERT_TRUE(loaded.usable());
  const auto limit = std::ranges::find(loaded.configuration.settings, ObjectRef{0x2000, 0}, &Setting::object);
  ASSERT_NE(limit, loaded.configuration.settings.end());
  EXPECT_EQ(limit->value, od::Literal::number(77));
  // Another one of its type comes in its place, with its maker's settings.
  rig.stations[1]->off();
  rig.world.run_for(2s);
  auto& fresh = rig.stations[1];
  fresh = std::make_unique<Station>(rig.world, rig.wire, 1, slave_description());
  fresh->on();
  ASSERT_TRUE(rig.world.run_until([&] { return fresh->state() == NmtState::operational; }, 30s));
  EXPECT_EQ(rig.limit(1), 77U);
  EXPECT_EQ(rig.limit(2), 0U) << "the others have none";
}

TEST(DictionaryManager, AnUploadedDcfCountsBeforeAConciseOne) {
  od::DescriptionBuilder b;
  device::add_device(b, {.name = "Master", .heartbeat_ms = 100});
  add_manager_objects(b,
                      {.most = 8, .startup = 0, .longest_concise = 200, .longest_dcf = 60'000, .longest_eds = 60'000});
  MasterRig rig(1, 1, {}, b.build());
  rig.go();
  ASSERT_EQ(rig.store_text(0x1F23, 1, slave_eds()), AbortCode::none);
  ASSERT_EQ(rig.store(0x1F22, 1, concise(60)), AbortCode::none);
  ASSERT_EQ(rig.write(0x1F26, 1, std::uint32_t{9000}), AbortCode::none);
  ASSERT_EQ(rig.write(0x1F27, 1, std::uint32_t{5}), AbortCode::none);
  ASSERT_TRUE(rig.get(rig.tool.write(NodeId(1), 0x2000, 0, std::uint32_t{61})));
  ASSERT_EQ(rig.write(upload_object, 1, upld), AbortCode::none);
  ASSERT_TRUE(
      rig.world.run_until([&] { return rig.manager->uploads().state(NodeId(1)) != UploadState::under_way; }, 20s));
  ASSERT_EQ(rig.read<std::uint32_t>(upload_object, 1), 2U);
  EXPECT_EQ(rig.read<std::uint32_t>(0x1F26, 1), 0U) << "the slave has no date, and 9000 was that of the concise one";
  ASSERT_TRUE(rig.get(rig.tool.write(NodeId(1), 0x2000, 0, std::uint32_t{99})));
  ASSERT_EQ(rig.write<std::uint8_t>(0x1F82, 1, 0x06), AbortCode::none);
  ASSERT_TRUE(rig.world.run_until([&] { return rig.limit(1) == 61U; }, 20s)) << rig.limit(1);
}

// What does not fit as it is, is compressed; what does not fit so either has failed, and nothing is half stored.
TEST(DictionaryManager, ADcfThatDoesNotFitIsCompressedOrRefused) {
  for (const std::uint32_t room : {2'500U, 200U}) {
    SCOPED_TRACE(room);
    MasterRig rig(1, 1, {}, describing_master(room));
    std::optional<Error> told;
    rig.manager->uploads().observe([&](NodeId, const Result<void>& done) {
      if (!done) told = done.error();
    });
    rig.go();
    ASSERT_EQ(rig.store_text(0x1F23, 1, slave_eds()), AbortCode::none);
    ASSERT_EQ(rig.write(upload_object, 1, upld), AbortCode::none);
    ASSERT_TRUE(
        rig.world.run_until([&] { return rig.manager->uploads().state(NodeId(1)) != UploadState::under_way; }, 20s));
    const auto dcf = rig.get(rig.tool.upload(NodeId(master_id), 0x1F20, 1));
    if (room > 1000) {
      EXPECT_EQ(rig.read<std::uint8_t>(0x1F21, 1), stored_format::zlib);
      ASSERT_TRUE(dcf);
      EXPECT_LE(dcf->bytes().size(), room);
      const auto text = unpack_stored(stored_format::zlib, dcf->bytes());
      ASSERT_TRUE(text);
      EXPECT_GT(text->size(), room);
    } else {
      EXPECT_EQ(rig.read<std::uint32_t>(upload_object, 1), 3U) << "failed";
      ASSERT_TRUE(told);
      EXPECT_EQ(told->code, Errc::mismatch);
      EXPECT_FALSE(dcf) << "1F20h is as it was";
    }
  }
}

TEST(DictionaryManager, UploadsThatAreNotBegunOrFail) {
  MasterRig rig(1, 3, {}, describing_master(60'000));
  rig.go();
  EXPECT_EQ(rig.write(upload_object, 1, upld + 1), AbortCode::not_stored);
  EXPECT_EQ(rig.write(upload_object, 4, upld), AbortCode::invalid_value) << "not assigned";
  EXPECT_EQ(rig.read<std::uint32_t>(upload_object, 0x80), od::refuse(AbortCode::write_only));
  // Neither the manager nor the slave has its EDS.
  EXPECT_EQ(rig.write(upload_object, 1, upld), AbortCode::none);
  EXPECT_EQ(rig.read<std::uint32_t>(upload_object, 1), 3U);
  // It leaves in the middle.
  ASSERT_EQ(rig.store_text(0x1F23, 2, slave_eds()), AbortCode::none);
  ASSERT_TRUE(rig.get(rig.tool.write(NodeId(master_id), upload_object, 2, upld)));
  rig.stations[2]->off();
  ASSERT_TRUE(
      rig.world.run_until([&] { return rig.manager->uploads().state(NodeId(2)) != UploadState::under_way; }, 60s));
  EXPECT_EQ(rig.read<std::uint32_t>(upload_object, 2), 3U);
  EXPECT_FALSE(rig.get(rig.tool.upload(NodeId(master_id), 0x1F20, 2)));
  // All at once: those that are there.
  ASSERT_EQ(rig.store_text(0x1F23, 1, slave_eds()), AbortCode::none);
  ASSERT_EQ(rig.store_text(0x1F23, 3, slave_eds()), AbortCode::none);
  ASSERT_EQ(rig.write(upload_object, 0x80, upld), AbortCode::none);
  ASSERT_TRUE(rig.world.run_until([&] { return rig.manager->uploads().state(NodeId(3)) == UploadState::done; }, 20s));
  EXPECT_EQ(rig.read<std::uint32_t>(upload_object, 1), 2U);
}
