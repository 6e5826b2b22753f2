// Objects of a remote node: what is read and written, what is refused before the bus is used, and what is said.
#include <gtest/gtest.h>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "../pch.hpp"
#include "rig.hpp"

namespace berth::client::test {
namespace {

using od::DataType;

TEST(ClientNode, ReadsByNameTextAndIndex) {
  Rig rig;
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("Identity object.Vendor-ID")), 1U);
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("1018h:01")), 1U);
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>(0x1018, 2)), 2U);
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>(ObjectRef{0x1018, 3})), 3U);
  EXPECT_EQ(rig.get(rig.node->read<std::string>("Manufacturer device name")), "Test device");
  EXPECT_EQ(rig.get(rig.node->read<std::int64_t>("Read only")), 7) << "a wider type than needed";
}

template <class T>
void round_trip(Rig& rig, DataType type, T value, Bytes on_the_wire) {
  const std::string name(od::name(type));
  ASSERT_TRUE(rig.get(rig.node->write(name, value))) << name;
  const auto stored = rig.device->device.values().bytes({static_cast<std::uint16_t>(0x2000 + unsigned(type)), 0});
  EXPECT_EQ(Bytes(stored.begin(), stored.end()), on_the_wire) << name;
  const auto back = rig.get(rig.node->read<T>(name));
  ASSERT_TRUE(back.has_value()) << name << ": " << back.error().message;
  EXPECT_EQ(*back, value) << name;
}

TEST(ClientNode, EveryTypeGoesThereAndBack) {
  Rig rig;
  round_trip(rig, DataType::boolean, true, {1});
  round_trip<std::int8_t>(rig, DataType::integer8, -2, {0xFE});
  round_trip<std::int16_t>(rig, DataType::integer16, -2, {0xFE, 0xFF});
  round_trip<std::int32_t>(rig, DataType::integer24, -8388608, {0, 0, 0x80});
  round_trip<std::int32_t>(rig, DataType::integer32, 0x01020304, {4, 3, 2, 1});
  round_trip<std::int64_t>(rig, DataType::integer40, -2, {0xFE, 0xFF, 0xFF, 0xFF, 0xFF});
  round_trip<std::int64_t>(rig, DataType::integer48, 0x010203040506, {6, 5, 4, 3, 2, 1});
  round_trip<std::int64_t>(rig, DataType::integer56, -1, Bytes(7, 0xFF));
  round_trip<std::int64_t>(rig, DataType::integer64, INT64_MIN, {0, 0, 0, 0, 0, 0, 0, 0x80});
  round_trip<std::uint8_t>(rig, DataType::unsigned8, 200, {200});
  round_trip<std::uint16_t>(rig, DataType::unsigned16, 0x1234, {0x34, 0x12});
  round_trip<std::uint32_t>(rig, DataType::unsigned24, 0x123456, {0x56, 0x34, 0x12});
  round_trip<std::uint32_t>(rig, DataType::unsigned32, 0xDEADBEEF, {0xEF, 0xBE, 0xAD, 0xDE});
  round_trip<std::uint64_t>(rig, DataType::unsigned40, 0xFFFFFFFFFF, Bytes(5, 0xFF));
  round_trip<std::uint64_t>(rig, DataType::unsigned48, 1, {1, 0, 0, 0, 0, 0});
  round_trip<std::uint64_t>(rig, DataType::unsigned56, 1ULL << 55, {0, 0, 0, 0, 0, 0, 0x80});
  round_trip<std::uint64_t>(rig, DataType::unsigned64, UINT64_MAX, Bytes(8, 0xFF));
  round_trip(rig, DataType::real32, 1.5F, {0, 0, 0xC0, 0x3F});
  round_trip(rig, DataType::real64, -0.0, {0, 0, 0, 0, 0, 0, 0, 0x80});
  round_trip(rig, DataType::visible_string, std::string("a text of more than seven bytes"), [] {
    const std::string_view t = "a text of more than seven bytes";
    return Bytes(t.begin(), t.end());
  }());
  round_trip(rig, DataType::unicode_string, std::string("\xC3\xA9"), {0xE9, 0});
  round_trip(rig, DataType::octet_string, Bytes{0, 1, 2, 0}, {0, 1, 2, 0});
  round_trip(rig, DataType::domain, Bytes(800, 0x5A), Bytes(800, 0x5A));
  round_trip(rig, DataType::time_of_day, co::TimeOfDay{.milliseconds = 0x01020304, .days = 0x0506}, {4, 3, 2, 1, 6, 5});
  round_trip(rig, DataType::unsigned16, Value{DataType::unsigned16, {0x39, 0x05}}, {0x39, 0x05});
  EXPECT_EQ(rig.get(rig.node->read<Value>("UNSIGNED16"))->text(), "1337");
}

