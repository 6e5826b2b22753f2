/// Errors as values. Every fallible call in Berth returns `Result<T>`; nothing on a frame's path throws.
///
/// `Error` is trivial on purpose: it can be made, copied and dropped without the heap, in a device's interrupt-like
/// code as well as in a tool. Text for users is composed at the border (`describe`), not where the error arises.
#pragma once

#include <cstdint>
#include <string>
#include <tl/expected.hpp>
#include <type_traits>

namespace berth {

/// The kind of error. The set is small: a caller uses it to decide whether to retry, ask or stop.
enum class Errc : std::uint8_t {
  timeout,      ///< no answer within the time allowed
  aborted,      ///< the peer refused; `Error::detail` is the SDO abort code or the LSS error code
  mismatch,     ///< an answer came, but not the expected one
  duplicate,    ///< two of something that may exist only once
  not_found,    ///< no such object, slot, device or file
  invalid,      ///< a value out of range, a call out of order
  exhausted,    ///< a queue or table of fixed size is full
  bus,          ///< the port cannot send: bus-off, listen-only, closed, cable
  io,           ///< a file, socket or store failed; `Error::detail` is errno or the store's code
  cancelled,    ///< the caller ended it
  unsupported,  ///< the peer or this build does not support it
};

/// The name of a code, as in `--json` output ("timeout", "aborted", ...).
[[nodiscard]] const char* name(Errc code) noexcept;

/// One error: what, and where on the bus. Trivially copyable; `text` points to static storage.
struct Error {
  Errc code = Errc::invalid;
  std::uint8_t node = 0;     ///< node-ID 1..127, or 0 without a node
  std::uint8_t sub = 0;      ///< sub-index, meaningful when `index` is not 0
  std::uint16_t index = 0;   ///< object index, or 0 without an object
  std::uint32_t detail = 0;  ///< see `Errc`
  const char* text = "";     ///< a static sentence fragment: the attempted action or the finding

  friend bool operator==(const Error& a, const Error& b) noexcept {
    return a.code == b.code && a.node == b.node && a.sub == b.sub && a.index == b.index && a.detail == b.detail;
  }
};
static_assert(std::is_trivially_copyable_v<Error>);

/// "node 5, object 1018h:02: aborted (06020000h): reading the identity".
[[nodiscard]] std::string describe(const Error& error);

template <class T>
using Result = tl::expected<T, Error>;

/// An error as a `Result` of any type: `return fail(Errc::timeout, "no answer");`
[[nodiscard]] inline tl::unexpected<Error> fail(Errc code, const char* text) noexcept {
  return tl::unexpected<Error>(Error{.code = code, .text = text});
}
[[nodiscard]] inline tl::unexpected<Error> fail(const Error& error) noexcept { return tl::unexpected<Error>(error); }

}  // namespace berth
