// Who may what at the server, by roles and places.
#include "../pch.hpp"
#include "server_fixture.hpp"

namespace berth::studio {

// Each token has its role: what it may not is refused with the role that it takes, by the socket and by POST.
TEST_F(StudioServer, ARoleMayWhatItMayAndIsToldWhatItMayNot) {
  const auto status = [this](Connection& client, const std::string& verb, Json* reply = nullptr) {
    client.send(Json{{"type", "request"}, {"id", verb}, {"verb", verb}, {"arguments", Json::object()}}.dump());
    const auto answer = client.next("reply");
    if (reply != nullptr) *reply = answer;
    return answer["status"].get<int>();
  };
  auto viewer = page(0, command::Role::view);
  EXPECT_EQ(snapshot_["role"], "view");
  EXPECT_EQ(snapshot_["token_file"], file_ + ".view");
  Json reply;
  EXPECT_EQ(status(*viewer, "report"), 0);
  EXPECT_EQ(status(*viewer, "nmt", &reply), 1);
  EXPECT_NE(reply["error"].get<std::string>().find("needs the role operate"), std::string::npos) << reply;
  EXPECT_EQ(status(*viewer, "sim"), 1) << "the plant's own verb changes it";
  auto operator_page = page(0, command::Role::operate);
  EXPECT_EQ(snapshot_["role"], "operate");
  EXPECT_EQ(status(*operator_page, "nmt"), 0);
  EXPECT_EQ(status(*operator_page, "sim"), 0);
  EXPECT_EQ(status(*operator_page, "sdo write", &reply), 1);
  EXPECT_NE(reply["error"].get<std::string>().find("needs the role configure"), std::string::npos) << reply;
  EXPECT_EQ(carried_, 3U);
  auto poster = connect();
  const std::string body = R"({"verb":"nmt"})";
  poster->say(head("POST /api/v1/request",
                   fmt::format("Authorization: Bearer {}\r\nOrigin: http://{}\r\nContent-Length: {}\r\n",
                               token(command::Role::view), own(), body.size())) +
              body);
  EXPECT_NE(poster->answer().find("needs the role operate"), std::string::npos);
  EXPECT_EQ(carried_, 3U);
}

TEST_F(StudioServer, OnlyWhoOperatesUnlocksRealBuses) {
  session_->set_careful(true);
  auto viewer = page(0, command::Role::view);
  auto watcher = page(0, command::Role::operate);
  const auto unlocked = [](const Json& change) {
    return change.contains("lock") && change["lock"]["unlocked_until_s"].is_number();
  };
  viewer->send(R"({"type":"unlock","minutes":5})");
  EXPECT_NE(viewer->next("error")["error"].get<std::string>().find("needs the role operate"), std::string::npos);
  watcher->send(R"({"type":"request","id":"a","verb":"nmt"})");
  EXPECT_EQ(watcher->next("reply")["status"], 1) << "still locked";
  watcher->send(R"({"type":"unlock","minutes":5})");
  auto change = watcher->next("change");
  while (change.is_object() && !unlocked(change)) change = watcher->next("change");
  EXPECT_TRUE(unlocked(change));
  viewer->send(R"({"type":"lock"})");
  EXPECT_TRUE(viewer->next("error").is_object());
  watcher->send(R"({"type":"request","id":"b","verb":"nmt"})");
  EXPECT_EQ(watcher->next("reply")["status"], 0) << "still unlocked";
  std::string refusals;
  const auto history = store_.history({});
  for (const auto& line : *history) {
    if (line.reason.find("(view)\tunlock\trefused: ") != std::string::npos) refusals += 'u';
    if (line.reason.find("(view)\tlock\trefused: ") != std::string::npos) refusals += 'l';
  }
  EXPECT_EQ(refusals, "ul");
}

// Half a request keeps nobody out, and who has shown a token keeps the place.
TEST_F(StudioServer, WhoShowsNoTokenMakesRoom) {
  auto first = page();
  std::vector<std::unique_ptr<Connection>> strangers;
  for (int i = 0; i < 15; ++i) {
    strangers.push_back(connect());
    strangers.back()->say("GET / HTTP/1.1\r\n");
  }
  auto second = page();
  EXPECT_TRUE(strangers.front()->hung_up());
  first->send(R"({"type":"request","id":"a","verb":"report"})");
  EXPECT_EQ(first->next("reply")["status"], 0);
  strangers.back()->say("Host: " + own() + "\r\n\r\n");
  EXPECT_EQ(strangers.back()->answer().substr(0, 12), "HTTP/1.1 200") << "the youngest was not the one to go";
}

}  // namespace berth::studio
