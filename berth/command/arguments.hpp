/// Reads and checks the arguments of requests.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/command/checked.hpp"
#include "berth/command/request.hpp"
#include "berth/lss/frames.hpp"

namespace berth::command {

/// The checked arguments of one request. The first error is kept in `problem`; values read after it are defaults.
class Arguments {
 public:
  /// An argument that the request's verb does not take is an error, and so is an unknown verb.
  explicit Arguments(const Request& request);

  [[nodiscard]] bool has(const std::string& key) const;
  /// Empty when absent.
  [[nodiscard]] std::string text(const std::string& key) const;
  std::string required(const std::string& key);
  /// C notation. Absent: `fallback`; an error without one.
  std::uint32_t number(const std::string& key, std::uint32_t low, std::uint32_t high,
                       std::optional<std::uint32_t> fallback = std::nullopt);
  LssAddress address(const std::string& key);
  /// Empty when absent.
  std::optional<LssAddress> optional_address(const std::string& key);
  /// A device as Berth names it (`to_string`).
  Identity device(const std::string& key);
  /// Empty when absent.
  std::optional<Identity> optional_device(const std::string& key);
  void wrong(std::string problem);
  [[nodiscard]] bool good() const noexcept { return problem_.empty(); }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const Request& request_;
  std::string problem_;
};

/// The arguments of an LSS command; only those that its service takes are set.
struct LssArguments {
  std::string service;
  std::string bus;
  std::optional<LssAddress> device;
  lss::State state = lss::State::waiting;
  NodeId id;
  bool store = false;
  std::uint32_t rate = 0;  ///< 0: none, or automatic
  std::string part;        ///< of the address, or "node-id"; empty: all of both
  std::uint16_t delay_ms = 0;
  lss::IdentifyRanges ranges;
};
/// Errors are in `problem`.
[[nodiscard]] LssArguments lss_arguments(const Request& request, std::string& problem);

}  // namespace berth::command
