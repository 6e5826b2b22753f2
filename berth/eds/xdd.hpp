/// XDD and XDC (CiA 311): the same device descriptions and configurations in XML. Read into the `File` of an EDS or
/// DCF, and written from it, so that all other code uses only `File`.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"

namespace berth::eds {

/// Reads the text of an XDD or XDC, of schema 1.0 or 1.1, with elements identified by their local names. As tolerant as
/// the EDS reader: each oddity is a finding with line and column, and only unintelligible content is an error. Facts
/// missing at an object come from the parameter in its `uniqueIDRef`, and from the parameter's template. An
/// `actualValue` becomes a `Parameter`. No I/O, no entities, nothing outside the text is ever opened. `File::document`
/// stays empty. Not kept, and reported in one note: units, descriptions, the meaning of single values, functions and
/// LEDs.
[[nodiscard]] Reading read_xdd(std::string_view text, std::string_view file_name, const ReadOptions& options = {});

/// True when the text is XML of any kind: its first character after a byte order mark and blanks is `<`.
[[nodiscard]] bool is_xml(std::string_view text) noexcept;

/// Reads a device description of any kind, EDS, DCF, XDD or XDC, recognised by its content. All code that takes a
/// description file uses these functions.
[[nodiscard]] Reading read_any(std::string text, std::string_view file_name, const ReadOptions& options = {});
/// A file that cannot be opened or is too long is a Reading with one error.
[[nodiscard]] Reading read_any_file(const std::filesystem::path& path, const ReadOptions& options = {});

struct XddOptions {
  bool values = false;              ///< an XDC: with actual values and the commissioning
  std::string_view file_name = {};  ///< for `fileName`; "" = from `FileInfo`
};

/// Writes a whole XDD or XDC of schema 1.1, UTF-8. Reading it back gives an equal `File`, except for: parts named in
/// the findings (tools, modules, object links, references and file names have no place in CiA 311), seconds of times,
/// and what `eds::write` cannot keep either. Facts of an EDS that CiA 311 has no place for but that are plain words are
/// written to the device's list of characteristics, where users see them.
[[nodiscard]] Written write_xdd(const File& file, const XddOptions& options = {});

}  // namespace berth::eds
