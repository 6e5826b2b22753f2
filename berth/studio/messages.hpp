/// Parses the messages of a page: the JSON objects of docs/api.md. Pure. For any bytes the result is a message or a
/// reason as text.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/command/request.hpp"

namespace berth::studio {

inline constexpr std::size_t longest_message = 64 * 1024;  ///< bytes, of a WebSocket message and of a body
inline constexpr std::size_t longest_id = 64;              ///< bytes
inline constexpr unsigned most_rows = 2000;                ///< of one answer to "frames"
inline constexpr std::size_t longest_filter = 200;         ///< bytes
inline constexpr unsigned most_minutes = 480;              ///< of one "unlock"

enum class MessageKind : std::uint8_t { request, frames, live, unlock, lock };

struct Message {
  MessageKind kind = MessageKind::lock;
  std::string id{};                     ///< request, frames: returned with the answer
  command::Request request{};           ///< request
  std::optional<std::uint64_t> from{};  ///< frames: the first number; empty: the newest
  unsigned count = 0;                   ///< frames: rows, 1 to `most_rows`
  std::string filter{};                 ///< frames
  bool on = false;                      ///< live
  unsigned minutes = 0;                 ///< unlock: 1 to `most_minutes`
};

/// One message of the WebSocket.
[[nodiscard]] tl::expected<Message, std::string> parse_message(std::string_view text);

/// The body of `POST /api/v1/request`: {"verb", "arguments"}.
[[nodiscard]] tl::expected<command::Request, std::string> parse_body(std::string_view text);

}  // namespace berth::studio
