#include "berth/studio/pages.hpp"

#include <algorithm>
#include <utility>

namespace berth::studio {
namespace {

constexpr std::string_view none_built =
    "<!doctype html>\n"
    "<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Berth Studio</title></head><body>\n"
    "<h1>Berth Studio</h1>\n"
    "<p>This berth was built without the pages of Studio. In the folder of Berth's sources,</p>\n"
    "<pre>./run pages</pre>\n"
    "<p>installs what they need (nodejs, npm), builds them, and the program with them; then start berth again. The "
    "interface that they use is here: docs/api.md describes it.</p>\n"
    "</body></html>\n";

constexpr std::pair<std::string_view, std::string_view> types[] = {
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".woff2", "font/woff2"},
    {".json", "application/json"},
    {".txt", "text/plain; charset=utf-8"},
    {".webmanifest", "application/manifest+json"},
};

std::string_view type_of(std::string_view path) noexcept {
  const auto* const it = std::ranges::find_if(types, [&](const auto& type) { return path.ends_with(type.first); });
  return it == std::end(types) ? "application/octet-stream" : it->second;
}

}  // namespace

Page page_at(std::string_view target) noexcept { return page_at(target, built_pages()); }

Page page_at(std::string_view target, std::span<const BuiltPage> pages) noexcept {
  std::string_view path = target.substr(0, target.find('?'));
  if (path == "/") path = "/index.html";
  const auto page = std::ranges::find(pages, path, &BuiltPage::path);
  if (page != pages.end()) {
    return {
        type_of(path), {reinterpret_cast<const char*>(page->bytes), page->size}, true, path.starts_with("/assets/")};
  }
  if (path == "/index.html") return {type_of(path), none_built, false, false};
  return {};
}

}  // namespace berth::studio
