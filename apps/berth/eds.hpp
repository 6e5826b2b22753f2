/// `berth eds`: device descriptions. One source file a verb.
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
  std::string to;      ///< convert: format, instead of by the extension
  std::string eds;     ///< convert: description of the device that a concise DCF is for
  std::optional<unsigned> node;
  bool strict = false;  ///< check: warnings count like errors
  bool quiet = false;   ///< check: no notes
  bool values = false;  ///< diff with a device: values too
};

int run_eds_check(const Options& options, const EdsOptions& eds);
int run_eds_convert(const Options& options, const EdsOptions& eds);
int run_eds_diff(const Options& options, const EdsOptions& eds);
int run_eds_show(const Options& options, const EdsOptions& eds);

/// A file read, with its text.
struct Described {
  std::string name;
  std::string text;
  eds::Reading reading;
  /// "EDS", "DCF", "XDD", "XDC"; "" when the file could not be read at all.
  std::string format;
  /// There is a description, though perhaps with errors.
  [[nodiscard]] bool readable() const { return !format.empty() && !reading.file.description->objects().empty(); }
};
[[nodiscard]] Described describe_file(const std::string& name);
/// Why it cannot be used, with all its errors; status 2.
[[nodiscard]] Failure unusable(const Described& file);

}  // namespace berth::cli
