#include "berth/trace/any_file.hpp"

#include <fmt/format.h>

#include <utility>

namespace berth::trace {
namespace {

/// True: some line may begin like candump's.
bool has_a_time(std::string_view text) noexcept {
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return true;
  return text[first] == '(' || text.find("\n(") != std::string_view::npos;
}

}  // namespace

AnyFile::AnyFile(std::string name, std::optional<Format> format, const ReadOptions& how)
    : name_(std::move(name)), format_(format), how_(how) {}

const std::vector<std::string>& AnyFile::buses() const noexcept {
  static const std::vector<std::string> none;
  return reader_ ? reader_->buses() : none;
}

std::string AnyFile::unreadable(std::string_view why) const { return fmt::format("{}: {}", name_, why); }

// A log in gzip is read like any other.
std::string AnyFile::feed(std::string_view bytes, Sink& sink) {
  if (!std::exchange(fed_, true) && is_gzip(bytes)) gunzip_ = std::make_unique<Gunzip>();
  if (!gunzip_) return take(bytes, sink);
  std::string wrong;
  const std::string broken = gunzip_->feed(bytes, [&](std::string_view piece) {
    if (wrong.empty()) wrong = take(piece, sink);
  });
  return broken.empty() || !wrong.empty() ? wrong : unreadable(broken);
}

std::string AnyFile::end(Sink& sink) {
  if (gunzip_ && !gunzip_->whole()) return unreadable("the gzip file is cut short");
  if (reader_) return {};
  if (head_.empty()) return unreadable("the file is empty");
  return begin(sink, true);
}

void AnyFile::finish(Sink& sink) {
  if (reader_) reader_->finish(sink);
}

std::string AnyFile::take(std::string_view bytes, Sink& sink) {
  if (reader_) {
    reader_->feed(bytes, sink);
    return {};
  }
  head_ += bytes;
  return begin(sink, head_.size() >= head_size);
}

// Chooses the format as soon as it can be recognised.
std::string AnyFile::begin(Sink& sink, bool whole_head) {
  if (!format_) format_ = recognise(head_);
  const bool other = !format_ || *format_ == Format::candump;
  if (const auto kind = foreign(head_); other && !kind.empty()) return unreadable(fmt::format("this is {}", kind));
  if (!format_ && whole_head) {
    // A text without a characteristic word is read as candump. That reader's errors show what is wrong with each line.
    if (head_.find('\0') != std::string::npos || !has_a_time(head_))
      return unreadable("this is neither candump, pcapng, pcap, Vector ASC nor PEAK TRC; name it by --from");
    format_ = Format::candump;
  }
  if (!format_) return {};
  reader_ = make_reader(*format_, name_, how_);
  reader_->feed(head_, sink);
  head_.clear();
  return {};
}

}  // namespace berth::trace
