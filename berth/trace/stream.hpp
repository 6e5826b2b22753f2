/// Trace files as streams: bytes in by chunks of any size, entries out; entries in, bytes out. Constant memory however
/// long the file is, no I/O, no allocation per frame. One reader and one writer for each format:
///
/// | format | what it is | what writing it loses |
/// | --- | --- | --- |
/// | candump | can-utils `candump -L` (candump.hpp) | time below 1 us |
/// | pcapng | PCAP Next Generation, LINKTYPE_CAN_SOCKETCAN (pcapng.hpp) | nothing |
/// | pcap | the older format of tcpdump (pcap.hpp) | it is read only |
/// | asc | Vector's ASCII log (asc.hpp) | time below 1 us; what an error frame says; that a direction is unknown (Rx) |
/// | trc | PEAK's trace 2.1 (trc.hpp) | time below 1 us; most of what an error frame says; unknown direction (Rx) |
/// | trc, version 1.1 | the same, older | besides: time below 100 us, FD frames (left out), buses (one is left) |
///
///     auto reader = trace::make_reader(trace::Format::candump, "run.log");
///     while (read(chunk)) reader->feed(chunk, sink);      // sink.entry(...), sink.finding(...)
///     reader->finish(sink);
///
///     auto writer = trace::make_writer(trace::Format::pcapng);
///     writer->write(entry, reader->buses()[entry.bus], out);   // appends to `out`; the caller takes it away
///     writer->finish(out);
///     for (const auto& line : writer->lost()) print(line);
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "berth/base/finding.hpp"
#include "berth/trace/trace.hpp"

namespace berth::trace {

enum class Format : std::uint8_t { candump, pcapng, asc, trc, pcap };
/// The formats that can also be written.
inline constexpr Format all_formats[] = {Format::candump, Format::pcapng, Format::asc, Format::trc};
[[nodiscard]] std::string_view name(Format format) noexcept;  ///< "candump", "pcapng", "asc", "trc", "pcap"
[[nodiscard]] bool is_written(Format format) noexcept;
/// By name; "log" is candump too.
[[nodiscard]] std::optional<Format> parse_format(std::string_view name) noexcept;
/// By a file name's extension: .log .pcapng .asc .trc .pcap, in either case.
[[nodiscard]] std::optional<Format> format_of_path(std::string_view path) noexcept;
/// By content: the first bytes of a file. 4096 suffice for all that tools write; empty: none of them.
[[nodiscard]] std::optional<Format> recognise(std::string_view head) noexcept;
inline constexpr std::size_t head_size = 4096;
/// The kind of an unreadable file, from its first bytes, for users: "a BLF file (Vector's binary log)", with what to do
/// about it after a semicolon. Empty: unknown.
[[nodiscard]] std::string_view foreign(std::string_view head) noexcept;

/// Gets what a reader reads, in the order of the file. Called inside `feed` and `finish`.
class Sink {
 public:
  virtual void entry(const Entry& entry) = 0;
  /// error: a line or block that is not of the format, left out; warning: read, but odd; note: what a format contains
  /// besides frames, and a file that may be truncated. Text formats give line and column; pcapng gives the byte in
  /// `key` ("byte 1204").
  virtual void finding(Finding finding) = 0;

 protected:
  ~Sink() = default;
};

class Reader {
 public:
  virtual ~Reader() = default;
  /// The next bytes of the file, cut anywhere. Not kept.
  virtual void feed(std::string_view bytes, Sink& sink) = 0;
  /// The end of the file: a last line without a line end is read; a truncated block is an error. Afterwards the reader
  /// is done.
  virtual void finish(Sink& sink) = 0;
  /// The names for `Entry::bus`; grows.
  [[nodiscard]] const std::vector<std::string>& buses() const noexcept { return buses_; }

 protected:
  std::vector<std::string> buses_;
};

struct ReadOptions {
  bool deltas = false;  ///< candump: each time counts from the previous line (-td)
};
/// `file_name` is for findings; nothing is opened.
[[nodiscard]] std::unique_ptr<Reader> make_reader(Format format, std::string file_name,
                                                  const ReadOptions& options = {});

/// Information that a written file lacks.
enum class Loss : std::uint8_t {
  fd_frame,          ///< left out: the format has no FD frames
  time,              ///< rounded to the format's unit
  time_before_zero,  ///< written as 0
  direction,         ///< unknown, written as received
  error_detail,      ///< an error frame's class and data
  bus,               ///< the format has one bus
  count_
};

class Writer {
 public:
  virtual ~Writer() = default;
  /// Appends the entry to `out`, preceded by what the format needs first. `bus` is the name of `entry.bus`; a number
  /// must always have the same name. Text formats write `_` for a blank in it.
  virtual void write(const Entry& entry, std::string_view bus, std::string& out) = 0;
  /// Appends what the format needs last (and first, if nothing was written).
  virtual void finish(std::string& out) = 0;
  /// How many entries lost this.
  [[nodiscard]] std::uint64_t lost(Loss loss) const noexcept { return lost_[static_cast<std::size_t>(loss)]; }
  /// As text, one line each: "12 FD frames are left out: TRC 1.1 has none". Empty: nothing was lost.
  [[nodiscard]] std::vector<std::string> lost() const;

 protected:
  void lose(Loss loss) noexcept { ++lost_[static_cast<std::size_t>(loss)]; }

 private:
  std::array<std::uint64_t, static_cast<std::size_t>(Loss::count_)> lost_{};
};

struct WriteOptions {
  bool trc_1_1 = false;    ///< TRC: version 1.1 instead of 2.1
  bool directions = true;  ///< candump: ` R` or ` T` after a frame whose direction is known, as `candump -x` does.
                           ///< canplayer ignores it; tshark 4.0 takes it for an error.
};
/// `format`: one that can be written.
[[nodiscard]] std::unique_ptr<Writer> make_writer(Format format, const WriteOptions& options = {});

}  // namespace berth::trace
