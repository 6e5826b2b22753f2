/// Berth Studio's server: a machine that runs, for pages in a browser of this computer, or by TLS of another, by HTTP
/// and WebSocket (docs/api.md).
///
///     auto studio = Studio::start(loop, session, carry, {.token_file = path + ".token"});
///     session.on_event([&](const auto& event) { studio->event(event); });
///     print(studio->address(command::Role::configure));   // http://127.0.0.1:8302/#token=...
///
/// It has a thread of its own, which never touches the session: requests and news go through bounded queues (link.hpp),
/// frames through a ring (frame_ring.hpp). So no client, however many or slow, holds up the executor.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "berth/command/role.hpp"
#include "berth/io/loop.hpp"
#include "berth/io/stream.hpp"
#include "berth/studio/desk.hpp"
#include "berth/studio/doors.hpp"
#include "berth/studio/frame_ring.hpp"
#include "berth/tree/session.hpp"

namespace berth::studio {

inline constexpr std::uint16_t default_port = 8302;  ///< and up to 8311, when it is taken and no person named one

struct Options {
  io::Endpoint where{"127.0.0.1", default_port};
  bool named = false;        ///< a person named `where`: no other port is taken instead
  std::string token_file{};  ///< the tokens of this start: `TokenFiles`; empty: no files
  std::string
      certificate{};  ///< with `key`, files in PEM: it speaks TLS, and may be reached from elsewhere; empty: not
  std::string key{};
  std::string tokens_kept{};  ///< the tokens are those of this file: `Tokens::keep`; empty: new ones
  bool simulated = false;     ///< for the pages
  std::size_t frames = FrameRing::standard;
  std::string signals = R"({"buses":[]})";  ///< JSON: what `GET /api/v1/signals` answers
};

/// Frames of the ring, as lines of a candump log.
struct RingPart {
  std::string text{};
  std::uint64_t next = 0;  ///< the first frame that was not looked at
  std::uint64_t end = 0;   ///< after the newest
};

class Studio {
 public:
  /// All must stay; the loop drives the session's executor. What is wrong is told in words: an address that is not
  /// loopback without a certificate, a port that is taken, a file that cannot be read or written.
  [[nodiscard]] static tl::expected<std::unique_ptr<Studio>, std::string> start(io::Loop& loop, tree::Session& session,
                                                                                Carry carry, const Options& options);
  /// Ends the thread; its clients' connections end.
  ~Studio();
  Studio(const Studio&) = delete;
  Studio& operator=(const Studio&) = delete;

  /// To be opened in a browser; it has the role's token.
  [[nodiscard]] std::string address(command::Role role) const;
  /// Where it listens, and the tokens of this start.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] const Tokens& tokens() const noexcept;
  /// The executor's thread: an event of the session, a frame of one of its buses.
  void event(const operate::Event& event);
  /// Between two turns of the loop: tells when the world's time was held or set to another speed.
  void look();
  void frame(std::string_view bus, const can::Frame& frame, rt::Time at, bool own) noexcept;
  /// A report of an error on a bus (can/bus_error.hpp), and what is known of it beside.
  void error(std::string_view bus, const can::Frame& report, rt::Time at, std::string_view about);
  /// Those that `filter` (as of "frames") lets through, of `count` frames from the number `from` on, or from the
  /// oldest.
  [[nodiscard]] RingPart ring(std::uint64_t from, std::size_t count, const std::string& filter) const;

 private:
  class Impl;
  explicit Studio(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::studio
