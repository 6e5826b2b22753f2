// Any bytes as what a page says: a message or a reason, within its bounds, a filter over a small ring; and as a Host,
// an Origin, a list of subprotocols: only the server's own names and the token are let in.
#include <string>
#include <vector>

#include "berth/studio/doors.hpp"
#include "berth/studio/export.hpp"
#include "berth/studio/messages.hpp"
#include "berth/studio/opened.hpp"
#include "berth/studio/search.hpp"
#include "fuzz/require.hpp"

namespace studio_target {

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace berth;
  const std::string text(reinterpret_cast<const char*>(data), size);
  static const std::vector<std::string> buses{"field"};
  static const studio::FrameRing* const ring = [] {
    auto* const made = new studio::FrameRing(16);
    for (std::uint8_t i = 0; i < 20; ++i) made->put(0, can::Frame::base(0x700U + i, {i}), rt::Time(), false);
    return made;
  }();
  const auto read = studio::parse_message(text);
  if (!read) fuzz::require(!read.error().empty());
  if (read && read->kind == studio::MessageKind::request)
    fuzz::require(!read->request.verb.empty() && !read->id.empty());
  studio::Message wanted{.kind = studio::MessageKind::frames, .id = "1", .count = 5, .filter = text};
  if (read && read->kind == studio::MessageKind::frames) wanted = *read;
  studio::Search search(*ring, buses, wanted);
  while (!search.step(7)) {
  }
  fuzz::require(!search.answer().empty());
  static_cast<void>(studio::parse_body(text));
  if (const auto query = studio::parse_trace_query(text)) {
    studio::Export file(*ring, buses, *query);
    std::string out;
    while (!file.step(7, out)) {
    }
    fuzz::require(query->filter.size() <= studio::longest_filter);
  }
  if (const auto name = studio::parse_name_query(text)) fuzz::require(name->find('/') == std::string::npos);
  studio::Opened opened("run.log", text);
  while (!opened.step()) {
  }
  if (const auto answer = opened.answer(); !answer) fuzz::require(answer.error().starts_with("run.log: "));
  const auto name = studio::name_in_host(text, 8302);
  if (!name.empty()) fuzz::require(text.find(name) != std::string::npos && text.ends_with(":8302"));
  if (studio::is_own_host(text, 8302)) fuzz::require(text.ends_with(":8302"));
  const std::string token(64, 'a');
  if (studio::same_token(text, token)) fuzz::require(text == token);
  fuzz::require(studio::token_offered(text).size() <= text.size());
  return 0;
}

}  // namespace studio_target