TEST(ClientNode, TheWrongCppTypeIsRefusedBeforeTheBusIsUsed) {
  Rig rig;
  const auto narrow = rig.get(rig.node->read<std::uint16_t>("Identity object.Vendor-ID"));
  ASSERT_FALSE(narrow.has_value());
  EXPECT_EQ(narrow.error().code, Errc::invalid);
  EXPECT_EQ(narrow.error().message,
            "node 5, object 1018h:01 \"Identity object/Vendor-ID\": it is UNSIGNED32, which cannot be read as "
            "std::uint16_t; use std::uint32_t");
  EXPECT_NE(rig.get(rig.node->read<std::string>("UNSIGNED32")).error().message.find("use std::uint32_t"),
            std::string::npos);
  EXPECT_NE(rig.get(rig.node->write("REAL32", 1))
                .error()
                .message.find("it is REAL32, which cannot be written from std::int32_t; use float"),
            std::string::npos);
  EXPECT_EQ(rig.bus.frames, std::vector<std::string>{});
}

// HU.17: limits are looked at.
TEST(ClientNode, AccessAndLimitsAreLookedAtBeforeTheBusIsUsed) {
  Rig rig;
  struct Row {
    const char* object;
    int value;
    od::AbortCode code;
  };
  for (const Row& row :
       {Row{"Limited", -11, od::AbortCode::value_too_low}, Row{"Limited", 101, od::AbortCode::value_too_high},
        Row{"Limited", 40000, od::AbortCode::value_too_high}, Row{"Above the node-ID", 5, od::AbortCode::value_too_low},
        Row{"Above the node-ID", 256, od::AbortCode::value_too_high}, Row{"Read only", 1, od::AbortCode::read_only},
        Row{"Manufacturer device name", 1, od::AbortCode::read_only}}) {
    const auto done = rig.get(rig.node->write(row.object, row.value));
    ASSERT_FALSE(done.has_value()) << row.object;
    EXPECT_EQ(done.error().code, Errc::invalid) << row.object;
    EXPECT_EQ(done.error().detail, static_cast<std::uint32_t>(row.code)) << done.error().message;
  }
  const auto secret = rig.get(rig.node->read<std::uint32_t>("Write only"));
  EXPECT_EQ(secret.error().message, "node 5, object 2102h:00 \"Write only\": the object is write-only (0601 0001)");
  const auto none = rig.get(rig.node->read<std::uint32_t>(0x5000, 0));
  EXPECT_EQ(none.error().code, Errc::not_found);
  EXPECT_EQ(none.error().message, "node 5, object 5000h:00: the description has no such object (0602 0000)");
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>(0x1018, 9)).error().detail, 0x06090011U);
  const auto ambiguous = rig.get(rig.node->write("Position", 1));
  EXPECT_EQ(ambiguous.error().code, Errc::duplicate);
  EXPECT_NE(ambiguous.error().message.find("node 5: 2 objects are called"), std::string::npos);
  EXPECT_EQ(rig.bus.frames, std::vector<std::string>{});
  for (const int value : {-10, 100}) EXPECT_TRUE(rig.get(rig.node->write("Limited", value)));
  EXPECT_TRUE(rig.get(rig.node->write("Above the node-ID", 6)));
}

