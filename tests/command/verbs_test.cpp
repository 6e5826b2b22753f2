// The table of verbs, by itself: what each needs, and that it says what it is.
#include "berth/command/verbs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "../pch.hpp"
#include "berth/command/arguments.hpp"

namespace berth::command {
namespace {

std::string quoted(std::string_view name) { return "\"" + std::string(name) + "\""; }

}  // namespace

TEST(VerbTable, EachRefusesARequestWithoutWhatItNeeds) {
  for (const Verb& verb : verbs()) {
    Request request{std::string(verb.name), {}};
    for (const Parameter& parameter : verb.parameters) {
      if (!parameter.required) continue;
      EXPECT_EQ(Arguments(request).problem(), quoted(verb.name) + " needs " + std::string(parameter.name));
      request.arguments[std::string(parameter.name)] = "1";
    }
    EXPECT_EQ(Arguments(request).problem(), "") << verb.name;
  }
}

TEST(VerbTable, EachRefusesWhatItDoesNotTake) {
  for (const Verb& verb : verbs()) {
    const Request request{std::string(verb.name), {{"nonsense", "1"}}};
    EXPECT_EQ(Arguments(request).problem(), quoted(verb.name) + " has no argument \"nonsense\"");
  }
}

TEST(VerbTable, EverythingSaysWhatItIs) {
  for (const Verb& verb : verbs()) {
    EXPECT_FALSE(verb.help.empty()) << verb.name;
    for (const Parameter& parameter : verb.parameters)
      EXPECT_FALSE(parameter.help.empty()) << verb.name << " " << parameter.name;
  }
}

// Else nobody could leave the first out.
TEST(VerbTable, NoWordThatIsNeededStandsBehindOneThatIsNot) {
  for (const Verb& verb : verbs()) {
    bool optional = false;
    for (const Parameter& parameter : verb.parameters) {
      if (parameter.form != Form::word) continue;
      EXPECT_FALSE(parameter.required && optional) << verb.name << " " << parameter.name;
      optional = optional || !parameter.required;
    }
  }
}

}  // namespace berth::command
