#include "berth/campaign/results.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <memory>
#include <utility>

#include "berth/base/read_files.hpp"

namespace berth::campaign {
namespace {

Error failed() {
  return {.code = Errc::io, .detail = static_cast<std::uint32_t>(errno), .text = "reading a campaign's lines"};
}

bool begins_as_a_line(std::string_view text) {
  const auto size = std::min(text.size(), line_begin.size());
  return text.substr(0, size) == line_begin.substr(0, size);
}

struct Closer {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, Closer>;

}  // namespace

// False: it is no line of a campaign.
bool Results::take(std::string_view text, const std::string& from, FileRead& file) {
  if (text.ends_with('\r')) text.remove_suffix(1);
  if (text.empty()) return true;
  auto line = parse_line(text);
  const auto begin = text.rfind(line_begin);
  if (!line && begin == std::string_view::npos) {
    if (file.bad_lines == 0) file.why_bad = line.error().text;
    return false;
  }
  if (!line) {
    // A torn line, and what followed it where files were joined.
    ++file.pieces;
    line = parse_line(text.substr(begin));
  }
  if (line) {
    ++file.lines;
    add(std::move(*line), from);
  }
  return true;
}

// In pieces, so that a file of one endless line takes no more memory than another.
Result<FileRead> Results::read(const std::string& path) {
  const File in(std::fopen(path.c_str(), "rbe"));
  if (!in) return fail(failed());
  note_read(path);
  FileRead file;
  std::array<char, 65'536> piece;
  std::string line;
  std::uint64_t number = 1;
  while (const std::size_t got = std::fread(piece.data(), 1, piece.size(), in.get())) {
    if (file.size == 0) file.begins_as_one = begins_as_a_line({piece.data(), got});
    for (std::size_t at = 0; at < got;) {
      const auto* const end = std::find(piece.data() + at, piece.data() + got, '\n');
      const auto size = static_cast<std::size_t>(end - piece.data()) - at;
      line.append(piece.data() + at, std::min(size, longest_line + 1 - std::min(line.size(), longest_line + 1)));
      at += size;
      file.size += size;
      if (at == got) break;
      ++at;
      file.torn_at = ++file.size;
      const bool good = take(line, path, file);
      if (!good && file.bad_lines++ == 0) file.first_bad = number;
      ++number;
      line.clear();
    }
  }
  if (std::ferror(in.get()) != 0) return fail(failed());
  if (!line.empty() && parse_line(line)) {
    take(line, path, file);
    file.torn_at = file.size;
    file.lacks_line_feed = true;
  }
  return file;
}

void Results::add(Line line, const std::string& from) {
  if (files_.empty() || files_.back() != from) files_.push_back(from);
  const auto file = static_cast<std::uint32_t>(files_.size() - 1);
  const Key key = line.key;
  const auto [it, is_new] = lines_.try_emplace(key, line);
  if (is_new) {
    from_[key] = file;
    return;
  }
  Line& first = it->second;
  if (first == line || !is_result(line.verdict)) {
    ++doubles_;
  } else if (!is_result(first.verdict)) {
    ++doubles_;
    first = std::move(line);
    from_[key] = file;
  } else {
    contradictions_.push_back({first, std::move(line), files_[from_[key]], from});
  }
}

}  // namespace berth::campaign
