// Two sensors on a simulated bus, a machine that publishes them, Debian's Mosquitto, and a host.
#include <csignal>

#include "fleet_rig.hpp"

namespace berth::fleet::test {
namespace {

constexpr const char* publishes = R"(publish = ["Position value"])"
                                  "\n";
constexpr const char* allows = "[mqtt]\nbroker = \"mqtt://127.0.0.1\"\ncommands = [\"nmt\", \"replace\"]\n";

std::string text(const char* word) { return word; }

bool born(View& view, const std::string& device) { return view.count(MessageType::dbirth, device) > 0; }

}  // namespace

TEST(FleetMachine, IsBornWithItsDevicesAndSaysWhatTheyAre) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "left") && born(view, "right"); }));
  ASSERT_TRUE(rig.until([&] { return view.is("", "Machine/Operational", true); }));
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Slot/State", text("operational")); }));
  ASSERT_TRUE(rig.until([&] { return view.is("", "Slots/left/State", text("operational")); }));
  EXPECT_EQ(view.count(MessageType::nbirth), 1U);
  EXPECT_EQ(view.said.front().type, MessageType::nbirth);
  EXPECT_TRUE(view.is("left", "Device/Vendor ID", std::uint64_t{1}));
  EXPECT_TRUE(view.is("left", "Slot/Node-ID", std::uint64_t{1}));
  const auto serial = rig.slot("left").device->address.serial;
  EXPECT_TRUE(view.is("left", "Device/Serial number", std::uint64_t{serial}));
  EXPECT_TRUE(view.is("", "Berth/Version", text("test")));
  EXPECT_TRUE(view.is("", "Buses/field/State", text("up")));
}

TEST(FleetMachine, ADeviceIsBornOnlyWhenItsIdentityWasChecked) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  for (const auto& each : view.changes) {
    if (each.device == "left" && each.metric == "Slot/State" && each.birth) {
      EXPECT_TRUE(each.value == Value(text("present")) || each.value == Value(text("configuring")) ||
                  each.value == Value(text("operational")));
    }
  }
  rig.world().find("a")->unplug();
  rig.world().find("b")->unplug();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ddeath, "left") == 1; }));
}

TEST(FleetMachine, AValueComesFromThePdoWithItsTime) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  const auto requests = rig.requests.size();
  const auto since =
      std::chrono::duration_cast<std::chrono::milliseconds>(rig.session().executor().now().time_since_epoch());
  rig.set_position(rig.device_in("left").name(), 4711);
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Position value", std::uint64_t{4711}); }));
  const auto& told = *view.last("left", "Signals/Position value");
  EXPECT_EQ(told.quality, sparkplug::Quality::good);
  const auto sent = RigClock::begin_ms + static_cast<std::uint64_t>(since.count());
  EXPECT_GE(told.at, sent);
  EXPECT_LE(told.at, sent + 5) << "when it was on the bus, not when it was looked at";
  EXPECT_EQ(rig.requests.size(), requests) << "nothing was asked on the bus";
}

// The machine loses a drive and gets it back.
TEST(FleetMachine, ALostDeviceDiesAndIsBornAgainWithoutItsOldValues) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  auto& device = rig.device_in("left");
  rig.set_position(device.name(), 7);
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Position value", std::uint64_t{7}); }));
  device.unplug();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ddeath, "left") == 1; }));
  ASSERT_TRUE(rig.until([&] { return view.is("", "Slots/left/State", text("absent")); }));
  ASSERT_TRUE(rig.until([&] { return view.is("", "Machine/Operational", false); }));
  EXPECT_EQ(view.count(MessageType::ddeath, "right"), 0U);
  device.plug();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") == 2; }));
  const auto* const value = view.last("left", "Signals/Position value");
  EXPECT_NE(value->quality, sparkplug::Quality::good) << "it was not heard since";
  EXPECT_FALSE(sparkplug::same(value->value, std::uint64_t{7})) << "it may be another device";
  ASSERT_TRUE(rig.until([&] { return view.is("", "Slots/left/State", text("operational")); }));
}

TEST(FleetMachine, AnswersARebirth) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "right") && born(view, "left"); }));
  view.command("", "Node Control/Rebirth", sparkplug::DataType::boolean, true);
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::nbirth) == 2; }));
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::dbirth, "left") >= 2; }));
}

