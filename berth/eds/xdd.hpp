/// XDD and XDC (CiA 311): the same device descriptions and configurations in XML. Read into the `File` that an EDS or
/// DCF gives, and written from it, so that everything above knows only `File`.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "berth/eds/eds.hpp"
#include "berth/eds/write.hpp"

namespace berth::eds {

/// Reads the text of an XDD or XDC, of schema 1.0 or 1.1: elements are known by their local names. As tolerant as the
/// EDS reader: each oddity is a finding with line and column, and only what cannot be understood is an error. What an
/// object does not say itself is taken from the parameter that its `uniqueIDRef` names, and from that one's template.
/// An `actualValue` becomes a `Parameter`. No I/O, no entities, nothing outside of the text is ever opened.
/// `File::document` stays empty. Not kept, and told in one note: units, descriptions, the meaning of single values,
/// functions and LEDs.
[[nodiscard]] Reading read_xdd(std::string_view text, std::string_view file_name, const ReadOptions& options = {});

/// True when the text is XML, whatever it describes: its first character but a byte order mark and blanks is `<`.
[[nodiscard]] bool is_xml(std::string_view text) noexcept;

/// A device description of any kind, EDS, DCF, XDD or XDC, told apart by its content. Whatever takes a description
/// file reads it with these.
[[nodiscard]] Reading read_any(std::string text, std::string_view file_name, const ReadOptions& options = {});
/// One that cannot be opened or is too long is a Reading with one error.
[[nodiscard]] Reading read_any_file(const std::filesystem::path& path, const ReadOptions& options = {});

struct XddOptions {
  bool values = false;              ///< an XDC: with actual values and the commissioning
  std::string_view file_name = {};  ///< for `fileName`; "" = as `FileInfo` has it
};

/// Writes a whole XDD or XDC of schema 1.1, UTF-8. Reading it back gives an equal `File`, but for: what the findings
/// name (tools, modules, object links, references and file names have no place in CiA 311), seconds of times
/// and what `eds::write` cannot keep either. Facts of an EDS that CiA 311 has no place for
/// but that are plain words stand in the device's list of characteristics, where people see them.
[[nodiscard]] Written write_xdd(const File& file, const XddOptions& options = {});

}  // namespace berth::eds