TEST(ClientNode, ChecksCanBeTurnedOffAndTheDeviceAnswersItself) {
  Rig rig({.check_access = false, .check_limits = false});
  const auto high = rig.get(rig.node->write("Limited", 101));
  EXPECT_EQ(high.error().code, Errc::aborted);
  EXPECT_EQ(high.error().message,
            "node 5, object 2100h:00 \"Limited\": aborted by the device: value too high (0609 0031)");
  EXPECT_EQ(rig.get(rig.node->write("Read only", 1)).error().detail, 0x06010002U);
  EXPECT_EQ(rig.get(rig.node->read<std::uint32_t>("Write only")).error().detail, 0x06010001U);
  EXPECT_EQ(rig.get(rig.node->read<std::uint16_t>(0x5000, 0)).error().detail, 0x06020000U);
  EXPECT_EQ(rig.get(rig.node->write(0x5000, 0, std::uint16_t{1})).error().code, Errc::aborted);
  const auto& frame = rig.bus.frames[rig.bus.frames.size() - 2];
  EXPECT_EQ(frame, "605#2B00500001000000") << "as an UNSIGNED16";
}

// An EDS that says UNSIGNED16 of a device that has an UNSIGNED32.
TEST(ClientNode, AnAnswerThatDoesNotFitTheDescription) {
  Rig rig;
  od::DescriptionBuilder b;
  b.variable(0x1018, {.name = "wrong"});
  b.variable(0x2007, {.name = "too short", .type = DataType::unsigned16});
  b.variable(0x2006, {.name = "too long", .type = DataType::unsigned32});
  RemoteNode wrong(*rig.network, NodeId(5), b.build());
  rig.device->device.values().set<std::uint32_t>({0x2007, 0}, 0x12345678);
  const auto cut = rig.get(wrong.read<std::uint16_t>("too short"));
  EXPECT_EQ(cut.error().code, Errc::mismatch);
  EXPECT_EQ(cut.error().message,
            "node 5, object 2007h:00 \"too short\": the answer has another length than the object's type");
  EXPECT_EQ(rig.get(wrong.read<std::uint32_t>("too long")).error().code, Errc::mismatch);
  EXPECT_EQ(rig.get(wrong.write("too long", 1)).error().code, Errc::aborted);
}

// HU.21: no answer: whether the frame left, and of which node and object.
TEST(ClientNode, HU_21_NoAnswer) {
  Rig rig;
  RemoteNode absent(*rig.network, NodeId(6), dictionary());
  const auto nobody = rig.get(absent.read<std::uint32_t>("Device type"));
  EXPECT_EQ(nobody.error().code, Errc::timeout);
  EXPECT_EQ(
      nobody.error().message,
      "node 6, object 1000h:00 \"Device type\": no answer to the SDO request: the request was on the wire, no node "
      "answered in time");
  rig.device->controller->power(false);
  const auto alone = rig.get(rig.node->read<std::uint32_t>("Device type"));
  EXPECT_EQ(alone.error().code, Errc::bus);
  EXPECT_NE(alone.error().message.find("node 5, object 1000h:00 \"Device type\": the SDO request never left"),
            std::string::npos)
      << alone.error().message;
  rig.bus.port->listen_only(true);
  EXPECT_NE(rig.get(rig.node->write("UNSIGNED8", 1)).error().message.find("never left: the port is listen-only"),
            std::string::npos);
  EXPECT_EQ(rig.get(rig.node->nmt(co::NmtCommand::start)).error().code, Errc::bus);
}

// HU.22: whether the device is told of a time-out is an option; a flood of events costs the oldest, not memory.
TEST(ClientNode, HU_22_AbortAtTimeoutAndFloods) {
  Rig rig;
  for (const bool told : {true, false}) {
    const co::SdoOptions options{.timeout = 50ms, .abort_on_timeout = told};
    RemoteNode absent(*rig.network, NodeId(6), rig.node->names().description(), {.sdo = options});
    rig.bus.frames.clear();
    EXPECT_EQ(rig.get(absent.read<std::uint32_t>("Device type")).error().code, Errc::timeout);
    rig.run(10ms);
    std::erase_if(rig.bus.frames, [](const std::string& frame) { return !frame.starts_with("606"); });
    const std::vector<std::string> aborted = {"606#4000100000000000", "606#8000100000000405"};
    EXPECT_EQ(rig.bus.frames, told ? aborted : std::vector{aborted.front()});
  }
  int called = 0;
  rig.node->on_emcy([&](const Emergency&) { ++called; });
  for (unsigned i = 0; i < 1000; ++i) {
    const auto low = static_cast<std::uint8_t>(i);
    rig.device->dispatcher.send(can::Frame::base(0x085, {low, 0x10, 1, 0, 0, 0, 0, 0}));
    rig.run(1ms);
  }
  EXPECT_EQ(called, 1000);
  EXPECT_EQ(rig.get(rig.node->next_emcy(rt::never))->emcy.code, 0x1000U + ((1000 - RemoteNode::kept_events) & 0xFF));
}

