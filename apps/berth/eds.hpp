/// `berth eds`: device descriptions. One source file per verb.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/eds/diff.hpp"
#include "berth/eds/eds.hpp"
#include "options.hpp"
#include "output.hpp"

namespace berth::cli {

struct EdsOptions {
  std::vector<std::string> files;
  std::string object;  ///< show: index, index:sub or name
  std::string to;      ///< convert: format, if not the extension's
  std::string eds;     ///< convert: description of a concise DCF's device
  std::optional<unsigned> node;
  bool strict = false;  ///< check: warnings count like errors
  bool quiet = false;   ///< check: no notes
  bool values = false;  ///< diff with a device: compares values too
};

int run_eds_check(const Options& options, const EdsOptions& eds);
int run_eds_convert(const Options& options, const EdsOptions& eds);
int run_eds_diff(const Options& options, const EdsOptions& eds);
int run_eds_show(const Options& options, const EdsOptions& eds);

/// A file that was read, with its text.
struct Described {
  std::string name;
  std::string text;
  eds::Reading reading;
  /// "EDS", "DCF", "XDD", "XDC"; "" when the file could not be read at all.
  std::string format;
  /// There is a description, possibly with errors.
  [[nodiscard]] bool readable() const { return !format.empty() && !reading.file.description->objects().empty(); }
};
[[nodiscard]] Described describe_file(const std::string& name);
/// Why the file cannot be used, with all its errors; status 2.
[[nodiscard]] Failure unusable(const Described& file);

}  // namespace berth::cli
