// The session's report as JSON: written piece by piece, and the same text as a JSON library makes of it as a whole.
#include "berth/operate/report.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace berth::operate {
namespace {

using Json = nlohmann::ordered_json;

SlotReport slot_number(unsigned n) {
  SlotReport slot;
  slot.bus = "field";
  slot.id = NodeId(static_cast<std::uint8_t>(1 + n % 127));
  slot.name = "slot " + std::to_string(n);
  slot.type = {1, n};
  if (n % 3 != 0) slot.device = LssAddress{1, n, 2, 0x1234'5678};
  if (n % 4 == 0) slot.reason = "failed:\n\t\"quoted\"";
  return slot;
}

Event event_number(unsigned n) {
  Event event;
  event.bus = n % 2 == 0 ? "field" : "f\xC3\xA4ld";
  event.text = "event " + std::to_string(n) + "\x01\xFF[1, 2]\n{";
  if (n % 3 == 0) event.slots = {"a", "b"};
  return event;
}

Report report_of(unsigned slots, unsigned events, unsigned questions) {
  Report report;
  for (unsigned n = 0; n < slots; ++n) report.slots.push_back(slot_number(n));
  for (unsigned n = 0; n < events; ++n) report.events.push_back(event_number(n));
  for (unsigned n = 0; n < questions; ++n) report.questions.push_back(event_number(n));
  if (slots > 0) report.bus_time_s = {{"field", 1.25}};
  return report;
}

std::vector<std::string> pieces_of(const Report& report, int indent) {
  std::vector<std::string> pieces;
  write_json(report, indent, [&](std::string_view piece) { pieces.emplace_back(piece); });
  return pieces;
}

std::string joined(const std::vector<std::string>& pieces) {
  std::string text;
  for (const auto& piece : pieces) text += piece;
  return text;
}

TEST(ReportJson, IsTheTextThatTheLibraryMakesOfIt) {
  for (const auto& report : {report_of(0, 0, 0), report_of(1, 1, 1), report_of(5, 17, 2)}) {
    for (const int indent : {-1, 2, 4}) {
      const auto text = joined(pieces_of(report, indent));
      EXPECT_EQ(text, Json::parse(text).dump(indent));
      EXPECT_EQ(text, to_json(report, indent));
    }
  }
}

TEST(ReportJson, HasEverySlotEventAndQuestionInOrder) {
  const auto json = Json::parse(joined(pieces_of(report_of(7, 9, 2), 2)));
  ASSERT_EQ(json.size(), 4U);
  ASSERT_EQ(json["slots"].size(), 7U);
  EXPECT_EQ(json["slots"][4]["name"], "slot 4");
  EXPECT_EQ(json["slots"][4]["r_sn"], "0x0000000212345678");
  EXPECT_EQ(json["slots"][4]["reason"], "failed:\n\t\"quoted\"");
  EXPECT_TRUE(json["slots"][3]["r_sn"].is_null());
  EXPECT_EQ(json["bus_time_s"]["field"], 1.25);
  ASSERT_EQ(json["events"].size(), 9U);
  EXPECT_EQ(json["events"][8]["bus"], "field");
  EXPECT_EQ(json["events"][3]["slots"], Json({"a", "b"}));
  ASSERT_EQ(json["questions"].size(), 2U);
}

// 12,000 devices' text is some 40 MB; no piece of it is.
TEST(ReportJson, ComesInPiecesOfOneSize) {
  const auto pieces = pieces_of(report_of(3'000, 3'000, 0), 2);
  EXPECT_GT(pieces.size(), 5U);
  for (const auto& piece : pieces) EXPECT_LT(piece.size(), 70'000U);
}

}  // namespace
}  // namespace berth::operate
