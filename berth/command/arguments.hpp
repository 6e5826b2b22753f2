/// The arguments of requests, read and checked.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "berth/command/checked.hpp"
#include "berth/command/request.hpp"
#include "berth/lss/frames.hpp"

namespace berth::command {

/// The arguments of one request, checked. The first thing wrong is kept in `problem`; what is read after that is a
/// default.
class Arguments {
 public:
  /// An argument that the request's verb does not take is wrong, and so is a verb that there is not.
  explicit Arguments(const Request& request);

  [[nodiscard]] bool has(const std::string& key) const;
  /// Empty when absent.
  [[nodiscard]] std::string text(const std::string& key) const;
  std::string required(const std::string& key);
  /// C notation. Absent: `fallback`, or wrong when there is none.
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

/// What an LSS command is about; only what its service takes means something.
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
/// What is wrong is in `problem`.
[[nodiscard]] LssArguments lss_arguments(const Request& request, std::string& problem);

}  // namespace berth::command
