// Changing a file and leaving the rest of it as it is.
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "../paths.hpp"
#include "berth/base/random.hpp"
#include "berth/eds/write.hpp"
#include "support.hpp"

namespace {

using namespace berth;
using namespace berth::eds;
using namespace berth::eds::test;

Document parse(std::string text) {
  Report report("f", 10);
  return Document::parse(std::move(text), report);
}

/// One change of a text.
std::string changed(const std::string& text, std::string_view section, std::string_view key, std::string_view value) {
  const Document document = parse(text);
  Editor editor(document);
  EXPECT_TRUE(editor.set(section, key, value)) << value;
  return editor.text();
}

TEST(EdsEditor, HU_17_OnlyTheValueChanges) {
  const std::string text = "; head\r\n[ A ]\r\n key = value ; why\r\n;inside\r\nother=1\r\n\r\n[B]\r\nx=2";
  EXPECT_EQ(changed(text, "a", "KEY", "new"),
            "; head\r\n[ A ]\r\n key = new ; why\r\n;inside\r\nother=1\r\n\r\n[B]\r\nx=2");
  EXPECT_EQ(changed(text, "A", "third", "3"),
            "; head\r\n[ A ]\r\n key = value ; why\r\n;inside\r\nother=1\r\nthird=3\r\n\r\n[B]\r\nx=2");
  EXPECT_EQ(changed(text, "B", "y", "3"), text + "\r\ny=3\r\n") << "the last line had no end";
  EXPECT_EQ(changed(text, "C", "z", "4"), text + "\r\n\r\n[C]\r\nz=4\r\n");
  EXPECT_EQ(changed(text, "A", "key", "value"), text) << "nothing to change";
}

TEST(EdsEditor, E1_1_LineEndsOfEveryKind) {
  EXPECT_EQ(changed("[A]\rk=1\r[B]\rx=1\r", "A", "n", "2"), "[A]\rk=1\rn=2\r[B]\rx=1\r");
  EXPECT_EQ(changed("[A]\nk=1\n", "B", "n", "2"), "[A]\nk=1\n\n[B]\nn=2\n");
  EXPECT_EQ(changed("", "B", "n", "2"), "[B]\nn=2\n");
  EXPECT_EQ(changed("\xEF\xBB\xBF[A]\nk=1\n", "A", "k", "2"), "\xEF\xBB\xBF[A]\nk=2\n");
  EXPECT_EQ(changed("\xEF\xBB\xBF", "A", "k", "2"), "\xEF\xBB\xBF[A]\nk=2\n");
  EXPECT_EQ(changed("[A]", "A", "k", "2"), "[A]\nk=2\n");
}

TEST(EdsEditor, E1_1_AnEmptyValueBeforeACommentStaysAValue) {
  const std::string text = changed("[A]\nk=; comment\n", "A", "k", "5");
  const Document document = parse(text);
  EXPECT_EQ(document.value(*document.find(*document.find("A"), "k")), "5");
  EXPECT_NE(text.find("; comment"), std::string::npos);
}

TEST(EdsEditor, RemovesKeysAndSections) {
  const Document document = parse("[A]\nk=1\nl=2\nk=3\n;c\n[B]\nx=1\n; behind\n\n[a]\nk=4\n");
  Editor keys(document);
  keys.remove("A", "K");
  EXPECT_EQ(keys.text(), "[A]\nl=2\n;c\n[B]\nx=1\n; behind\n\n[a]\n") << "everywhere";
  EXPECT_EQ(keys.value("A", "k"), std::nullopt);
  ASSERT_TRUE(keys.set("A", "k", "9"));
  EXPECT_EQ(keys.value("A", "k"), "9");
  EXPECT_EQ(keys.text(), "[A]\nl=2\n;c\n[B]\nx=1\n; behind\n\n[a]\nk=9\n") << "the last section counts";
  Editor sections(document);
  sections.remove_section("b");
  EXPECT_FALSE(sections.has_section("B"));
  EXPECT_EQ(sections.text(), "[A]\nk=1\nl=2\nk=3\n;c\n; behind\n\n[a]\nk=4\n");
  ASSERT_TRUE(sections.set("B", "y", "1"));
  EXPECT_EQ(sections.value("B", "x"), std::nullopt);
  EXPECT_EQ(sections.value("B", "y"), "1");
}

TEST(EdsEditor, NewSectionsStandBehindTheOneThatIsNamed) {
  const Document document = parse("[A]\nk=1\n\n[B]\nx=1\n");
  Editor editor(document);
  ASSERT_TRUE(editor.add_section("N", "A"));
  ASSERT_TRUE(editor.add_section("M", "N"));
  ASSERT_TRUE(editor.set("M", "a", "1"));
  ASSERT_TRUE(editor.set("N", "b", "2"));
  ASSERT_TRUE(editor.set("N", "B", "3"));
  EXPECT_EQ(editor.text(), "[A]\nk=1\n\n[N]\nb=3\n\n[M]\na=1\n\n[B]\nx=1\n");
}

TEST(EdsEditor, WhatALineCannotCarryIsRefusedAndNothingChanges) {
  const Document document = parse("[A]\nk=1\n");
  Editor editor(document);
  for (const char* value : {"a\nb", "a\rb", " a", "a ", "a ;b", ";b", "\ta"}) {
    EXPECT_EQ(editor.set("A", "k", value).error().code, Errc::invalid) << value;
  }
  for (const char* key : {"", "a=b", "[a", "a]", ";a", "#a", " a", "a\n"})
    EXPECT_FALSE(editor.set("A", key, "1")) << key;
  for (const char* name : {"", "a]", "[a", "a=b", "a\nb"}) EXPECT_FALSE(editor.set(name, "k", "1")) << name;
  EXPECT_FALSE(editor.set("A", "k", "\xFF"));
  EXPECT_EQ(editor.text(), document.text());
  EXPECT_TRUE(editor.set("A", "k", "a;b")) << "inside of a word it is text";
}

// HU.10: the file's own encoding stays.
TEST(EdsEditor, HU_10_TextGoesInAsWindows1252WhereTheFileIs) {
  const Document document = parse("[A]\nk=\xE4\n");
  ASSERT_EQ(document.encoding(), Encoding::windows_1252);
  Editor editor(document);
  ASSERT_TRUE(editor.set("A", "l", "\xC3\xB6 \xE2\x82\xAC"));  // ö €
  EXPECT_EQ(editor.value("A", "l"), "\xC3\xB6 \xE2\x82\xAC");
  EXPECT_EQ(editor.text(), "[A]\nk=\xE4\nl=\xF6 \x80\n");
  EXPECT_FALSE(editor.set("A", "l", "\xE2\x9C\x93")) << "no check mark in Windows-1252";
  // Names of sections and keys are UTF-8 too.
  const Document named = parse("[\xC4]\n\xE4=1\n");
  Editor umlauts(named);
  EXPECT_EQ(umlauts.value("\xC3\x84", "\xC3\xA4"), "1");
  ASSERT_TRUE(umlauts.set("\xC3\x84", "\xC3\xA4", "2"));
  ASSERT_TRUE(umlauts.set("\xC3\x84", "\xC3\xB6", "3"));
  ASSERT_TRUE(umlauts.set("\xC3\x9C", "k", "4"));
  EXPECT_EQ(umlauts.text(), "[\xC4]\n\xE4=2\n\xF6=3\n\n[\xDC]\nk=4\n");
  const Document ascii = parse("[A]\nk=1\n");
  Editor either(ascii);
  ASSERT_TRUE(either.set("A", "k", "\xC3\xB6"));
  EXPECT_FALSE(either.set_raw("A", "l", "\xF6")) << "one file, one encoding";
}

std::vector<std::string> some_texts() {
  namespace fs = std::filesystem;
  std::vector<std::string> texts{"[A]\nk=1\nl=2\n\n;c\n[B]\r\nx=1 ;d\r\ny=\r\n\r\n[C]", "", "[A]\r[B]\rk=1\r\r"};
  for (const fs::path& folder : {fs::path(berth::test::source_dir()) / "examples" / "eds", eds_folder()}) {
    if (!fs::is_directory(folder)) continue;
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.path().extension() != ".eds" && entry.path().extension() != ".dcf") continue;
      std::ifstream in(entry.path(), std::ios::binary);
      texts.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
    }
  }
  return texts;
}

