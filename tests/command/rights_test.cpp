// Who may have which verb carried out: every verb by every face, beside what docs/security.md says.
#include "berth/command/rights.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <set>
#include <sstream>
#include <string>

#include "../paths.hpp"
#include "../pch.hpp"
#include "berth/command/verbs.hpp"

namespace berth::command {
namespace {

// The verbs in backquotes on the page between these words.
std::set<std::string> verbs_of_the_page(const std::string& after, const std::string& before) {
  std::ifstream file(test::source_dir() + "/docs/security.md");
  std::ostringstream all;
  all << file.rdbuf();
  const std::string page = all.str();
  const auto begin = page.find(after);
  const auto end = page.find(before, begin);
  if (begin == std::string::npos || end == std::string::npos) return {};
  std::set<std::string> verbs;
  const std::string list = page.substr(begin, end - begin);
  for (std::size_t at = list.find('`'); at != std::string::npos;) {
    const auto close = list.find('`', at + 1);
    verbs.insert(list.substr(at + 1, close - at - 1));
    at = list.find('`', close + 1);
  }
  return verbs;
}

bool may(Face face, const std::string& verb, const Granted& granted = {}, const std::string& argument = {}) {
  Request request{verb, {}};
  if (!argument.empty()) request.arguments[argument] = "1";
  return why_refused(face, request, granted).empty();
}

}  // namespace

// A doctor that listens only asks.
TEST(Rights, WhatAnArgumentMakesOfAVerbCounts) {
  EXPECT_TRUE(may(Face::studio, "doctor"));
  EXPECT_TRUE(may(Face::gateway, "doctor", {}, "for"));
  for (const char* const argument : {"active", "intrusive", "conformance"}) {
    SCOPED_TRACE(argument);
    EXPECT_FALSE(may(Face::studio, "doctor", {}, argument));
    EXPECT_FALSE(may(Face::gateway, "doctor", {}, argument));
    EXPECT_TRUE(may(Face::studio, "doctor", {.changes = true}, argument));
    EXPECT_FALSE(may(Face::studio, "doctor", {.changes = true, .role = Role::view}, argument));
    EXPECT_TRUE(may(Face::studio, "doctor", {.changes = true, .role = Role::operate}, argument));
    EXPECT_TRUE(may(Face::person, "doctor", {}, argument));
  }
}

TEST(Rights, EveryVerbByEveryFace) {
  const auto asking = verbs_of_the_page("Verbs that only read and ask:", ". All others");
  ASSERT_EQ(asking.size(), 17U);
  for (const auto& each : verbs()) {
    const std::string verb(each.name);
    SCOPED_TRACE(verb);
    const bool asks = asking.contains(verb);
    EXPECT_EQ(each.effect() == Effect::asks, asks) << "docs/security.md has it otherwise";
    EXPECT_TRUE(may(Face::person, verb));
    EXPECT_TRUE(may(Face::program, verb));
    EXPECT_EQ(may(Face::gateway, verb), asks);
    EXPECT_TRUE(may(Face::gateway, verb, {.changes = true}));
    EXPECT_EQ(may(Face::studio, verb), asks);
    EXPECT_TRUE(may(Face::studio, verb, {.changes = true}));
    EXPECT_FALSE(may(Face::node, verb));
    const design::BusCommands none;
    EXPECT_FALSE(may(Face::node, verb, {.listed = &none, .changes = true}));
    const design::BusCommands listed{{verb}};
    EXPECT_TRUE(may(Face::node, verb, {.listed = &listed}));
    const design::BusCommands another{{verb == "report" ? "scan" : "report"}};
    EXPECT_FALSE(may(Face::node, verb, {.listed = &another}));
    EXPECT_FALSE(may(Face::mqtt, verb));
    EXPECT_FALSE(may(Face::mqtt, verb, {.listed = &none, .changes = true}));
    EXPECT_TRUE(may(Face::mqtt, verb, {.listed = &listed}));
    EXPECT_FALSE(may(Face::mqtt, verb, {.listed = &another}));
  }
}

// A page's role, and no other face's.
TEST(Rights, EveryVerbByEveryRole) {
  const auto asking = verbs_of_the_page("Verbs that only read and ask:", ". All others");
  const auto operating = verbs_of_the_page("Verbs of role operate:", ". All others");
  ASSERT_EQ(operating.size(), 12U);
  for (const auto& each : verbs()) {
    const std::string verb(each.name);
    SCOPED_TRACE(verb);
    const auto as = [&](Face face, Role role) { return may(face, verb, {.changes = true, .role = role}); };
    EXPECT_EQ(as(Face::studio, Role::view), asking.contains(verb));
    EXPECT_EQ(as(Face::studio, Role::operate), asking.contains(verb) || operating.contains(verb));
    EXPECT_TRUE(as(Face::studio, Role::configure));
    EXPECT_TRUE(as(Face::person, Role::view));
    EXPECT_TRUE(as(Face::gateway, Role::view));
  }
  EXPECT_EQ(why_refused(Face::studio, {"nmt", {}}, {.changes = true, .role = Role::view})
                .find("\"nmt\" needs the role operate"),
            0U);
  for (const auto role : all_roles) EXPECT_EQ(parse_role(name(role)), role);
  EXPECT_FALSE(parse_role("owner"));
}

// What the process itself carries out (the plant's "sim") is not in the table.
TEST(Rights, AVerbOutsideOfTheTableChangesThePlantAndIsForRoleOperate) {
  const Granted viewer{.changes = true, .role = Role::view};
  EXPECT_FALSE(why_refused(Face::studio, {"sim", {{"action", "unplug"}}}, viewer).empty());
  EXPECT_TRUE(why_refused(Face::studio, {"sim", {{"action", "devices"}}}, viewer).empty());
  EXPECT_TRUE(why_refused(Face::studio, {"sim", {{"action", "unplug"}}}, {.role = Role::operate}).empty());
}

// "yes" is taken by every verb; the others by those that have them.
TEST(Rights, WhatIsAPersonsToSay) {
  std::set<std::string> personal;
  for (const auto& each : verbs()) {
    const std::string verb(each.name);
    SCOPED_TRACE(verb);
    const design::BusCommands listed{{verb}};
    std::set<std::string> names{"yes"};
    for (const auto& parameter : each.parameters) names.insert(std::string(parameter.name));
    for (const auto& name : names) {
      const auto* const parameter = each.parameter(name);
      ASSERT_NE(parameter, nullptr) << name;
      if (parameter->personal) personal.insert(name);
      EXPECT_TRUE(may(Face::person, verb, {}, name)) << name;
      EXPECT_TRUE(may(Face::program, verb, {}, name)) << name;
      EXPECT_EQ(may(Face::node, verb, {.listed = &listed}, name), !parameter->personal) << name;
      EXPECT_EQ(may(Face::mqtt, verb, {.listed = &listed}, name), !parameter->personal) << name;
      EXPECT_EQ(may(Face::gateway, verb, {.changes = true}, name), !parameter->personal) << name;
      EXPECT_EQ(may(Face::studio, verb, {.changes = true}, name), !parameter->personal || name == "yes") << name;
    }
  }
  EXPECT_EQ(personal, (std::set<std::string>{"file", "from-scratch", "yes"}));
}

}  // namespace berth::command
