/// The pages of Studio: what was in web/dist when this was built, compressed (gzip), else one built-in page that says
/// how to build them. Names are compared as they stand: nothing is looked for on a disk.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace berth::studio {

/// As CMake writes them (cmake/Berth.cmake).
struct BuiltPage {
  std::string_view path;  ///< "/index.html"
  const unsigned char* bytes = nullptr;
  std::size_t size = 0;
};
[[nodiscard]] std::span<const BuiltPage> built_pages() noexcept;

struct Page {
  std::string_view type;  ///< MIME
  std::string_view body;
  bool compressed = false;  ///< by gzip
  bool lasts = false;       ///< its name changes when it does (/assets/): a browser may keep it
};

/// The page at a path such as "/" or "/assets/x.js"; `body` is null when there is none. What stands after a '?' is the
/// page's own.
[[nodiscard]] Page page_at(std::string_view target) noexcept;
/// The same among pages given.
[[nodiscard]] Page page_at(std::string_view target, std::span<const BuiltPage> pages) noexcept;

}  // namespace berth::studio
