/// The arguments of requests, read and checked.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tl/expected.hpp>

#include "berth/co/nmt.hpp"
#include "berth/command/request.hpp"
#include "berth/lss/frames.hpp"
#include "berth/od/data_type.hpp"

namespace berth::command {

template <class T>
using Checked = tl::expected<T, std::string>;  ///< the error is for people

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
  /// A node-ID; 0 for "all" when that is allowed.
  std::uint8_t node(const std::string& key, bool all_allowed);

  void wrong(std::string problem);
  [[nodiscard]] bool good() const noexcept { return problem_.empty(); }
  [[nodiscard]] const std::string& problem() const noexcept { return problem_; }

 private:
  const Request& request_;
  std::string problem_;
};

/// The object that an SDO command is about.
struct ObjectArguments {
  std::string bus;
  NodeId node;
  std::uint16_t index = 0;
  std::uint8_t sub = 0;
  od::DataType type = od::DataType::none;
};
[[nodiscard]] ObjectArguments object_arguments(Arguments& arguments);
/// The bytes of a value as a person wrote it; type `none`: a row of hex bytes.
[[nodiscard]] Checked<std::vector<std::uint8_t>> value_bytes(od::DataType type, const std::string& text, NodeId node);
struct NmtArguments {
  std::string bus;
  co::NmtCommand command = co::NmtCommand::start;
  co::NmtTarget target;
  std::string word;
};
[[nodiscard]] NmtArguments nmt_arguments(Arguments& arguments);

/// What an LSS command is about; only what its service takes means something.
struct LssArguments {
  std::string service;
  std::string bus;
  std::optional<LssAddress> device;
  lss::State state = lss::State::waiting;
  NodeId id;
  bool store = false;
  std::uint32_t rate = 0;
  std::uint16_t delay_ms = 0;
  lss::IdentifyRanges ranges;
};
/// What is wrong is in `problem`.
[[nodiscard]] LssArguments lss_arguments(const Request& request, std::string& problem);

}  // namespace berth::command
