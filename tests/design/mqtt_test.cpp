// `[mqtt]` and `publish`: keys, ranges, what is refused at its place, and edits that keep the rest.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "berth/design/edit.hpp"
#include "berth/design/machine.hpp"

using namespace berth;
using namespace std::chrono_literals;
using design::Publish;

namespace mqtt_tests {
namespace {

std::string file(const std::string& mqtt, const std::string& slot = {}, const std::string& name = "left") {
  return "[machine]\nname = \"m\"\n" + mqtt + "[bus.field]\nport = \"sim\"\nbitrate = 125000\n" +
         "[[slot]]\nbus = \"field\"\nid = 5\nname = \"" + name + "\"\ntype = { vendor = 1, product = 1 }\n" + slot;
}

std::string said(const std::string& text) {
  std::string all;
  for (const auto& finding : design::read_machine(text, "m.toml", {}).findings) all += to_string(finding) + "\n";
  return all;
}

std::vector<Publish> published(const std::string& value) {
  const auto text = file("", "publish = " + value + "\n");
  const auto read = design::read_machine(text, "m.toml", {});
  EXPECT_TRUE(read.machine) << said(text);
  return read.machine ? read.machine->slots.front().publish : std::vector<Publish>();
}

void refused(const std::string& text, const char* place, const char* part) {
  SCOPED_TRACE(text);
  const auto words = said(text);
  EXPECT_NE(words.find(place), std::string::npos) << words;
  EXPECT_NE(words.find(part), std::string::npos) << words;
}

const std::string broker = "[mqtt]\nbroker = \"mqtts://b\"\n";

}  // namespace

TEST(MqttKeys, WithoutTheTableThereIsNone) { EXPECT_FALSE(design::read_machine(file(""), "m.toml", {}).machine->mqtt); }

TEST(MqttKeys, DefaultsAreThoseOfThePage) {
  const auto read = design::read_machine(file(broker), "m.toml", {});
  ASSERT_TRUE(read.machine) << said(file(broker));
  const auto& mqtt = *read.machine->mqtt;
  EXPECT_EQ(mqtt.broker, "mqtts://b");
  EXPECT_EQ(mqtt.group, "berth");
  EXPECT_EQ(mqtt.node, "");
  EXPECT_EQ(mqtt.version, design::MqttVersion::automatic);
  EXPECT_EQ(mqtt.backlog, 16'777'216U);
  EXPECT_FALSE(mqtt.commands.allow("nmt"));
}

TEST(MqttKeys, EachIsRead) {
  const auto read = design::read_machine(
      file(broker + "group = \"plant 7\"\nnode = \"line-3\"\nprimary_host = \"scada\"\nversion = \"3.1.1\"\n"
                    "ca = \"ca.pem\"\ncertificate = \"c.pem\"\nkey = \"k.pem\"\nlogin = \"login\"\nclient_id = \"x\"\n"
                    "backlog = 65536\ncommands = [\"nmt\", \"replace\", \"nmt\"]\n"),
      "m.toml", {});
  ASSERT_TRUE(read.machine);
  const auto& mqtt = *read.machine->mqtt;
  EXPECT_EQ(mqtt.group + mqtt.node + mqtt.primary_host + mqtt.client_id, "plant 7line-3scadax");
  EXPECT_EQ(mqtt.version, design::MqttVersion::v3_1_1);
  EXPECT_EQ(mqtt.ca + mqtt.certificate + mqtt.key + mqtt.login, "ca.pemc.pemk.pemlogin");
  EXPECT_EQ(mqtt.backlog, 65'536U);
  EXPECT_EQ(mqtt.commands.verbs, (std::vector<std::string>{"nmt", "replace"}));
}

TEST(MqttKeys, WhatCannotBeIsRefusedAtItsPlace) {
  refused(file("[mqtt]\ngroup = \"a\"\n"), "m.toml:3:1: error: mqtt.broker", "missing");
  refused(file("[mqtt]\nbroker = \"broker:1883\"\n"), "m.toml:4:10: error: mqtt.broker", "mqtt://HOST:PORT");
  refused(file(broker + "group = \"a/b\"\n"), "m.toml:5:9: error: mqtt.group", "topic");
  refused(file(broker + "group = \"STATE\"\n"), "m.toml:5:9", "topic of hosts");
  refused(file(broker + "node = \"a#\"\n"), "m.toml:5:8", "topic");
  refused(file(broker + "version = \"4\"\n"), "m.toml:5:11", "3.1.1");
  refused(file(broker + "certificate = \"c\"\n"), "m.toml:5:15", "belong together");
  refused(file("[mqtt]\nbroker = \"mqtt://b\"\nca = \"c\"\n"), "m.toml:5:6", "no TLS");
  refused(file(broker + "login = \"/etc/login\"\n"), "m.toml:5:9", "login");
  refused(file(broker + "backlog = 65535\n"), "m.toml:5:11", "65536");
  refused(file(broker + "commands = [\"sdo write\"]\n"), "m.toml:5:12", "cannot be commanded by MQTT");
  refused(file(broker + "brocker = 1\n"), "m.toml:5:1", "did you mean \"broker\"?");
  refused(file(broker, "", "a+b"), "m.toml:3:1", "slot \"a+b\" (line 8)");
}

TEST(MqttKeys, SlotsThatDifferInCaseOnlyAreOneDeviceToAHost) {
  const std::string twin = "[[slot]]\nbus = \"field\"\nid = 6\nname = \"LEFT\"\ntype = { vendor = 1, product = 1 }\n";
  refused(file(broker, twin), "m.toml:3:1", "differ in case only");
  EXPECT_EQ(said(file("", twin)), "") << "without a broker they are two";
}

TEST(PublishKeys, StringsAndTablesInOneList) {
  const auto list = published(R"(["Position", { object = "6401h:01", deadband = 5, writable = true, every = "2 s",)"
                              R"( timeout = "9 s" }, { object = "temp", poll = true, deadband = 0.5 }])");
  ASSERT_EQ(list.size(), 3U);
  EXPECT_EQ(list[0].object, "Position");
  EXPECT_EQ(list[0].every, 1s);
  EXPECT_FALSE(list[0].writable || list[0].poll || list[0].timeout);
  EXPECT_EQ(list[1].deadband, 5);
  EXPECT_EQ(list[1].every, 2s);
  EXPECT_EQ(list[1].timeout, 9s);
  EXPECT_TRUE(list[1].writable);
  EXPECT_TRUE(list[2].poll);
  EXPECT_EQ(list[2].deadband, 0.5);
}

TEST(PublishKeys, WhatCannotBeIsRefusedAtItsPlace) {
  const auto slot = [](const std::string& value) { return file("", "publish = " + value + "\n"); };
  refused(slot("\"Position\""), "m.toml:11:11", "publish");
  refused(slot("[7]"), "m.toml:11:12", "string or a table");
  refused(slot("[\"\"]"), "m.toml:11:11", "empty");
  refused(slot("[\"a\", \"a\"]"), "m.toml:11:11", "appears twice");
  refused(slot("[{ deadband = 1 }]"), "m.toml:11:12: error: slot[1].publish[1].object", "missing");
  refused(slot(R"([{ object = "a", deadband = -1 }])"), "m.toml:11:39", "from 0 on");
  refused(slot(R"([{ object = "a", deadband = nan }])"), "m.toml:11:39", "from 0 on");
  refused(slot(R"([{ object = "a", every = "99 ms" }])"), "m.toml:11:36", "100 ms");
  refused(slot(R"([{ object = "a", poll = true, every = "900 ms" }])"), "m.toml:11:49", "1 s");
  refused(slot(R"([{ object = "a", poll = true, every = "9 s", timeout = "9 s" }])"), "m.toml:11:66", "stale");
  refused(slot(R"([{ object = "a", evry = "1 s" }])"), "m.toml:11:28", "did you mean \"every\"?");
}

TEST(MqttEdits, ChangeTheirBytesOnly) {
  const std::string text = file("[mqtt]  # the plant's\nbroker = \"mqtt://b\" # old\ncommands = [\"nmt\"]\n",
                                "publish = [ \"a\", { object = \"b\", deadband = 5 } ] # two\n");
  const auto with = [&](const std::string& what, const std::string& by) {
    auto changed = text;
    return changed.replace(changed.find(what), what.size(), by);
  };
  EXPECT_EQ(design::set_mqtt_key(text, "broker", std::string("mqtts://c")), with("mqtt://b", "mqtts://c"));
  EXPECT_EQ(design::set_mqtt_key(text, "commands", std::vector<std::string>{"locate", "nmt"}),
            with("[\"nmt\"]", "[\"locate\", \"nmt\"]"));
  EXPECT_EQ(design::set_mqtt_key(text, "group", std::string("g")), with("[\"nmt\"]\n", "[\"nmt\"]\ngroup = \"g\"\n"));
  EXPECT_EQ(design::set_slot_key(text, "left", "publish", std::vector<std::string>{"c"}),
            with("[ \"a\", { object = \"b\", deadband = 5 } ]", "[\"c\"]"));
  EXPECT_EQ(design::set_slot_key(text, "left", "id", std::int64_t{6}), with("id = 5", "id = 6"));
  EXPECT_EQ(design::set_mqtt_key(file(""), "broker", std::string("mqtt://b")),
            file("") + "\n[mqtt]\nbroker = \"mqtt://b\"\n");
}

}  // namespace mqtt_tests
