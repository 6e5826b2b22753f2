/// What the next attempt to connect is like, after how the last one ended: its version of MQTT, its address, the pause
/// before it. Pure; internal to room `mqtt`.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "berth/mqtt/cause.hpp"
#include "berth/mqtt/options.hpp"

namespace berth::mqtt {

/// How far the last attempt came.
enum class Stage : std::uint8_t {
  before_broker,  ///< no name, no address, no TLS
  asked,          ///< CONNECT was on its way, and was not answered with yes
  connected
};

class Attempts {
 public:
  Attempts(const Options& options, Random random) noexcept;

  /// 5 or 3.1.1.
  [[nodiscard]] Version version() const noexcept { return version_; }
  /// One of the host's addresses; `found` is not empty.
  [[nodiscard]] const std::string& address(const std::vector<std::string>& found) noexcept;

  /// The pause before the next attempt. 0: at once, with another address or version.
  [[nodiscard]] Milliseconds after(const Cause& cause, Stage stage, Milliseconds lasted) noexcept;

 private:
  [[nodiscard]] bool other_address(const Cause& cause, Stage stage) noexcept;
  [[nodiscard]] bool other_version(const Cause& cause, Stage stage) noexcept;

  bool automatic_;
  bool settled_ = false;  // this version has worked, or the other was refused
  Version version_;
  std::size_t address_ = 0;
  std::size_t addresses_ = 0;  // of the last lookup
  Backoff backoff_;
};

}  // namespace berth::mqtt