// By MQTT 5 the will comes too, with the same bdSeq (SP.276): hosts know the node as dead by then.
TEST(FleetMachine, EndsWithItsDeathAndItsWill) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "right"); }));
  rig.fleet.reset();
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ndeath) > 0; }));
  ASSERT_TRUE(rig.until([&] { return broker.log().find("disconnected") != std::string::npos; }));
  ASSERT_TRUE(rig.until([&] { return view.count(MessageType::ndeath) == 2; }));
  std::vector<Value> numbers;
  for (const auto& change : view.changes) {
    if (change.metric == "bdSeq") numbers.push_back(change.value);
  }
  ASSERT_EQ(numbers.size(), 3U);
  EXPECT_TRUE(sparkplug::same(numbers[0], numbers[1]));
  EXPECT_TRUE(sparkplug::same(numbers[1], numbers[2]));
}

// The broker is away while the value changes: each value that the machine took comes, in order, with its time.
TEST(FleetMachine, LosesNothingWhileTheBrokerIsRestarted) {
  NEEDS_BROKER();
  Broker broker;
  Folder folder;
  View view(broker);
  Rig rig(machine_text("", "publish = [{ object = \"Position value\", every = \"100 ms\" }]\n"));
  ASSERT_EQ(rig.publish(to(broker, folder.file("line.db.mqtt"))), "");
  ASSERT_TRUE(rig.up());
  const auto device = rig.device_in("left").name();
  std::vector<std::uint64_t> sent;
  const auto set = [&](std::uint32_t value) {
    rig.set_position(device, value);
    sent.push_back(value);
    rig.run(300ms);
    std::this_thread::sleep_for(5ms);
  };
  for (std::uint32_t i = 1; i <= 5; ++i) set(i);
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Position value", std::uint64_t{5}); }));
  broker.kill();
  ASSERT_TRUE(rig.until([&] { return rig.told_of("keeps what changes") > 0; }));
  for (std::uint32_t i = 6; i <= 40; ++i) set(i);
  broker.start();
  ASSERT_TRUE(view.station().heard.until([](const auto& s) { return s.is_connected() && s.connected.size() == 2; }));
  for (std::uint32_t i = 41; i <= 45; ++i) set(i);
  const auto values = [&] {
    view.look();
    std::map<std::uint64_t, std::uint64_t> found;  // by value: its time
    for (const auto& each : view.changes) {
      const auto* const value = std::get_if<std::uint64_t>(&each.value);
      if (each.metric == "Signals/Position value" && value != nullptr && !found.contains(*value))
        found[*value] = each.at;
    }
    return found;
  };
  ASSERT_TRUE(rig.until(
      [&] { return values().size() >= sent.size() && view.is("left", "Signals/Position value", std::uint64_t{45}); }));
  const auto found = values();
  std::uint64_t before = 0;
  for (const auto value : sent) {
    ASSERT_TRUE(found.contains(value)) << value;
    EXPECT_GE(found.at(value), before) << value;
    before = found.at(value);
  }
  EXPECT_TRUE(std::ranges::any_of(view.changes, &View::Change::historical));
  EXPECT_EQ(rig.told_of("connected to"), 2U) << rig.told();
}

TEST(FleetMachine, ANewProcessSendsWhatTheLastOneKept) {
  NEEDS_BROKER();
  Broker broker;
  Folder folder;
  const auto file = folder.file("line.db.mqtt");
  broker.stop();
  {
    Rig rig(machine_text("", "publish = [{ object = \"Position value\", every = \"100 ms\" }]\n"));
    ASSERT_EQ(rig.publish(to(broker, file)), "");
    ASSERT_TRUE(rig.up());
    rig.run(2s);
    rig.set_position(rig.device_in("left").name(), 99);
    rig.run(1s);
    rig.set_position(rig.device_in("left").name(), 100);
    rig.run(1s);
  }
  broker.start();
  View view(broker);
  Rig rig(machine_text("", "publish = [{ object = \"Position value\", every = \"100 ms\" }]\n"));
  ASSERT_EQ(rig.publish(to(broker, file)), "");
  ASSERT_TRUE(rig.until([&] {
    view.look();
    return std::ranges::any_of(
        view.changes, [](const View::Change& c) { return c.historical && c.value == Value(std::uint64_t{99}); });
  }));
}

