// Which PDO carries a chosen value, and what a frame says of it.
#include "berth/fleet/signals.hpp"

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <rapidcheck/gtest.h>
#include <array>
#include <bit>
#include <cmath>

#include "berth/base/random.hpp"
#include "berth/can/length.hpp"
#include "berth/fleet/told.hpp"
#include "tests/paths.hpp"

namespace berth::fleet {
namespace {

using namespace std::chrono_literals;
using sparkplug::DataType;
using sparkplug::Value;

design::Machine machine(const std::string& publish) {
  const auto file = berth::test::source_dir() + "/examples/fleet.toml";
  auto read = design::read_machine(
      "[machine]\nname = \"m\"\n[bus.field]\nport = \"sim\"\nbitrate = 250_000\n[[slot]]\nbus = \"field\"\nid = 5\n"
      "name = \"left\"\neds = \"eds/sensor.eds\"\n" +
          publish,
      file, design::eds_loader());
  for (const auto& each : read.findings) ADD_FAILURE() << to_string(each);
  return read.machine ? std::move(*read.machine) : design::Machine{};
}

std::string refused(const std::string& publish) {
  const auto plan = plan_signals(machine(publish), nullptr);
  EXPECT_TRUE(plan.signals.empty());
  return plan.findings.empty() ? std::string() : to_string(plan.findings.front());
}

Signal signal_of(od::DataType type, unsigned at, unsigned bits, std::uint32_t key = 0x185) {
  Signal signal;
  signal.type = type;
  signal.key = key;
  signal.at = static_cast<std::uint8_t>(at);
  signal.bits = static_cast<std::uint8_t>(bits);
  return signal;
}

}  // namespace

TEST(FleetSignals, AnObjectIsFoundInItsPdoByNameAndByNumber) {
  for (const char* const word : {"Position value", "6004h", "6004h:00"}) {
    const auto plan = plan_signals(machine(fmt::format("publish = [\"{}\"]\n", word)), nullptr);
    ASSERT_EQ(plan.signals.size(), 1U) << word;
    const auto& signal = plan.signals.front();
    EXPECT_EQ(signal.metric, std::string("Signals/") + word) << "as the file has it";
    EXPECT_EQ(signal.key, 0x185U);  // TPDO 1 of node 5
    EXPECT_EQ(signal.at, 0);
    EXPECT_EQ(signal.bits, 32);
    EXPECT_EQ(signal.data_type(), DataType::uint32);
    EXPECT_EQ(signal.timeout, 0s) << "it is sent on change";
  }
}

TEST(FleetSignals, WhatNoPdoCarriesIsRefusedWithItsPlace) {
  const auto words = refused("publish = [\"Temperature\"]\n");
  EXPECT_NE(words.find("fleet.toml:11:12: error: publish \"Temperature\": no PDO of slot \"left\" carries 2002h:00"),
            std::string::npos)
      << words;
  EXPECT_NE(words.find("poll = true"), std::string::npos);
}

TEST(FleetSignals, UnknownObjectsAreRefused) {
  EXPECT_NE(refused("publish = [\"Positoin\"]\n").find("fleet.toml:11:12"), std::string::npos);
  EXPECT_NE(refused("publish = [{ object = \"7777h\", poll = true }]\n").find("type is not known"), std::string::npos);
}

TEST(FleetSignals, APolledOneNeedsNoPdo) {
  const auto plan = plan_signals(machine("publish = [{ object = \"Temperature\", poll = true, every = \"2 s\" }, "
                                         "{ object = \"Mounting place\", poll = true }]\n"),
                                 nullptr);
  ASSERT_EQ(plan.signals.size(), 2U);
  EXPECT_TRUE(plan.signals[0].polled());
  EXPECT_EQ(plan.signals[0].timeout, 6s);
  EXPECT_EQ(plan.signals[0].data_type(), DataType::int16);
  EXPECT_EQ(plan.signals[1].data_type(), DataType::string);
}

TEST(FleetSignals, TypesAtTheBroker) {
  using od::DataType;
  EXPECT_EQ(signal_of(DataType::boolean, 0, 1).data_type(), sparkplug::DataType::boolean);
  EXPECT_EQ(signal_of(DataType::integer8, 0, 8).data_type(), sparkplug::DataType::int8);
  EXPECT_EQ(signal_of(DataType::unsigned24, 0, 24).data_type(), sparkplug::DataType::uint32);
  EXPECT_EQ(signal_of(DataType::integer64, 0, 64).data_type(), sparkplug::DataType::int64);
  EXPECT_EQ(signal_of(DataType::real32, 0, 32).data_type(), sparkplug::DataType::float32);
  auto scaled = signal_of(DataType::integer16, 0, 16);
  scaled.factor = 0.1;
  EXPECT_EQ(scaled.data_type(), sparkplug::DataType::float64);
  EXPECT_DOUBLE_EQ(std::get<double>(scaled.value(static_cast<std::uint64_t>(std::int64_t{-235}))), -23.5);
  EXPECT_EQ(scaled.text_for(Value(-23.5)), "-235");
  EXPECT_EQ(scaled.text_for(Value(1e300)), std::nullopt);
}

TEST(FleetSignals, AFrameGivesItsSignalsAndNoOthers) {
  const std::vector<Signal> signals{signal_of(od::DataType::unsigned16, 0, 16),
                                    signal_of(od::DataType::integer8, 16, 8), signal_of(od::DataType::boolean, 24, 1),
                                    signal_of(od::DataType::unsigned8, 0, 8, 0x186)};
  SignalTable table(signals, 1);
  table.frame(0, can::Frame::base(0x185, {0x34, 0x12, 0xFF, 0x01}), rt::Time(7s));
  EXPECT_EQ(table.state(0).raw, 0x1234U);
  EXPECT_EQ(std::get<std::int64_t>(signals[1].value(table.state(1).raw)), -1);
  EXPECT_EQ(signals[2].value(table.state(2).raw), Value(true));
  EXPECT_EQ(table.state(0).at, rt::Time(7s));
  EXPECT_FALSE(table.state(3).known);
}

TEST(FleetSignals, FramesThatAreNoPdoAreIgnored) {
  const std::vector<Signal> signals{signal_of(od::DataType::unsigned32, 0, 32)};
  SignalTable table(signals, 1);
  table.frame(0, can::Frame::request(0x185, 4), rt::Time(1s));
  table.frame(0, can::Frame::base(0x185, {1, 2, 3}), rt::Time(1s));  // too short
  table.frame(0, can::Frame::ext(0x185, {1, 2, 3, 4}), rt::Time(1s));
  EXPECT_FALSE(table.state(0).known);
}

RC_GTEST_PROP(FleetSignals, EachPositionIsReadAsItIsWritten, ()) {
  const auto bits = *rc::gen::inRange(1U, 65U);
  const auto at = *rc::gen::inRange(0U, 65U - bits);
  const auto word = *rc::gen::arbitrary<std::uint64_t>();
  const std::vector<Signal> signals{signal_of(od::DataType::unsigned64, at, bits)};
  SignalTable table(signals, 1);
  std::array<std::uint8_t, 8> data{};
  for (unsigned i = 0; i < 8; ++i) data[i] = static_cast<std::uint8_t>(word >> (8 * i));
  table.frame(0, can::Frame::base(0x185, data), rt::Time(1s));
  // Bit by bit, as CiA 301 counts them.
  std::uint64_t expected = 0;
  for (unsigned i = 0; i < bits; ++i) expected |= std::uint64_t{(data[(at + i) / 8] >> ((at + i) % 8)) & 1U} << i;
  RC_ASSERT(table.state(0).raw == expected);
}

TEST(FleetSignals, TheLoadIsAboutThatOfTheWire) {
  const std::vector<Signal> none;
  SignalTable table(none, 1);
  std::uint64_t exact = 0;
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    std::array<std::uint8_t, 8> data{};
    for (auto& byte : data) byte = static_cast<std::uint8_t>(random.next());
    const auto frame = can::Frame::base(static_cast<std::uint32_t>(random.below(0x800)), data);
    exact += can::exact_bits(frame);
    table.frame(0, frame, rt::Time(1s));
  }
  const auto estimated = table.take_bits(0);
  EXPECT_NEAR(static_cast<double>(estimated), static_cast<double>(exact), 0.05 * static_cast<double>(exact));
  EXPECT_EQ(table.take_bits(0), 0U);
}

