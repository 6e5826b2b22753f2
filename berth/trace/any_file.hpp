/// A trace file of any readable format, perhaps in gzip; its content tells the format.
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
  /// `format` empty: detect it from the content. `name` is for findings; nothing is opened.
  explicit AnyFile(std::string name, std::optional<Format> format = std::nullopt, const ReadOptions& how = {});
  /// The next bytes, cut anywhere. Returns empty, or what kind of unreadable file it is: then feed nothing more.
  [[nodiscard]] std::string feed(std::string_view bytes, Sink& sink);
  /// The end of the file: reports a file without a frame. Does not need `finish`.
  [[nodiscard]] std::string end(Sink& sink);
  /// As `Reader::finish`: reads a last line without a line end.
  void finish(Sink& sink);
  /// The file was replaced, and is fed from its beginning.
  void begin_anew() noexcept { fed_ = false; }

  [[nodiscard]] const std::vector<std::string>& buses() const noexcept;
  /// Empty: unknown yet.
  [[nodiscard]] std::optional<Format> format() const noexcept { return format_; }

 private:
  [[nodiscard]] std::string take(std::string_view bytes, Sink& sink);
  [[nodiscard]] std::string begin(Sink& sink, bool whole_head);
  [[nodiscard]] std::string unreadable(std::string_view why) const;

  std::string name_;
  std::optional<Format> format_;
  ReadOptions how_;
  std::unique_ptr<Reader> reader_;
  std::unique_ptr<Gunzip> gunzip_;  // for a gzip file
  std::string head_;                // until the format is known
  bool fed_ = false;
};

}  // namespace berth::trace
