// Addresses of brokers and files with a user and a password.
#include "berth/mqtt/where.hpp"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "../pch.hpp"
#include "berth/mqtt/login.hpp"
#include "folder.hpp"

namespace berth::mqtt {

TEST(MqttWhere, AddressesAsPeopleWriteThem) {
  EXPECT_EQ(parse_where("mqtt://broker.plant"), (Where{false, "broker.plant", 1883}));
  EXPECT_EQ(parse_where("mqtts://broker.plant"), (Where{true, "broker.plant", 8883}));
  EXPECT_EQ(parse_where("mqtts://broker.plant:443"), (Where{true, "broker.plant", 443}));
  EXPECT_EQ(parse_where("MQTT://localhost:1"), (Where{false, "localhost", 1}));
  EXPECT_EQ(parse_where("mqtt://10.0.0.7:65535"), (Where{false, "10.0.0.7", 65535}));
  EXPECT_EQ(parse_where("mqtt://[::1]"), (Where{false, "::1", 1883}));
  EXPECT_EQ(parse_where("mqtts://[2001:db8::7]:8884"), (Where{true, "2001:db8::7", 8884}));
  EXPECT_EQ(parse_where("mqtt://plant_3.example."), (Where{false, "plant_3.example.", 1883}));
}

TEST(MqttWhere, WhatIsNoneIsRefusedInWords) {
  const auto why = [](std::string_view text) { return parse_where(text).error(); };
  EXPECT_EQ(why("broker"), "\"broker\": write mqtt://HOST, or with TLS mqtts://HOST");
  EXPECT_EQ(why("http://broker"), "\"http://broker\": write mqtt://HOST, or with TLS mqtts://HOST");
  EXPECT_EQ(why("mqtt:broker"), "\"mqtt:broker\": write mqtt://HOST, or with TLS mqtts://HOST");
  EXPECT_EQ(why("mqtt://"), "\"mqtt://\": the host is missing: mqtt://HOST or mqtt://HOST:PORT");
  EXPECT_EQ(why("mqtt://:1883"), "\"mqtt://:1883\": the host is missing: mqtt://HOST or mqtt://HOST:PORT");
  EXPECT_EQ(why("mqtt://::1"), "\"mqtt://::1\": an IPv6 address is written in brackets: mqtt://[::1]:1883");
  EXPECT_EQ(why("mqtt://[::1"), "\"mqtt://[::1\": an IPv6 address stands in the brackets: mqtt://[::1]:1883");
  EXPECT_EQ(why("mqtt://[broker]"), "\"mqtt://[broker]\": an IPv6 address stands in the brackets: mqtt://[::1]:1883");
  EXPECT_EQ(why("mqtt://[::1]1883"), "\"mqtt://[::1]1883\": after the address comes nothing, or a colon and the port");
  for (const std::string port : {"0", "65536", "-1", "+1", "1883x", " 1883", "", "99999999999999999999"}) {
    EXPECT_NE(why("mqtt://broker:" + port).find("the port is a number from 1 to 65535"), std::string::npos) << port;
    EXPECT_NE(why("mqtt://[::1]:" + port).find("the port is a number from 1 to 65535"), std::string::npos) << port;
  }
  EXPECT_EQ(why("mqtt://broker/topic"), "\"mqtt://broker/topic\": nothing follows the host and the port");
  EXPECT_EQ(why("mqtt://broker?x"), "\"mqtt://broker?x\": nothing follows the host and the port");
  for (const std::string host : {"a b", "a..b", "10.0.0.300", "10.1", "4711", "bröker", "a\nb", ".", "-%"})
    EXPECT_NE(why("mqtt://" + host).find("is neither a host's name nor an address"), std::string::npos) << host;
  EXPECT_FALSE(parse_where(std::string_view("mqtt://10.0.0.7\0x", 17)));
  EXPECT_FALSE(parse_where(std::string_view("mqtt://[::1\0x]", 14)));
  EXPECT_FALSE(parse_where("mqtt://" + std::string(64, 'a')));
  EXPECT_TRUE(parse_where("mqtt://" + std::string(63, 'a')));
}

TEST(MqttWhere, AUserIsRefusedAndNotRepeated) {
  const auto why = parse_where("mqtt://user:secret@broker").error();
  EXPECT_NE(why.find("put both into a file"), std::string::npos) << why;
  EXPECT_EQ(why.find("secret"), std::string::npos);
}

RC_GTEST_PROP(MqttWhere, WhatIsWrittenIsReadEqual, ()) {
  const auto hosts = std::vector<std::string>{"broker", "a.b-c.example", "127.0.0.1", "::1", "fe80::1:2"};
  const Where where{*rc::gen::arbitrary<bool>(), *rc::gen::elementOf(hosts),
                    *rc::gen::inRange<std::uint16_t>(1, 65535)};
  RC_ASSERT(parse_where(to_string(where)) == where);
}

TEST(MqttLogin, TwoLines) {
  EXPECT_EQ(parse_login("user\nsecret\n"), (Login{"user", "secret"}));
  EXPECT_EQ(parse_login("user\nsecret"), (Login{"user", "secret"}));
  EXPECT_EQ(parse_login("user\r\nsecret\r\n"), (Login{"user", "secret"}));
  EXPECT_EQ(parse_login("a user\n  se cret \n\n\n"), (Login{"a user", "  se cret "}));
  EXPECT_EQ(parse_login("user\n\n"), (Login{"user", ""}));
}

TEST(MqttLogin, OtherFilesAreRefusedInWordsThatDoNotRepeatThem) {
  const auto why = [](std::string_view text) { return parse_login(text).error(); };
  EXPECT_EQ(why(""), "1: the user is missing: the first line is the user's name");
  EXPECT_EQ(why("\nsecret\n"), "1: the user is missing: the first line is the user's name");
  EXPECT_EQ(why("secret"), "2: the password is missing: the second line is the password");
  EXPECT_EQ(why("user\nsecret\nmore\n"), "3: only two lines are expected: the user and the password");
  EXPECT_EQ(why(std::string_view("us\0er\nsecret\n", 13)), "1: this is not a text file: it has a NUL character");
}

// As Studio's tokens: only the owner may read it.
TEST(MqttLogin, AFileThatOthersCanReadIsRefused) {
  const test::Folder folder;
  const auto path = folder.write("login", "user\nsecret\n");
  EXPECT_EQ(read_login(path), (Login{"user", "secret"}));
  for (const mode_t mode : {0640U, 0604U, 0620U, 0601U}) {
    ASSERT_EQ(::chmod(path.c_str(), mode), 0);
    EXPECT_EQ(read_login(path).error(), path + ": other users can read the password in it: chmod 600 " + path);
  }
  ASSERT_EQ(::chmod(path.c_str(), 0600), 0);
  ASSERT_EQ(::symlink(path.c_str(), folder.file("link").c_str()), 0);
  EXPECT_FALSE(read_login(folder.file("link")));
  EXPECT_FALSE(read_login(folder.file("none")));
  EXPECT_NE(read_login(folder.file(".")).error().find("this is not a file"), std::string::npos);
  EXPECT_EQ(read_login(folder.write("wrong", "user")).error(),
            folder.file("wrong") + ":2: the password is missing: the second line is the password");
  EXPECT_FALSE(read_login(folder.write("long", "user\n" + std::string(4096, 'x') + "\n")));
}

}  // namespace berth::mqtt
