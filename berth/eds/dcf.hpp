/// Makes a DCF from an EDS and values, and reads the files beside a DCF (CiA 306 §5).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "berth/base/result.hpp"
#include "berth/eds/file.hpp"

namespace berth::eds {

/// The content of a DCF beyond its EDS.
struct Configuration {
  std::optional<Commissioning> commissioning = {};
  std::vector<Parameter> parameters = {};           ///< values to set; a `Literal` of kind none removes a value
  std::vector<Denotation> denotations = {};         ///< names to set; "" removes one
  std::vector<FileReference> file_references = {};  ///< plain file names; "" removes one
  /// [FileInfo], if not empty. LastEDS is the EDS's FileName unless given.
  std::string file_name = {};
  std::string last_eds = {};
  std::string modification_time = {};  ///< hh:mmAM
  std::string modification_date = {};  ///< mm-dd-yyyy
  std::string modified_by = {};
};

/// The text of `eds.document` with these changes and every other byte unchanged. A value is written like the file's
/// default: hex or decimal, and `$NODEID+n` as given. Values of CompactSubObj arrays go to [xxxxValue]; PDOs that only
/// CompactPDO describes get sections. Errors: `Errc::not_found` for an object that is not in the EDS, `Errc::invalid`
/// for a value that is invalid for its type or that a file cannot contain; both with the object.
[[nodiscard]] Result<std::string> make_dcf(const File& eds, const Configuration& configuration);

/// True for a plain file name beside the DCF, which leads nowhere else on any system: no slash, backslash, colon or
/// control characters, not a dot or two, not empty.
[[nodiscard]] bool plain_file_name(std::string_view name) noexcept;

/// The content of a `DownloadFile` (or an `UploadFile`) beside `dcf`. Errors: `Errc::invalid` for a name that leads
/// elsewhere (also by a symbolic link out of the folder) or a file longer than `max_bytes`, `Errc::not_found` when
/// there is none, `Errc::io` with errno.
[[nodiscard]] Result<std::vector<std::uint8_t>> read_beside(const std::filesystem::path& dcf, const FileReference& file,
                                                            std::size_t max_bytes = 64U << 20U);

}  // namespace berth::eds
