/// A gzip file (RFC 1952), one member or several, unpacked piece by piece in constant memory.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

namespace berth::trace {

/// The first bytes of a gzip file.
[[nodiscard]] bool is_gzip(std::string_view head) noexcept;

class Gunzip {
 public:
  /// After the first `unsuspicious` bytes, a file that grows more than so many times is no log and is refused.
  static constexpr std::uint64_t most_growth = 300;
  static constexpr std::uint64_t unsuspicious = std::uint64_t{64} << 20U;

  Gunzip();
  ~Gunzip();
  Gunzip(const Gunzip&) = delete;
  Gunzip& operator=(const Gunzip&) = delete;

  /// The next bytes of the file, cut anywhere; `out` gets the unpacked ones. Returns empty, or an error for users: then
  /// feed nothing more.
  [[nodiscard]] std::string feed(std::string_view bytes, const std::function<void(std::string_view)>& out);
  /// The file may end here.
  [[nodiscard]] bool whole() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace berth::trace
