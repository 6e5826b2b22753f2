/// The pages of Studio: the content of web/dist at build time, compressed (gzip), or one built-in page that says how to
/// build them. Names are compared literally: no disk is accessed.
#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace berth::studio {

/// As written by CMake (cmake/Berth.cmake).
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
  bool lasts = false;       ///< its name changes with its content (/assets/): a browser may keep it
};

/// The page at a path such as "/" or "/assets/x.js"; `body` is null if there is none. The part after a '?' is for the
/// page itself.
[[nodiscard]] Page page_at(std::string_view target) noexcept;
/// The same with the given pages.
[[nodiscard]] Page page_at(std::string_view target, std::span<const BuiltPage> pages) noexcept;

}  // namespace berth::studio
