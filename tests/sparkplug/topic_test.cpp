// Topics: made, read, and the names that are refused.
#include "berth/sparkplug/topic.hpp"

#include <gtest/gtest.h>

namespace {

using namespace berth;
using namespace berth::sparkplug;

const EdgeNodeId press{"Halle 3", "Presse"};

// SP.14, SP.15: namespace, group, type, edge node and device, in this order.
TEST(SparkplugTopic, MadeAsTheStandardHasThem) {
  EXPECT_EQ(make_topic(press, MessageType::nbirth), "spBv1.0/Halle 3/NBIRTH/Presse");
  EXPECT_EQ(make_topic(press, MessageType::ndeath), "spBv1.0/Halle 3/NDEATH/Presse");
  EXPECT_EQ(make_topic(press, MessageType::ndata), "spBv1.0/Halle 3/NDATA/Presse");
  EXPECT_EQ(make_topic(press, MessageType::ncmd), "spBv1.0/Halle 3/NCMD/Presse");
  EXPECT_EQ(make_topic(press, MessageType::dbirth, "drive"), "spBv1.0/Halle 3/DBIRTH/Presse/drive");
  EXPECT_EQ(make_topic(press, MessageType::ddeath, "drive"), "spBv1.0/Halle 3/DDEATH/Presse/drive");
  EXPECT_EQ(make_topic(press, MessageType::ddata, "drive"), "spBv1.0/Halle 3/DDATA/Presse/drive");
  EXPECT_EQ(make_topic(press, MessageType::dcmd, "drive"), "spBv1.0/Halle 3/DCMD/Presse/drive");
  EXPECT_EQ(state_topic("scada"), "spBv1.0/STATE/scada");
}

// SP.22, SP.23: DBIRTH, DDEATH, DDATA and DCMD have a device ID, the others have none.
TEST(SparkplugTopic, WhatIsMadeIsRead) {
  for (const auto type : {MessageType::nbirth, MessageType::ndeath, MessageType::ndata, MessageType::ncmd}) {
    const auto topic = parse_topic(make_topic(press, type));
    ASSERT_TRUE(topic);
    EXPECT_EQ(*topic, (Topic{.type = type, .edge = press, .device = {}, .host = {}}));
    EXPECT_FALSE(parse_topic(make_topic(press, type, "drive"))) << name(type);
  }
  for (const auto type : {MessageType::dbirth, MessageType::ddeath, MessageType::ddata, MessageType::dcmd}) {
    const auto topic = parse_topic(make_topic(press, type, "drive"));
    ASSERT_TRUE(topic);
    EXPECT_EQ(*topic, (Topic{.type = type, .edge = press, .device = "drive", .host = {}}));
    EXPECT_FALSE(parse_topic(make_topic(press, type))) << name(type);
  }
  const auto state = parse_topic("spBv1.0/STATE/scada");
  ASSERT_TRUE(state);
  EXPECT_EQ(*state, (Topic{.type = MessageType::state, .edge = {}, .device = {}, .host = "scada"}));
  EXPECT_FALSE(parse_topic("spBv1.0/G/STATE/scada"));
}

TEST(SparkplugTopic, OtherTopics) {
  EXPECT_EQ(parse_topic("factory/line").error().code, Errc::not_found);
  EXPECT_EQ(parse_topic("").error().code, Errc::not_found);
  EXPECT_EQ(parse_topic("spAv1.0/G/NBIRTH/E").error().code, Errc::not_found);
  for (const auto* bad : {"spBv1.0", "spBv1.0/", "spBv1.0/G", "spBv1.0/G/NBIRTH", "spBv1.0/G/nbirth/E",
                          "spBv1.0//NBIRTH/E", "spBv1.0/G/NBIRTH/", "spBv1.0/G/DBIRTH/E/", "spBv1.0/G/DBIRTH/E/D/x",
                          "spBv1.0/STATE/", "spBv1.0/STATE/NBIRTH/E", "spBv1.0/G/DBIRTH/E/+", "spBv1.0/G/NBIRTH/#"}) {
    const auto topic = parse_topic(bad);
    ASSERT_FALSE(topic) << bad;
    EXPECT_EQ(topic.error().code, Errc::invalid) << bad;
    EXPECT_STRNE(topic.error().text, "") << bad;
  }
}

// SP.2, SP.4, SP.6: IDs are UTF-8. SP.3, SP.5, SP.7: and have MQTT's characters only. SP.16, SP.18, SP.19: without + /
// #.
TEST(SparkplugTopic, LegalIds) {
  for (const auto* good : {"a", "Presse 7", "\xC3\x96lmühle", "a.b:c$d", "STATE"}) EXPECT_TRUE(check_id(good)) << good;
  const std::string zero("a\0b", 3);
  for (const std::string& bad : {std::string(), std::string("a/b"), std::string("a+"), std::string("#"),
                                 std::string("\xFF"), zero, std::string("a\nb"), std::string(1025, 'x')}) {
    EXPECT_FALSE(check_id(bad)) << bad;
  }
  EXPECT_TRUE(check_id(std::string(1024, 'x')));
  EXPECT_STREQ(check_id("Linie 1/Presse").error().text,
               "a Sparkplug ID may not contain /, which separates the levels of a topic");
  EXPECT_FALSE(check(EdgeNodeId{"STATE", "E"}));
  EXPECT_FALSE(check(EdgeNodeId{"G", "a/b"}));
  EXPECT_FALSE(check(EdgeNodeId{"a/b", "E"}));
  EXPECT_TRUE(check(press));
}

}  // namespace