// Bytes that are made and looked at on the way.
struct Pattern final : co::SdoSource, co::SdoSink {
  explicit Pattern(std::size_t n) : length(n) {}
  static std::uint8_t at(std::size_t i) { return static_cast<std::uint8_t>(i * 7 + (i >> 8)); }
  od::Answer<std::size_t> read(std::span<std::uint8_t> into) noexcept override {
    std::size_t n = 0;
    while (n < into.size() && given < length) into[n++] = at(given++);
    return n;
  }
  od::AbortCode write(std::span<const std::uint8_t> bytes) noexcept override {
    for (const auto byte : bytes) good = byte == at(taken++) && good;
    return od::AbortCode::none;
  }
  std::size_t length;
  std::size_t given = 0;
  std::size_t taken = 0;
  bool good = true;
};

TEST(ClientNode, LongObjectsAsStreams) {
  Rig rig;
  Pattern source(800);
  const auto sent = rig.get(rig.node->download("DOMAIN", source));
  ASSERT_TRUE(sent.has_value()) << sent.error().message;
  EXPECT_EQ(rig.device->device.values().bytes({0x200F, 0}).size(), 800U);
  Pattern sink(0);
  std::optional<bool> well;
  rig.node->upload("DOMAIN", sink, [&](const Outcome<void>& done) { well = done.has_value(); });
  rig.run(1s);
  EXPECT_EQ(well, true);
  EXPECT_EQ(sink.taken, 800U);
  EXPECT_TRUE(sink.good);
  Pattern more(5000);
  EXPECT_EQ(rig.get(rig.node->download("DOMAIN", more)).error().code, Errc::aborted) << "more than it has room for";
  const auto frames = rig.bus.frames.size();
  EXPECT_EQ(rig.get(rig.node->upload("UNSIGNED32", sink)).error().message,
            "node 5, object 2007h:00 \"UNSIGNED32\": only strings and DOMAINs can be streamed");
  EXPECT_EQ(rig.get(rig.node->download("Manufacturer device name", source)).error().detail, 0x06010002U);
  EXPECT_EQ(rig.bus.frames.size(), frames);
}

TEST(ClientNode, AnUnconfiguredNodeIdIsAnError) {
  Rig rig;
  RemoteNode blank(*rig.network, NodeId(), dictionary());
  EXPECT_EQ(rig.get(blank.read<std::uint32_t>("Device type")).error().code, Errc::invalid);
  EXPECT_EQ(rig.get(blank.nmt(co::NmtCommand::start)).error().code, Errc::invalid);
  EXPECT_FALSE(blank.state().has_value());
}