TEST(FleetMachine, CommandsOnlyAsTheFileAllows) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(allows, publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return born(view, "left") && born(view, "right"); }));
  view.command("left", "Commands/NMT", sparkplug::DataType::string, text("preop"));
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Done", 2) == "Commands/NMT"; }));
  EXPECT_EQ(view.cell("Commands/Done", 1), "left");
  EXPECT_EQ(view.cell("Commands/Done", 3), "preop");
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Device/NMT state", text("pre-operational")); }));
  EXPECT_EQ(rig.audited("nmt").size(), 2U) << "begun, done";
  // `locate` is not listed: the metric is not there.
  view.command("left", "Commands/Locate", sparkplug::DataType::uint32, std::uint64_t{5});
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 2) == "Commands/Locate"; }));
  EXPECT_EQ(rig.audited("Commands/Locate").size(), 1U);
  // Nothing but NMT was carried out.
  EXPECT_TRUE(std::ranges::all_of(rig.requests, [](const auto& r) { return r.verb == "nmt"; }));
  view.command("left", "Commands/NMT", sparkplug::DataType::string, text("explode"));
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 3) == "explode"; }));
  EXPECT_NE(view.cell("Commands/Refused", 4).find("is not an NMT command"), std::string::npos);
}

TEST(FleetMachine, WithoutCommandsItOnlySpeaks) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  view.command("", "Commands/NMT/field", sparkplug::DataType::string, text("stop"));
  view.command("left", "Signals/Position value", sparkplug::DataType::uint32, std::uint64_t{1});
  ASSERT_TRUE(rig.until([&] { return rig.audited("refused").size() == 2; }));
  EXPECT_TRUE(rig.requests.empty());
}

// A personal confirmation cannot come by MQTT.
TEST(FleetMachine, WhatNeedsAPersonIsRefused) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(allows, publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  rig.session().set_careful(true);
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  view.command("left", "Commands/NMT", sparkplug::DataType::string, text("reset-node"));
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 3) == "reset-node"; }));
  EXPECT_NE(view.cell("Commands/Refused", 4).find("operational"), std::string::npos)
      << view.cell("Commands/Refused", 4);
  EXPECT_EQ(rig.slot("left").state, places::SlotState::operational);
}

TEST(FleetMachine, ReplacesADeviceThatIsGone) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(allows, publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  auto& device = rig.device_in("left");
  device.unplug();
  ASSERT_TRUE(rig.until([&] { return view.is("", "Slots/left/State", text("absent")); }));
  device.next_power_on().serial = 77;
  device.plug();
  view.command("", "Commands/Replace/left", sparkplug::DataType::string, text(""));
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Done", 2) == "Commands/Replace/left"; })) << rig.told();
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Device/Serial number", std::uint64_t{77}); }));
}

TEST(FleetMachine, WritesWhatIsMarkedAndReadsWhatNoPdoCarries) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", "publish = [{ object = \"Filter time\", poll = true, writable = true }]\n"));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Filter time", std::uint64_t{10}); }));
  view.command("left", "Signals/Filter time", sparkplug::DataType::uint16, std::uint64_t{250});
  ASSERT_TRUE(rig.until([&] { return view.is("left", "Signals/Filter time", std::uint64_t{250}); }));
  EXPECT_EQ(rig.value_in(rig.device_in("left").name(), {0x2000, 0}), 250U);
  view.command("left", "Signals/Filter time", sparkplug::DataType::uint16, std::uint64_t{5000});  // above its limit
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 3) == "5000"; }));
  EXPECT_EQ(rig.value_in(rig.device_in("left").name(), {0x2000, 0}), 250U);
}

// A concise DCF (CiA 302-3): one entry, Filter time (2000h:00, UNSIGNED16) = 20.
Value filter_time_20() { return sparkplug::Bytes{1, 0, 0, 0, 0x00, 0x20, 0, 2, 0, 0, 0, 20, 0}; }

