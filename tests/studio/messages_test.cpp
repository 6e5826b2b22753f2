// What a page may say: each message of docs/api.md, and what is none.
#include "berth/studio/messages.hpp"

#include <gtest/gtest.h>

#include <string>

#include "../pch.hpp"

namespace berth::studio {

TEST(StudioMessages, EachIsRead) {
  auto read = parse_message(R"({"type":"request","id":"1","verb":"sdo read","arguments":{"node":"5"}})");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->kind, MessageKind::request);
  EXPECT_EQ(read->id, "1");
  EXPECT_EQ(read->request, (command::Request{"sdo read", {{"node", "5"}}}));
  read = parse_message(R"({"type":"frames","id":"2","from":7,"count":2000,"filter":"sdo 601"})");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->kind, MessageKind::frames);
  EXPECT_EQ(read->from, 7U);
  EXPECT_EQ(read->count, 2000U);
  EXPECT_EQ(read->filter, "sdo 601");
  read = parse_message(R"({"type":"frames","id":"2","count":1})");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->from, std::nullopt);
  read = parse_message(R"({"type":"live","frames":true})");
  ASSERT_TRUE(read && read->kind == MessageKind::live && read->on);
  read = parse_message(R"({"type":"unlock","minutes":10})");
  ASSERT_TRUE(read && read->kind == MessageKind::unlock && read->minutes == 10);
  read = parse_message(R"({"type":"lock"})");
  ASSERT_TRUE(read && read->kind == MessageKind::lock);
}

TEST(StudioMessages, WhatIsNoneIsRefusedInWords) {
  const std::string deep(30'000, '[');
  const std::string long_id = R"({"type":"request","verb":"report","id":")" + std::string(65, 'x') + "\"}";
  const std::string long_filter = R"({"type":"frames","id":"1","count":1,"filter":")" + std::string(201, 'x') + "\"}";
  for (const std::string& bad : {std::string(),
                                 std::string("null"),
                                 std::string("[]"),
                                 std::string("{"),
                                 std::string("{}"),
                                 deep,
                                 long_id,
                                 long_filter,
                                 std::string(65'537, ' '),
                                 std::string(R"({"type":5})"),
                                 std::string(R"({"type":"shutdown"})"),
                                 std::string(R"({"type":"lock","more":1})"),
                                 std::string(R"({"type":"request","id":"1"})"),
                                 std::string(R"({"type":"request","verb":"report"})"),
                                 std::string(R"({"type":"request","id":"","verb":"x"})"),
                                 std::string(R"({"type":"request","id":"1","verb":"x","arguments":[]})"),
                                 std::string(R"({"type":"request","id":"1","verb":"x","arguments":{"a":5}})"),
                                 std::string(R"({"type":"frames","id":"1","count":0})"),
                                 std::string(R"({"type":"frames","id":"1","count":2001})"),
                                 std::string(R"({"type":"frames","id":"1","count":1,"from":-1})"),
                                 std::string(R"({"type":"live","frames":1})"),
                                 std::string(R"({"type":"unlock","minutes":0})"),
                                 std::string(R"({"type":"unlock","minutes":481})"),
                                 std::string(R"({"type":"unlock","minutes":1.5})"),
                                 std::string("{\"type\":\"lock\xff\"}")}) {
    const auto read = parse_message(bad);
    EXPECT_FALSE(read) << bad.substr(0, 100);
    EXPECT_TRUE(read || !read.error().empty());
  }
}

TEST(StudioMessages, BodiesOfRequests) {
  EXPECT_TRUE(parse_body(R"({"verb":"report","arguments":{}})"));
  EXPECT_TRUE(parse_body(R"({"verb":"report"})"));
  EXPECT_FALSE(parse_body(R"({"verb":"report","type":"request"})"));
  EXPECT_FALSE(parse_body(""));
  EXPECT_FALSE(parse_body(std::string(65'537, ' ')));
}

}  // namespace berth::studio
