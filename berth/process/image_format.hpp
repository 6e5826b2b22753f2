/// The places in the memory of an image, which two processes may share: a head, the table of the variables, and an
/// exchange for each direction. Numbers use this processor's format; a file of another version is refused.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <tl/expected.hpp>

#include "berth/process/exchange.hpp"
#include "berth/process/layout.hpp"
#include "berth/process/process.h"

namespace berth::process {

/// At the beginning of each block of outputs: when it was published.
struct OutputHead {
  std::int64_t now_ns = 0;        ///< by the executor of the network's side
  std::int64_t monotonic_ns = 0;  ///< CLOCK_MONOTONIC, between processes only; else 0
  std::uint64_t number = 0;       ///< the first is 1
};

/// At the beginning of each block of inputs: the application's other data.
struct InputHead {
  std::uint64_t seen = 0;        ///< `OutputHead::number` of the outputs that it used
  std::uint16_t error_code = 0;  ///< its EMCY; 0: no error
  std::uint8_t error_register = 0;
  std::uint8_t reserved[5] = {};
};

/// Status of one output variable.
struct OutputStatus {
  std::int64_t received_ns = 0;  ///< by the executor of the network's side
  std::uint32_t validity = BERTH_WAITING;
  std::uint32_t reserved = 0;
};

class ImageFormat {
 public:
  explicit ImageFormat(const Layout& layout);

  [[nodiscard]] std::size_t size() const noexcept { return inputs_at_ + inputs_.memory(); }
  [[nodiscard]] const BlockLayout& outputs() const noexcept { return outputs_; }
  [[nodiscard]] const BlockLayout& inputs() const noexcept { return inputs_; }
  [[nodiscard]] std::uint8_t* outputs(std::uint8_t* memory) const noexcept { return memory + outputs_at_; }
  [[nodiscard]] std::uint8_t* inputs(std::uint8_t* memory) const noexcept { return memory + inputs_at_; }

  // A block of outputs contains: its head, the diagnosis, the statuses, the values. One of inputs: its head, the
  // values.
  static constexpr std::size_t diagnosis_at = sizeof(OutputHead);
  static constexpr std::size_t status_at = diagnosis_at + sizeof(berth_diagnosis);
  static constexpr std::size_t input_values_at = sizeof(InputHead);
  [[nodiscard]] std::size_t output_values_at() const noexcept { return output_values_at_; }

  /// Begins an image in `memory`, `size()` bytes that are 0: no values, and nothing passed. Its mark is set last.
  void begin(std::uint8_t* memory) const noexcept;

 private:
  std::vector<std::uint8_t> table_;
  std::uint32_t variables_;
  BlockLayout outputs_;
  BlockLayout inputs_;
  std::size_t output_values_at_ = 0;
  std::size_t outputs_at_ = 0;
  std::size_t inputs_at_ = 0;
};

/// The layout of an image begun by another process. `memory` may hold anything. The error says what to do.
[[nodiscard]] tl::expected<Layout, std::string> read_layout(std::span<const std::uint8_t> memory);

}  // namespace berth::process
