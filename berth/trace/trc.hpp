/// PEAK's trace files (PEAK CAN TRC File Format), as PCAN-View and PCAN-Explorer write them.
///
///     ;$FILEVERSION=2.1
///     ;$STARTTIME=42195.26223668981481
///     ;$COLUMNS=N,O,T,B,I,d,R,L,D
///     ;   berth: bus 1 is backbone
///           1         0.713 DT 1      07E5 Rx -  8    51 00 00 00 00 80 00 00
///           2         1.001 DT 1  1F900135 Rx -  0
///           3         1.400 RR 1      0701 Tx -  1
///           4         1.900 FB 1      0123 Rx -  2    AA BB
///           5         2.100 ER 1      0008 Rx -  4    01 00 00 00
///
/// Read: versions 1.0 to 1.3, 2.0 and 2.1, the columns of 2.x in any order that `$COLUMNS` gives. Time is milliseconds
/// since the start; Berth takes the start as UTC, because the file does not say, and as 0 if there is none. Frames: Rx,
/// Tx with or without RTR (1.x); DT, RR, FD, FB (BRS), FE (ESI), BI (both). ER and Error become SocketCAN's report of a
/// protocol error with the kind and the counters. Warnings, status and counter changes, events and everything else are
/// counted in one note at the end. Bus N has the name that the head's table gives it, or a comment of Berth's (above),
/// else "can<N-1>"; versions without buses have "can0".
///
/// Written: 2.1, or 1.1 when asked. Lost in 2.1: nanoseconds, that a direction is unknown (Rx), of an error frame all
/// but bit, form or stuff error, direction and counters. Lost in 1.1 besides: all below 100 us, buses, FD frames.
#pragma once

#include <string>
#include <vector>

#include "berth/trace/lines.hpp"

namespace berth::trace {

class TrcReader final : public LineReader {
 public:
  explicit TrcReader(std::string file) : LineReader(std::move(file)) {}

 private:
  /// A line's content, column by column.
  struct Row {
    rt::Duration offset{};
    std::string_view type, id, way, size, data;
    char size_kind = 'l';
    unsigned bus = 1;
  };
  void line(std::string_view line) override;
  void over() override;
  void head(std::string_view line);
  void version(std::string_view text);
  void columns(std::string_view text);
  void table(std::string_view line);
  [[nodiscard]] std::optional<Row> row();
  [[nodiscard]] bool known_type(std::string_view type) const noexcept;
  void frame(const Row& row);
  void error_frame(const Row& row);
  [[nodiscard]] bool size_of(const Row& row);
  [[nodiscard]] bool data(const Row& row);
  void keep_on(const Row& row);
  [[nodiscard]] std::string_view word();
  void wrong(std::string_view word, std::string message);

  std::string columns_ = "NOIlD";  // of version 1.0, which has no $FILEVERSION
  bool version_2_ = false;
  bool in_table_ = false;
  rt::Duration start_{};
  std::uint64_t others_ = 0;
  std::string_view line_;
  std::size_t at_ = 0;
  Entry entry_;
  std::vector<std::pair<unsigned, std::uint16_t>> numbers_;  // bus's number in the file, and here
  std::vector<std::pair<unsigned, std::string>> names_;
};

class TrcWriter final : public Writer {
 public:
  explicit TrcWriter(bool version_1_1) : old_(version_1_1) {}
  void write(const Entry& entry, std::string_view bus, std::string& out) override;
  void finish(std::string& out) override;

 private:
  void begin(rt::Duration first, std::string& out);
  [[nodiscard]] char* offset(rt::Duration at, char* to);
  void write_old(const Entry& entry, std::string& out);
  void write_new(const Entry& entry, std::string& out);

  bool old_;
  bool begun_ = false;
  rt::Duration start_{};
  std::uint64_t count_ = 0;
  LineNames names_;
};

}  // namespace berth::trace
