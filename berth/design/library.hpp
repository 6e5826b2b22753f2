/// The device library: a user's knowledge of device types beyond their descriptions, above all how a device without LSS
/// gets its node-ID. `[[device-type]]` tables, in a separate file that several machines share (`devices =` in the
/// machine file) or in the machine file itself; docs/machine-file.md has the grammar.
///
/// What Berth learns of devices is in the store; this is what a user wrote.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/base/ids.hpp"
#include "berth/od/description.hpp"
#include "berth/places/recipe.hpp"
#include "berth/text/reach.hpp"
#include "berth/text/toml.hpp"

namespace berth::design {

/// The data of a device description that a slot uses: object 1018h, else [DeviceInfo].
struct DeviceType {
  TypeCode type;
  std::optional<std::uint32_t> revision;
  std::shared_ptr<const od::Description> description = {};  ///< null: the loader provides none
  std::uint8_t unasked = 0;  ///< parts of `type` that are not given (`places::SlotAsks::unasked`)
};
/// Reads the description at `path`; remarks go to `findings`, and at least one error if it gives no result.
using TypeLoader = std::function<std::optional<DeviceType>(const std::string& path, Findings& findings)>;

/// One device type of the library.
struct KnownDevice {
  std::string name;  ///< the name that slots use in `device =`; unique
  TypeCode type;
  std::optional<std::uint32_t> revision;
  std::string eds;                                     ///< as written; empty if the type is given by numbers
  std::string eds_path;                                ///< the same, relative to the library's folder
  std::shared_ptr<const od::Description> description;  ///< the content of `eds`; null without one
  std::shared_ptr<const places::Recipe> recipe;        ///< null: it has LSS, or a fixed node-ID
  std::uint8_t unasked = 0;                            ///< as in `DeviceType`
  std::string file;                                    ///< where it is written
  text::Place place;
};
using Library = std::vector<KnownDevice>;

/// Reads the `[[device-type]]` tables beneath `root`. `loader` as in `read_machine`.
[[nodiscard]] Library read_device_types(text::Table& root, const std::string& file, const text::Reach& reach,
                                        const TypeLoader& loader, Findings& findings);

/// Reads a library file's text: only `[[device-type]]` tables. All errors are findings. `allowed`: folders besides the
/// file's own (`text::Reach`).
[[nodiscard]] Library read_library(std::string_view text, const std::string& file, const TypeLoader& loader,
                                   std::span<const std::string> allowed, Findings& findings);

}  // namespace berth::design
