#include "berth/text/columns.hpp"

#include <locale.h>
#include <cwchar>

namespace berth::text {
namespace {

/// The C library's tables of characters, whatever the locale of the process is.
class Utf8 {
 public:
  Utf8() noexcept : before_(::uselocale(tables())) {}
  ~Utf8() { ::uselocale(before_); }
  Utf8(const Utf8&) = delete;
  Utf8& operator=(const Utf8&) = delete;

 private:
  static locale_t tables() noexcept {
    static const locale_t made = ::newlocale(LC_CTYPE_MASK, "C.UTF-8", nullptr);
    return made;
  }
  locale_t before_;
};

struct Glyph {
  std::size_t bytes = 1;
  std::size_t columns = 1;
};

Glyph first_of(std::string_view line) noexcept {
  if (static_cast<unsigned char>(line.front()) < 0x80) return {};
  wchar_t wide = 0;
  std::mbstate_t state{};
  const std::size_t bytes = std::mbrtowc(&wide, line.data(), line.size(), &state);
  if (bytes == 0 || bytes > line.size()) return {};
  const int columns = ::wcwidth(wide);
  return {bytes, columns < 0 ? std::size_t{1} : static_cast<std::size_t>(columns)};
}

/// Bytes of the longest beginning that is not wider than `most`.
std::size_t fitting(std::string_view line, std::size_t most) {
  const Utf8 utf8;
  std::size_t at = 0;
  for (std::size_t used = 0; at < line.size();) {
    const Glyph c = first_of(line.substr(at));
    if (used + c.columns > most) break;
    used += c.columns;
    at += c.bytes;
  }
  return at;
}

}  // namespace

std::size_t columns(std::string_view line) {
  const Utf8 utf8;
  std::size_t sum = 0;
  for (std::size_t at = 0; at < line.size();) {
    const Glyph c = first_of(line.substr(at));
    sum += c.columns;
    at += c.bytes;
  }
  return sum;
}

std::string cut(std::string_view line, std::size_t most) { return std::string(line.substr(0, fitting(line, most))); }

std::string padded(std::string_view line, std::size_t least) {
  const std::size_t has = columns(line);
  return std::string(line) + std::string(has < least ? least - has : 0, ' ');
}

std::vector<std::string> wrapped(std::string_view line, std::size_t most) {
  const Utf8 utf8;
  std::vector<std::string> lines;
  for (;;) {
    std::size_t end = fitting(line, most);
    if (end == line.size()) break;
    if (end == 0) end = first_of(line).bytes;  // wider than the whole line: it is shown anyway
    const std::size_t space = line.substr(0, end + 1).find_last_of(' ');
    const bool at_space = space != std::string_view::npos && space > 0;
    lines.emplace_back(line.substr(0, at_space ? space : end));
    line.remove_prefix(at_space ? space + 1 : end);
    if (line.empty()) return lines;
  }
  lines.emplace_back(line);
  return lines;
}

}  // namespace berth::text
