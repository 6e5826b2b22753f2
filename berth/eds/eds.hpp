/// Electronic data sheets and device configuration files (CiA 306): reading.
///
/// The reader is tolerant: it accepts files found in the field, reports each oddity with line, column and key, and
/// refuses (a finding of severity `error`) only what it cannot understand: a value invalid for its type, a file without
/// objects, a file beyond the limits below. Every row of docs/hard-cases.md §4 is a test (tests/eds/quirks_test.cpp).
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "berth/base/finding.hpp"
#include "berth/eds/file.hpp"

namespace berth::eds {

struct Reading {
  File file;
  Findings findings;  ///< by line
  [[nodiscard]] bool usable() const noexcept { return !has_errors(findings); }
};

/// Limits for the work that a hostile file can cause.
struct ReadOptions {
  std::size_t max_bytes = 64U << 20U;        ///< a longer file is refused
  std::size_t max_sub_objects = 1U << 18U;   ///< after expanding CompactSubObj and CompactPDO
  std::size_t max_value_bytes = 64U << 20U;  ///< names and defaults after expanding
  std::size_t max_findings = 1000;
};

/// Reads the text of an EDS or DCF. `file_name` is only for the findings. No I/O, no exceptions except bad_alloc.
[[nodiscard]] Reading read(std::string text, std::string_view file_name, const ReadOptions& options = {});
/// Reads a file; one that cannot be opened or is too long is a Reading with one error.
[[nodiscard]] Reading read_file(const std::filesystem::path& path, const ReadOptions& options = {});

}  // namespace berth::eds
