// The server before clients that are plain sockets: what is let in, what is said, and those who misbehave. The executor
// is turned by this thread, the server has its own.
#include "berth/can/bus_error.hpp"
#include "server_fixture.hpp"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <set>

#include "../paths.hpp"
#include "../pch.hpp"
#include "berth/command/audit.hpp"
#include "berth/command/verbs.hpp"
#include "berth/studio/messages.hpp"

namespace berth::studio {

TEST_F(StudioServer, PagesNeedNoTokenAndCarryThePolicy) {
  auto client = connect();
  client->say(head("GET /"));
  const auto answer = client->answer();
  EXPECT_EQ(answer.substr(0, 15), "HTTP/1.1 200 OK");
  EXPECT_NE(answer.find("Content-Security-Policy: default-src 'none'; script-src 'self';"), std::string::npos);
  EXPECT_NE(answer.find("X-Content-Type-Options: nosniff"), std::string::npos);
  client->say(head("GET /../../etc/passwd"));
  EXPECT_EQ(client->answer().substr(0, 12), "HTTP/1.1 404");
  client->say(head("DELETE /"));
  EXPECT_EQ(client->answer().substr(0, 12), "HTTP/1.1 405");
}

TEST_F(StudioServer, TheTokenIsInItsFileAndWithoutItNothingIsToldOrDone) {
  const std::string token = first_line(file_);
  EXPECT_EQ(token, this->token());
  EXPECT_EQ(first_line(file_ + ".view"), studio_->tokens().of(command::Role::view));
  EXPECT_EQ(first_line(file_ + ".operate"), studio_->tokens().of(command::Role::operate));
  EXPECT_EQ(studio_->address(command::Role::configure), "http://" + own() + "/#token=" + token);
  EXPECT_EQ(status_of(head("GET /api/v1/snapshot")), "HTTP/1.1 401");
  EXPECT_EQ(status_of(head("GET /api/v1/snapshot", "Authorization: Bearer " + std::string(64, '0') + "\r\n")),
            "HTTP/1.1 401");
  EXPECT_EQ(status_of(head("GET /api/v1/snapshot", bearer())), "HTTP/1.1 200");
  EXPECT_EQ(status_of(socket(std::string(64, '0'), "http://" + own())), "HTTP/1.1 401");
  start();
  EXPECT_NE(this->token(), token);
}

TEST_F(StudioServer, OtherHostsAndOtherPagesAreRefused) {
  const std::string rebound =
      "GET /api/v1/snapshot HTTP/1.1\r\nHost: evil.example:" + std::to_string(studio_->where().port) + "\r\n" +
      bearer() + "\r\n";
  EXPECT_EQ(status_of(rebound), "HTTP/1.1 403");
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\n\r\n"), "HTTP/1.1 403");
  EXPECT_EQ(status_of("GET / HTTP/1.1\r\nHost: " + own() + "\r\nHost: evil.example\r\n\r\n"), "HTTP/1.1 403");
  EXPECT_EQ(status_of(socket(token(), "http://evil.example")), "HTTP/1.1 403");
  EXPECT_EQ(status_of(head("GET /api/v1/snapshot", bearer() + "Origin: http://evil.example\r\n")), "HTTP/1.1 403");
  const std::string body = R"({"verb":"nmt"})";
  const auto length = fmt::format("Content-Length: {}\r\n", body.size());
  EXPECT_EQ(status_of(head("POST /api/v1/request", bearer() + length) + body), "HTTP/1.1 403");
  EXPECT_EQ(status_of(head("POST /api/v1/request", bearer() + length + "Origin: null\r\n") + body), "HTTP/1.1 403");
  EXPECT_EQ(carried_, 0U);
}

TEST_F(StudioServer, WhatIsNoHttpAndWhatIsTooLongIsRefused) {
  EXPECT_EQ(status_of("\x16\x03\x01 TLS?\r\n\r\n"), "HTTP/1.1 400");
  EXPECT_EQ(status_of(head("GET /", "X: " + std::string(9000, 'x') + "\r\n")), "HTTP/1.1 431");
  EXPECT_EQ(status_of(head("POST /api/v1/request", bearer() + "Content-Length: 70000\r\n")), "HTTP/1.1 413");
  EXPECT_EQ(status_of(post("{")), "HTTP/1.1 400");
  auto client = page();
  client->send(std::string(70'000, ' '));
  EXPECT_TRUE(client->hung_up());
  auto other = page();
  other->send("[");
  EXPECT_EQ(other->next("error")["error"], "a message is one JSON object");
}

TEST_F(StudioServer, ASnapshotThenChangesInOrder) {
  auto client = page();
  EXPECT_EQ(snapshot_["machine"]["name"], "bench");
  EXPECT_EQ(snapshot_["machine"]["simulated"], true);
  EXPECT_EQ(snapshot_["buses"][0]["name"], "field");
  EXPECT_EQ(snapshot_["buses"][0]["bit_rate"], 125'000);
  EXPECT_EQ(snapshot_["role"], "configure");
  EXPECT_EQ(snapshot_["lock"]["real"], false);
  EXPECT_GT(snapshot_["verbs"].size(), 20U);
  auto seq = snapshot_["seq"].get<int>();
  session_->tell("field", operate::EventKind::step, "<b>first</b>\n\xff");
  auto change = client->next("change");
  while (change["events"].empty()) seq = change["seq"], change = client->next("change");
  EXPECT_EQ(change["seq"], seq + 1);
  EXPECT_EQ(change["events"][0]["text"].get<std::string>().substr(0, 12), "<b>first</b>");
  auto second = page();
  EXPECT_EQ(snapshot_["seq"], change["seq"]);
  EXPECT_EQ(snapshot_["slots"][0]["name"], "drive");
  EXPECT_FALSE(snapshot_["events"].empty());
}

TEST_F(StudioServer, RequestsAreCarriedOutByRightsAndChangesAreTold) {
  auto client = page();
  client->send(R"({"type":"request","id":"a","verb":"report","arguments":{}})");
  auto reply = client->next("reply");
  EXPECT_EQ(reply["id"], "a");
  EXPECT_EQ(reply["status"], 0);
  EXPECT_EQ(reply["reply"]["done"], true);
  client->send(R"({"type":"request","id":"b","verb":"nmt","arguments":{"command":"start"}})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  EXPECT_EQ(client->next("change")["events"][0]["text"], "studio: nmt command=start: done");
  client->send(R"({"type":"request","id":"c","verb":"program download","arguments":{"file":"/etc/passwd"}})");
  EXPECT_EQ(client->next("reply")["status"], 1);
  session_->set_careful(true);
  client->send(R"({"type":"request","id":"d","verb":"nmt","arguments":{"command":"start","yes":"1"}})");
  reply = client->next("reply");
  EXPECT_EQ(reply["status"], 1);
  EXPECT_NE(reply["error"].get<std::string>().find("unlocks"), std::string::npos);
  EXPECT_EQ(carried_, 2U);
  client->send(R"({"type":"unlock","minutes":5})");
  auto change = client->next("change");
  while (change.is_object() && !(change.contains("lock") && change["lock"]["unlocked_until_s"].is_number()))
    change = client->next("change");
  client->send(R"({"type":"request","id":"e","verb":"nmt","arguments":{"command":"start","yes":"1"}})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  client->send(R"({"type":"lock"})");
  client->send(R"({"type":"request","id":"f","verb":"nmt","arguments":{"command":"start"}})");
  EXPECT_EQ(client->next("reply")["status"], 1);
  auto other = connect();
  other->say(post(R"({"verb":"report"})"));
  const auto answer = other->answer();
  EXPECT_EQ(answer.substr(0, 12), "HTTP/1.1 200");
  EXPECT_NE(answer.find(R"("status":0)"), std::string::npos);
}

TEST_F(StudioServer, WhatOneClientWritesTheOthersAreTold) {
  auto writer = page();
  auto other = page();
  writer->send(R"({"type":"request","id":"r","verb":"sdo read","arguments":{"node":"5","object":"1017h"}})");
  EXPECT_EQ(writer->next("reply")["status"], 0);
  writer->send(
      R"({"type":"request","id":"w","verb":"sdo write","arguments":{"node":"5","object":"1017h","value":"500"}})");
  const auto reply = writer->next("reply");
  EXPECT_EQ(reply["status"], 0);
  auto change = other->next("change");
  while (change.is_object() && !change.contains("written")) change = other->next("change");
  ASSERT_EQ(change["written"].size(), 1U) << "who reads changes nothing";
  EXPECT_EQ(change["written"][0], reply["reply"]);
}

TEST_F(StudioServer, WhoLeavesEndsItsRequestsAndOneClientHasEightAtMost) {
  auto client = page();
  for (int i = 0; i < 9; ++i) client->send(fmt::format(R"({{"type":"request","id":"{}","verb":"scan"}})", i));
  const auto reply = client->next("reply");
  EXPECT_EQ(reply["id"], "8");
  EXPECT_EQ(reply["status"], 3);
  client.reset();
  auto other = page();
  other->send(R"({"type":"request","id":"x","verb":"report"})");
  EXPECT_EQ(other->next("reply")["status"], 0);
}

// The wait for a hang-up of the first was still there, and held up the server's thread at the second.
TEST_F(StudioServer, AConnectionThatIsKeptAsksAgainAndAgain) {
  auto client = connect();
  for (int i = 0; i < 3; ++i) {
    client->say(post(R"({"verb":"report"})"));
    EXPECT_EQ(client->answer().substr(0, 12), "HTTP/1.1 200") << i;
    client->in.clear();
    client->say(head("GET /api/v1/snapshot", bearer()));
    EXPECT_EQ(client->answer().substr(0, 12), "HTTP/1.1 200") << i;
    client->in.clear();
  }
}

TEST_F(StudioServer, FramesByRangeAndByFilterOverTheWholeRing) {
  auto client = page();
  frames(3000);
  client->send(R"({"type":"frames","id":"1","from":10,"count":3})");
  auto answer = client->next("frames");
  ASSERT_EQ(answer["rows"].size(), 3U);
  EXPECT_EQ(answer["first"], 10);
  EXPECT_EQ(answer["last"], 12);
  EXPECT_EQ(answer["rows"][0]["n"], 10);
  EXPECT_EQ(answer["rows"][0]["data"], "05");
  EXPECT_EQ(answer["rows"][0]["bus"], "field");
  EXPECT_EQ(answer["rows"][0]["id"], 0x705);
  client->send(R"({"type":"frames","id":"2","count":5,"filter":"705#7F PRE"})");
  answer = client->next("frames");
  EXPECT_EQ(answer["matched"], 1000);
  ASSERT_EQ(answer["rows"].size(), 5U);
  EXPECT_EQ(answer["last"], 2997);
  client->send(R"({"type":"frames","id":"3","count":5,"from":100,"filter":"pre-operational"})");
  answer = client->next("frames");
  EXPECT_EQ(answer["first"], 102);
  client->send(R"({"type":"frames","id":"4","count":5,"filter":"nothing like it"})");
  EXPECT_TRUE(client->next("frames")["rows"].empty());
}

TEST_F(StudioServer, LiveFramesComeInBatchesAndNoneIsMissing) {
  auto client = page();
  client->send(R"({"type":"live","frames":true})");
  client->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  frames(8'000);
  std::uint64_t expected = 0;
  bool second = false;
  while (expected < 20'000) {
    int opcode = 0;
    const auto text = client->message(&opcode);
    ASSERT_FALSE(text.empty());
    if (opcode != 2) continue;
    const auto number = [&](std::size_t at, unsigned bytes) {
      std::uint64_t value = 0;
      for (unsigned i = bytes; i > 0; --i) value = value << 8U | static_cast<unsigned char>(text[at + i - 1]);
      return value;
    };
    ASSERT_EQ(number(0, 2), 0x0101U);
    const auto count = number(2, 2);
    ASSERT_EQ(number(8, 8), expected);
    ASSERT_EQ(number(16, 8), (1000 + expected) * 1000);
    ASSERT_EQ(text.size(), 24 + 11 * count);
    ASSERT_EQ(number(28, 4), 0x705U);
    ASSERT_EQ(number(33, 1), expected % 2 == 0 ? 0x81U : 0x01U);
    if (count > 1) {
      ASSERT_EQ(number(24 + 11, 4), 1U);
    }
    expected += count;
    if (expected == 8'000 && !std::exchange(second, true)) frames(12'000);
  }
  const auto rates = client->next("rates");
  EXPECT_EQ(rates["ring"]["next"], 20'000);
  EXPECT_EQ(rates["left_out"], 0);
}

TEST_F(StudioServer, ARemoteFrameTellsTheLengthItAsksForAndHasNoBytes) {
  auto client = page();
  client->send(R"({"type":"live","frames":true})");
  client->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  studio_->frame("field", can::Frame::request(0x701, 2), rt::Time(1ms), true);
  int opcode = 0;
  std::string batch;
  while (opcode != 2) batch = client->message(&opcode);
  ASSERT_EQ(batch.size(), 24U + 10U);
  EXPECT_EQ(static_cast<unsigned char>(batch[24 + 9]), 0x82U);
  client->send(R"({"type":"frames","id":"1","count":1})");
  const auto row = client->next("frames")["rows"][0];
  EXPECT_EQ(row["rtr"], true);
  EXPECT_EQ(row["data"], "");
  EXPECT_EQ(row["dlc"], 2);
}

TEST_F(StudioServer, ErrorsAreRowsAreCountedAndOfMoreThanEnoughOnlyCounted) {
  auto client = page();
  client->send(R"({"type":"live","frames":true})");
  client->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  const auto report = can::error_report(can::ErrorKind::stuff, can::ErrorPlace::data, false, true, 8, 0);
  studio_->error("no such bus", report, rt::Time(1ms), "");
  for (unsigned i = 0; i < Desk::most_errors + 50; ++i)
    studio_->error("field", report, rt::Time(1ms), "drive sent 185#");
  studio_->error("field", report, rt::Time(1001ms), "");
  int opcode = 0;
  std::string batch;
  while (opcode != 2) batch = client->message(&opcode);
  EXPECT_EQ(batch.substr(24 + 4, 4), std::string("\x88\x02\0\x20", 4)) << "bit 29: no frame";
  client->send(R"({"type":"frames","id":"1","count":2000,"filter":"stuff drive"})");
  const auto answer = client->next("frames");
  EXPECT_EQ(answer["matched"], Desk::most_errors);
  EXPECT_EQ(answer["rows"][0]["error"], true);
  auto bus = client->next("rates")["buses"][0];
  while (bus["errors"] != Desk::most_errors + 51) {
    const auto rates = client->next("rates");
    ASSERT_TRUE(rates.is_object());
    bus = rates["buses"][0];
  }
  EXPECT_EQ(bus["bus"], "field");
  EXPECT_EQ(bus["state"], "active");
  EXPECT_EQ(bus["tec"], 0);
  port_->preset_counters(130, 7);
  while (bus["state"] != "passive") {
    const auto rates = client->next("rates");
    ASSERT_TRUE(rates.is_object());
    bus = rates["buses"][0];
  }
  EXPECT_EQ(bus["tec"], 130);
  EXPECT_EQ(bus["rec"], 7);
  EXPECT_EQ(bus["frames_per_s"], 0) << "errors are no frames";
}

TEST_F(StudioServer, ASlowClientIsToldThatItGetsLessAndHoldsNobodyUp) {
  auto slow = page();
  slow->send(R"({"type":"live","frames":true})");
  for (int i = 0; i < 25; ++i) {
    frames(20'000);
    for (int k = 0; k < 20; ++k) session_->tell("field", operate::EventKind::step, std::string(50'000, 'x'));
    for (int k = 0; k < 110; ++k) loop_.turn(1ms);
  }
  auto good = connect();
  const auto begin = std::chrono::steady_clock::now();
  good->say(post(R"({"verb":"report"})"));
  EXPECT_EQ(good->answer().substr(0, 12), "HTTP/1.1 200");
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s);
  // It gets what is left of that, then one snapshot instead of the changes, and the number of frames left out.
  EXPECT_TRUE(slow->next("snapshot").is_object());
  EXPECT_GT(slow->next("rates")["left_out"], 0);
}

TEST_F(StudioServer, TheSeventeenthIsToldAndAnIdleOneMakesRoom) {
  std::vector<std::unique_ptr<Connection>> pages;
  for (int i = 0; i < 15; ++i) pages.push_back(page());
  auto idle = connect();
  idle->say(head("GET /"));
  EXPECT_EQ(idle->answer().substr(0, 12), "HTTP/1.1 200");
  pages.push_back(page());
  EXPECT_TRUE(idle->hung_up());
  EXPECT_EQ(status_of(head("GET /")), "HTTP/1.1 503");
  pages.pop_back();
  pages.front()->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(pages.front()->next("reply")["status"], 0);
}

TEST_F(StudioServer, AServerThatEndsEndsItsClientsAndTheNextOneHasOthers) {
  auto client = page();
  client->send(R"({"type":"request","id":"a","verb":"scan"})");
  const auto token = this->token();
  start();
  EXPECT_TRUE(client->hung_up());
  EXPECT_EQ(status_of(socket(token, "http://" + own())), "HTTP/1.1 401");
  auto again = page();
  EXPECT_EQ(snapshot_["slots"].size(), 1U);
}

TEST_F(StudioServer, OnlyThisComputerAndATakenPortIsSaid) {
  const auto carry = [this](const auto& request, auto& reply) { return this->carry(request, reply); };
  const auto anywhere = Studio::start(loop_, *session_, carry, {.where = {"0.0.0.0", 0}});
  ASSERT_FALSE(anywhere);
  EXPECT_NE(anywhere.error().find("TLS"), std::string::npos) << anywhere.error();
  const auto taken = Studio::start(loop_, *session_, carry, {.where = studio_->where(), .named = true});
  ASSERT_FALSE(taken);
  EXPECT_NE(taken.error().find("in use"), std::string::npos) << taken.error();
  const auto next = Studio::start(loop_, *session_, carry, {.where = studio_->where(), .frames = 16});
  ASSERT_TRUE(next) << next.error();
  EXPECT_GT((*next)->where().port, studio_->where().port);
}

// What a page changed, was refused and broke off, and that it unlocked the machine.
TEST_F(StudioServer, WhatAPageChangesIsInTheAuditLog) {
  auto client = page();
  client->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  client->send(R"({"type":"request","id":"b","verb":"nmt","arguments":{"command":"start\tx"}})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  session_->set_careful(true);
  client->send(R"({"type":"request","id":"c","verb":"nmt"})");
  EXPECT_EQ(client->next("reply")["status"], 1);
  client->send(R"({"type":"unlock","minutes":10})");
  client->send(R"({"type":"request","id":"d","verb":"boot"})");
  EXPECT_EQ(client->next("reply")["status"], 0);
  client->send(R"({"type":"lock"})");
  EXPECT_TRUE(client->until([&] { return store_.history({})->size() >= 8; }));
  std::vector<std::string> lines;
  const auto history = store_.history({});
  for (const auto& line : *history) {
    if (line.event != command::audit_event) continue;
    EXPECT_EQ(line.on.machine, "bench");
    EXPECT_EQ(line.reason.find(token()), std::string::npos);
    EXPECT_TRUE(line.reason.starts_with("studio, client ")) << line.reason;
    lines.push_back(line.reason.substr(line.reason.find('\t') + 1));
  }
  ASSERT_EQ(lines.size(), 7U);
  EXPECT_EQ(lines[0], "nmt command=start x\tbegun");
  EXPECT_EQ(lines[1], "nmt command=start x\tdone");
  EXPECT_TRUE(lines[2].starts_with("nmt\trefused: ")) << lines[2];
  EXPECT_TRUE(lines[3].starts_with("unlock\t")) << lines[3];
  EXPECT_EQ(lines[5], "boot\tdone");
  EXPECT_TRUE(lines[6].starts_with("lock\t")) << lines[6];
}

TEST_F(StudioServer, AWorldThatStandsIsTold) {
  auto client = page();
  EXPECT_EQ(snapshot_["world"]["paused"], false);
  EXPECT_EQ(snapshot_["world"]["speed"], 1);
  client->send(R"({"type":"live","frames":true})");
  loop_.pause(true);
  studio_->look();
  auto change = client->next("change");
  while (!change.is_null() && !change.contains("world")) change = client->next("change");
  EXPECT_EQ(change["world"]["paused"], true);
  auto rates = client->next("rates");
  while (rates["world"]["paused"] == false) rates = client->next("rates");
  EXPECT_EQ(rates["world"]["paused"], true);
  client->send(R"({"type":"request","id":"n","verb":"nmt"})");
  EXPECT_EQ(client->next("reply")["status"], 0) << "what needs no time is answered";
  auto second = page();
  EXPECT_EQ(snapshot_["world"]["paused"], true);
  loop_.pause(false);
  loop_.set_speed(4);
  studio_->look();
  change = client->next("change");
  while (!change.is_null() && !change.contains("world")) change = client->next("change");
  EXPECT_EQ(change["world"]["speed"], 4);
}

// ---- docs/api ----

/// The types that `parse_message` names when it is given another.
static std::vector<std::string> taken_types() {
  std::vector<std::string> types;
  std::string words = parse_message(R"({"type":"?"})").error();
  words = words.substr(words.find(" is ") + 4);
  for (std::size_t at = 0; at < words.size();) {
    const auto end = std::min(words.find_first_of(" ,", at), words.size());
    const std::string word = words.substr(at, end - at);
    if (!word.empty() && word != "or") types.push_back(word);
    at = end + 1;
  }
  return types;
}

// Every message that the server sends here is as docs/api says, and each that docs/api has is sent; the same for what
// it takes. The schema's own examples are taken, too.
TEST_F(StudioServer, TheContractIsWhatIsSpoken) {
  std::string heard;
  const auto sent = [&](const Json& message) { heard += Json{{"sent", message}}.dump() + "\n"; };
  auto client = page();
  sent(snapshot_);
  frames(300);
  studio_->error("field", can::error_report(can::ErrorKind::form, can::ErrorPlace::data, true, true, 1, 2),
                 rt::Time(1s), "drive sent 185#");
  session_->tell("field", operate::EventKind::step, "an event");
  client->send(R"({"type":"live","frames":true})");
  client->send(R"({"type":"request","id":"a","verb":"nmt","arguments":{"node":"5","command":"start"}})");
  client->send(R"({"type":"request","id":"b","verb":"no such verb"})");
  client->send(R"({"type":"frames","id":"f","count":20})");
  client->send(R"({"type":"frames","id":"g","count":20,"filter":"705"})");
  client->send("[");
  loop_.pause(true);
  studio_->look();
  std::set<std::string> types;
  for (int i = 0; i < 200 && types.size() < 5; ++i) {
    int opcode = 0;
    const auto text = client->message(&opcode);
    if (opcode != 1) continue;
    const auto message = Json::parse(text);
    types.insert(message["type"].get<std::string>());
    sent(message);
  }
  loop_.pause(false);
  auto poster = connect();
  poster->say(post(R"({"verb":"report"})"));
  const auto answer = poster->answer();
  heard += Json{{"answer", Json::parse(answer.substr(answer.find("\r\n\r\n") + 4))}}.dump() + "\n";
  const std::string log = "(0000000001.000000) can0 705#7F\nno frame\n(0000000002.000000) can0 701#R\n";
  poster->say(head("POST /api/v1/read?name=run.log",
                   bearer() + fmt::format("Origin: http://{}\r\nContent-Length: {}\r\n", own(), log.size())) +
              log);
  const auto opened = poster->answer();
  heard += Json{{"opened", Json::parse(opened.substr(opened.find("\r\n\r\n") + 4))}}.dump() + "\n";
  poster->say(head("GET /api/v1/signals", bearer()));
  const auto signals = poster->answer();
  heard += Json{{"signals", Json::parse(signals.substr(signals.find("\r\n\r\n") + 4))}}.dump() + "\n";
  Json verbs = Json::array();
  for (const auto& verb : command::verbs()) verbs.push_back(verb.name);
  heard += Json{{"verbs", verbs}}.dump() + "\n" + Json{{"taken", taken_types()}}.dump() + "\n";
  const std::string file = fmt::format("{}/studio_{}.heard", ::testing::TempDir(), ::getpid());
  std::ofstream(file) << heard;
  const std::string source = test::source_dir();
  const int status = std::system(  // NOLINT(concurrency-mt-unsafe): nothing else runs here
      fmt::format("python3 '{0}/tests/studio/check_contract.py' '{0}' '{1}'", source, file).c_str());
  std::remove(file.c_str());
  if (WEXITSTATUS(status) == 3 && std::getenv("BERTH_REQUIRE") == nullptr) GTEST_SKIP() << "no validator";
  EXPECT_EQ(WEXITSTATUS(status), 0) << "see what it printed above";
  std::ifstream in(source + "/docs/api/messages.schema.json");
  const Json schema = Json::parse(in);
  for (const auto& type : taken_types()) {
    for (const auto& example : schema.at("$defs").at("to " + type).at("examples")) {
      const auto read = parse_message(example.dump());
      EXPECT_TRUE(read) << example << (read ? "" : read.error());
    }
  }
}

}  // namespace berth::studio