TEST(FleetSignals, ADeadbandIsInTheUnit) {
  auto signal = signal_of(od::DataType::integer16, 0, 16);
  signal.factor = 0.1;
  signal.wanted.deadband = 0.5;
  ToldValue told{.raw = 100, .known = true};
  EXPECT_FALSE(has_moved(told, {.raw = 104, .known = true}, signal));
  EXPECT_TRUE(has_moved(told, {.raw = 105, .known = true}, signal));
  EXPECT_TRUE(has_moved(told, {.raw = 95, .known = true}, signal));
  signal.wanted.deadband = 0;
  EXPECT_TRUE(has_moved(told, {.raw = 101, .known = true}, signal));
  EXPECT_FALSE(has_moved(told, {.raw = 100, .known = true}, signal));
  EXPECT_TRUE(has_moved({}, {.raw = 0, .known = true}, signal)) << "the first value";
}

TEST(FleetSignals, NotANumberHasMoved) {
  auto signal = signal_of(od::DataType::real32, 0, 32);
  signal.wanted.deadband = 1;
  const auto raw = [](float value) { return std::uint64_t{std::bit_cast<std::uint32_t>(value)}; };
  EXPECT_TRUE(has_moved({.raw = raw(1), .known = true}, {.raw = raw(NAN), .known = true}, signal));
}

TEST(FleetSignals, BytesOfAReply) {
  EXPECT_EQ(bytes_in(R"({"bytes":"F4 01"})"), (std::vector<std::uint8_t>{0xF4, 0x01}));
  EXPECT_EQ(bytes_in(R"({"bytes":""})"), std::vector<std::uint8_t>{});
  for (const char* const text : {"", "[]", "{}", R"({"bytes":7})", R"({"bytes":"F"})", R"({"bytes":"G0"})"})
    EXPECT_EQ(bytes_in(text), std::nullopt) << text;
}

}  // namespace berth::fleet
