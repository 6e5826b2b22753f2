// Trace files that a page sends: what the answer has of them, and who may send one.
#include "berth/studio/opened.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string>

#include "../pch.hpp"
#include "server_fixture.hpp"

namespace berth::studio {
namespace {

tl::expected<Json, std::string> open(const std::string& name, const std::string& bytes) {
  Opened file(name, bytes);
  while (!file.step()) {
  }
  const auto answer = file.answer();
  if (!answer) return tl::unexpected(answer.error());
  return Json::parse(*answer);
}

std::string why(const std::string& bytes) {
  const auto read = open("x.log", bytes);
  return read ? std::string() : read.error();
}

}  // namespace

TEST(StudioOpened, FramesWithTheirWords) {
  const auto read = open("run.log",
                         "(0000000001.000000) can0 705#7F\n(0000000001.250000) can1 601#4018100400000000\n"
                         "(0000000002.000000) can0 701#R\n(0000000002.500000) can0 1F940000#\n");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ((*read)["name"], "run.log");
  EXPECT_EQ((*read)["format"], "candump");
  EXPECT_EQ((*read)["buses"], Json({"can0", "can1"}));
  EXPECT_EQ((*read)["frames"], 4);
  EXPECT_TRUE((*read)["findings"].empty());
  const auto& rows = (*read)["rows"];
  ASSERT_EQ(rows.size(), 4U);
  EXPECT_EQ(rows[0]["n"], 0);
  EXPECT_NE(rows[0]["text"].get<std::string>().find("pre-operational"), std::string::npos);
  EXPECT_EQ(rows[1]["t_s"], 1.25);
  EXPECT_EQ(rows[1]["bus"], "can1");
  EXPECT_EQ(rows[1]["data"], "4018100400000000");
  EXPECT_EQ(rows[2]["rtr"], true);
  EXPECT_EQ(rows[3]["ext"], true);
}

TEST(StudioOpened, ErrorFramesAreRows) {
  const auto read = open("run.log",
                         "(0000000001.000000) can0 705#7F\n(0000000001.500000) can0 20000088#0000840A00001000\n"
                         "(0000000002.000000) can0 705#05\n");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ((*read)["frames"], 3);
  const auto& rows = (*read)["rows"];
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_FALSE(rows[0].contains("error"));
  EXPECT_EQ(rows[1]["error"], true);
  EXPECT_EQ(rows[1]["id"], 0x88);
  EXPECT_EQ(rows[1]["text"], "error: bus error, protocol (stuff, while sending), in the data; counters tx 16, rx 0");
  EXPECT_TRUE((*read)["findings"].empty());
}

TEST(StudioOpened, WrongLinesAreToldByTheirPlaceAndTheOthersAreRead) {
  const auto read =
      open("run.log", "(0000000001.000000) can0 705#7F\nthis is not a frame\n(0000000002.000000) can0 705#05\n");
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ((*read)["rows"].size(), 2U);
  ASSERT_EQ((*read)["findings"].size(), 1U);
  EXPECT_EQ((*read)["findings"][0].get<std::string>().find("run.log:2:"), 0U) << (*read)["findings"][0];
  std::string wrong;
  for (int i = 0; i < 500; ++i) wrong += "(0000000001.000000) can0 705#XX\n";
  const auto many = open("run.log", wrong);
  ASSERT_TRUE(many) << many.error();
  EXPECT_EQ((*many)["findings"].size() + (*many)["more_findings"].get<std::size_t>(), 500U);
  EXPECT_EQ((*many)["findings"].size(), Opened::most_findings);
}

TEST(StudioOpened, WhatIsNoTraceIsToldAsWhatItIs) {
  EXPECT_EQ(why("").find("x.log: "), 0U);
  EXPECT_NE(why("LOGG\x90" + std::string(4100, '\0')).find("BLF"), std::string::npos);
  EXPECT_NE(why(std::string("\x1f\x8b\x08\0\0\0\0\0\0\x03", 10)).find("cut short"), std::string::npos);
  EXPECT_NE(why(std::string(5000, '\0')).find("neither"), std::string::npos);
}

TEST(StudioOpened, HasAsManyRowsAsAPageHolds) {
  std::string text;
  for (unsigned i = 0; i < Opened::most_frames + 7; ++i) text += fmt::format("({:010}.000000) can0 705#05\n", i);
  const auto read = open("long.log", text);
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ((*read)["frames"], Opened::most_frames + 7);
  EXPECT_EQ((*read)["rows"].size(), Opened::most_frames);
}

TEST(StudioOpened, TheNameIsNoPath) {
  EXPECT_EQ(parse_name_query("name=run.log").value(), "run.log");
  EXPECT_EQ(parse_name_query("name=a%20b%2F..%2Frun.log").value(), "run.log");
  for (const char* bad : {"", "name=", "name", "file=x", "name=x&name=y", "name=%"})
    EXPECT_FALSE(parse_name_query(bad)) << bad;
}

TEST_F(StudioServer, AFileIsReadForWhoMaySendOneAndOneAtATime) {
  const std::string log = "(0000000001.000000) can0 705#7F\n";
  const auto sent = [&](const std::string& token, std::size_t length) {
    return head(
        "POST /api/v1/read?name=run.log",
        fmt::format("Authorization: Bearer {}\r\nOrigin: http://{}\r\nContent-Length: {}\r\n", token, own(), length));
  };
  EXPECT_NE(status_of(sent(token(command::Role::view), log.size()) + log).find("200"), std::string::npos);
  EXPECT_EQ(status_of(sent(std::string(64, '0'), longest_file)), "HTTP/1.1 401") << "before the file is there";
  EXPECT_EQ(status_of(sent(token(), longest_file + 1)), "HTTP/1.1 413");
  EXPECT_EQ(status_of(sent(token(), 0)), "HTTP/1.1 422");
  EXPECT_EQ(status_of(head("GET /api/v1/read?name=x", bearer())), "HTTP/1.1 405");
  auto slow = connect();
  slow->say(sent(token(), 100) + log);
  std::string other;
  ASSERT_TRUE(slow->until([&] { return (other = status_of(sent(token(), log.size()) + log)) == "HTTP/1.1 503"; }));
  slow->say(std::string(100 - log.size(), '\n'));
  const auto answer = slow->answer();
  EXPECT_EQ(answer.substr(0, 12), "HTTP/1.1 200");
  EXPECT_EQ(Json::parse(answer.substr(answer.find("\r\n\r\n") + 4))["frames"], 1);
  EXPECT_EQ(status_of(sent(token(), log.size()) + log), "HTTP/1.1 200");
  auto gone = connect();
  gone->say(sent(token(), 100));
  ASSERT_TRUE(gone->until([&] { return status_of(sent(token(), log.size()) + log) == "HTTP/1.1 503"; }));
  gone.reset();
  auto next = connect();
  EXPECT_TRUE(next->until([&] { return status_of(sent(token(), log.size()) + log) == "HTTP/1.1 200"; }));
}

}  // namespace berth::studio