/// Reading a file and writing it with no change, or with a change taken back, gives the same bytes.
TEST(EdsEditor, HU_17_NoChangeIsNoChange) {
  for (const auto& text : some_texts()) {
    const Document document = parse(text);
    const Editor editor(document);
    EXPECT_EQ(editor.text(), text);
    Editor back(document);
    for (const Section& section : document.sections()) {
      for (const Entry& entry : document.entries(section)) {
        const auto name = document.name(section);
        const auto key = document.key(entry);
        const auto value = back.value(name, key);
        if (!value || name.empty() || !back.set(name, key, "changed")) continue;
        ASSERT_TRUE(back.set(name, key, *value));
      }
    }
    EXPECT_EQ(back.text(), text);
  }
}

/// Any edit leaves all other bytes: with the one value cut out of both texts they are the same, and every other entry
/// says what it said.
RC_GTEST_PROP(EdsEditor, HU_17_AnyEditLeavesTheOtherBytes, (std::uint64_t seed)) {
  static const std::vector<std::string> texts = some_texts();
  Random random(seed);
  const std::string& text = texts[random.below(texts.size())];
  const Document document = parse(text);
  if (document.entries().empty()) return;
  const auto sections = document.sections();
  const Section& section = sections[random.below(sections.size())];
  if (section.count == 0) return;
  const auto name = document.name(section);
  const std::size_t which = random.below(section.count);
  const Entry& entry = document.entries(section)[which];
  // The entry that counts: the last of its key in the last section of its name.
  if (document.find(name) != &section || document.find(section, document.key(entry)) != &entry) return;
  const std::string value = random.chance(200'000) ? "" : "v" + std::to_string(random.next());
  Editor editor(document);
  RC_ASSERT(editor.set(name, document.key(entry), value).has_value());
  const std::string after = editor.text();
  const std::string head = text.substr(0, entry.value_at);
  const std::string tail = text.substr(entry.value_at + entry.value_length);
  RC_ASSERT(after.substr(0, head.size()) == head);
  RC_ASSERT(after.substr(after.size() - tail.size()) == tail);
  const Document now = parse(after);
  RC_ASSERT(now.entries().size() == document.entries().size());
  for (std::size_t i = 0; i < now.entries().size(); ++i) {
    const bool same = i == section.first + which;
    RC_ASSERT(now.value(now.entries()[i]) == (same ? std::string_view(value) : document.value(document.entries()[i])));
    RC_ASSERT(now.key(now.entries()[i]) == document.key(document.entries()[i]));
  }
}

/// Any sequence of edits on any text: what the editor says is what a reader of its text finds.
RC_GTEST_PROP(EdsEditor, HU_17_AnyEditsAreReadBack, (std::uint64_t seed)) {
  Random random(seed);
  std::string text;
  const std::vector<std::string> pieces{
      "[A]", "[b]", "[ C ]", "k=1", "l = 2 ;x", "m=", "k=3", ";c", "", "\xE4=1", "[a]", "n=; y"};
  const std::vector<std::string> ends{"\n", "\r\n", "\r"};
  const std::string end = ends[random.below(ends.size())];
  for (auto n = random.below(12); n != 0; --n) {
    text += pieces[random.below(pieces.size())];
    if (n != 1 || random.chance(500'000)) text += end;
  }
  const Document document = parse(text);
  Editor editor(document);
  const std::vector<std::string> names{"A", "B", "c", "D"};
  const std::vector<std::string> keys{"K", "l", "m", "n", "o"};
  for (auto n = random.below(10); n != 0; --n) {
    const auto& name = names[random.below(names.size())];
    const auto& key = keys[random.below(keys.size())];
    switch (random.below(5)) {
      case 0: editor.remove(name, key); break;
      case 1: editor.remove_section(name); break;
      case 2: RC_ASSERT(editor.add_section(name, names[random.below(names.size())]).has_value()); break;
      default:
        RC_ASSERT(editor.set(name, key, random.chance(100'000) ? "" : std::to_string(random.below(100))).has_value());
    }
  }
  const Document after = parse(editor.text());
  for (const auto& name : names) {
    const Section* const section = after.find(name);
    RC_ASSERT((section != nullptr) == editor.has_section(name));
    for (const auto& key : keys) {
      const Entry* const entry = section == nullptr ? nullptr : after.find(*section, key);
      RC_ASSERT((entry != nullptr) == editor.value(name, key).has_value());
      if (entry != nullptr) RC_ASSERT(after.utf8(after.value(*entry)) == *editor.value(name, key));
    }
  }
}

}  // namespace
