#include "berth/eds/text.hpp"

#include <algorithm>

#include "berth/eds/lines_parts.hpp"

namespace berth::eds {

bool fits_a_line(std::string_view value) noexcept {
  if (value.empty()) return true;
  if (blank(value.front()) || blank(value.back()) || std::ranges::any_of(value, line_break)) return false;
  for (std::size_t at = value.find(';'); at != std::string_view::npos; at = value.find(';', at + 1)) {
    if (at == 0 || blank(value[at - 1])) return false;
  }
  return true;
}

std::string fitted(std::string_view value) {
  std::string made(value);
  std::ranges::replace_if(made, line_break, ' ');
  for (std::size_t at = 0; at < made.size(); ++at) {
    if (made[at] == ';' && (at == 0 || blank(made[at - 1]))) made[at] = ',';
  }
  while (!made.empty() && blank(made.back())) made.pop_back();
  made.erase(made.begin(), std::ranges::find_if_not(made, blank));
  if (made.starts_with(';')) made.front() = ',';
  return made;
}

void TextBuilder::section(std::string_view name) {
  if (!text_.empty()) text_ += line_end_;
  section_ = name;
  text_ += '[';
  text_ += name;
  text_ += ']';
  text_ += line_end_;
}

void TextBuilder::plain(std::string_view key, std::string_view value) {
  if (key.size() + value.size() + 1 > longest_line) {
    tell(key, "the line is longer than the 255 characters that CiA 306 allows; some readers cut it",
         Finding::Severity::note);
  }
  text_ += key;
  text_ += '=';
  text_ += value;
  text_ += line_end_;
}

void TextBuilder::tell(std::string_view key, std::string message, Finding::Severity severity) {
  findings_.push_back({severity, "", 0, 0, fmt::format("[{}] {}", section_, key), std::move(message), ""});
}

void TextBuilder::raw(std::string_view key, std::string_view value) {
  if (fits_a_line(value)) {
    plain(key, value);
    return;
  }
  tell(key, "a line cannot carry blanks at its ends, line breaks and comment signs; written without them");
  plain(key, fitted(value));
}

void TextBuilder::text(std::string_view key, std::string_view value) {
  const Encoding of_value = encoding_of(value);
  if (of_value == Encoding::ascii || (of_value == Encoding::utf8 && encoding_ != Encoding::windows_1252)) {
    raw(key, value);
    return;
  }
  if (const auto converted = of_value == Encoding::utf8 ? to_windows_1252(value) : std::nullopt) {
    raw(key, *converted);
    return;
  }
  tell(key, of_value == Encoding::utf8
                ? "Windows-1252, which a value of the file needs, lacks a character of this text; written with ?"
                : "the text is not UTF-8; written with ?");
  std::string made(value);
  std::ranges::replace_if(
      made, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '?');
  raw(key, made);
}

}  // namespace berth::eds
