// The command line is made of the table of verbs (berth/command/verbs.hpp): each help page is compared with it.
#include <gtest/gtest.h>

#include <sstream>
#include <string>

#include "berth/command/verbs.hpp"
#include "process.hpp"

namespace berth::test {
namespace {

// "report" is `berth status`; what only other verbs ask for is on no command line.
Words words_of(std::string_view verb) {
  if (verb == "report") return {"status"};
  if (verb == "sdo probe") return {};
  Words words;
  std::istringstream in{std::string(verb)};
  for (std::string word; in >> word;) words.push_back(word);
  return words;
}

// In one line, without the help's own breaks.
std::string page_of(Words words) {
  words.emplace_back("--help");
  std::istringstream in(berth(words).out);
  std::string page;
  for (std::string word; in >> word;) page += word + " ";
  return page;
}

std::string spelled(const command::Parameter& parameter) {
  if (parameter.form == command::Form::word) return std::string(parameter.name);
  const std::string name =
      parameter.spelled.empty() ? "--" + std::string(parameter.name) : std::string(parameter.spelled);
  return name.substr(0, name.find(','));
}

}  // namespace

TEST(VerbTable, TheHelpPagesAreOfIt) {
  for (const command::Verb& verb : command::verbs()) {
    const Words words = words_of(verb.name);
    if (words.empty()) continue;
    SCOPED_TRACE(verb.name);
    const std::string page = page_of(words);
    EXPECT_TRUE(page.starts_with(std::string(verb.help) + " Usage: ")) << page;
    for (const auto& parameter : verb.parameters) {
      const bool reads = parameter.form != command::Form::common && parameter.form != command::Form::own;
      if (!reads) continue;
      EXPECT_NE(page.find(spelled(parameter)), std::string::npos) << parameter.name;
      EXPECT_NE(page.find(std::string(parameter.help)), std::string::npos) << parameter.name << " in " << page;
    }
  }
}

}  // namespace berth::test
