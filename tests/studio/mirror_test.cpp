// The messages that tell the machine as it is, made of what the executor's thread tells.
#include "berth/studio/mirror.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "../pch.hpp"

namespace berth::studio {
namespace {

using Json = nlohmann::json;

TEST(StudioMirror, OpenQuestionsAreInTheSnapshotAndInTheChangeThatChangesThem) {
  design::Machine machine;
  machine.buses.emplace_back().name = "field";
  Mirror mirror(machine, {.simulated = true});
  EXPECT_TRUE(Json::parse(mirror.snapshot(0, command::Role::view))["questions"].empty());
  operate::Event question{{}, "field", operate::EventKind::question, {}, "which one?"};
  question.slots = {"left", "right"};
  question.devices = {"00000001-00000002-00000003-00000004"};
  News news;
  news.questions = {question};
  const auto change = Json::parse(mirror.take(news));
  EXPECT_EQ(change["seq"], 1);
  ASSERT_EQ(change["questions"].size(), 1U);
  EXPECT_EQ(change["questions"][0]["slots"][1], "right");
  news.questions.reset();
  news.events = {operate::Event{{}, "field", operate::EventKind::step, {}, "searching"}};
  EXPECT_FALSE(Json::parse(mirror.take(news)).contains("questions"));
  EXPECT_EQ(Json::parse(mirror.snapshot(0, command::Role::view))["questions"][0]["devices"][0], question.devices[0]);
  news.questions.emplace();
  EXPECT_TRUE(Json::parse(mirror.take(news))["questions"].is_array());
  EXPECT_TRUE(Json::parse(mirror.snapshot(0, command::Role::view))["questions"].empty());
}

// Frames are numbered anew by each start: a page that finds another one lets go of those it had.
TEST(StudioMirror, EachStartIsAnother) {
  design::Machine machine;
  machine.buses.emplace_back().name = "field";
  const Mirror one(machine, {.simulated = true});
  const Mirror other(machine, {.simulated = true});
  const auto start = [](const Mirror& mirror) {
    return Json::parse(mirror.snapshot(0, command::Role::view)).at("start").get<std::string>();
  };
  EXPECT_EQ(start(one), start(one));
  EXPECT_NE(start(one), start(other));
}

TEST(StudioMirror, AVerbTellsHowTheCommandLineSpellsAnArgument) {
  design::Machine machine;
  machine.buses.emplace_back().name = "field";
  const auto verbs = Json::parse(Mirror(machine, {.simulated = true}).snapshot(0, command::Role::view))["verbs"];
  std::string spelled;
  bool for_a_person = false;
  for (const auto& verb : verbs) {
    for (const auto& parameter : verb["parameters"])
      if (verb["name"] == "program download" && parameter["name"] == "file") for_a_person = true;
    if (verb["name"] != "lss set-node-id") continue;
    for (const auto& parameter : verb["parameters"])
      if (parameter["name"] == "store") spelled = parameter.value("spelled", "");
  }
  EXPECT_EQ(spelled, "--save");
  EXPECT_FALSE(for_a_person);
}

}  // namespace
}  // namespace berth::studio
