// The boot-up of one slave, against a slave that can be wrong in each of the ways that CiA 302-2 has a letter for
// (docs/protocols/cia302.md §Boot-up of a slave).
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "berth/network/boot_slave.hpp"
#include "tests/manager/fake_device.hpp"

using namespace berth;
using namespace berth::manager;
using namespace berth::network;
using namespace berth::manager::test;
using co::NmtCommand;

namespace {

constexpr std::uint32_t io_module = 0x0003'0191;

struct FakeTarget final : BootTarget {
  explicit FakeTarget(rt::Executor& on) : executor(&on) {
    device.add({0x1000, 0}, u32(io_module), false);
    device.add({0x1018, 1}, u32(0x11), false);
    device.add({0x1018, 2}, u32(0x22), false);
    device.add({0x1018, 3}, u32(0x0002'0005), false);
    device.add({0x1018, 4}, u32(0x44), false);
  }
  co::SdoAccess& objects() noexcept override { return device; }
  rt::Task<Result<rt::Time>> command(NmtCommand command) override {
    commands.push_back(command);
    co_return executor->now();
  }
  rt::Task<bool> boots(rt::Time, rt::Time deadline) override {
    if (!boots_up) co_await rt::sleep_until(deadline);
    co_return boots_up;
  }
  rt::Task<std::optional<NmtState>> heartbeat(rt::Duration within) override {
    ++beats_awaited;
    const rt::Duration wait = beat ? rt::Duration(1ms) : within;
    co_await rt::sleep_for(wait);
    co_return beat;
  }
  rt::Task<std::optional<NmtState>> guard() override { co_return guarded; }
  void supervise(const SlaveRules&) override { supervised = true; }

  rt::Executor* executor;
  FakeDevice device;
  std::vector<NmtCommand> commands;
  std::optional<NmtState> beat = NmtState::pre_operational;
  std::optional<NmtState> guarded = NmtState::pre_operational;
  bool boots_up = true;
  bool supervised = false;
  unsigned beats_awaited = 0;
};

struct FakeSource final : BootSource {
  rt::Task<Result<void>> configure(BootTarget&, SlaveRules&) override {
    ++configured;
    co_return configuring;
  }
  rt::Task<Result<void>> update(BootTarget& target, const SlaveRules&) override {
    ++updated;
    if (brings) static_cast<FakeTarget&>(target).device.objects[{0x1F56, 1}].value = u32(*brings);
    co_return updating;
  }
  Result<void> configuring{};
  Result<void> updating{};
  std::optional<std::uint32_t> brings;
  [[nodiscard]] bool polls() const noexcept override { return questions_left > 0 && questions_left-- > 0; }
  mutable unsigned questions_left = 1'000'000;
  unsigned configured = 0;
  unsigned updated = 0;
};

struct Booting {
  BootResult run() {
    BootResult result;
    BootSlave boot(runner.executor(), target, source, rules, options);
    runner.run(into(boot, result));
    return result;
  }
  static rt::Task<void> into(BootSlave& boot, BootResult& result) { result = co_await boot.run(); }

  Runner runner;
  FakeTarget target{runner.executor()};
  FakeSource source;
  SlaveRules rules{.assigned = true, .boots = true};
  BootOptions options;
};

}  // namespace

// B.4 steps 1 to 9 with nothing expected but that it is there: it is configured, and ready.
TEST(BootSlave, WithNothingExpectedItIsConfiguredAndReady) {
  Booting b;
  const auto result = b.run();
  EXPECT_EQ(result.status, BootStatus::booted) << result.text();
  EXPECT_TRUE(result.configured);
  EXPECT_EQ(b.source.configured, 1U);
  EXPECT_TRUE(b.target.supervised);
  EXPECT_TRUE(b.target.commands.empty()) << "the network starts it";
  EXPECT_EQ(result.text(), "booted");
}

TEST(BootSlave, AANodeThatIsNotAssignedIsNotTouched) {
  Booting b;
  b.rules = slave_rules_of(0xFFFF'FFFE);  // all bits but the first
  const auto result = b.run();
  EXPECT_EQ(letter(result.status), 'A');
  EXPECT_EQ(b.target.device.reads, 0U);
  EXPECT_FALSE(b.target.supervised);
}

// Without bit 2 only error control is started.
TEST(BootSlave, WithoutTheBootBitOnlyErrorControlIsStarted) {
  Booting b;
  b.rules.boots = false;
  b.rules.device_type = 1;  // would be C
  b.rules.heartbeat = 100ms;
  EXPECT_EQ(b.run().status, BootStatus::booted);
  EXPECT_EQ(b.target.device.reads, 0U);
  EXPECT_EQ(b.target.beats_awaited, 1U);
  EXPECT_TRUE(b.target.supervised);
  EXPECT_EQ(b.source.configured, 0U);
}

// S5.16: a mandatory slave that is silent is given up when the boot time is over, and not before.
TEST(BootSlave, BASilentMandatorySlaveIsGivenUpAfterTheBootTime) {
  Booting b;
  b.target.device.silent.insert({0x1000, 0});
  b.options.give_up = rt::Time{5s};
  const auto result = b.run();
  EXPECT_EQ(letter(result.status), 'B');
  EXPECT_FALSE(result.detail.empty());
  EXPECT_GE(b.target.device.reads, 5U);
  EXPECT_LE(b.runner.now(), rt::Time{5s});
  EXPECT_GT(b.runner.now(), rt::Time{3s});
  EXPECT_FALSE(b.target.supervised);
}

// S5.16: an optional slave is asked until it is there: one that is connected later is found.
TEST(BootSlave, AnOptionalSlaveThatIsConnectedLaterIsFound) {
  Booting b;
  b.target.device.silent.insert({0x1000, 0});
  struct Plug final : rt::Job {
    explicit Plug(FakeDevice& d) : device(&d) {}
    void run() noexcept override { device->silent.clear(); }
    FakeDevice* device;
  } plug(b.target.device);
  b.runner.executor().at(rt::Time{1h}, plug);
  EXPECT_EQ(b.run().status, BootStatus::booted);
  EXPECT_GE(b.runner.now(), rt::Time{1h});
}

// S5.16: until it is found, or the application stops polling. Not a mandatory one: it has the boot time (1F89h).
TEST(BootSlave, S5_16_TheApplicationStopsPollingAnOptionalSlave) {
  for (const bool mandatory : {false, true}) {
    Booting b;
    b.target.device.silent.insert({0x1000, 0});
    b.rules.mandatory = mandatory;
    b.source.questions_left = 8;
    b.options.give_up = rt::Time{1h};
    EXPECT_EQ(b.run().status, BootStatus::b);
    EXPECT_EQ(b.target.device.reads < 10, !mandatory) << b.target.device.reads;
    EXPECT_GE(b.target.device.reads, 4U);
  }
}

// B is "no answer to the upload of 1000h", also of a slave whose identity was read: unless it has answered that, too.
TEST(BootSlave, BASlaveThatIsIdentifiedAndDoesNotAnswer1000h) {
  for (const bool typed : {false, true}) {
    Booting b;
    b.target.device.silent.insert({0x1000, 0});
    b.options.identified = true;
    b.options.typed = typed;
    b.options.give_up = rt::Time{};
    EXPECT_EQ(b.run().status, typed ? BootStatus::booted : BootStatus::b);
  }
}

// S5.14: each part that is expected is compared; 0 is not.
TEST(BootSlave, EachPartOfTheIdentityHasItsLetter) {
  struct Case {
    std::uint32_t SlaveRules::*part;
    std::uint32_t right;
    char letter;
  };
  const Case cases[] = {{&SlaveRules::device_type, io_module, 'C'},
                        {&SlaveRules::vendor, 0x11, 'D'},
                        {&SlaveRules::product, 0x22, 'M'},
                        {&SlaveRules::revision, 0x0002'0005, 'N'},
                        {&SlaveRules::serial, 0x44, 'O'}};
  for (const Case& c : cases) {
    Booting right;
    right.rules.*c.part = c.right;
    EXPECT_EQ(right.run().status, BootStatus::booted) << c.letter;
    Booting wrong;
    wrong.rules.*c.part = c.right + 1;
    const auto result = wrong.run();
    EXPECT_EQ(letter(result.status), c.letter) << result.text();
    EXPECT_NE(result.detail.find("instead of"), std::string::npos) << result.detail;
    EXPECT_EQ(wrong.source.configured, 0U) << "a stranger is not configured";
    EXPECT_FALSE(wrong.target.supervised);
  }
}

TEST(BootSlave, APartThatTheSlaveDoesNotHaveIsNotAsExpected) {
  Booting b;
  b.target.device.objects.erase({0x1018, 4});
  EXPECT_EQ(b.run().status, BootStatus::booted) << "not expected, not read";
  b.rules.serial = 0x44;
  EXPECT_EQ(letter(b.run().status), 'O');
  Booting typeless;
  typeless.target.device.objects.erase({0x1000, 0});
  EXPECT_EQ(typeless.run().status, BootStatus::booted) << "it answers, and any type will do";
  typeless.rules.device_type = io_module;
  EXPECT_EQ(letter(typeless.run().status), 'C');
}

// CiA 301 §7.5.2.18 makes the vendor-ID alone mandatory: what a slave does not have is unknown, and not another value.
TEST(BootSlave, APartOfTheIdentityThatTheSlaveDoesNotSayIsNotCompared) {
  for (const std::uint8_t says : {std::uint8_t{0}, std::uint8_t{1}, std::uint8_t{2}}) {
    Booting b;
    for (std::uint8_t sub = 4; sub > says; --sub) b.target.device.objects.erase({0x1018, sub});
    b.rules.vendor = 0x11;
    b.rules.product = 0x22;
    b.rules.revision = 0x0002'0005;
    const auto result = b.run();
    EXPECT_EQ(result.status, BootStatus::booted) << result.text();
  }
  Booting refused;
  refused.target.device.refuses_read[{0x1018, 2}] = AbortCode::hardware;
  refused.rules.product = 0x22;
  EXPECT_EQ(letter(refused.run().status), 'M') << "it has one, and does not tell it now";
}

// The manual's reading of 1F87h: major part equal, minor part at least.
TEST(BootSlave, ACompatibleRevisionIsTakenWhereThatIsAskedFor) {
  const auto status = [](std::uint32_t expected, RevisionCheck check) {
    Booting b;
    b.rules.revision = expected;
    b.rules.revision_check = check;
    return b.run().status;
  };
  EXPECT_EQ(status(0x0002'0003, RevisionCheck::equal), BootStatus::n);
  EXPECT_EQ(status(0x0002'0003, RevisionCheck::compatible), BootStatus::booted);
  EXPECT_EQ(status(0x0002'0006, RevisionCheck::compatible), BootStatus::n);
  EXPECT_EQ(status(0x0001'0003, RevisionCheck::compatible), BootStatus::n);
}

// Step 4: an operational slave is left alone, configuration and all.
TEST(BootSlave, LAKeepAliveSlaveThatIsOperationalIsLeftAlone) {
  for (const bool by_heartbeat : {true, false}) {
    Booting b;
    b.rules.keep_alive = true;
    if (by_heartbeat) b.rules.heartbeat = 200ms;
    b.target.beat = b.target.guarded = NmtState::operational;
    const auto result = b.run();
    EXPECT_EQ(letter(result.status), 'L');
    EXPECT_TRUE(is_ready(result.status));
    EXPECT_TRUE(b.target.commands.empty());
    EXPECT_EQ(b.source.configured, 0U);
    EXPECT_TRUE(b.target.supervised);
  }
}

TEST(BootSlave, AKeepAliveSlaveThatIsNotOperationalIsReset) {
  Booting b;
  b.rules.keep_alive = true;
  EXPECT_EQ(b.run().status, BootStatus::booted);
  EXPECT_EQ(b.target.commands, std::vector{NmtCommand::reset_communication});
  EXPECT_EQ(b.source.configured, 1U);
  b.target.boots_up = false;
  EXPECT_EQ(letter(b.run().status), 'B');
}

TEST(BootSlave, EAndFAStateThatCannotBeSeen) {
  Booting b;
  b.rules.keep_alive = true;
  b.target.guarded.reset();
  EXPECT_EQ(letter(b.run().status), 'F');
  b.rules.heartbeat = 100ms;
  b.target.beat.reset();
  EXPECT_EQ(letter(b.run().status), 'E');
}

TEST(BootSlave, TheSoftwareHasFourEnds) {
  const auto expect = [](Booting& b, std::uint32_t expected, std::optional<std::uint32_t> is) {
    b.rules.checks_software = true;
    b.rules.expected.software = expected;
    if (is) b.target.device.add({0x1F56, 1}, u32(*is), false);
  };
  Booting unknown;
  expect(unknown, 0, 7);
  EXPECT_EQ(letter(unknown.run().status), 'G');
  Booting untold;
  expect(untold, 7, std::nullopt);
  EXPECT_EQ(letter(untold.run().status), 'G');
  Booting right;
  expect(right, 7, 7);
  EXPECT_EQ(right.run().status, BootStatus::booted);
  Booting old;
  expect(old, 7, 6);
  EXPECT_EQ(letter(old.run().status), 'H');
  old.rules.may_update = true;
  old.source.updating = fail(Errc::unsupported, "no program");
  EXPECT_EQ(letter(old.run().status), 'I');
  EXPECT_EQ(old.source.configured, 0U);
}

// S5.26: by 1F56h where 1F55h has something, else by the date and time of paper 5's time (1F52h, 1F53h, 1F54h).
TEST(BootSlave, TheSoftwareIsKnownByTheOldObjectsToo) {
  struct Case {
    std::uint32_t date, time;
    char letter;
  };
  for (const Case& c : {Case{15'000, 1'000, 0}, Case{15'001, 1'000, 'H'}, Case{15'000, 1'001, 'H'}}) {
    Booting b;
    b.rules.checks_software = true;
    b.rules.expected.software_date = c.date;
    b.rules.expected.software_time = c.time;
    EXPECT_EQ(letter(b.run().status), 'G') << "it has no 1F52h";
    b.target.device.add({0x1F52, 1}, u32(15'000), false);
    EXPECT_EQ(letter(b.run().status), 'G') << "nor its time";
    b.target.device.add({0x1F52, 2}, u32(1'000), false);
    EXPECT_EQ(letter(b.run().status), c.letter) << b.run().text();
    b.rules.expected.software = 7;  // the new way comes first
    b.target.device.add({0x1F56, 1}, u32(7), false);
    EXPECT_EQ(b.run().status, BootStatus::booted);
  }
}

// What only a machine file can expect: the texts of 1009h and 100Ah.
TEST(BootSlave, VersionsAsTexts) {
  const Bytes version = {'2', '.', '1'};
  for (const bool identified : {false, true}) {
    Booting b;
    b.options.identified = identified;
    b.rules.expected.hardware_text = "2.1";
    EXPECT_EQ(letter(b.run().status), 'N') << "it tells none";
    b.target.device.add({0x1009, 0}, version, false);
    EXPECT_EQ(b.run().status, BootStatus::booted);
    b.rules.expected.hardware_text = "2.10";
    const auto other = b.run();
    EXPECT_EQ(letter(other.status), 'N');
    EXPECT_NE(other.text().find("\"2.1\" instead of \"2.10\""), std::string::npos) << other.text();
    EXPECT_EQ(b.source.configured, 1U) << "the one that was right";
  }
  Booting b;
  b.rules.checks_software = true;
  b.rules.expected.software_text = "2.1";
  EXPECT_EQ(letter(b.run().status), 'G');
  b.target.device.add({0x100A, 0}, {'2', '.', '1', 0}, false);
  EXPECT_EQ(b.run().status, BootStatus::booted) << "padded with NUL";
  b.rules.expected.software_text = "2.2";
  EXPECT_EQ(letter(b.run().status), 'H');
}

// The right program that does not run is started, once; a keep-alive slave is left as it is.
TEST(BootSlave, ARightProgramThatIsStoppedIsStarted) {
  Booting b;
  b.rules.checks_software = true;
  b.rules.expected.software = 7;
  b.target.device.add({0x1F56, 1}, u32(7), false);
  b.target.device.add({0x1F51, 1}, u8(0));
  EXPECT_EQ(b.run().status, BootStatus::booted);
  EXPECT_EQ(b.target.device.value({0x1F51, 1}), u8(1));
  EXPECT_EQ(b.target.device.writes_to({0x1F51, 1}), 1U);
  b.target.device.objects[{0x1F51, 1}].value = u8(0);
  b.target.device.forgets.insert({0x1F51, 1});
  EXPECT_EQ(letter(b.run().status), 'I') << "it does not start";
  b.rules.keep_alive = true;
  EXPECT_EQ(b.run().status, BootStatus::booted);
}

// Behind an update all begins anew: another program may have another identity.
TEST(BootSlave, AnUpdateIsFollowedByAllChecksAgain) {
  Booting b;
  b.rules.checks_software = b.rules.may_update = true;
  b.rules.expected.software = 7;
  b.target.device.add({0x1F56, 1}, u32(6), false);
  b.source.brings = 7;
  const auto result = b.run();
  EXPECT_EQ(result.status, BootStatus::booted) << result.text();
  EXPECT_TRUE(result.updated);
  EXPECT_TRUE(result.detail.empty()) << result.detail;
  EXPECT_EQ(b.source.updated, 1U);
  EXPECT_EQ(b.source.configured, 1U);
}

// A program that does not bring what is expected is not downloaded for ever.
TEST(BootSlave, AnUpdateThatChangesNothingIsTriedOnce) {
  Booting b;
  b.rules.checks_software = b.rules.may_update = true;
  b.rules.expected.software = 7;
  b.target.device.add({0x1F56, 1}, u32(6), false);
  EXPECT_EQ(letter(b.run().status), 'I');
  EXPECT_EQ(b.source.updated, 1U);
}

// Keep alive forbids an update, whatever bit 6 says.
TEST(BootSlave, AKeepAliveSlaveIsNotUpdated) {
  Booting b;
  b.rules.checks_software = b.rules.may_update = b.rules.keep_alive = true;
  b.rules.expected.software = 7;
  b.target.device.add({0x1F56, 1}, u32(6), false);
  EXPECT_EQ(letter(b.run().status), 'H');
  EXPECT_EQ(b.source.updated, 0U);
}

// Step 7: both not 0 and equal, else step 8.
TEST(BootSlave, OnlyTheExpectedDateAndTimeSaveTheConfiguration) {
  struct Case {
    std::uint32_t date, time;
    unsigned configured;
  };
  for (const Case& c : {Case{15, 16, 0}, Case{15, 17, 1}, Case{14, 16, 1}, Case{0, 16, 1}, Case{15, 0, 1}}) {
    Booting b;
    b.target.device.add({0x1020, 1}, u32(15));
    b.target.device.add({0x1020, 2}, u32(c.time == 0 ? 0 : 16));
    b.rules.expected_date = c.date;
    b.rules.expected_time = c.time;
    EXPECT_EQ(b.run().status, BootStatus::booted);
    EXPECT_EQ(b.source.configured, c.configured) << c.date << ' ' << c.time;
  }
}

TEST(BootSlave, JAConfigurationThatFailsStopsThisSlave) {
  Booting b;
  b.source.configuring = fail(Errc::aborted, "6110h:01 is refused");
  const auto result = b.run();
  EXPECT_EQ(letter(result.status), 'J');
  EXPECT_NE(result.text().find("6110h:01 is refused"), std::string::npos) << result.text();
  EXPECT_FALSE(b.target.supervised);
}

TEST(BootSlave, KASlaveWithoutAHeartbeatIsNotReady) {
  Booting b;
  b.rules.heartbeat = 300ms;
  b.target.beat.reset();
  EXPECT_EQ(letter(b.run().status), 'K');
  EXPECT_FALSE(b.target.supervised);
}

// S5.12, S5.13: the numbers of the objects, there and back; a reserved bit of 1F80h is refused.
TEST(BootRules, TheObjectsNumbersThereAndBack) {
  for (std::uint32_t bits = 0; bits < 0x80; ++bits) {
    const auto startup = startup_of(bits);
    ASSERT_TRUE(startup);
    EXPECT_EQ(value_of(*startup), bits);
  }
  for (unsigned bit = 7; bit < 32; ++bit) EXPECT_FALSE(startup_of(1U << bit));
  const SlaveRules rules = slave_rules_of(0x01F4'030D);  // assigned, booted, mandatory; 500 ms, three times
  EXPECT_TRUE(rules.assigned && rules.boots && rules.mandatory);
  EXPECT_FALSE(rules.keep_alive || rules.checks_software || rules.may_update || rules.restores);
  EXPECT_EQ(rules.guard_time, 500ms);
  EXPECT_EQ(rules.retry_factor, 3);
  EXPECT_EQ(value_of(rules), 0x01F4'030DU);
  EXPECT_EQ(value_of(slave_rules_of(0x01F4'03FE)), 0U) << "without bit 0 the others do not count";
}

TEST(BootRules, EveryLetterHasAText) {
  for (char c = 'A'; c <= 'O'; ++c) {
    const auto status = static_cast<BootStatus>(c);
    EXPECT_FALSE(text(status).empty()) << c;
    EXPECT_NE(text(status), text(BootStatus::booted)) << c;
    EXPECT_EQ(advice(status).empty(), c == 'L') << c;
  }
}
