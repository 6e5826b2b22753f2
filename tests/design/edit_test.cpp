#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <string>

#include "berth/design/edit.hpp"

#include "berth/base/random.hpp"
#include "berth/design/machine.hpp"
#include "tests/pch.hpp"

namespace berth::design {
namespace {

const std::string text =
    "# the conveyor\n"
    "[machine]\n"
    "name = \"m\"   # its name\n"
    "\n"
    "[bus.b]\n"
    "port = \"sim\"\n"
    "bitrate = 125_000  # as delivered\n"
    "\n"
    "[[slot]]           # at the door\n"
    "  bus  = \"b\"\n"
    "  id   = 2\n"
    "  name = \"left\"\n"
    "  type = { vendor = 0x0000_0001, product = 1 } # B\n"
    "  # nothing more\n"
    "\n"
    "[[slot]]\n"
    "bus = \"b\"\n"
    "ids = \"10..12\"\n"
    "name = \"pump {id}\"\n"
    "type.vendor = 1\n"
    "type.product = 5\n"
    "\n"
    "# links follow\n"
    "[[link]]\n"
    "from = \"left/x\"\n"
    "to = [\"pump 10/y\"]\n";

Errc code_of(const Result<std::string>& result) { return result ? Errc{} : result.error().code; }

std::string replaced(std::string in, const std::string& what, const std::string& with) {
  const auto at = in.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return in.replace(at, what.size(), with);
}

TEST(Edit, SetsAValueAndNothingElse) {
  EXPECT_EQ(set_slot_key(text, "left", "id", std::int64_t{7}), replaced(text, "id   = 2", "id   = 7"));
  EXPECT_EQ(set_slot_key(text, "left", "name", std::string("a \"b\"")),
            replaced(text, "name = \"left\"", "name = \"a \\\"b\\\"\""));
  EXPECT_EQ(set_slot_key(text, "left", "type", TypeCode{0xABCD, 2}),
            replaced(text, "{ vendor = 0x0000_0001, product = 1 }", "{ vendor = 0x0000ABCD, product = 0x00000002 }"));
}

TEST(Edit, AddsAKeyBehindTheLastWithItsIndent) {
  EXPECT_EQ(set_slot_key(text, "left", "optional", true), replaced(text, "} # B\n", "} # B\n  optional = true\n"));
}

TEST(Edit, TheDottedKeysOfASlotStayTogether) {
  EXPECT_EQ(set_slot_key(text, "pump {id}", "replacement", std::string("auto")),
            replaced(text, "name = \"pump {id}\"\n", "name = \"pump {id}\"\nreplacement = \"auto\"\n"));
}

TEST(Edit, RemovesAKeyWithItsLineButNotItsComment) {
  EXPECT_EQ(remove_slot_key(text, "left", "id"), replaced(text, "  id   = 2\n", ""));
  EXPECT_EQ(remove_slot_key(text, "left", "type"),
            replaced(text, "  type = { vendor = 0x0000_0001, product = 1 } # B\n", "   # B\n"));
  EXPECT_EQ(code_of(remove_slot_key(text, "left", "optional")), Errc::not_found);
}

TEST(Edit, AddsASlotBehindTheLastOne) {
  const NewSlot slot{"b", NodeId(20), "new", {1, 2}, {{"optional", true}}};
  EXPECT_EQ(add_slot(text, slot), replaced(text, "type.product = 5\n",
                                           "type.product = 5\n\n[[slot]]\nbus = \"b\"\nid = 20\nname = \"new\"\n"
                                           "type = { vendor = 0x00000001, product = 0x00000002 }\noptional = true\n"));
  const auto result = read_machine(*add_slot(text, slot), "m.toml", {});
  ASSERT_TRUE(result.machine) << to_string(result.findings.at(0));
  EXPECT_EQ(result.machine->slots.back().spec.name.name, "new");
}

TEST(Edit, AddsTheFirstSlotToAFileWithoutALastLineEnd) {
  const std::string bare = "[machine]\r\nname = \"m\" # x";
  const auto edited = add_slot(bare, {"b", NodeId(1), "s", {1, 2}, {}});
  EXPECT_EQ(edited, bare +
                        "\r\n\r\n[[slot]]\r\nbus = \"b\"\r\nid = 1\r\nname = \"s\"\r\n"
                        "type = { vendor = 0x00000001, product = 0x00000002 }\r\n");
}

TEST(Edit, RefusesWhatItCannotDo) {
  EXPECT_EQ(code_of(set_slot_key(text, "nobody", "id", std::int64_t{7})), Errc::not_found);
  EXPECT_EQ(code_of(set_slot_key(text, "pump 11", "optional", true)), Errc::unsupported);
  EXPECT_EQ(code_of(set_slot_key(text, "left", "a b", true)), Errc::invalid);
  EXPECT_EQ(code_of(set_slot_key("a = = 1", "left", "id", true)), Errc::invalid);
  EXPECT_EQ(code_of(set_slot_key(text, "left", "name", std::string("\xFF"))), Errc::invalid);
  EXPECT_EQ(code_of(set_slot_key(text, "pump {id}", "type", TypeCode{1, 2})), Errc::unsupported);
  EXPECT_EQ(code_of(add_slot(text, {"b", NodeId(20), "left", {}, {}})), Errc::duplicate);
  EXPECT_EQ(code_of(add_slot(text, {"b", NodeId(20), "pump 11", {}, {}})), Errc::duplicate);
  EXPECT_EQ(code_of(add_slot(text, {"b", NodeId(11), "x", {}, {}})), Errc::duplicate);
  EXPECT_EQ(code_of(add_slot(text, {"b", NodeId(20), "x", {}, {{"bus", true}}})), Errc::invalid);
  EXPECT_EQ(code_of(add_slot("slot = []\n", {"b", NodeId(20), "x", {}, {}})), Errc::unsupported);
}

TEST(Edit, SlotsInOneLine) {
  const std::string line = "slot = [ { name = \"a\", id = 1 }, { name = \"b\" } ] # both\n";
  EXPECT_EQ(set_slot_key(line, "b", "id", std::int64_t{2}),
            "slot = [ { name = \"a\", id = 1 }, { name = \"b\", id = 2 } ] # both\n");
  EXPECT_EQ(set_slot_key(line, "a", "id", std::int64_t{2}),
            "slot = [ { name = \"a\", id = 2 }, { name = \"b\" } ] # both\n");
}

/// A machine file with whatever people put between the lines.
std::string random_file(Random& random, int slots) {
  const std::array<const char*, 6> noise{"",       "# a comment = \"no key\"\n",        "\n",
                                         "  \t\n", "# \xC3\xA4\xE2\x82\xAC [[slot]]\n", "\n\n"};
  const auto more = [&] { return std::string(noise.at(random.below(noise.size()))); };
  std::string out =
      (random.chance(200'000) ? "\xEF\xBB\xBF" : "") + more() + "[machine]\nname = \"\xC3\xA4\" # n\n" + more();
  for (int i = 0; i < slots; ++i) {
    const std::string indent(random.below(3), ' ');
    out += more() + "[[slot]]" + (random.chance(300'000) ? " # s" : "") + "\n";
    out += indent + "name = \"s" + std::to_string(i) + "\"" + (random.chance(300'000) ? " # \xE2\x82\xAC" : "") + "\n";
    if (random.chance(500'000)) out += more() + indent + "bus='b'\n";
    if (random.chance(500'000)) out += indent + "note = \"\"\"\nmany\n  lines # no comment\n\"\"\"" + "\n";
    if (random.chance(500'000)) out += indent + "list = [ 1,\n # two\n 2 ] # end\n";
    if (random.chance(300'000)) out += more() + "[slot.type]\nvendor = 1 # v\n";
  }
  out += more();
  if (random.chance(300'000) && !out.empty() && out.back() == '\n') out.pop_back();
  if (random.chance(300'000)) {
    std::string crlf;
    for (const char c : out) crlf += c == '\n' ? std::string("\r\n") : std::string(1, c);
    return crlf;
  }
  return out;
}

// Setting a key that is there: the bytes before and behind its value stay. Adding one: taking the new line out again
// gives the old text.
RC_GTEST_PROP(Edit, EverythingElseStaysByteForByte, (std::uint64_t seed)) {
  Random random(seed);
  const int slots = 1 + static_cast<int>(random.below(4));
  std::string now = random_file(random, slots);
  for (int step = 0; step < 6; ++step) {
    const auto slot = "s" + std::to_string(random.below(static_cast<std::uint64_t>(slots)));
    const std::array<const char*, 5> keys{"bus", "note", "list", "fresh", "optional"};
    const std::string key = keys.at(random.below(keys.size()));
    const NewValue value = random.chance(500'000)
                               ? NewValue(std::string("v\n\"\\ ") + std::to_string(random.below(100)))
                               : NewValue(static_cast<std::int64_t>(random.below(1000)));
    const auto edited = set_slot_key(now, slot, key, value);
    RC_ASSERT(edited.has_value());
    std::size_t front = 0;
    while (front < now.size() && front < edited->size() && now[front] == (*edited)[front]) ++front;
    std::size_t back = 0;
    while (back < now.size() - front && back < edited->size() - front &&
           now[now.size() - 1 - back] == (*edited)[edited->size() - 1 - back]) {
      ++back;
    }
    // What was taken out is at most the old value: it holds no key, no header, no comment of another line.
    const std::string gone = now.substr(front, now.size() - front - back);
    RC_ASSERT(gone.find("name =") == std::string::npos && gone.find("[[slot]]") == std::string::npos);
    RC_ASSERT(gone.find("# end") == std::string::npos && gone.find("# s") == std::string::npos);
    // Setting the same again changes nothing more.
    RC_ASSERT(*set_slot_key(*edited, slot, key, value) == *edited);
    now = *edited;
  }
  const auto added = add_slot(now, {"b", NodeId(9), "one more", {1, 2}, {}});
  RC_ASSERT(added.has_value());
  const auto at = added->find("[[slot]]", added->find("one more") - 40);
  RC_ASSERT(at != std::string::npos);
  RC_ASSERT(added->size() > now.size());
  // Without the inserted block the text is the old one (a line end may have been completed).
  std::size_t front = 0;
  while (front < now.size() && now[front] == (*added)[front]) ++front;
  const auto tail = now.substr(front);
  RC_ASSERT(added->ends_with(tail));
}

RC_GTEST_PROP(Edit, RemovingWhatWasAddedGivesTheOldText, (std::uint64_t seed)) {
  Random random(seed);
  std::string before = random_file(random, 3);
  if (before.back() != '\n') before += before.find("\r\n") != std::string::npos ? "\r\n" : "\n";
  const auto slot = "s" + std::to_string(random.below(3));
  const auto with = set_slot_key(before, slot, "fresh", std::int64_t{1});
  RC_ASSERT(with.has_value());
  RC_ASSERT(*remove_slot_key(*with, slot, "fresh") == before);
}

}  // namespace
}  // namespace berth::design
