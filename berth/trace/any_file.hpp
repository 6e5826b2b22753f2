/// A trace file of any format that is read, perhaps in gzip: which one it is, is found by its content.
///
///     trace::AnyFile file("run.log.gz");
///     while (read(chunk)) if (auto wrong = file.feed(chunk, sink); !wrong.empty()) return tell(wrong);
///     if (auto wrong = file.end(sink); !wrong.empty()) return tell(wrong);     // "run.log.gz: the file is empty"
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "berth/trace/gunzip.hpp"
#include "berth/trace/stream.hpp"

namespace berth::trace {

class AnyFile {
 public:
  /// `format` empty: by the content. `name` stands in the findings, nothing is opened.
  explicit AnyFile(std::string name, std::optional<Format> format = std::nullopt, const ReadOptions& how = {});
  /// The next bytes, cut anywhere. Empty, or what the file is that no reader reads: then nothing more is to be fed.
  [[nodiscard]] std::string feed(std::string_view bytes, Sink& sink);
  /// No more comes: a file without a frame is told as what it is. `finish` is not called with it.
  [[nodiscard]] std::string end(Sink& sink);
  /// As `Reader::finish`: a last line without an end is read.
  void finish(Sink& sink);
  /// The file became another, and is fed from its beginning.
  void begin_anew() noexcept { fed_ = false; }

  [[nodiscard]] const std::vector<std::string>& buses() const noexcept;
  /// Empty: not known yet.
  [[nodiscard]] std::optional<Format> format() const noexcept { return format_; }

 private:
  [[nodiscard]] std::string take(std::string_view bytes, Sink& sink);
  [[nodiscard]] std::string begin(Sink& sink, bool whole_head);
  [[nodiscard]] std::string unreadable(std::string_view why) const;

  std::string name_;
  std::optional<Format> format_;
  ReadOptions how_;
  std::unique_ptr<Reader> reader_;
  std::unique_ptr<Gunzip> gunzip_;  // of a file in gzip
  std::string head_;                // until the format is known
  bool fed_ = false;
};

}  // namespace berth::trace
