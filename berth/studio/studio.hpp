/// Berth Studio's server: offers a running machine to web pages in a browser of this computer, or, with TLS, of another
/// one, by HTTP and WebSocket (docs/api.md).
///
///     auto studio = Studio::start(loop, session, carry, {.token_file = path + ".token"});
///     session.on_event([&](const auto& event) { studio->event(event); });
///     print(studio->address(command::Role::configure));   // http://127.0.0.1:8302/#token=...
///
/// It has its own thread, which never accesses the session: requests and news go through bounded queues (link.hpp),
/// frames through a ring (frame_ring.hpp). So no client holds up the executor, regardless of their number and speed.
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

inline constexpr std::uint16_t default_port = 8302;  ///< up to 8311 if it is taken and the user named none

struct Options {
  io::Endpoint where{"127.0.0.1", default_port};
  bool named = false;        ///< a user named `where`: no other port is tried
  std::string token_file{};  ///< the tokens of this start: `TokenFiles`; empty: no files
  std::string
      certificate{};  ///< with `key`, files in PEM: TLS is used, and other computers may connect; empty: neither
  std::string key{};
  std::string tokens_kept{};  ///< file with the tokens to use: `Tokens::keep`; empty: new ones
  bool simulated = false;     ///< for the pages
  std::string fleet{};        ///< GROUP/NAME of the machine at its broker; empty: it does not answer "fleet"
  std::string version{};      ///< Berth's, for the metrics
  bool open_metrics = false;  ///< `GET /metrics` needs no token
  std::size_t frames = FrameRing::standard;
  std::string signals = R"({"buses":[]})";  ///< JSON: the answer to `GET /api/v1/signals`
};

/// Frames of the ring, as lines of a candump log.
struct RingPart {
  std::string text{};
  std::uint64_t next = 0;  ///< the first frame not searched
  std::uint64_t end = 0;   ///< after the newest
};

class Studio {
 public:
  /// All must outlive this; the loop drives the session's executor. Errors as text: an address other than loopback
  /// without a certificate, a port that is taken, a file that cannot be read or written.
  [[nodiscard]] static tl::expected<std::unique_ptr<Studio>, std::string> start(io::Loop& loop, tree::Session& session,
                                                                                Carry carry, const Options& options);
  /// Ends the thread; its clients' connections end.
  ~Studio();
  Studio(const Studio&) = delete;
  Studio& operator=(const Studio&) = delete;

  /// To be opened in a browser; it contains the role's token.
  [[nodiscard]] std::string address(command::Role role) const;
  /// The same without a token: it opens nothing.
  [[nodiscard]] std::string page() const;
  /// Where it listens, and the tokens of this start.
  [[nodiscard]] const io::Endpoint& where() const noexcept;
  [[nodiscard]] const Tokens& tokens() const noexcept;
  /// The executor's thread: an event of the session, a frame of one of its buses.
  void event(const operate::Event& event);
  /// Call between two turns of the loop: reports that the world's time was paused or its speed changed.
  void look();
  void frame(std::string_view bus, const can::Frame& frame, rt::Time at, bool own) noexcept;
  /// A report of an error on a bus (can/bus_error.hpp), and more that is known of it.
  void error(std::string_view bus, const can::Frame& report, rt::Time at, std::string_view about);
  /// The frames that pass `filter` (as in "frames"), out of `count` frames from the number `from` on, or from the
  /// oldest.
  [[nodiscard]] RingPart ring(std::uint64_t from, std::size_t count, const std::string& filter) const;

 private:
  class Impl;
  explicit Studio(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace berth::studio