TEST(ClientNode, NmtAndStates) {
  Rig rig({.heartbeat = 250ms});
  std::vector<std::string> told;
  rig.node->on_state([&](const StateEvent& e) { told.push_back(std::string(co::name(e.kind)) + " " + name(e.state)); });
  EXPECT_FALSE(rig.node->state().has_value()) << "before the first heartbeat";
  rig.run(150ms);
  EXPECT_EQ(rig.node->state(), NmtState::pre_operational);
  const auto before = rig.world.now();
  const auto sent = rig.get(rig.node->nmt(co::NmtCommand::start));
  ASSERT_TRUE(sent.has_value());
  EXPECT_GT(*sent, before);
  rig.run(150ms);
  EXPECT_EQ(rig.node->state(), NmtState::operational);
  rig.node->nmt(co::NmtCommand::reset_node,
                [&](const Outcome<rt::Time>& o) { told.push_back(o ? "reset sent" : "no"); });
  rig.run(250ms);
  rig.device->controller->power(false);
  rig.run(1s);
  EXPECT_FALSE(rig.node->state().has_value());
  std::vector<std::string> expected = {std::string(co::name(co::HeartbeatEvent::Kind::started)) + " pre-operational",
                                       std::string(co::name(co::HeartbeatEvent::Kind::state_changed)) + " operational",
                                       "reset sent"};
  ASSERT_GE(told.size(), 6U);
  EXPECT_EQ(std::vector<std::string>(told.begin(), told.begin() + 3), expected);
  EXPECT_EQ(told[3], std::string(co::name(co::HeartbeatEvent::Kind::boot_up)) + " initialising");
  EXPECT_EQ(told[5], std::string(co::name(co::HeartbeatEvent::Kind::lost)) + " pre-operational");
  EXPECT_EQ(told.size(), 6U);
  const auto first = rig.get(rig.node->next_state(rt::never));
  EXPECT_EQ(first->kind, co::HeartbeatEvent::Kind::boot_up) << "the queue has them all, from the node's beginning on";
}

// HU.24: a node that was never there is noticed.
TEST(ClientNode, HU_24_ANodeThatWasNeverSeen) {
  Rig rig;
  rig.network->set_never_seen_time(500ms);
  RemoteNode absent(*rig.network, NodeId(6), rig.node->names().description());
  const auto event = rig.get(absent.next_state(rig.world.now() + 1s));
  ASSERT_TRUE(event.has_value());
  EXPECT_EQ(event->kind, co::HeartbeatEvent::Kind::never_seen);
  EXPECT_EQ(event->node, NodeId(6));
}

TEST(ClientNode, Emergencies) {
  Rig rig;
  std::vector<std::string> told;
  rig.node->on_emcy([&](const Emergency& e) { told.emplace_back(e.text()); });
  rig.device->device.errors().raise(0x2310, co::error_register::current, {1, 2, 3, 4, 5});
  rig.run(5ms);
  rig.device->device.errors().clear(0x2310);
  const auto first = rig.get(rig.node->next_emcy(rt::never));
  ASSERT_TRUE(first.has_value());
  EXPECT_EQ(first->node, NodeId(5));
  EXPECT_EQ(first->emcy, (co::Emcy{.code = 0x2310, .error_register = 0x03, .info = {1, 2, 3, 4, 5}}));
  const auto second = rig.get(rig.node->next_emcy(rig.world.now() + 1s));
  ASSERT_TRUE(second.has_value());
  EXPECT_EQ(second->emcy.code, 0);
  EXPECT_EQ(rig.get(rig.node->next_emcy(rig.world.now() + 1s)).error().code, Errc::timeout);
  EXPECT_EQ(told, (std::vector<std::string>{co::emcy_text(0x2310), co::emcy_text(0)}));
}

TEST(ClientNode, EmergenciesOnADescribedIdentifier) {
  Rig rig;
  od::DescriptionBuilder b;
  b.variable(0x1014, {.name = "COB-ID EMCY", .initial = od::Literal::node_id_plus(0x200)});
  RemoteNode other(*rig.network, NodeId(9), b.build());
  int told = 0;
  other.on_emcy([&](const Emergency& e) { told += e.emcy.code == 0x1000 ? 1 : 100; });
  rig.device->dispatcher.send(*can::parse_frame("209#0010810000000000"));
  rig.device->dispatcher.send(*can::parse_frame("089#0020810000000000"));
  rig.device->dispatcher.send(*can::parse_frame("209#00108100000000"));
  rig.run(5ms);
  EXPECT_EQ(told, 1);
}

TEST(ClientNode, SyncIsProduced) {
  Rig rig;
  rig.network->produce_sync(10ms);
  rig.run(35ms);
  EXPECT_EQ(std::count(rig.bus.frames.begin(), rig.bus.frames.end(), "080#"), 4);
  rig.network->produce_sync(0ms);
  rig.run(50ms);
  EXPECT_EQ(std::count(rig.bus.frames.begin(), rig.bus.frames.end(), "080#"), 4);
  EXPECT_EQ(rig.network->send_sync(), can::Queued::yes);
}

}  // namespace
}  // namespace berth::client::test