// `configure` restarts the device: on a real bus a person confirms that, and the host says so.
TEST(FleetMachine, TakesAConfigurationThatAPersonConfirmed) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("[mqtt]\nbroker = \"mqtt://127.0.0.1\"\ncommands = [\"configure\"]\n", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  rig.session().set_careful(true);
  ASSERT_TRUE(rig.until([&] { return born(view, "left") && born(view, "right"); }));
  const auto device = rig.device_in("left").name();
  view.command("left", "Commands/Configure", sparkplug::DataType::bytes, filter_time_20());
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 2) == "Commands/Configure"; }));
  EXPECT_NE(view.cell("Commands/Refused", 4).find("operational"), std::string::npos);
  EXPECT_EQ(rig.value_in(device, {0x2000, 0}), 10U);
  view.command("left", "Commands/Configure", sparkplug::DataType::bytes, filter_time_20(), "line", true);
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Done", 2) == "Commands/Configure"; }));
  EXPECT_EQ(view.cell("Commands/Done", 1), "left");
  // The CRC-32 of the thirteen bytes by another program: Python's zlib.crc32.
  EXPECT_EQ(view.cell("Commands/Done", 3), "13 bytes, CRC-32 48F28B0F");
  EXPECT_EQ(rig.value_in(device, {0x2000, 0}), 20U);
  EXPECT_EQ(rig.slot("left").state, places::SlotState::operational);
  EXPECT_EQ(rig.value_in(rig.device_in("right").name(), {0x2000, 0}), 10U) << "the other slot keeps its own";
  EXPECT_EQ(rig.told_of("a user gave a concise DCF"), 1U) << rig.told();
  EXPECT_EQ(rig.audited("configure").size(), 4U) << "begun and no, begun and done";
}

// A confirmation by MQTT is for what its permission says: NMT is not.
TEST(FleetMachine, AConfirmationIsNoneForOtherCommands) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text(allows, publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  rig.session().set_careful(true);
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  view.command("left", "Commands/NMT", sparkplug::DataType::string, text("reset-node"), "line", true);
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 3) == "reset-node"; }));
  EXPECT_EQ(rig.slot("left").state, places::SlotState::operational);
}

// Nothing changes if the file is none for this device.
TEST(FleetMachine, AConfigurationThatDoesNotFitIsRefusedInWords) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("[mqtt]\nbroker = \"mqtt://127.0.0.1\"\ncommands = [\"configure\"]\n", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  const sparkplug::Bytes unknown_object{1, 0, 0, 0, 0x77, 0x77, 0, 2, 0, 0, 0, 20, 0};
  view.command("left", "Commands/Configure", sparkplug::DataType::bytes, unknown_object);
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 2) == "Commands/Configure"; }));
  EXPECT_NE(view.cell("Commands/Refused", 4).find("7777"), std::string::npos) << view.cell("Commands/Refused", 4);
  const auto boots = rig.told_of("boot");
  view.command("left", "Commands/Configure", sparkplug::DataType::bytes, sparkplug::Bytes{});
  ASSERT_TRUE(rig.until([&] { return view.cell("Commands/Refused", 4).find("zlib") != std::string::npos; }));
  EXPECT_EQ(rig.told_of("boot"), boots);
  EXPECT_EQ(rig.slot("left").state, places::SlotState::operational);
}

TEST(FleetMachine, AFloodOfCommandsDoesNotFloodTheLog) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
  for (int i = 0; i < 200; ++i) view.command("left", "x", sparkplug::DataType::string, text("y"));
  ASSERT_TRUE(rig.until([&] { return rig.told_of("dropped") > 0; }));
  EXPECT_LT(rig.audited("refused").size(), 100U);
}

TEST(FleetMachine, TheSameMachineTwiceIsSaidInWords) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig one(machine_text("", publishes));
  ASSERT_EQ(one.publish(to(broker)), "");
  ASSERT_TRUE(one.until([&] { return born(view, "left"); }));
  Rig two(machine_text("", publishes));
  ASSERT_EQ(two.publish(to(broker)), "");
  ASSERT_TRUE(one.until([&] { return one.told_of("runs twice") + two.told_of("runs twice") > 0; }));
}

TEST(FleetMachine, WaitsForItsPrimaryHost) {
  NEEDS_BROKER();
  Broker broker;
  View view(broker);
  Rig rig(machine_text("[mqtt]\nbroker = \"mqtt://127.0.0.1\"\nprimary_host = \"scada\"\n", publishes));
  ASSERT_EQ(rig.publish(to(broker)), "");
  ASSERT_TRUE(rig.up());
  ASSERT_TRUE(rig.until([&] { return rig.told_of("connected to") > 0; }));
  rig.run(3s);
  EXPECT_EQ(view.count(MessageType::nbirth), 0U);
  ASSERT_TRUE(view.station().publish("spBv1.0/STATE/scada", R"({"online":true,"timestamp":1})",
                                     mqtt::Qos::at_least_once, true));
  ASSERT_TRUE(rig.until([&] { return born(view, "left"); }));
}

}  // namespace berth::fleet::test
