/// The socketcand protocol (github.com/linux-can/socketcand, doc/protocol.md and the server's source): elements `< word
/// word ... >` over TCP, in both directions. Only the encoding; the connections are in socketcand_port.hpp and
/// serve/socketcand_server.hpp.
///
///     client to server                               server to client
///                                                    < hi >                              at once
///     < open can0 >                                  < ok >     now in BCM mode
///     < rawmode >  < bcmmode >  < controlmode >      < ok >
///     < send 7E5 8 4 1 0 0 0 0 0 0 >                 nothing
///     < echo >                                       < echo >
///     < subscribe 0 0 123 >  < filter .. >  ..       < frame 123 1700000000.000123 0401 >
///     < statistics 1000 >                            < stat rbytes rpackets tbytes tpackets >
///                                                    < error .. >
///
/// An identifier of eight digits is an extended one. The protocol has neither remote nor FD frames. Identifiers and
/// data are hexadecimal, lengths decimal; data of `send` are numbers with blanks between, data of `frame` are pairs of
/// digits, in BCM mode with blanks between and after.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "berth/can/frame.hpp"
#include "berth/rt/executor.hpp"

namespace berth::io {

inline constexpr std::uint16_t socketcand_port = 29536;
/// Longest element, brackets included: the size of socketcand's own buffer.
inline constexpr std::size_t longest_element = 8290;

/// Splits a stream of bytes into elements, wherever TCP cut it. Blanks and line ends between elements are ignored;
/// other bytes there, and an element that is too long, are faults: skipped and counted, with the place of the last.
class ElementReader {
 public:
  void add(std::string_view bytes) { buffer_.append(bytes); }
  /// The text between the brackets, without blanks at its ends; valid until the next call of `add` or `next`. Empty
  /// optional: no complete element yet.
  [[nodiscard]] std::optional<std::string_view> next();
  [[nodiscard]] std::uint64_t faults() const noexcept { return faults_; }
  /// Offset of the last fault in bytes since the beginning.
  [[nodiscard]] std::uint64_t fault_at() const noexcept { return fault_at_; }
  /// Bytes kept; never more than the last added ones and one element.
  [[nodiscard]] std::size_t kept() const noexcept { return buffer_.size() - head_; }

 private:
  void fault(std::size_t at) noexcept;
  void skip_to_bracket() noexcept;
  std::string buffer_;
  std::size_t head_ = 0;      // start of the unread part of buffer_
  std::uint64_t before_ = 0;  // bytes before buffer_
  std::uint64_t faults_ = 0;
  std::uint64_t fault_at_ = 0;
  bool in_fault_ = false;  // the bytes before were wrong too: one fault, not many
};

/// A client's request.
struct SocketcandCommand {
  enum class Kind : std::uint8_t {
    open,  ///< `bus`
    echo,
    raw_mode,
    bcm_mode,
    control_mode,
    send,       ///< `frame`
    add,        ///< `frame` at once and then every `interval`; 0: only once
    update,     ///< new data for the job of this identifier
    remove,     ///< ends the job of this identifier (`delete`)
    filter,     ///< frames of this identifier when bits of the mask in `frame` changed, at most every `interval`
    subscribe,  ///< frames of this identifier, at most every `interval`
    unsubscribe,
    statistics,  ///< every `interval`; 0: stop
    configure,   ///< `< can0 B .. >`, `< can0 C .. >`: bit timing and mode of an interface
    malformed,   ///< one of these, with invalid words
    unknown,
  };
  Kind kind = Kind::unknown;
  std::string bus{};
  can::Frame frame{};
  rt::Duration interval{0};
};
/// Parses the text between the brackets. A bus name may have blanks.
[[nodiscard]] SocketcandCommand parse_command(std::string_view element);

/// A server's message.
struct SocketcandNotice {
  enum class Kind : std::uint8_t { hi, ok, echo, frame, error, stat, malformed, unknown };
  Kind kind = Kind::unknown;
  can::Frame frame{};
  std::chrono::microseconds at{0};  ///< frame: the server's time
  std::string text{};               ///< error: its text
};
[[nodiscard]] SocketcandNotice parse_notice(std::string_view element);

/// True if the protocol can express this frame: neither remote nor FD, at most 8 bytes.
[[nodiscard]] constexpr bool socketcand_can_say(const can::Frame& frame) noexcept {
  return !frame.remote && !frame.fd && frame.size <= 8;
}
void append_send(std::string& out, const can::Frame& frame);
/// `spaced`: as in BCM mode. A negative time is written as 0.
void append_frame(std::string& out, const can::Frame& frame, std::chrono::microseconds at, bool spaced);

}  // namespace berth::io
